"""What tests of the operator page look at: its figures, its pictures, whether anything lies on anything."""

import io
import time
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Page, expect

from tests.browser.conftest import PATIENCE_MS

SIZES = [(1280, 720), (1920, 1080)]

OVERLAPS = """() => {
  // Every element that shows text of its own, and every control; pairs that are not nested must not overlap.
  const shown = [...document.querySelectorAll("body *")].filter((node) => {
    const box = node.getBoundingClientRect();
    if (!node.checkVisibility() || box.width === 0 || box.height === 0) return false;
    if (node.closest(".unseen, [hidden], option, svg")) return false;
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
      const stage = "iframe, top-view canvas, comparison-map canvas";
      // What lies on these lies there on purpose.
      if (a.matches(stage) || b.matches(stage)) continue;
      const width = Math.min(p.right, q.right) - Math.max(p.left, q.left);
      const height = Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top);
      if (width <= 1 || height <= 1) continue;
      found.push(`${a.tagName} "${a.textContent}" / ${b.tagName} "${b.textContent}"`);
    }
  return found;
}"""


CUT_OFF = """() => [...document.querySelectorAll(
    ".bar, progress-strip, .panel, [role=tabpanel], figcaption, .title, dd, dt"
  )]
  .filter((node) => node.clientWidth > 0 && node.scrollWidth > node.clientWidth + 1)
  .map((node) => `${node.tagName} ${node.className}: ${node.textContent.slice(0, 60)}`)"""


def launch(page: Page) -> None:
    page.click("#tab-new")
    page.select_option("#preset", "quick")
    page.click("#launch")
    page.click("#tab-figures")


def number(page: Page, figure: str) -> float:
    text = page.text_content(f"#figure-{figure}").replace(" k", "e3").replace(" M", "e6")
    return float(text) if text != "–" else 0.0


def wait_for_state(page: Page, word: str) -> None:
    expect(page.locator("#mission-state")).to_contain_text(word, timeout=PATIENCE_MS, ignore_case=True)


def wait_until(page: Page, expression: str, arg: Any = None, *, timeout_ms: float = PATIENCE_MS) -> None:
    """Until an expression, or a function of `arg`, holds. The page's policy forbids `eval`, by which
    playwright's own `wait_for_function` would look a second time."""
    late_s = time.monotonic() + timeout_ms / 1000
    while not page.evaluate(expression, arg):
        assert time.monotonic() < late_s, f"still not so after {timeout_ms / 1000:.0f} s: {expression}"
        page.wait_for_timeout(50)


def wait_for_number(page: Page, figure: str, above: float, *, timeout_ms: float = PATIENCE_MS) -> None:
    wait_until(
        page,
        """([figure, above]) => {
          const text = document.getElementById(`figure-${figure}`).textContent;
          return parseFloat(text.replace(" k", "e3").replace(" M", "e6")) > above;
        }""",
        [figure, above],
        timeout_ms=timeout_ms,
    )


def scene_pixels(page: Page) -> np.ndarray:
    """The middle of the 3D scene, without the viewer's own panels."""
    pixels = pixels_of(page, "#scene-view")
    height, width = pixels.shape[:2]
    return pixels[height // 3 : height * 9 // 10, width // 10 : width * 9 // 10]


def pixels_of(page: Page, selector: str) -> np.ndarray:
    """A part of the page as it is drawn."""
    picture = page.locator(selector).screenshot(timeout=PATIENCE_MS)
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(float)


def map_pixels(page: Page) -> np.ndarray:
    """The map from above."""
    return pixels_of(page, "#top-view-canvas")


def n_colours(pixels: np.ndarray) -> int:
    """Colours told apart in steps of a sixteenth."""
    return len(np.unique((pixels // 16).reshape(-1, 3), axis=0))


def assert_clean(page: Page, width: int, height: int) -> None:
    """Nothing overlaps, nothing is cut off, and the page itself never scrolls."""
    assert page.evaluate(OVERLAPS) == []
    assert page.evaluate(CUT_OFF) == []
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert page.evaluate("document.documentElement.scrollHeight") == height
    box = page.locator("#stop").bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= width
