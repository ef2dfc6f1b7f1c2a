"""Lenses undone and depth aligned, against scenes with closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from hgs_core.errors import SensorError
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.lens import Distortion, LensCamera
from hgs_core.geometry.se3 import SE3
from hgs_core.sensing.raw_frame import RawFrame, nearest_index
from hgs_core.sensing.rectifier import Rectifier

COLOUR = CameraIntrinsics.centred(160, 120, 130.0)
DEPTH = CameraIntrinsics(width=100, height=70, fx=85.0, fy=82.0, cx=47.0, cy=36.0)
LENSES = {
    "barrel": Distortion(model="plumb_bob", coefficients=(-0.25, 0.05, 2e-3, -1e-3, 0.0)),
    "pincushion": Distortion(model="plumb_bob", coefficients=(0.15, 0.02, 0.0, 1e-3, 0.0)),
    "rational": Distortion(
        model="rational_polynomial", coefficients=(0.3, 0.1, 1e-3, 0.0, 0.05, 0.5, 0.1, 0.0)
    ),
    "fisheye": Distortion(model="equidistant", coefficients=(0.02, -0.01, 0.0, 0.0)),
}


def raw_frame(
    rgb: np.ndarray,
    depth_m: np.ndarray,
    colour: LensCamera,
    depth: LensCamera,
    T_colour_depth: SE3 | None = None,
) -> RawFrame:
    return RawFrame(
        rgb=rgb,
        depth_m=depth_m,
        colour_camera=colour,
        depth_camera=depth,
        T_colour_depth=T_colour_depth or SE3.identity(),
        T_world_camera=None,
        timestamp_s=0.0,
        sequence=0,
    )


def rays_of(camera: LensCamera) -> np.ndarray:
    """The rays (x, y) that the pixels of a camera behind a lens see: its formula turned round by fixed-point
    iteration, where `LensCamera` only ever goes forward."""
    plain = camera.intrinsics.rays()[..., :2]
    xy = plain.copy()
    for _ in range(200):
        xy = xy + 0.7 * (plain - camera.distortion.distort(xy))
    return xy


def pattern(xy: np.ndarray) -> np.ndarray:
    """A smooth picture on the plane z = 1."""
    waves = [np.sin(9 * xy[..., 0]), np.cos(7 * xy[..., 1]), np.sin(5 * (xy[..., 0] + xy[..., 1]))]
    return np.round(127.5 + 100.0 * np.stack(waves, axis=-1)).astype(np.uint8)


@pytest.mark.parametrize("lens", LENSES)
def test_a_picture_taken_through_a_lens_is_that_of_a_pinhole_again(lens: str):
    camera = LensCamera(intrinsics=COLOUR, distortion=LENSES[lens])
    xy = rays_of(camera)
    slope = (1.0 / (0.5 + 0.2 * xy[..., 0] - 0.1 * xy[..., 1])).astype(np.float32)  # a plane
    frame = Rectifier().rectify(raw_frame(pattern(xy), slope, camera, camera))
    seen = frame.intrinsics.rays()[..., :2]
    assert np.abs(frame.rgb.astype(int) - pattern(seen)).max() <= 3
    true_m = 1.0 / (0.5 + 0.2 * seen[..., 0] - 0.1 * seen[..., 1])
    # The nearest pixel lies at most half a pixel aside, in both directions: 0.2 / 130 of slope, at 2 to 3 m.
    assert np.abs(frame.depth_m - true_m).max() < 0.02


def test_the_lines_of_a_grid_are_straight_again():
    """Dots on a grid of the plane z = 1, drawn where a strong lens shows them, come to lie on the grid."""
    lens = Distortion(model="plumb_bob", coefficients=(-0.25, 0.05, 0.0, 0.0, 0.0))
    camera = LensCamera(intrinsics=COLOUR, distortion=lens)
    rows, columns = np.mgrid[-2:3, -3:4]
    grid = 0.12 * np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)
    shown = camera.project(grid)
    v, u = np.mgrid[: COLOUR.height, : COLOUR.width] + 0.5
    distance = np.hypot(u[..., None] - shown[:, 0], v[..., None] - shown[:, 1]).min(axis=-1)
    dots = np.repeat(255.0 * np.exp(-((distance / 2.0) ** 2))[..., None], 3, axis=-1).astype(np.uint8)
    depth = np.ones((COLOUR.height, COLOUR.width), np.float32)
    frame = Rectifier().rectify(raw_frame(dots, depth, camera, camera))
    for x, y in grid:
        at = frame.intrinsics.fx * x + frame.intrinsics.cx, frame.intrinsics.fy * y + frame.intrinsics.cy
        near = np.exp(-(((u - at[0]) ** 2 + (v - at[1]) ** 2) / 50.0)) * frame.rgb[..., 0]
        centre = np.array([(near * u).sum(), (near * v).sum()]) / near.sum()
        assert np.abs(centre - at).max() < 0.25
    straight = camera.intrinsics.fx * grid + [COLOUR.cx, COLOUR.cy]
    assert np.abs(shown - straight).max() > 2.0  # what there was to undo


def test_images_of_one_pinhole_camera_are_handed_on_as_they_are():
    rgb = pattern(COLOUR.rays()[..., :2])
    depth = np.full((120, 160), 2.0, np.float32)
    camera = LensCamera(intrinsics=COLOUR)
    frame = Rectifier().rectify(raw_frame(rgb, depth, camera, camera))
    assert frame.rgb is rgb
    assert frame.depth_m is depth
    assert frame.intrinsics == COLOUR
    posed = frame.at(SE3.identity())
    assert (posed.timestamp_s, posed.sequence) == (0.0, 0)


def test_depth_of_another_size_in_the_same_place_comes_along_its_rays():
    """Of a wall with a step; the depth camera sees less of it than the colour camera does."""
    side = DEPTH.rays()[..., 0] > 0.1
    depth = np.where(side, np.float32(1.0), np.float32(2.0))
    depth[:10] = 0.0
    depth[10:20] = np.inf
    rgb = np.zeros((120, 160, 3), np.uint8)
    frame = Rectifier().rectify(
        raw_frame(rgb, depth, LensCamera(intrinsics=COLOUR), LensCamera(intrinsics=DEPTH))
    )
    x, y = COLOUR.rays()[..., 0], COLOUR.rays()[..., 1]
    u, v = DEPTH.fx * x + DEPTH.cx, DEPTH.fy * y + DEPTH.cy
    inside = (u >= 0) & (u < 100) & (v >= 0) & (v < 70)
    assert not inside.all()
    expected = np.where(DEPTH.rays()[0, np.clip(u.astype(int), 0, 99), 0] > 0.1, 1.0, 2.0)
    expected = np.where(v < 10, 0.0, np.where(v < 20, np.inf, expected))
    np.testing.assert_array_equal(frame.depth_m, np.where(inside, expected, 0.0))


def two_walls(camera: CameraIntrinsics, centre: np.ndarray) -> np.ndarray:
    """z-depth of a wall at z = 3 and, before it, a board at z = 1.2 for |x| < 0.2, seen from `centre`."""
    xy = camera.rays()[..., :2]
    at_board = centre[0] + xy[..., 0] * (1.2 - centre[2])
    return np.where(np.abs(at_board) < 0.2, 1.2 - centre[2], 3.0 - centre[2]).astype(np.float32)


@pytest.mark.parametrize("lens", [Distortion(), LENSES["barrel"]], ids=["pinhole", "lens"])
def test_depth_from_beside_the_colour_camera_gets_the_edges_that_the_colour_camera_sees(lens: Distortion):
    """8 cm to the right: the board's edges shift by 4 pixels against the wall behind."""
    T_colour_depth = SE3(rotation=np.eye(3), translation=np.array([0.08, 0.0, 0.01]))
    depth_camera = LensCamera(intrinsics=DEPTH, distortion=lens)
    at_board = 0.08 + rays_of(depth_camera)[..., 0] * 1.19
    depth = np.where(np.abs(at_board) < 0.2, np.float32(1.19), np.float32(2.99))
    frame = Rectifier().rectify(
        raw_frame(
            np.zeros((120, 160, 3), np.uint8),
            depth,
            LensCamera(intrinsics=COLOUR),
            depth_camera,
            T_colour_depth,
        )
    )
    true_m = two_walls(COLOUR, np.zeros(3))
    known = frame.depth_m > 0
    right = known & (np.abs(frame.depth_m - true_m) < 0.01)
    assert (known & ~right).sum() / known.sum() < 0.025  # of the board's edges, a pixel or two
    # No wall shines through the board, and holes are where only the colour camera sees the wall.
    board = true_m < 2.0
    inner = board & np.roll(board, 3, axis=1) & np.roll(board, -3, axis=1)
    rows = slice(20, 100)
    assert known[rows][inner[rows]].all()
    assert (frame.depth_m[rows][inner[rows]] < 2.0).all()
    hidden = ~known[rows] & ~board[rows]
    assert 0 < hidden.sum() / (~board[rows]).sum() < 0.25
    # A simple resize is wrong wherever the edge moved.
    naive = np.kron(two_walls(replace(COLOUR), np.array([0.08, 0.0, 0.01])), np.ones((1, 1)))
    assert (np.abs(naive - true_m) > 0.5).sum() > 4 * (known & ~right).sum() / 2


