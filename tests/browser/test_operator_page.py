"""The operator page in a real browser, with software WebGL."""

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.app.fake_mission import runner
from tests.browser.conftest import PATIENCE_MS
from tests.browser.page_checks import (
    SIZES,
    assert_clean,
    launch,
    n_colours,
    number,
    scene_pixels,
    wait_for_number,
    wait_for_state,
    wait_until,
)

pytestmark = pytest.mark.timeout(420)


def test_an_operator_starts_watches_and_stops_a_real_mission(live, open_page):
    service = live()
    page = open_page(service.url, width=1040, height=600, stage="3d")
    expect(page.locator("#stop")).to_be_disabled()
    launch(page)
    wait_for_state(page, "running")
    wait_for_number(page, "frames", 2)
    frames, gaussians = number(page, "frames"), number(page, "gaussians")
    wait_for_number(page, "frames", frames)
    assert number(page, "gaussians") >= gaussians > 0
    assert number(page, "observed") > 0

    scene = page.frame_locator("#scene-view")
    expect(scene.locator("canvas").first).to_be_visible(timeout=PATIENCE_MS)
    for kind in ("observed", "rendered", "depth", "quality"):
        wait_until(page, "(id) => document.getElementById(id).naturalWidth > 0", f"image-{kind}")
    for _ in range(90):  # the camera finds its place and splats fade in
        pixels = scene_pixels(page)
        if pixels.std() > 12 and n_colours(pixels) > 40:
            break
        page.wait_for_timeout(1000)
    # A map has many colours; an empty scene has a background and a grid.
    assert pixels.std() > 12
    assert n_colours(pixels) > 40

    page.click("#stop")
    wait_for_state(page, "aborted")
    expect(page.locator("#stop")).to_be_disabled()
    page.click("#tab-results")
    expect(page.locator("result-list a", has_text="report.json")).to_be_visible(timeout=PATIENCE_MS)
    with page.expect_download() as download:
        page.locator("result-list a", has_text="report.json").click()
    assert "interrupted" in download.value.path().read_text()


def test_a_reloaded_page_finds_the_running_mission_again(live, open_page):
    service = live(runner("run_slowly"))
    page = open_page(service.url)
    launch(page)
    wait_for_number(page, "frames", 3)
    page.reload()
    wait_for_state(page, "running")
    wait_for_number(page, "frames", 3)
    expect(page.locator("mission-title")).to_have_attribute("data-mission", service.missions.running()[0].id)
    page.click("#tab-events")
    expect(page.locator("event-list li[data-kind=state]").first).to_contain_text("running")

    page.click("#pause")
    wait_for_state(page, "paused")
    standing = number(page, "frames")
    expect(page.locator("#pause")).to_have_text("Resume")
    page.click("#pause")
    wait_for_number(page, "frames", standing)


def press_outside_the_scene(page: Page, key: str) -> None:
    page.evaluate("document.activeElement.blur()")
    wait_until(page, "document.activeElement === document.body")
    page.keyboard.press(key)


def test_the_keyboard_is_enough(live, open_page):
    service = live(runner("run_slowly"))
    page = open_page(service.url, stage="3d")
    page.focus("#tab-figures")
    page.keyboard.press("End")
    expect(page.locator("#tab-new")).to_be_focused()
    page.focus("#preset")
    page.keyboard.type("quick")
    for _ in range(5):  # seed, time limit, clock, all settings, start
        page.keyboard.press("Tab")
    expect(page.locator("#launch")).to_be_focused()
    page.keyboard.press("Enter")
    wait_for_state(page, "running")
    # The 3D scene takes the focus once it has loaded: keys belong to it then, not to the page.
    expect(page.frame_locator("#scene-view").locator("canvas").first).to_be_visible(timeout=PATIENCE_MS)
    press_outside_the_scene(page, "Space")
    wait_for_state(page, "paused")
    press_outside_the_scene(page, "Space")
    wait_for_state(page, "running")
    page.focus("#tab-candidates")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#tab-orders")).to_be_focused()
    expect(page.locator("#panel-orders")).to_be_visible()
    # Keys belong to the scene while it has the focus, but STOP is heard there, too.
    page.locator("#scene-view").click(position={"x": 60, "y": 300})
    page.keyboard.press("Shift+S")
    wait_for_state(page, "aborted")


