"""How far one has to drive to see a known scene: what a path length can be stated as a multiple of.

The observable samples are to be seen, to a share of them, by level cameras at reachable places; path lengths
are those of shortest ways over the free floor. Only driving has a length: at every place along the path the
camera may look to any side, as a robot that turns in place may, and what it sees while driving counts. The
looks that are needed besides are then chosen, the most seeing first.

The length is that of the shortest path found (see `covering_path`), not a lower bound.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from pydantic import ValidationError

from hgs_core.evaluation.ceiling import CeilingRequest, cache_directory, cache_key, observable_ceiling
from hgs_core.evaluation.covering_path import CoverProblem, covering_path, packed
from hgs_core.evaluation.floor_graph import FloorGraph, floor_graph
from hgs_core.evaluation.looks import N_YAWS, YAWS_RAD, Looks
from hgs_core.evaluation.reachable import reachable_floor
from hgs_core.evaluation.report_parts import ReportPart
from hgs_core.scene.ray_caster import RayCaster

_log = logging.getLogger(__name__)

LEVELS: Final = (0.90, 0.95, 0.97)
N_SEARCH_SAMPLES: Final = 20_000
"""Of the observable samples, evenly; the share of them that a path sees is that of all to 0.2 %."""
SEARCHES: Final = 3
"""For each level, with different random numbers; the shortest path counts."""
ROUNDS: Final = 300
"""Of each search."""

_SEED: Final = 20_240_902
_METHOD_VERSION: Final = 1
"""Raised whenever the method changes, so that old cache files are not used."""


class Look(ReportPart):
    """One view: a level camera's place and heading."""

    x_m: float
    y_m: float
    yaw_rad: float


class CoveringRoute(ReportPart):
    """The shortest path found that sees a share of the observable surface."""

    level: float
    """The share that was asked for."""
    seen_share: float
    """The share that is seen from along the path."""
    length_m: float
    route_m: tuple[tuple[float, float], ...]
    """Floor positions along it, the start first; straight from one to the next but where the grid of places
    misses a passage."""
    looks: tuple[Look, ...]
    """What is looked at besides straight ahead, in the order of driving."""


class FullKnowledgePath(ReportPart):
    """What full knowledge of a scene would need."""

    n_observable: int
    """Samples of the true surface that any reachable camera pose can see."""
    n_samples: int
    """Of these, how many the paths were made for."""
    n_places: int
    """Grid places on the reachable floor."""
    visible_share: float
    """Share of the samples that a look from some place sees."""
    routes: tuple[CoveringRoute, ...]
    """One for each level, rising."""


def full_knowledge_path(
    caster: RayCaster,
    request: CeilingRequest,
    *,
    levels: Sequence[float] = LEVELS,
    n_samples: int = N_SEARCH_SAMPLES,
    rounds: int = ROUNDS,
    progress: Callable[[str], None] | None = None,
) -> FullKnowledgePath:
    """Short paths from the start that see each of `levels` of the observable surface, from the cache where
    they are known.

    Raises `SceneError` when the start is not free, or a level is more than all places see.
    """
    levels = sorted(levels)
    method = ["full knowledge", _METHOD_VERSION, N_YAWS, _SEED, SEARCHES, *levels, n_samples, rounds]
    path = cache_directory() / f"full-knowledge-{cache_key(caster.mesh, request, method)}.json"
    cached = _load(path)
    if cached is not None:
        return cached
    result = _computed(caster, request, levels, n_samples, rounds, progress or (lambda message: None))
    _store(path, result)
    return result


