"""The map from above: right is x, up is y, ceilings are cut away."""

import numpy as np
import pytest

from hgs_core.errors import MapError
from hgs_core.evaluation.top_view import top_view
from hgs_core.gaussians.gaussian_map import GaussianMap, Primitive
from tests.gaussians.maps import PRIMITIVES


def floor_and_ceiling(primitive: Primitive = "isotropic") -> GaussianMap:
    """A 4 x 2 m floor, red but for a green quarter at large x and y, under a white ceiling."""
    x, y = np.meshgrid(np.arange(0.0, 4.0, 0.05), np.arange(0.0, 2.0, 0.05), indexing="ij")
    n = x.size
    parameters = np.zeros((2 * n, 8), np.float32)
    parameters[:, 0], parameters[:, 1] = np.tile(x.ravel(), 2), np.tile(y.ravel(), 2)
    parameters[n:, 2] = 2.5
    green = (parameters[:n, 0] > 2.0) & (parameters[:n, 1] > 1.0)
    parameters[:n, 3:6] = np.where(green[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    parameters[n:, 3:6] = 1.0
    parameters[:, 6] = np.log(0.04)
    parameters[:, 7] = 4.0
    gaussians = GaussianMap(primitive=primitive)
    up = np.tile(np.float32([0.0, 0.0, 1.0]), (2 * n, 1))
    gaussians.append(parameters, up if primitive == "disc" else None, anchor_keyframe=0)
    return gaussians


@PRIMITIVES
def test_axes_cut_and_path(primitive: Primitive) -> None:
    path = np.array([[0.5, 0.5, 1.0], [1.5, 0.5, 1.0]])
    image = top_view(floor_and_ceiling(primitive), path, width_px=400)
    height = image.shape[0]
    assert height == pytest.approx(200, abs=6)
    assert image[height // 4, 300].argmax() == 1  # green: right and up
    assert image[height // 4, 100].argmax() == 0
    assert image[3 * height // 4, 300].argmax() == 0
    assert image[: height // 2, :, 2].max() < 60  # nothing white: the ceiling is gone
    # The path is 1 m long, a quarter of the picture; the dots' rims stand out by 4 pixels.
    on_path = np.all(image == [255, 60, 0], axis=2)
    assert np.count_nonzero(on_path.any(axis=0)) == pytest.approx(108, abs=6)
    assert abs(np.argwhere(on_path)[:, 0].mean() / height - 0.75) < 0.03


def test_a_white_dot_starts_the_way_and_a_black_one_ends_it() -> None:
    path = np.array([[0.5, 0.5, 1.0], [1.5, 0.5, 1.0]])
    corners = (np.array([0.0, 0.0]), np.array([4.0, 2.0]))
    image = top_view(floor_and_ceiling(), path, width_px=408, bounds_m=corners)
    assert image.shape == (204, 408, 3)  # 100 pixels a metre, a hundredth more on every side
    assert image[152, 54].tolist() == [255, 255, 255]
    assert image[152, 154].tolist() == [0, 0, 0]


def test_given_bounds_are_what_is_shown() -> None:
    corners = (np.array([2.0, 0.0]), np.array([4.0, 2.0]))
    way = np.array([[3.0, 1.0, 1.0], [3.0, 1.5, 1.0]])
    image = top_view(floor_and_ceiling(), way, width_px=200, bounds_m=corners)
    assert image.shape == (200, 200, 3)
    on_path = np.argwhere(np.all(image == [255, 60, 0], axis=2))
    assert abs(on_path[:, 1].mean() - 100) < 3


def test_nothing_below_the_cut_is_an_error() -> None:
    with pytest.raises(MapError, match="cut higher"):
        top_view(floor_and_ceiling(), np.zeros((0, 3)), cut_height_m=-1.0)
