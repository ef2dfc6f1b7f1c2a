"""The operator page in a real browser, with software WebGL."""

import io

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from tests.app.fake_mission import runner
from tests.browser.conftest import PATIENCE_MS

pytestmark = pytest.mark.timeout(420)

SIZES = [(1280, 720), (1920, 1080)]

OVERLAPS = """() => {
  // Every element that shows text of its own, and every control; pairs that are not nested must not overlap.
  const shown = [...document.querySelectorAll("body *")].filter((node) => {
    const box = node.getBoundingClientRect();
    if (box.width === 0 || box.height === 0 || node.closest(".unseen, [hidden], option, svg")) return false;
    const text = [...node.childNodes].some((c) => c.nodeType === Node.TEXT_NODE && c.textContent.trim());
    return text || node.matches("button, select, input, canvas, iframe, img");
  });
  const clipped = (node) => {
    let { left, top, right, bottom } = node.getBoundingClientRect();
    for (let up = node.parentElement; up; up = up.parentElement) {
      if (getComputedStyle(up).overflow === "visible") continue;
      const box = up.getBoundingClientRect();
      [left, top] = [Math.max(left, box.left), Math.max(top, box.top)];
      [right, bottom] = [Math.min(right, box.right), Math.min(bottom, box.bottom)];
    }
    return { left, top, right, bottom };
  };
  const boxes = shown.map((node) => [node, clipped(node)]);
  const found = [];
  for (let i = 0; i < boxes.length; i++)
    for (let j = i + 1; j < boxes.length; j++) {
      const [a, p] = boxes[i];
      const [b, q] = boxes[j];
      if (a.contains(b) || b.contains(a) || a.closest("thead") || b.closest("thead")) continue;
      if (a.matches("iframe") || b.matches("iframe")) continue;  // the note lies on the scene on purpose
      const width = Math.min(p.right, q.right) - Math.max(p.left, q.left);
      const height = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
      if (width <= 1 || height <= 1) continue;
      found.push(`${a.tagName} "${a.textContent}" / ${b.tagName} "${b.textContent}"`);
    }
  return found;
}"""


CUT_OFF = """() => [...document.querySelectorAll(".panel, [role=tabpanel], figcaption, .title, dd, dt")]
  .filter((node) => node.clientWidth > 0 && node.scrollWidth > node.clientWidth + 1)
  .map((node) => `${node.tagName} ${node.className}: ${node.textContent.slice(0, 60)}`)"""


def launch(page: Page) -> None:
    page.select_option("#preset", "quick")
    page.click("#launch")


def number(page: Page, figure: str) -> float:
    text = page.inner_text(f"#figure-{figure}").replace(" k", "e3").replace(" M", "e6")
    return float(text) if text != "–" else 0.0


def wait_for_state(page: Page, word: str) -> None:
    expect(page.locator("#mission-state")).to_contain_text(word, timeout=PATIENCE_MS, ignore_case=True)


def wait_for_number(page: Page, figure: str, above: float) -> None:
    page.wait_for_function(
        """([figure, above]) => {
          const text = document.getElementById(`figure-${figure}`).textContent;
          return parseFloat(text.replace(" k", "e3").replace(" M", "e6")) > above;
        }""",
        arg=[figure, above],
        timeout=PATIENCE_MS,
    )


def scene_pixels(page: Page) -> np.ndarray:
    """The middle of the 3D scene, without the viewer's own panels."""
    picture = page.locator("#scene-view").screenshot(timeout=PATIENCE_MS)
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(float)
    height, width = pixels.shape[:2]
    return pixels[height // 3 : height * 9 // 10, width // 10 : width * 9 // 10]


def n_colours(pixels: np.ndarray) -> int:
    """Colours told apart in steps of a sixteenth."""
    return len(np.unique((pixels // 16).reshape(-1, 3), axis=0))


def test_an_operator_starts_watches_and_stops_a_real_mission(live, open_page):
    service = live()
    page = open_page(service.url, width=960, height=600)
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
        page.wait_for_function(
            "(id) => document.getElementById(id).naturalWidth > 0", arg=f"image-{kind}", timeout=PATIENCE_MS
        )
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
    assert page.locator("#mission-picker").input_value() == service.missions.running()[0].id
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
    page.wait_for_function("document.activeElement === document.body")
    page.keyboard.press(key)


def test_the_keyboard_is_enough(live, open_page):
    service = live(runner("run_slowly"))
    page = open_page(service.url)
    page.focus("#preset")
    page.keyboard.type("quick")
    for _ in range(4):
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
    expect(page.locator("#tab-events")).to_be_focused()
    expect(page.locator("#panel-events")).to_be_visible()
    page.keyboard.press("Shift+S")
    wait_for_state(page, "aborted")


def test_a_refused_wish_is_explained_at_its_field(live, open_page):
    service = live(runner("run_short"))
    page = open_page(service.url)
    page.evaluate("document.querySelector('select[name=scene]').append(new Option('castle', 'castle'))")
    page.select_option("select[name=scene]", "castle")
    page.click("#launch")
    expect(page.locator("mission-form .problem")).to_contain_text("castle")
    expect(page.locator("select[name=scene]")).to_have_attribute("aria-invalid", "true")
    expect(page.locator("#mission-state")).to_contain_text("no mission", ignore_case=True)


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_nothing_overlaps_and_nothing_is_cut_off(live, open_page, tmp_path, dark):
    service = live(runner("run_slowly"))
    page = open_page(service.url, dark=dark)
    launch(page)
    wait_for_number(page, "frames", 12)
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_timeout(500)
        page.screenshot(path=tmp_path / f"page-{width}.png", timeout=PATIENCE_MS)
        assert page.evaluate(OVERLAPS) == []
        assert page.evaluate(CUT_OFF) == []
        assert page.evaluate("document.documentElement.scrollWidth") == width
        assert page.evaluate("document.documentElement.scrollHeight") == height
        box = page.locator("#stop").bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    brightness = sum(int(part) for part in ground.removeprefix("rgb(").removesuffix(")").split(","))
    assert (brightness < 200) == dark
