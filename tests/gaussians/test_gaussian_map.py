"""The map's arrays: append, keep, blocks, save and restore."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import BLOCK, LOG_RADIUS, GaussianMap, Primitive
from tests.gaussians.maps import PRIMITIVES, gaussian_map


def rows(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(n, 8)).astype(np.float32)


@given(st.lists(st.integers(0, 700), min_size=1, max_size=5))
def test_append_keeps_what_is_there(sizes: list[int]) -> None:
    gaussians, expected = GaussianMap(), []
    for number, size in enumerate(sizes):
        new = rows(size, number)
        gaussians.append(new, anchor_keyframe=number)
        expected.append(new)
    np.testing.assert_array_equal(gaussians.parameters[: gaussians.size], np.concatenate(expected))
    anchors = np.repeat(np.arange(len(sizes)), sizes)
    np.testing.assert_array_equal(gaussians.anchor_keyframe[: gaussians.size], anchors)


def test_blocks_bound_their_gaussians() -> None:
    gaussians = GaussianMap()
    gaussians.append(rows(3 * BLOCK + 17), anchor_keyframe=0)
    gaussians.append(rows(100, 1), anchor_keyframe=1)
    assert len(gaussians.block_bounds) == 4
    radii = gaussians.radii_m[:, None]
    for block, bounds in enumerate(gaussians.block_bounds):
        inside = slice(block * BLOCK, (block + 1) * BLOCK)
        assert (gaussians.centres_m[inside] - radii[inside] >= bounds[:3] - 1e-5).all()
        assert (gaussians.centres_m[inside] + radii[inside] <= bounds[3:] + 1e-5).all()


def test_rows_appended_after_a_drop_have_no_history() -> None:
    gaussians = GaussianMap()
    gaussians.append(rows(10), anchor_keyframe=0)
    gaussians.information[:10] = 5.0
    gaussians.adam_steps[:10] = 3
    gaussians.keep(np.arange(10) < 4)
    gaussians.append(rows(6, 1), anchor_keyframe=1)
    assert gaussians.information[:4].min() == 5.0
    assert gaussians.information[4:10].max() == 0.0
    assert gaussians.adam_steps[:10].tolist() == [3] * 4 + [0] * 6


def test_keep_drops_rows_and_refuses_another_length() -> None:
    gaussians = GaussianMap()
    parameters = rows(2 * BLOCK)
    gaussians.append(parameters, anchor_keyframe=0)
    kept = parameters[:, LOG_RADIUS] > 0
    gaussians.keep(kept)
    np.testing.assert_array_equal(gaussians.parameters[: gaussians.size], parameters[kept])
    with pytest.raises(MapError, match="one flag a Gaussian"):
        gaussians.keep(np.ones(3, bool))


def test_normals_go_with_their_discs() -> None:
    gaussians = gaussian_map("disc", rows(2 * BLOCK), np.random.default_rng(0))
    normals = gaussians.normals[: gaussians.size].copy()
    gaussians.normal_first_moment[: gaussians.size] = 3.0
    kept = gaussians.parameters[: gaussians.size, LOG_RADIUS] > 0
    gaussians.keep(kept)
    np.testing.assert_array_equal(gaussians.normals[: gaussians.size], normals[kept])
    size = gaussians.size
    gaussians.append(rows(5, 1), np.tile(np.float32([0, 0, 1]), (5, 1)), anchor_keyframe=1)
    np.testing.assert_array_equal(gaussians.normals[size : size + 5, 2], 1.0)
    assert gaussians.normal_first_moment[:size].min() == 3.0
    assert gaussians.normal_first_moment[size : size + 5].max() == 0.0


def test_normals_are_for_discs_and_discs_need_them() -> None:
    with pytest.raises(MapError, match=r"'disc' need normals of shape \(4, 3\), got \(4, 0\)"):
        GaussianMap(primitive="disc").append(rows(4), anchor_keyframe=0)
    with pytest.raises(MapError, match=r"'isotropic' need normals of shape \(4, 0\), got \(4, 3\)"):
        GaussianMap().append(rows(4), np.zeros((4, 3), np.float32), anchor_keyframe=0)


@PRIMITIVES
def test_state_restores_everything(primitive: Primitive) -> None:
    gaussians = gaussian_map(primitive, rows(300), np.random.default_rng(0))
    gaussians.information[:300] = 1.5
    restored = GaussianMap.restore(gaussians.state())
    for name, value in gaussians.state().items():
        np.testing.assert_array_equal(restored.state()[name], value)
    np.testing.assert_array_equal(restored.block_bounds, gaussians.block_bounds)
