"""`trajectories/`: every mission's map and way from above, and one sheet a scene to compare them on."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from hgs_core.benchmark.planners.cell import CellFiles, CellResult, scene_file_name
from hgs_core.benchmark.planners.grid import GRID
from hgs_core.benchmark.planners.results import GridResults, number_at
from hgs_core.errors import MapError
from hgs_core.evaluation.top_view import top_view
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.gaussians.ply import read_ply

TRAJECTORIES: Final = "trajectories"

_WIDTH_PX: Final = 900
_TILE_PX: Final = 450
_CAPTION_PX: Final = 44
_GAP_PX: Final = 10
_INK: Final = (28, 31, 38)
_EMPTY: Final = (229, 231, 235)


def draw_missing(results: GridResults) -> None:
    """Top views of finished cells that have none, or an older one."""
    for result in results.cells.values():
        if result.report is None:
            _picture(results.root, result).unlink(missing_ok=True)
        elif _is_stale(results.root, result):
            _draw(results.root, result)


def draw_sheet(results: GridResults, scene: str) -> Path | None:
    """The scene's top views, a row a seed and a column a planner, gaps where a mission is missing.

    Drawn only where a cell changed since. None where no mission has a picture.
    """
    tiles = {(key.planner, key.seed): one for key, one in results.cells.items() if key.scene == scene}
    path = results.root / TRAJECTORIES / f"{scene_file_name(scene)}.png"
    if not any(_picture(results.root, one).is_file() for one in tiles.values()):
        path.unlink(missing_ok=True)
        return None
    if not path.is_file() or path.stat().st_mtime < _changed(results, tiles.values()):
        _save(_sheet(results, tiles), path)
    return path


def _sheet(results: GridResults, tiles: Mapping[tuple[str, int], CellResult]) -> Image.Image:
    seeds = sorted({seed for _, seed in tiles})
    planners = [planner for planner in results.grid.planners if any(name == planner for name, _ in tiles)]
    images = {place: image for place, one in tiles.items() if (image := _tile(results.root, one)) is not None}
    height = max(image.height for image in images.values())
    step_x, step_y = _TILE_PX + _GAP_PX, height + _CAPTION_PX + _GAP_PX
    sheet = Image.new("RGB", (step_x * len(planners) + _GAP_PX, step_y * len(seeds) + _GAP_PX), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=15)
    for (row, seed), (column, planner) in itertools.product(enumerate(seeds), enumerate(planners)):
        x, y = _GAP_PX + column * step_x, _GAP_PX + row * step_y
        caption = _caption(planner, seed, tiles.get((planner, seed)))
        draw.text((x, y), caption, fill=_INK, font=font, spacing=3)
        image = images.get((planner, seed))
        if image is None:
            draw.rectangle((x, y + _CAPTION_PX, x + _TILE_PX, y + _CAPTION_PX + height), fill=_EMPTY)
        else:
            sheet.paste(image, (x, y + _CAPTION_PX))
    return sheet


def _tile(root: Path, result: CellResult) -> Image.Image | None:
    path = _picture(root, result)
    if not path.is_file():
        return None
    with Image.open(path) as image:
        size = (_TILE_PX, round(image.height * _TILE_PX / image.width))
        return image.convert("RGB").resize(size, Image.Resampling.LANCZOS)


def _changed(results: GridResults, cells: Iterable[CellResult]) -> float:
    """When the grid or one of the cells was last changed."""
    paths = [results.root / GRID]
    for one in cells:
        files = CellFiles(results.root, one.key)
        paths += [files.record, files.folder / "report.json", _picture(results.root, one)]
    return max(path.stat().st_mtime for path in paths if path.exists())


def _is_stale(root: Path, result: CellResult) -> bool:
    picture, report = _picture(root, result), CellFiles(root, result.key).folder / "report.json"
    return not picture.is_file() or picture.stat().st_mtime < report.stat().st_mtime


def _draw(root: Path, result: CellResult) -> None:
    folder, record = CellFiles(root, result.key).folder, result.record
    bounds = None if record is None else (np.array(record.lower_m), np.array(record.upper_m))
    way = read_trajectory(folder / "trajectory.txt").poses.translation
    try:
        image = top_view(read_ply(folder / "map.ply"), way, width_px=_WIDTH_PX, bounds_m=bounds)
    except MapError:
        return  # a map without anything below the ceiling: its place on the sheet stays empty
    _save(Image.fromarray(image), _picture(root, result))


def _picture(root: Path, result: CellResult) -> Path:
    return root / TRAJECTORIES / f"{result.key.file_name}.png"


def _caption(planner: str, seed: int, result: CellResult | None) -> str:
    head = f"{planner}, seed {seed}"
    if result is None:
        return f"{head}\nnot asked for"
    if result.report is None:
        return f"{head}\n{result.status}"
    path_m = number_at(result.report, "path_length_m")
    ratio = number_at(result.report, "completion_ratio_observable")
    figures = [
        str(result.report.get("stop_reason")).replace("_", " "),
        "path not measured" if path_m is None else f"{path_m:.1f} m",
        "not evaluated" if ratio is None else f"observable C.R. {ratio:.3f}",
    ]
    return f"{head}\n{', '.join(figures)}"


def _save(image: Image.Image, path: Path) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    image.save(partial, "PNG")
    partial.replace(path)
