"""What the page offers beside start and stop, on one real mission that runs and one that has ended."""

import os
import re
import signal
import zipfile

import httpx
import pytest
from playwright.sync_api import Page, expect

from app.settings import DisplaySettings, Settings
from tests.app.live_service import serving
from tests.browser.conftest import MAX_SPLATS, PATIENCE_MS, new_page
from tests.browser.page_checks import (
    map_pixels,
    n_colours,
    number,
    pixels_of,
    wait_for_number,
    wait_for_state,
    wait_until,
)

pytestmark = [pytest.mark.slow, pytest.mark.timeout(420)]  # two real missions and a minute of clicks

SMALL = {"sensor": "rgbd_5m_tiny", "evaluate": "false", "mesh.enabled": "false"}
"""A sixteenth of the pixels, and no more at the end than what was mapped."""


class RealMissions:
    """A service with a mission that has ended and one that runs."""

    def __init__(self, service) -> None:
        self.service = service
        self.api = httpx.Client(base_url=f"{service.url}api/v1", timeout=60)
        self.ended = self._begin(seed=0, max_time_s=8)
        assert service.missions.get(self.ended).join(2 * PATIENCE_MS / 1000)
        self.running = self._begin(seed=1, scene="building")  # it does not end while it is looked at

    def _begin(self, **wish) -> str:
        order = {"scene": "house", "preset": "quick", "overrides": SMALL, **wish}
        mission = self.api.post("/missions", json=order).raise_for_status().json()["id"]
        self.api.post(f"/missions/{mission}/start").raise_for_status()
        return mission


@pytest.fixture(scope="module")
def missions(tmp_path_factory):
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("tools"),
        mission_threads=1,
        display=DisplaySettings(max_splats=MAX_SPLATS),
    )
    with serving(settings) as service:
        yield RealMissions(service)


@pytest.fixture(scope="module")
def window(missions, chromium):
    with new_page(chromium, missions.service.url) as page:
        yield page


@pytest.fixture
def page(window, missions):
    """The page as it shows the running mission."""
    show(window, missions.running)
    wait_for_number(window, "frames", 8)
    return window


def show(page: Page, mission: str) -> None:
    page.click("#tab-missions")
    page.click(f'mission-list li[data-id="{mission}"] button')
    expect(page.locator("mission-title")).to_have_attribute("data-mission", mission)
    page.click("#tab-figures")


def at(page: Page, right: float, down: float) -> tuple[float, float]:
    """A place on the map from above, in shares of its size."""
    box = page.locator("#top-view-canvas").bounding_box()
    return (box["x"] + right * box["width"], box["y"] + down * box["height"])


def go_to_moment(page: Page, share: float) -> None:
    page.evaluate(
        """(share) => {
          const slider = document.getElementById("timeline-slider");
          slider.value = Math.round(share * slider.max);
          slider.dispatchEvent(new Event("input"));
        }""",
        share,
    )


def areas(page: Page, kind: str):
    return page.locator(f"order-panel li[data-kind={kind}]")


def test_the_map_from_above_and_the_progress_are_live(page):
    wait_until(page, "document.querySelector('top-view .empty').hidden")
    assert n_colours(map_pixels(page)) > 60
    expect(page.locator("#progress-time")).to_contain_text("of 1:00:00")
    expect(page.locator("#progress-missing")).to_contain_text("m³")
    estimate = page.text_content("#progress-estimate")
    assert "estimate" in estimate or "nearly done" in estimate
    before = number(page, "frames")
    wait_for_number(page, "frames", before)


