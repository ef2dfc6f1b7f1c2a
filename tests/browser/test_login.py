"""Logging in, in a real browser; and what a viewer's page offers."""

import time

import httpx
import pytest
from playwright.sync_api import expect

from tests.app.fake_mission import runner
from tests.browser.conftest import PATIENCE_MS
from tests.browser.page_checks import (
    CUT_OFF,
    OVERLAPS,
    assert_clean,
    launch,
    n_colours,
    scene_pixels,
    wait_for_number,
    wait_for_state,
)

pytestmark = pytest.mark.timeout(420)

OPERATOR = "the operator's token, long enough"
VIEWER = "the viewer's token, long enough"
TOKENS = {"operator_token": OPERATOR, "viewer_token": VIEWER}


def log_in(page, token: str) -> None:
    expect(page.locator("#login button")).to_be_enabled()
    page.fill("#token", token)
    page.press("#token", "Enter")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_an_operator_logs_in_commands_and_logs_out(live, open_page, tmp_path, dark):
    service = live(runner("run_slowly"), access=TOKENS)
    page = open_page(service.url, dark=dark)
    expect(page).to_have_url(f"{service.url}login.html")
    expect(page.locator("#token")).to_be_focused()
    page.screenshot(path=tmp_path / "login.png", timeout=PATIENCE_MS)
    log_in(page, "a guess")
    expect(page.locator("#login-problem")).to_contain_text("not a token")
    page.screenshot(path=tmp_path / "refused.png", timeout=PATIENCE_MS)
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate(CUT_OFF) == []

    log_in(page, OPERATOR)
    expect(page).to_have_url(service.url)
    expect(page.locator("#session-role")).to_have_text("operator")
    assert page.evaluate("document.cookie") == ""  # no script can read it
    launch(page)
    wait_for_state(page, "running")
    wait_for_number(page, "frames", 5)
    page.click("#stage-3d")
    expect(page.frame_locator("#scene-view").locator("canvas").first).to_be_visible(timeout=PATIENCE_MS)
    for _ in range(90):
        if n_colours(scene_pixels(page)) > 20:
            break
        page.wait_for_timeout(1000)
    assert n_colours(scene_pixels(page)) > 20
    launch(page)  # a second one waits for its turn
    wait_for_state(page, "queued")
    expect(page.locator("#mission-reason")).to_contain_text("Number 1 in the queue")
    for width, height in ((1280, 720), (1920, 1080)):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(500)
        page.screenshot(path=tmp_path / f"queued-{width}.png", timeout=PATIENCE_MS)
        assert_clean(page, width, height)
    page.click("#stop")
    wait_for_state(page, "aborted")

    page.click("#log-out")
    expect(page).to_have_url(f"{service.url}login.html")
    page.goto(service.url)
    expect(page).to_have_url(f"{service.url}login.html")


def test_a_viewer_watches_and_commands_nothing(live, open_page, tmp_path):
    service = live(runner("run_slowly"), access=TOKENS)
    with httpx.Client(
        base_url=f"{service.url}api/v1", headers={"Authorization": f"Bearer {OPERATOR}"}
    ) as operator:
        mission = operator.post("/missions", json={"preset": "quick"}).json()["id"]
        operator.post(f"/missions/{mission}/start")
    page = open_page(service.url)
    log_in(page, VIEWER)
    expect(page.locator("#session-role")).to_have_text("viewer")
    wait_for_state(page, "running")
    wait_for_number(page, "frames", 5)
    for control in ("#stop", "#pause", "#launch", "#tool-region", "#tool-no_go", "#send-orders"):
        expect(page.locator(control)).to_be_disabled()
    page.click("#stage-3d")
    expect(page.frame_locator("#scene-view").locator("canvas").first).to_be_visible(timeout=PATIENCE_MS)
    page.screenshot(path=tmp_path / "viewer.png", timeout=PATIENCE_MS)
    page.keyboard.press("Shift+S")
    page.wait_for_timeout(500)
    wait_for_state(page, "running")


def test_a_token_is_never_sent_before_the_script_is_there(live, chromium):
    """The browser alone would put it into the address, and so into its history."""
    service = live(runner("run_slowly"), access=TOKENS)
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(f"{service.url}login.html")
    expect(page.locator("#login button")).to_be_disabled()
    page.fill("#token", OPERATOR)
    page.press("#token", "Enter")
    page.wait_for_timeout(500)
    assert page.url == f"{service.url}login.html"
    assert page.input_value("#token") == OPERATOR, "nothing was sent"
    context.close()


def test_a_page_whose_session_ends_asks_to_log_in_again(live, open_page, monkeypatch):
    service = live(runner("run_slowly"), access=TOKENS)
    page = open_page(service.url)
    log_in(page, OPERATOR)
    launch(page)
    wait_for_state(page, "running")
    a_year_s = 365 * 86_400.0
    monkeypatch.setattr(service.app.state.sessions, "_now", lambda: time.time() + a_year_s)
    expect(page).to_have_url(f"{service.url}login.html", timeout=PATIENCE_MS)
