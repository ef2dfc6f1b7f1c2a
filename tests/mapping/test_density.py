"""The budget of Gaussians on a piece of surface."""

from collections import Counter
from pathlib import Path

import numpy as np

from hgs_core.gaussians.gaussian_map import CENTRE, LOGIT_OPACITY
from hgs_core.geometry.boxes import Box
from hgs_core.mapping.config import MappingConfig
from hgs_core.mapping.density import SurfaceDensity
from hgs_core.mapping.mapper import Mapper
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap
from tests.mapping.new_mapper import empty_mapper
from tests.mapping.test_mapper import wall_ahead

FAINT = -3.0


def voxels() -> VoxelMap:
    """4 x 4 x 4 of half a metre around the origin."""
    return VoxelMap(VoxelConfig(size_m=0.5), region=Box(lower_m=np.full(3, -1.0), upper_m=np.full(3, 1.0)))


def points(n: int, seed: int) -> np.ndarray:
    """Gaussians in these voxels, one in five of them faint."""
    parameters = np.zeros((n, 8), np.float32)
    parameters[:, CENTRE] = np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 3))
    parameters[::5, LOGIT_OPACITY] = FAINT - 1.0
    return parameters


def at(position: float, n: int) -> np.ndarray:
    parameters = np.zeros((n, 8), np.float32)
    parameters[:, CENTRE] = position
    return parameters


def voxel_of(point: np.ndarray) -> tuple[int, ...]:
    return tuple(np.floor(point[CENTRE] / 0.5).astype(int).tolist())


def test_new_ones_fit_in_until_their_voxel_is_full_the_first_first() -> None:
    density = SurfaceDensity(max_per_m2=40.0)  # ten a voxel
    there, first, second = points(300, 0), points(300, 1), points(300, 2)
    density.recount(there, voxels(), min_logit_opacity=FAINT)
    held = Counter(voxel_of(point) for point in there if point[LOGIT_OPACITY] >= FAINT)
    for new in (first, second):
        expected = []
        for point in new:
            expected.append(held[voxel_of(point)] < 10)
            held[voxel_of(point)] += expected[-1]
        assert density.admit(new).tolist() == expected
    assert 0 < sum(expected) < 300


def test_where_nothing_was_counted_all_fit_in() -> None:
    density = SurfaceDensity(max_per_m2=40.0)
    assert density.admit(points(100, 0)).all()
    density.recount(at(0.1, 10), voxels(), min_logit_opacity=FAINT)
    assert not density.admit(at(0.2, 1)).any()
    assert density.admit(at(7.0, 20)).all()
    density.recount(at(0.1, 0), voxels(), min_logit_opacity=FAINT)
    assert density.admit(at(0.2, 1)).all()


def test_what_was_counted_survives_saving() -> None:
    density, restored = (SurfaceDensity(max_per_m2=40.0) for _ in range(2))
    density.recount(points(300, 0), voxels(), min_logit_opacity=FAINT)
    density.admit(points(100, 1))
    restored.restore(density.state())
    new = points(300, 2)
    assert restored.admit(new).tolist() == density.admit(new).tolist()


def test_the_mapper_adds_nothing_where_its_budget_is_spent(tmp_path: Path) -> None:
    """What the first frame placed was counted, then turned invisible, which pruning after the second frame
    drops: what is there then, the second frame placed."""
    added = {}
    for budget in (1.0, 50_000.0):
        config = MappingConfig(max_gaussians_per_m2=budget, prune_interval=1)
        mapper = empty_mapper(config, tmp_path / f"{budget:.0f}")
        mapper.integrate(wall_ahead(0.0, 0))
        filled = set(map(tuple, cells(mapper)))
        mapper.gaussians.parameters[:, LOGIT_OPACITY] = -20.0
        mapper.integrate(wall_ahead(0.0, 1))
        added[budget] = sum(tuple(cell) in filled for cell in cells(mapper))
    assert added[1.0] == 0
    assert added[50_000.0] > 0


def cells(mapper: Mapper) -> list[list[int]]:
    centres_m = mapper.gaussians.centres_m.astype(np.float64)
    cells: list[list[int]] = np.floor(centres_m / mapper.voxels.config.size_m).astype(int).tolist()
    return cells
