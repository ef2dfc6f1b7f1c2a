import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hgs_core.robot.robot import STEP_HEIGHT_M
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.textured_mesh import Material, TexturedMesh
from tests.scene.worlds import with_boxes


def mesh_of(corners):
    n = len(corners)
    return TexturedMesh(
        vertices_m=corners.reshape(-1, 3).astype(np.float32),
        triangles=np.arange(3 * n, dtype=np.int32).reshape(n, 3),
        uv=np.zeros((n, 3, 2), dtype=np.float32),
        material_index=np.zeros(n, dtype=np.int32),
        materials=(Material(name="m"),),
    )


def naive_clearance(corners, points, low, high, samples=60):
    """Distance to a dense sampling of each triangle, kept where its height is in the band."""
    a, b = np.meshgrid(np.linspace(0, 1, samples), np.linspace(0, 1, samples))
    inside = a + b <= 1
    weights = np.stack([1 - a - b, a, b], axis=-1)[inside]
    cloud = np.einsum("wk,nkd->nwd", weights, corners).reshape(-1, 3)
    cloud = cloud[(cloud[:, 2] >= low) & (cloud[:, 2] <= high)][:, :2]
    if len(cloud) == 0:
        return np.full(len(points), np.inf)
    return np.linalg.norm(points[:, None] - cloud[None], axis=-1).min(axis=1)


@given(st.integers(0, 2**32 - 1))
def test_clearance_agrees_with_dense_sampling(seed):
    rng = np.random.default_rng(seed)
    corners = rng.uniform([0, 0, -0.3], [1, 1, 1.6], size=(4, 3, 3))
    corners[0, :, 0] = 0.4  # upright: projects to a segment
    corners[1, 1, :2] = corners[1, 0, :2]  # upright with a vertical edge
    points = rng.uniform(-0.5, 1.5, size=(8, 2))
    exact = BodyObstacles(mesh_of(corners), 1.1).clearance_m(points)
    sampled = naive_clearance(corners.astype(np.float32).astype(float), points, STEP_HEIGHT_M, 1.1)
    if np.isinf(sampled).all():
        return  # too thin a slice for the sampling to hit
    assert np.all(exact <= sampled + 1e-4)
    assert np.all(exact >= sampled - 0.04)


@pytest.fixture(scope="module")
def furnished():
    return with_boxes(
        ((0.5, 0.5, 0.0), (1.5, 1.2, 0.8)),  # a table-high block
        ((-2.0, -1.5, 1.2), (-1.0, -1.0, 2.0)),  # a cupboard on the wall, above the body
        ((-1.0, 0.5, 0.0), (0.0, 1.5, 0.02)),  # a rug
    )


@pytest.mark.parametrize(
    ("x", "y", "clearance"),
    [
        (2.0, 0.8, 0.5),  # beside the block, nearer than the wall at x = 3
        (1.0, 0.8, 0.0),  # in it
        (-1.5, -1.25, 0.75),  # under the cupboard: the wall at y = -2 counts
        (-0.5, 1.0, 1.0),  # on the rug: block and wall are 1 m away
        (2.9, -1.0, 0.1),
    ],
)
def test_what_counts_as_an_obstacle(furnished, x, y, clearance):
    assert BodyObstacles(furnished, 1.1).clearance_m(np.array([x, y])) == pytest.approx(clearance, abs=1e-5)


def test_a_taller_body_meets_the_cupboard(furnished):
    assert BodyObstacles(furnished, 1.3).clearance_m(np.array([-1.5, -1.25])) == 0.0


def test_an_empty_band_leaves_everything_free():
    floor = mesh_of(np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=float))
    assert np.isinf(BodyObstacles(floor, 1.1).clearance_m(np.array([0.2, 0.2])))
