"""The operator page, map and 3D scene beside each other, left open for the hours of a mission."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import psutil
import pytest
from playwright.sync_api import CDPSession, Page

from app.settings import DisplaySettings
from tests.app.fake_mission import runner
from tests.app.served import Served, served
from tests.browser.conftest import MAX_SPLATS, new_page
from tests.browser.page_checks import assert_clean, launch, number, wait_for_number

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


def browser_mib() -> dict[str, float]:
    """Memory of the browser's processes, of none of them shared, by what they do."""
    held = {"renderer": 0.0, "gpu-process": 0.0, "": 0.0}
    for process in psutil.Process().children(recursive=True):
        if "chrom" in process.name():
            does = next((part for part in process.cmdline() if part.startswith("--type=")), "--type=")
            kind = does.removeprefix("--type=")
            held[kind if kind in held else ""] += process.memory_full_info().uss / 2**20
    return held


def memory(page: Page, tools: CDPSession, service: Served) -> Memory:
    tools.send("HeapProfiler.collectGarbage")
    counts: dict[str, Any] = {
        one["name"]: one["value"] for one in tools.send("Performance.getMetrics")["metrics"]
    }
    browser = browser_mib()
    return Memory(
        frames=number(page, "frames"),
        heap_mib=counts["JSHeapUsedSize"] / 2**20,
        nodes=counts["Nodes"],
        listeners=counts["JSEventListeners"],
        page_mib=browser["renderer"],
        drawing_mib=browser["gpu-process"],
        rest_mib=browser[""],
        service_mib=psutil.Process(service.pid).memory_info().rss / 2**20,
    )


@pytest.mark.slow
@pytest.mark.timeout(7200)
def test_hours_of_watching_take_no_more_memory_than_minutes(chromium, tmp_path, capsys):
    """Two hours of a mission, compressed in time: 18,000 frames, a view of the scene ten times a second."""
    display = DisplaySettings(max_splats=MAX_SPLATS, interval_s=0.1)
    with (
        served(
            tmp_path / "data", runner=runner("run_for_hours"), display=display, mission_threads=1
        ) as service,
        new_page(chromium, service.url, stage="both") as page,
    ):
        tools = page.context.new_cdp_session(page)
        tools.send("Performance.enable")
        launch(page)
        found = []
        for reading in range(1, READINGS):
            wait_for_number(page, "frames", FRAMES * reading / READINGS, timeout_ms=1_800_000)
            found.append(memory(page, tools, service))
        assert_clean(page, 1280, 720)
    with capsys.disabled():
        sys.stdout.write("\n frames   heap   nodes   listeners   page   drawing   rest   service (MiB)\n")
        for one in found:
            sys.stdout.write(
                f"{one.frames:7.0f} {one.heap_mib:6.1f} {one.nodes:7.0f} {one.listeners:11.0f} "
                f"{one.page_mib:6.0f} {one.drawing_mib:9.0f} {one.rest_mib:6.0f} {one.service_mib:9.0f}\n"
            )
    middle, last = found[len(found) // 2], found[-1]
    assert last.heap_mib < 1.1 * middle.heap_mib + 5
    assert last.nodes < 1.1 * middle.nodes + 500
    assert last.listeners < 1.1 * middle.listeners + 50
    assert last.page_mib < 1.1 * middle.page_mib + 30
    assert last.drawing_mib < 1.1 * middle.drawing_mib + 30
    assert last.rest_mib < 1.1 * middle.rest_mib + 30
    assert last.service_mib < middle.service_mib + 30