def test_nothing_in_range_stays_nothing_in_range():
    depth = np.full((70, 100), np.inf, np.float32)
    depth[:, :50] = 2.0
    depth[30] = 0.0
    turned = SE3(rotation=np.eye(3), translation=np.array([0.05, 0.0, 0.0]))
    cameras = LensCamera(intrinsics=DEPTH), LensCamera(intrinsics=DEPTH)
    frame = Rectifier().rectify(raw_frame(np.zeros((70, 100, 3), np.uint8), depth, *cameras, turned))
    assert np.isinf(frame.depth_m[10, 60:]).all()
    assert (frame.depth_m[10, 5:45] == 2.0).all()
    assert (frame.depth_m[30, 60:99] == 0.0).all()


def test_tables_follow_the_cameras():
    rectifier = Rectifier()
    depth = np.ones((120, 160), np.float32)
    rgb = np.zeros((120, 160, 3), np.uint8)
    for lens in (Distortion(), LENSES["pincushion"], Distortion()):
        camera = LensCamera(intrinsics=COLOUR, distortion=lens)
        frame = rectifier.rectify(raw_frame(rgb, depth, camera, camera))
        assert frame.intrinsics == camera.undistorted()


def test_images_of_another_size_than_their_camera_are_refused():
    with pytest.raises(SensorError, match="the depth image measures 160 x 120 pixels, its camera 100 x 70"):
        raw_frame(
            np.zeros((120, 160, 3), np.uint8),
            np.zeros((120, 160), np.float32),
            LensCamera(intrinsics=COLOUR),
            LensCamera(intrinsics=DEPTH),
        )


def test_the_nearest_time_counts_within_the_bound():
    times = np.array([0.0, 0.1, 0.2])
    assert nearest_index(times, 0.16, 0.05) == 2
    assert nearest_index(times, 0.15, 0.06) == 1
    assert nearest_index(times, 0.24, 0.02) is None
    assert nearest_index(times, -0.01, 0.02) == 0
    assert nearest_index(np.zeros(0), 0.0, 1.0) is None