def test_charts_tell_the_value_under_the_pointer(page):
    chart = page.locator("chart-strip line-chart[data-field=n_gaussians]")
    newest = chart.locator(".title b")
    expect(newest).not_to_have_text("–")
    box = chart.locator("canvas").bounding_box()
    page.mouse.move(box["x"] + 44, box["y"] + box["height"] / 2)
    wait_until(
        page, "document.querySelector('line-chart[data-field=n_gaussians] .title b').textContent !== '–'"
    )
    early = newest.text_content()
    page.mouse.move(5, 5)
    expect(newest).not_to_have_text(early)
    for field in ("coverage", "psnr_current_db", "planning_s"):
        canvas = page.locator(f"line-chart[data-field={field}] canvas")
        expect(canvas).to_have_attribute("aria-label", re.compile("%|dB|ms"))


def test_a_candidate_is_marked_on_the_map_and_in_the_table(page):
    page.click("#pause")
    wait_for_state(page, "paused")  # so that no new plan comes between
    page.click("#tab-candidates")
    row = page.locator("candidate-table tbody tr").first
    expect(row).to_be_visible()
    plain = map_pixels(page)
    row.hover()
    expect(row).to_have_class("chosen pointed")
    page.wait_for_timeout(200)
    assert abs(map_pixels(page) - plain).max() > 60
    page.mouse.move(5, 5)
    expect(row).not_to_have_class("chosen pointed")
    words = page.locator("candidate-table tr.rejected .words").all_text_contents()
    assert all("gain" in word or "path" in word for word in words)
    page.click("#pause")
    wait_for_state(page, "running")


def test_areas_are_drawn_changed_and_removed_by_mouse_and_by_keys(page):
    page.click("#tab-orders")
    page.click("#tool-no_go")
    for right, down in ((0.3, 0.4), (0.5, 0.4), (0.5, 0.6), (0.3, 0.4)):  # the first corner closes it
        page.mouse.click(*at(page, right, down))
    expect(areas(page, "no_go")).to_contain_text("3 corners")
    expect(page.locator("#orders-state")).to_contain_text("not sent yet")

    page.mouse.move(*at(page, 0.5, 0.6))  # it is selected: its corner can be dragged
    page.mouse.down()
    page.mouse.move(*at(page, 0.6, 0.7), steps=5)
    page.mouse.up()
    page.focus("#top-view-canvas")
    page.keyboard.press("i")
    expect(areas(page, "no_go")).to_contain_text("4 corners")
    page.keyboard.press("Delete")
    expect(areas(page, "no_go")).to_contain_text("3 corners")
    page.keyboard.press("Escape")

    page.focus("#tool-region")
    page.keyboard.press("Enter")
    for key in ("ArrowRight", "ArrowDown", "ArrowLeft"):
        page.keyboard.press("Enter")
        for _ in range(5):
            page.keyboard.press(key)
    page.keyboard.press("Enter")
    page.keyboard.press("c")
    expect(areas(page, "region")).to_contain_text("4 corners")
    page.keyboard.press("Shift+Delete")
    expect(areas(page, "region")).to_have_count(0)
    page.click("#revert-orders")
    expect(areas(page, "no_go")).to_have_count(0)
    wait_for_state(page, "running")


