import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

from app.missions.service import DEFAULT_RUNNER
from app.settings import DisplaySettings, Settings
from tests.app.live_service import LiveService, serving

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE_MS = 120_000
"""WebGL runs in software here, beside a mission."""
MAX_SPLATS = 10_000

expect.set_options(timeout=60_000)


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    """The distribution's Chromium; tests are skipped where there is none."""
    executable = shutil.which("chromium") or shutil.which("chromium-browser")
    if executable is None:
        pytest.skip("no chromium on this machine: install the distribution's package `chromium`")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(FLAGS))
        yield browser
        browser.close()


@contextmanager
def new_page(
    chromium: Browser,
    url: str,
    *,
    width: int = 1280,
    height: int = 720,
    dark: bool = False,
    touch: bool = False,
    stage: str = "map",
) -> Iterator[Page]:
    """A page in a window of its own. `stage`: what is shown in the middle, `map`, `3d` or `both`."""
    context = chromium.new_context(
        viewport={"width": width, "height": height},
        color_scheme="dark" if dark else "light",
        has_touch=touch,
    )
    context.set_default_timeout(PATIENCE_MS)
    context.add_init_script(
        f"localStorage.getItem('hgs-stage') ?? localStorage.setItem('hgs-stage', '{stage}')"
    )
    page = context.new_page()
    page.goto(url)
    page.wait_for_selector("#preset option, #login", state="attached")
    yield page
    context.close()


@pytest.fixture
def open_page(chromium):
    """Open an address in a fresh window; see `new_page`."""
    with ExitStack() as windows:
        yield lambda url, **look: windows.enter_context(new_page(chromium, url, **look))


@pytest.fixture
def live(tmp_path):
    """Serve on a free port, as `hgs serve` does: `live(runner=...)`. Stopped after the test."""
    with ExitStack() as running:

        def begin(runner: str = DEFAULT_RUNNER, **changes) -> LiveService:
            settings = Settings(
                data_dir=tmp_path / "data",
                mission_threads=1,
                display=DisplaySettings(max_splats=MAX_SPLATS),
                **changes,
            )
            return running.enter_context(serving(settings, runner=runner))

        yield begin