def test_many_missions_come_page_by_page(live, open_page):
    service = live(runner("run_short"))
    with httpx.Client(base_url=f"{service.url}api/v1") as client:
        for seed in range(52):
            client.post("/missions", json={"preset": "quick", "seed": seed}).raise_for_status()
    page = open_page(service.url)
    page.click("#tab-missions")
    expect(page.locator("mission-list li")).to_have_count(50)
    page.click("#older-missions")
    expect(page.locator("mission-list li")).to_have_count(52)
    expect(page.locator("#older-missions")).to_be_hidden()
    expect(page.locator("mission-list li").last).to_contain_text("seed 0")
    page.locator("mission-list li button").last.press("Enter")
    expect(page.locator("mission-title")).to_contain_text("seed 0")
    expect(page.locator("#mission-state")).to_contain_text("created")
    expect(page.locator("#start")).to_be_enabled()


def test_a_refused_wish_is_explained_at_its_field(live, open_page):
    service = live(runner("run_short"))
    page = open_page(service.url)
    page.click("#tab-new")
    page.evaluate("document.querySelector('select[name=scene]').append(new Option('castle', 'castle'))")
    page.select_option("select[name=scene]", "castle")
    page.click("#launch")
    expect(page.locator("mission-form .problem")).to_contain_text("castle")
    expect(page.locator("select[name=scene]")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#mission-state")).to_contain_text("no mission", ignore_case=True)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_nothing_overlaps_and_nothing_is_cut_off(live, open_page, tmp_path, dark):
    """At both sizes, in the colours that the system asks for, with every tab and in the comparison."""
    service = live(runner("run_slowly"))
    page = open_page(service.url, dark=dark)
    launch(page)
    wait_for_number(page, "frames", 12)
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    brightness = sum(int(part) for part in ground.removeprefix("rgb(").removesuffix(")").split(","))
    assert (brightness < 200) == dark
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        for left, right in (("figures", "candidates"), ("missions", "events"), ("new", "orders")):
            page.click(f"#tab-{left}")
            page.click(f"#tab-{right}")
            page.wait_for_timeout(300)
            page.screenshot(path=tmp_path / f"{right}-{width}.png", timeout=PATIENCE_MS)
            assert_clean(page, width, height)
        page.click("#compare")
        page.wait_for_timeout(1000)
        page.screenshot(path=tmp_path / f"compare-{width}.png", timeout=PATIENCE_MS)
        assert_clean(page, width, height)
        page.click("#compare")


def test_a_tablet_is_enough(live, open_page, tmp_path):
    """Upright, by finger: STOP stays in sight, whatever is scrolled, and targets are large enough."""
    service = live(runner("run_slowly"))
    page = open_page(service.url, width=820, height=1180, touch=True)
    launch(page)
    wait_for_number(page, "frames", 5)
    page.locator("result-list, #tab-results").first.scroll_into_view_if_needed()
    page.evaluate("document.querySelector('.board').scrollTop = 1e6")
    page.screenshot(path=tmp_path / "tablet.png", timeout=PATIENCE_MS)
    box = page.locator("#stop").bounding_box()
    assert 0 <= box["y"] < 100
    assert page.evaluate("document.documentElement.scrollWidth") == 820
    small = page.evaluate(
        """() => [...document.querySelectorAll("button, select, input:not([type=checkbox])")]
          .filter((node) => node.checkVisibility())
          .map((node) => [node.id || node.textContent, node.getBoundingClientRect().height])
          .filter(([, height]) => height < 33)"""
    )
    assert small == []
    page.evaluate("document.querySelector('.board').scrollTop = 0")
    page.tap("#tool-no_go")
    canvas = page.locator("#top-view-canvas").bounding_box()
    for right, down in ((0.3, 0.3), (0.6, 0.3), (0.6, 0.6), (0.3, 0.3)):  # the first corner again closes it
        page.touchscreen.tap(canvas["x"] + right * canvas["width"], canvas["y"] + down * canvas["height"])
    page.tap("#tab-orders")
    expect(page.locator("order-panel li[data-kind=no_go]")).to_have_count(1)
    page.set_viewport_size({"width": 1024, "height": 768})  # and turned
    page.wait_for_timeout(300)
    page.screenshot(path=tmp_path / "turned.png", timeout=PATIENCE_MS)
    assert_clean(page, 1024, 768)
    page.tap("#stop")
    wait_for_state(page, "aborted")
