import numpy as np
import pytest
from numpy import ndarray

from hgs_core.gain.panorama import PanoramaGrid
from hgs_core.gain.sight import SightLimits, Targets, is_clear, seen_by_yaw
from hgs_core.voxels.voxel_map import VoxelMap
from tests.gain.naive import pieces
from tests.gain.worlds import CAMERA, empty_voxels

GRID = PanoramaGrid.for_camera(CAMERA, n_azimuths=120, n_elevations=32)
HERE = np.array([[2.05, 2.05, 1.05]])


def nothing_opaque(voxels: VoxelMap) -> ndarray:
    return np.zeros(voxels.states.shape, bool)


def seen(
    point: tuple[float, float, float], limits: SightLimits, normal: ndarray | None = None, weight: float = 3.0
) -> ndarray:
    """The gains of all yaws at `HERE` for one target."""
    voxels = empty_voxels((4.0, 4.0, 2.5))
    targets = Targets(
        points_m=HERE + np.array([point]),
        weights=np.array([weight]),
        normals=None if normal is None else normal[None],
    )
    return seen_by_yaw(GRID, targets, voxels, nothing_opaque(voxels), HERE, limits)[0]


def test_a_target_counts_at_every_yaw_that_has_it_in_the_image() -> None:
    """90 degrees of view: yaws up to 45 degrees to either side of a target's bearing of 30 degrees."""
    bearing = np.radians(30.0)
    gains = seen((np.cos(bearing), np.sin(bearing), 0.0), SightLimits(near_m=0.0, far_m=4.0))
    turned = np.abs(np.angle(np.exp(1j * (GRID.yaws_rad - bearing))))
    np.testing.assert_allclose(gains[turned < np.radians(41.0)], 3.0, rtol=1e-6)
    np.testing.assert_allclose(gains[turned > np.radians(49.0)], 0.0)


@pytest.mark.parametrize(("height_m", "is_seen"), [(0.5, True), (-0.5, True), (0.65, False), (-0.65, False)])
def test_what_lies_above_or_below_the_image_is_not_seen(height_m: float, is_seen: bool) -> None:
    """The image ends at a tangent of 340 / 600 = 0.567."""
    assert seen((1.0, 0.0, height_m), SightLimits(near_m=0.0, far_m=4.0)).any() == is_seen


@pytest.mark.parametrize(
    ("level", "near_m", "far_m", "is_seen"),
    [
        (False, 0.5, 1.15, True),
        (False, 0.5, 1.05, False),
        (False, 1.15, 2.0, False),
        (True, 0.5, 1.05, True),
        (True, 1.05, 2.0, False),
    ],
)
def test_distances_are_straight_or_level(level: bool, near_m: float, far_m: float, is_seen: bool) -> None:
    """The target is 1.118 m away, 1 m of it in the plane."""
    limits = SightLimits(near_m=near_m, far_m=far_m, level=level)
    assert seen((1.0, 0.0, 0.5), limits).any() == is_seen


@pytest.mark.parametrize(("incidence_deg", "is_seen"), [(61.0, True), (59.0, False)])
def test_a_surface_is_seen_from_its_front_up_to_an_angle(incidence_deg: float, is_seen: bool) -> None:
    """A surface along the line to it, turned by 30 degrees towards the viewer: 60 degrees off its normal."""
    limits = SightLimits(near_m=0.0, far_m=4.0, max_incidence_rad=np.radians(incidence_deg))
    normal = np.array([-np.cos(np.pi / 3), np.sin(np.pi / 3), 0.0])
    assert seen((1.0, 0.0, 0.0), limits, normal).any() == is_seen
    assert not seen((1.0, 0.0, 0.0), limits, -normal).any()


def test_lines_of_sight_are_those_through_every_voxel_but_for_clipped_corners() -> None:
    """A sample every 0.7 voxels: only what a line crosses for less than that can be missed."""
    rng = np.random.default_rng(0)
    voxels = empty_voxels((2.0, 2.0, 1.0))
    opaque = rng.random(voxels.states.shape) < 0.05
    starts, ends = rng.uniform(0.01, [1.99, 1.99, 0.99], (2, 300, 3))
    found = is_clear(voxels, opaque, starts, ends, far_m=3.0)
    expected_blocked = 0
    for start, end, clear in zip(starts, ends, found, strict=True):
        crossed = pieces(start * 10, end * 10, voxels.states.shape)[:-1]
        length = 10 * float(np.linalg.norm(end - start))
        inside = max(((b - a) * length for cell, a, b in crossed[1:] if opaque[cell]), default=0.0)
        expected_blocked += inside > 0.7
        if inside == 0.0 and not opaque[crossed[0][0]] if crossed else True:
            assert clear
        if inside > 0.7:
            assert not clear
    assert expected_blocked > 50


def test_the_voxel_of_the_target_may_be_opaque() -> None:
    voxels = empty_voxels((4.0, 4.0, 2.0))
    opaque = nothing_opaque(voxels)
    opaque[30, 10, 10] = True
    start, end = np.array([[1.05, 1.05, 1.05]]), np.array([[3.05, 1.05, 1.05]])
    assert is_clear(voxels, opaque, start, end, far_m=4.0)[0]
    assert not is_clear(voxels, opaque, start, end + np.array([0.1, 0.0, 0.0]), far_m=4.0)[0]


def test_nothing_is_fine() -> None:
    voxels = empty_voxels((1.0, 1.0, 1.0))
    targets = Targets(points_m=np.zeros((0, 3)), weights=np.zeros(0))
    limits = SightLimits(near_m=0.0, far_m=4.0)
    assert not seen_by_yaw(GRID, targets, voxels, nothing_opaque(voxels), HERE, limits).any()
    none = seen_by_yaw(GRID, targets, voxels, nothing_opaque(voxels), HERE[:0], limits)
    assert none.shape == (0, 120)