def test_orders_hold_once_they_are_sent_and_views_wait_for_approval(page, missions):
    path = f"/missions/{missions.running}/directives"
    page.click("#tab-orders")
    page.click("#tool-no_go")
    for right, down in ((0.02, 0.9), (0.06, 0.9), (0.06, 0.98), (0.02, 0.98)):  # where nothing is
        page.mouse.click(*at(page, right, down))
    page.focus("#top-view-canvas")
    page.keyboard.press("c")
    page.fill("#order-max_path_m", "-1")
    page.click("#send-orders")
    expect(page.locator("order-panel .problem")).to_contain_text("greater than 0")
    expect(page.locator("#order-max_path_m")).to_have_attribute("aria-invalid", "true")
    assert missions.api.get(path).json()["no_go"] == []
    page.fill("#order-max_path_m", "500")
    page.check("#order-approve_views")
    page.click("#send-orders")
    expect(page.locator("#orders-state")).to_have_text("In force.")
    told = missions.api.get(path).json()
    assert len(told["no_go"][0]) == 4
    assert (told["max_path_m"], told["approve_views"]) == (500, True)
    expect(page.locator("#progress-path")).to_contain_text("of 500.0 m")

    expect(page.locator("approval-bar")).to_be_visible(timeout=PATIENCE_MS)
    waiting = missions.api.get(f"/missions/{missions.running}").json()["approval"]["plan_sequence"]
    expect(page.locator("#mission-reason")).to_contain_text("your word")
    page.click("#approve")
    wait_until(
        page,
        """([path, seen]) => fetch(path).then((answer) => answer.json())
          .then(({ approval }) => approval === null || approval.plan_sequence > seen)""",
        [f"/api/v1/missions/{missions.running}", waiting],
    )
    page.uncheck("#order-approve_views")
    areas(page, "no_go").get_by_role("button", name="Remove").click()
    page.click("#send-orders")
    expect(page.locator("#orders-state")).to_have_text("In force.")
    expect(page.locator("approval-bar")).to_be_hidden(timeout=PATIENCE_MS)
    page.click("#tab-events")
    page.select_option("#event-kind", "orders")
    expect(page.locator("event-list li[data-kind=directives]")).to_have_count(2)
    expect(page.locator("event-list li[data-kind=approval]").first).to_be_visible()
    page.select_option("#event-kind", "all")


def test_events_are_filtered_by_kind_level_and_text(page):
    page.click("#tab-events")
    events = page.locator("event-list li")
    expect(events.first).to_be_visible()
    page.select_option("#event-kind", "plans")
    expect(page.locator("event-list li:not([data-kind=plan])")).to_have_count(0)
    expect(events.first).to_be_visible()
    page.select_option("#event-kind", "state and phase")
    page.fill("#event-text", "RUNNING")
    expect(page.locator("event-list li[data-kind=state]")).to_contain_text(["running"])
    page.fill("#event-text", "no event says this")
    expect(page.locator("event-list .empty")).to_contain_text("No event passes")
    page.fill("#event-text", "")
    page.select_option("#event-kind", "all")
    page.select_option("#event-level", "errors")
    expect(events).to_have_count(0)
    page.select_option("#event-level", "any level")
    expect(events.first).to_be_visible()


@pytest.mark.parametrize("which", ["running", "ended"])
def test_the_timeline_goes_back_and_returns(page, missions, which):
    show(page, getattr(missions, which))
    wait_until(page, "Number(document.getElementById('timeline-slider').max) >= 2")
    frames = number(page, "frames")
    image = page.get_attribute("#image-observed", "src")
    go_to_moment(page, 0.0)
    expect(page.locator("#timeline-text")).to_contain_text("Past: 0:00")
    expect(page.locator("body")).to_have_class("past")
    wait_until(
        page, "(frames) => Number(document.getElementById('figure-frames').textContent) < frames", frames
    )
    wait_until(page, "(old) => document.getElementById('image-observed').src !== old", image)
    expect(page.locator("#progress-estimate")).to_have_text("looking at the past")
    page.focus("#timeline-slider")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#timeline-text")).to_contain_text("(2 of")
    page.click("#play")
    expect(page.locator("#timeline-text")).not_to_contain_text("(2 of")
    page.focus("#timeline-slider")
    page.keyboard.press("Escape")
    expect(page.locator("body")).not_to_have_class("past")
    wait_for_number(page, "frames", frames - 1)
    assert n_colours(map_pixels(page)) > 40


def test_two_missions_are_compared(page, missions):
    page.click("#compare")
    page.select_option("#compare-a", missions.ended)
    page.select_option("#compare-b", missions.running)
    path = page.locator("#compare-figures tr", has_text="Path").locator("td")
    expect(path.nth(1)).not_to_have_text("–")
    expect(path.nth(0)).not_to_have_text("–")
    assert any(mark in path.nth(2).text_content() for mark in "▲▼=")
    expect(page.locator("mission-comparison figure img[src]")).to_have_count(8)
    wait_until(
        page, "document.querySelector('mission-comparison line-chart .title b').textContent.includes(', B')"
    )
    assert n_colours(pixels_of(page, "comparison-map canvas")) > 40
    expect(page.locator("#stop")).to_be_visible()
    page.click("#compare")
    expect(page.locator("#top-view-canvas")).to_be_visible()