def _computed(
    caster: RayCaster,
    request: CeilingRequest,
    levels: list[float],
    n_samples: int,
    rounds: int,
    progress: Callable[[str], None],
) -> FullKnowledgePath:
    ceiling = observable_ceiling(caster, request, progress=progress)
    observable = ceiling.samples_m[ceiling.observable]
    chosen = np.linspace(0, len(observable) - 1, min(n_samples, len(observable))).round().astype(int)
    looks = Looks(
        caster,
        observable[chosen],
        camera_height_m=request.camera_height_m,
        intrinsics=request.intrinsics,
        range_m=request.range_m,
    )
    progress("shortest ways over the floor")
    floor = reachable_floor(
        caster,
        start_xy=request.start_xy,
        radius_m=request.robot_radius_m,
        height_m=request.robot_height_m,
    )
    graph = floor_graph(floor)
    progress(f"what {len(graph.positions_m)} places see")
    seen = np.array([looks.seen(position).any(axis=0) for position in graph.positions_m])
    start = graph.nearest(*request.start_xy)
    to_start_m = float(np.hypot(*(graph.positions_m[start] - request.start_xy)))
    problem = CoverProblem(graph, packed(seen), start)
    routes: list[CoveringRoute] = []
    found: list[tuple[int, ...]] = []
    # From the highest level down: a path that sees more is one to begin with for less.
    for level in reversed(levels):
        progress(f"the shortest path that sees {level:.0%}")
        n_wanted = int(np.ceil(level * len(chosen)))
        searched = [
            covering_path(problem, n_wanted, rng=rng, rounds=rounds, begin_with=found)
            for rng in np.random.default_rng(_SEED).spawn(SEARCHES)
        ]
        path = min(searched, key=lambda one: one.length_m)
        found.append(path.stops)
        places = _places(graph, path.stops)
        routes.append(
            CoveringRoute(
                level=level,
                seen_share=path.n_seen / len(chosen),
                length_m=to_start_m + path.length_m,
                route_m=tuple((float(x), float(y)) for x, y in graph.positions_m[places]),
                looks=_needed_looks(looks, graph.positions_m[places], n_wanted),
            )
        )
    return FullKnowledgePath(
        n_observable=len(observable),
        n_samples=len(chosen),
        n_places=len(graph.positions_m),
        visible_share=problem.n_visible / len(chosen),
        routes=tuple(reversed(routes)),
    )


def _places(graph: FloorGraph, stops: Sequence[int]) -> list[int]:
    """All places along the path."""
    places = [stops[0]]
    for begin, end in pairwise(stops):
        places += graph.way(begin, end)[1:]
    return places


def _needed_looks(looks: Looks, route_m: Float[ndarray, "n 2"], n_wanted: int) -> tuple[Look, ...]:
    """Looks along the route that see `n_wanted` samples together with those straight ahead, the most seeing
    first chosen."""
    seen = np.zeros(len(looks.samples_m), dtype=bool)
    ahead = np.diff(route_m, axis=0)
    for begin, end, heading in zip(route_m, route_m[1:], np.arctan2(*ahead.T[::-1]), strict=False):
        for position in (begin, end):
            seen |= looks.seen(position, np.array([heading]))[0]
    positions = list(dict.fromkeys(map(tuple, route_m.tolist())))
    views = packed(np.concatenate([looks.seen(np.array(position)) for position in positions]))
    known = packed(seen[None])[0]
    chosen: list[int] = []
    while np.bitwise_count(known).sum() < n_wanted:
        chosen.append(int(np.argmax(np.bitwise_count(views & ~known).sum(axis=1, dtype=np.int64))))
        known = known | views[chosen[-1]]
    return tuple(
        Look(
            x_m=positions[index // N_YAWS][0],
            y_m=positions[index // N_YAWS][1],
            yaw_rad=float(YAWS_RAD[index % N_YAWS]),
        )
        for index in sorted(chosen)
    )


def _load(path: Path) -> FullKnowledgePath | None:
    try:
        return FullKnowledgePath.model_validate_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValidationError) as error:
        _log.warning("cannot use the cached path %s (%s): computing it again", path, error)
        return None


def _store(path: Path, result: FullKnowledgePath) -> None:
    partial = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(result.model_dump_json(), encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        _log.warning("cannot cache the full-knowledge path in %s: %s", path, error)
