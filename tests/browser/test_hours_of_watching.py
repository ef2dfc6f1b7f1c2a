"""The operator page, map and 3D scene beside each other, left open for the hours of a mission."""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
from playwright.sync_api import BrowserType, Page

from app.settings import DisplaySettings
from tests.app.fake_mission import runner
from tests.app.served import Served, served
from tests.browser.conftest import FLAGS, MAX_SPLATS, PATIENCE_MS
from tests.browser.page_checks import assert_clean, launch, number

FRAMES = 18_000
READINGS = 10


@dataclass(frozen=True, kw_only=True)
class Memory:
    """What both ends hold after so many frames."""

    frames: float
    heap_mib: float
    """Live JavaScript objects of the page and the scene in it."""
    nodes: float
    listeners: float
    page_mib: float
    """Of the process that runs the page, its alone; likewise below."""
    drawing_mib: float
    """Of the process that draws (WebGL in software)."""
    rest_mib: float
    """Of the browser's other processes."""
    service_mib: float


class OwnBrowser:
    """Chromium as an operator has it, with no debugger looking on.

    A debugger that is attached makes the page's process keep the bodies of all answers, up to hundreds of
    megabytes of them, for the developer to look at: it must be away while memory is watched.
    """

    def __init__(self, kind: BrowserType, process: subprocess.Popen[bytes], profile: Path) -> None:
        self._kind = kind
        self._process = process
        self._port_file = profile / "DevToolsActivePort"

    @contextmanager
    def attached(self) -> Iterator[Page]:
        """Its one page, to look at for a moment."""
        late_s = time.monotonic() + PATIENCE_MS / 1000
        while not self._port_file.is_file():
            assert self._process.poll() is None, f"chromium ended with {self._process.returncode}"
            assert time.monotonic() < late_s, "chromium does not open its port for debuggers"
            time.sleep(0.1)
        port = self._port_file.read_text().split()[0]
        browser = self._kind.connect_over_cdp(f"http://127.0.0.1:{port}")
        page = browser.contexts[0].pages[0]
        page.set_default_timeout(PATIENCE_MS)
        yield page
        browser.close()

    def mib(self) -> dict[str, float]:
        """Memory of its processes, of none of them shared, by what they do."""
        held = {"renderer": 0.0, "gpu-process": 0.0, "": 0.0}
        root = psutil.Process(self._process.pid)
        for process in (root, *root.children(recursive=True)):
            does = next((part for part in process.cmdline() if part.startswith("--type=")), "--type=")
            kind = does.removeprefix("--type=")
            held[kind if kind in held else ""] += process.memory_full_info().uss / 2**20
        return held


@contextmanager
def own_browser(kind: BrowserType, profile: Path) -> Iterator[OwnBrowser]:
    executable = shutil.which("chromium") or shutil.which("chromium-browser")
    assert executable is not None
    options = [f"--user-data-dir={profile}", "--remote-debugging-port=0", "--window-size=1280,720"]
    process = subprocess.Popen(
        [executable, *FLAGS, *options, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield OwnBrowser(kind, process, profile)
    finally:
        process.terminate()
        process.wait(60)


def memory(browser: OwnBrowser, service: Served, frames: float) -> Memory:
    """Of the page right after a collection of its garbage: until the next, it grows by 100 MiB and more."""
    with browser.attached() as page:
        tools = page.context.new_cdp_session(page)
        tools.send("Performance.enable")
        tools.send("HeapProfiler.collectGarbage")
        held = browser.mib()
        counts: dict[str, Any] = {
            one["name"]: one["value"] for one in tools.send("Performance.getMetrics")["metrics"]
        }
    return Memory(
        frames=frames,
        heap_mib=counts["JSHeapUsedSize"] / 2**20,
        nodes=counts["Nodes"],
        listeners=counts["JSEventListeners"],
        page_mib=held["renderer"],
        drawing_mib=held["gpu-process"],
        rest_mib=held[""],
        service_mib=psutil.Process(service.pid).memory_info().rss / 2**20,
    )


def wait_for_frame(service: Served, above: float) -> float:
    """Until the mission is past that frame; which it has then."""
    late_s = time.monotonic() + 1800.0
    while True:
        (summary,) = httpx.get(f"{service.api}/missions").json()["missions"]
        mission = httpx.get(f"{service.api}/missions/{summary['id']}").json()
        figures = mission["figures"]
        if figures is not None and figures["frame"] >= above:
            return float(figures["frame"])
        assert time.monotonic() < late_s, f"no frame {above:.0f} within half an hour: {mission}"
        time.sleep(1.0)


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_hours_of_watching_take_no_more_memory_than_minutes(chromium, tmp_path, capsys):
    """Two hours of a mission, compressed in time: 18,000 frames, a view of the scene ten times a second."""
    display = DisplaySettings(max_splats=MAX_SPLATS, interval_s=0.1)
    with (
        served(
            tmp_path / "data", runner=runner("run_for_hours"), display=display, mission_threads=1
        ) as service,
        own_browser(chromium.browser_type, tmp_path / "profile") as browser,
    ):
        with browser.attached() as page:
            page.goto(service.url)
            page.evaluate("localStorage.setItem('hgs-stage', 'both')")
            page.reload()
            page.wait_for_selector("#preset option", state="attached")
            launch(page)
        found = []
        for reading in range(1, READINGS):
            found.append(memory(browser, service, wait_for_frame(service, FRAMES * reading / READINGS)))
        with browser.attached() as page:
            shown = number(page, "frames")
            assert_clean(page, *page.evaluate("[innerWidth, innerHeight]"))
    with capsys.disabled():
        sys.stdout.write("\n frames   heap   nodes   listeners   page   drawing   rest   service (MiB)\n")
        for one in found:
            sys.stdout.write(
                f"{one.frames:7.0f} {one.heap_mib:6.1f} {one.nodes:7.0f} {one.listeners:11.0f} "
                f"{one.page_mib:6.0f} {one.drawing_mib:9.0f} {one.rest_mib:6.0f} {one.service_mib:9.0f}\n"
            )
    middle, last = found[len(found) // 2], found[-1]
    assert shown > 0.99 * last.frames  # the page rounds it
    assert last.heap_mib < 1.1 * middle.heap_mib + 5
    assert last.nodes < 1.1 * middle.nodes + 500
    assert last.listeners < 1.1 * middle.listeners + 50
    assert last.page_mib < 1.1 * middle.page_mib + 30
    assert last.drawing_mib < 1.1 * middle.drawing_mib + 30
    assert last.rest_mib < 1.1 * middle.rest_mib + 30
    assert last.service_mib < middle.service_mib + 30