def test_settings_are_changed_in_a_form_made_of_their_schema(page, missions):
    page.click("#tab-new")
    page.select_option("#preset", "quick")
    page.click(".all-settings > summary")
    page.fill("#settings-filter", "max time")
    limit = page.locator('[data-path="limits.max_time_s"]')
    expect(limit).to_have_value("3600")
    expect(page.locator(".setting", has=limit)).to_contain_text("> 0")
    limit.fill("-5")
    expect(page.locator(".setting", has=limit).locator(".problem")).to_contain_text("greater than 0")
    page.click("#launch")  # refused here: nothing is sent
    expect(page.locator("mission-form > form > .problem")).to_contain_text("not allowed")
    limit.fill("30")

    page.fill("#settings-filter", "log odds limits")
    odds = page.locator('[data-path="voxels.log_odds_limits"]')
    odds.fill("high")  # what this page cannot judge the service refuses, at its field
    page.click("#launch")
    expect(page.locator(".setting", has=odds).locator(".problem")).to_contain_text("log_odds_limits")
    expect(odds).to_be_focused()
    page.locator(".setting", has=odds).locator(".reset").click()
    expect(page.locator("#settings-changed")).to_contain_text("1 changed")

    page.click("#launch")
    wait_for_state(page, "queued")
    queued = page.get_attribute("mission-title", "data-mission")
    assert missions.api.get(f"/missions/{queued}").json()["overrides"] == {"limits.max_time_s": "30"}
    page.click("#tab-missions")
    expect(page.locator(f'mission-list li[data-id="{queued}"]')).to_contain_text("Number 1 in the queue")
    page.click("#stop")
    wait_for_state(page, "aborted")
    page.select_option("#mission-filter", "failed or aborted")
    expect(page.locator("mission-list li")).to_have_count(1)
    page.select_option("#mission-filter", "all")
    expect(page.locator("mission-list li")).to_have_count(3)


def test_everything_is_downloaded_at_once(page, missions):
    show(page, missions.ended)
    page.click("#tab-results")
    with page.expect_download() as download:
        page.click("#download-all")
    with zipfile.ZipFile(download.value.path()) as archive:
        names = {name.partition("/")[2] for name in archive.namelist()}
    assert {"report.json", "report.html", "map.ply", "trajectory.txt", "events.jsonl", "config.yaml"} <= names


def test_what_is_stale_says_so(page, missions):
    """The mission's process is held: the page tells that nothing new comes, until something does."""
    pid = missions.service.missions.get(missions.running).pid
    os.kill(pid, signal.SIGSTOP)
    try:
        expect(page.locator("#stale-badge")).to_contain_text("no data for", timeout=PATIENCE_MS)
    finally:
        os.kill(pid, signal.SIGCONT)
    expect(page.locator("#stale-badge")).to_be_hidden(timeout=PATIENCE_MS)


def test_colours_are_chosen_and_kept(page):
    for theme in ("light", "dark"):
        page.click("#theme")
        expect(page.locator("html")).to_have_attribute("data-theme", theme)
    page.reload()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    page.click("#theme")


def test_stop_is_heard_from_the_map_but_not_while_writing(page, missions):
    page.click("#tab-events")
    page.click("#event-text")
    page.keyboard.press("Shift+S")
    expect(page.locator("#event-text")).to_have_value("S")
    wait_for_state(page, "running")
    page.fill("#event-text", "")
    page.focus("#top-view-canvas")
    page.keyboard.press("Shift+S")
    wait_for_state(page, "aborted")
    assert missions.api.get(f"/missions/{missions.running}").json()["stop_reason"] == "interrupted"
