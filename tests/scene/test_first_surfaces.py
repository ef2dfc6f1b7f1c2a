"""Pictures by the z-buffer, held against Embree's rays and against themselves."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.native import kernels
from hgs_core.scene.ray_caster import RayCaster
from tests.scene.worlds import with_boxes

CAMERA = CameraIntrinsics(width=71, height=45, fx=40.0, fy=36.0, cx=33.0, cy=24.5)
CENTRES = np.zeros((1, 2), np.float32)
NOTHING = 0xFFFFFFFF


@pytest.fixture(scope="module")
def furnished():
    """A room with boxes, one of which the camera stands close to, and slivers of triangles."""
    return RayCaster(
        with_boxes(
            ((0.5, 0.5, 0.0), (1.5, 1.2, 0.8)),
            ((-2.0, -1.5, 1.5), (-1.0, -1.0, 2.0)),
            ((-0.5, -0.5, 0.0), (-0.499, 0.5, 1.9)),
        )
    )


def met(caster, pose, offsets=CENTRES, wanted=None, camera=CAMERA):
    return caster._first_surfaces(camera, pose, offsets, wanted=wanted)


def any_pose(rng):
    return SE3(
        rotation=Rotation.random(random_state=rng.integers(2**31)).as_matrix(),
        translation=rng.uniform([-2.9, -1.9, 0.05], [2.9, 1.9, 2.45]),
    )


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_every_pixel_shows_what_a_ray_through_it_meets(furnished, seed):
    pose = any_pose(np.random.default_rng(seed))
    found = met(furnished, pose)
    directions = CAMERA.rays().reshape(-1, 3) @ pose.rotation.T
    depth = furnished.cast(np.broadcast_to(pose.translation, directions.shape), directions)
    # A ray that passes an edge within rounding meets this side of it or the other.
    agree = np.isclose(found.z_depth_m[0], depth, rtol=1e-4, atol=1e-4)
    assert np.count_nonzero(~agree) <= 2

    hit = agree & np.isfinite(depth)
    triangle = found.triangle[0, hit]
    first, second = found.barycentric[0, hit].T.astype(np.float64)
    weights = np.stack([1 - first - second, first, second], axis=1)
    points = (furnished.mesh.corners_m[triangle] * weights[:, :, None]).sum(axis=1)
    expected = pose.translation + directions[hit] * depth[hit, None]
    np.testing.assert_allclose(points, expected, atol=2e-3)
    cosine = np.abs((furnished.mesh.normals[triangle] * directions[hit]).sum(axis=1))
    np.testing.assert_allclose(found.facing[0, hit], cosine, rtol=1e-3, atol=1e-3)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
@example(0)
def test_looks_aside_at_some_pixels_are_those_of_a_camera_moved_aside(furnished, seed):
    rng = np.random.default_rng(seed)
    pose, wanted = any_pose(rng), rng.random((CAMERA.height, CAMERA.width)) < rng.random()
    offsets = rng.uniform(-0.5, 0.5, (3, 2)).astype(np.float32)
    found = met(furnished, pose, offsets, wanted)
    for look, (du, dv) in enumerate(offsets.tolist()):
        moved = CameraIntrinsics(
            width=CAMERA.width,
            height=CAMERA.height,
            fx=CAMERA.fx,
            fy=CAMERA.fy,
            cx=CAMERA.cx - du,
            cy=CAMERA.cy - dv,
        )
        whole = met(furnished, pose, camera=moved)
        other = found.triangle[look] != whole.triangle[0, wanted.ravel()]
        assert np.count_nonzero(other) <= 1  # directions may differ in their last bit
        depth = whole.z_depth_m[0, wanted.ravel()]
        np.testing.assert_allclose(found.z_depth_m[look, ~other], depth[~other], rtol=1e-5)


def test_pictures_do_not_depend_on_the_number_of_threads(furnished):
    pose = level_camera_pose(-1.0, 0.3, 1.25, 0.4)
    pictures = []
    try:
        for threads in (1, 2, 3):
            kernels.set_threads(threads)
            pictures.append(furnished.render(CAMERA, pose))
    finally:
        kernels.set_threads(1)
    for rgb, depth in pictures[1:]:
        np.testing.assert_array_equal(rgb, pictures[0][0])
        np.testing.assert_array_equal(depth, pictures[0][1])


def test_of_two_surfaces_in_one_place_the_first_is_shown():
    world = with_boxes(((0.5, -1.0, 0.0), (1.5, 1.0, 2.0)), ((0.5, -1.0, 0.0), (1.5, 1.0, 2.0)))
    ahead = met(RayCaster(world), level_camera_pose(-1.0, 0.0, 1.0, 0.0))
    middle = ahead.triangle[0].reshape(CAMERA.height, CAMERA.width)[20:25, 30:36]
    assert (middle < 24).all()  # the room has 12 triangles, each box 12


def first_surfaces(vertices, triangles, translation=(0.0, 0.0, 0.0), **changes):
    arguments = {
        "vertices": np.asarray(vertices, np.float32).reshape(-1, 3),
        "triangles": np.asarray(triangles, np.int32).reshape(-1, 3),
        "rotation": np.eye(3),
        "translation": np.asarray(translation, np.float64),
        "width": 20,
        "height": 10,
        "fx": 10.0,
        "fy": 10.0,
        "cx": 10.0,
        "cy": 5.0,
        "offsets": CENTRES,
        "wanted": None,
        "triangle": np.zeros((1, 200), np.uint32),
        "barycentric": np.zeros((1, 200, 2), np.float32),
        "z_depth_m": np.zeros((1, 200), np.float32),
        "facing": np.zeros((1, 200), np.float32),
        **changes,
    }
    kernels.first_surfaces(**arguments)
    return arguments


def test_triangles_that_no_pixel_can_show_are_left_out():
    """Without area, edge-on, behind the camera, with corners that are no numbers or at the camera itself."""
    corners = [[0, 0, 2], [1, 0, 2], [2, 0, 2], [0, 0, 5], [0, 0, -2], [1, 1, -2], [1, 0, -3]]
    corners += [[np.nan, 0, 1], [np.inf, 1, 1], [1e30, 2e30, 3e30], [0, 0, 0]]
    triangles = [[0, 1, 2], [0, 0, 0], [0, 1, 3], [4, 5, 6], [0, 1, 7], [0, 5, 8], [0, 1, 10], [0, 9, 9]]
    found = first_surfaces(corners, triangles)
    assert (found["triangle"] == NOTHING).all()
    assert np.isinf(found["z_depth_m"]).all()
    assert (first_surfaces(corners, [])["triangle"] == NOTHING).all()
    nowhere = first_surfaces([[-9, -9, 2], [9, -9, 2], [0, 9, 2]], [[0, 1, 2]], translation=(np.nan, 0, 0))
    assert (nowhere["triangle"] == NOTHING).all()


def test_a_triangle_that_reaches_behind_the_camera_is_shown_where_it_lies_ahead():
    """A floor 1 m below, from 50 m behind to 50 m ahead."""
    found = first_surfaces([[-200, 1, -50], [200, 1, -50], [0, 1, 50]], [[0, 1, 2]])
    depth = found["z_depth_m"].reshape(10, 20)
    assert np.isinf(depth[:5]).all()
    np.testing.assert_allclose(
        depth[5:], np.repeat(10.0 / (np.arange(5) + 0.5)[:, None], 20, axis=1), rtol=1e-5
    )


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"width": 0}, "a width and a height"),
        ({"wanted": np.ones((10, 19), bool)}, "height and width"),
        ({"wanted": np.zeros((10, 20), bool)}, "a wanted pixel"),
        ({"facing": np.zeros((2, 200), np.float32)}, "a row a look"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        first_surfaces([[0, 0, 1]], [], **changes)
