import numpy as np
import pytest

from app.missions.display import CANDIDATE_STATUSES, SUBSPACE_STATES, DisplayView, slot_bytes
from app.missions.display_builder import GAP_FACTOR, display_view
from app.missions.transport import ArraySlot
from hgs_core.evaluation.colour_maps import (
    BEYOND_RANGE,
    NO_RETURN,
    colourise,
    colourise_depth,
    colourise_log,
    ramp,
)
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.planning.plan import CandidateStatus, SubspaceState
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap
from tests.app import fake_mission


@pytest.fixture(scope="module")
def mission_view():
    rng = np.random.default_rng(0)
    gaussians = GaussianMap()
    gaussians.append(fake_mission._room(rng), anchor_keyframe=0)
    robot = fake_mission._robot(0.3, 7)
    plan = fake_mission._plan(robot, 0.3, rng)
    trajectory = [np.array([0.1 * k, 0.0, 1.0], np.float32) for k in range(10)]
    return fake_mission._view(gaussians, VoxelMap(VoxelConfig()), robot, plan, trajectory, 7)


def test_names_on_both_sides_of_the_wire_agree():
    assert tuple(SubspaceState) == SUBSPACE_STATES
    assert tuple(CandidateStatus) == CANDIDATE_STATUSES


def test_a_view_survives_the_slot(mission_view):
    slot = ArraySlot.create(slot_bytes(100_000, 640))
    made = display_view(mission_view, max_splats=100_000, max_image_width=640)
    slot.write(made.arrays(), made.meta())
    _, arrays, meta = slot.read()
    slot.close()
    read = DisplayView.of(arrays, meta)
    assert read.time_s == mission_view.time_s
    assert read.n_gaussians == mission_view.snapshot.gaussians.size
    for name, array in made.arrays().items():
        np.testing.assert_array_equal(getattr(read, name), array, err_msg=name)
    np.testing.assert_allclose(read.splat_centres_m, mission_view.snapshot.gaussians.centres_m)
    assert read.observed.shape == (90, 160, 3)
    assert read.quality.shape == (169, 300, 3)


def test_of_a_large_map_every_kth_splat_is_shown_enlarged(mission_view):
    total = mission_view.snapshot.gaussians.size
    made = display_view(mission_view, max_splats=total // 3, max_image_width=640)
    assert len(made.splat_centres_m) <= total // 3
    stride = round(total / len(made.splat_centres_m))
    whole = display_view(mission_view, max_splats=total, max_image_width=640)
    np.testing.assert_allclose(made.splat_radii_m, 0.05 * GAP_FACTOR * np.sqrt(stride), rtol=1e-5)
    np.testing.assert_allclose(whole.splat_radii_m, 0.05, rtol=1e-5)
    through = 1.0 - whole.splat_opacities[::stride] / 255.0
    np.testing.assert_allclose(made.splat_opacities / 255.0, 1.0 - through**stride, atol=0.02)
    again = display_view(mission_view, max_splats=total // 3, max_image_width=640)
    np.testing.assert_array_equal(made.splat_centres_m, again.splat_centres_m)


def test_the_largest_view_fits_its_slot(mission_view):
    """The bound holds for images at their largest, too."""
    made = display_view(mission_view, max_splats=1000, max_image_width=160)
    slot = ArraySlot.create(slot_bytes(1000, 160))
    slot.write(made.arrays(), made.meta())
    slot.close()


def test_the_colour_map_rises_evenly_in_lightness():
    linear = (ramp() / 255.0) ** 2.2
    luminance = linear @ np.array([0.2126, 0.7152, 0.0722])
    assert np.all(np.diff(luminance) > -1e-3)
    assert luminance[0] < 0.02
    assert luminance[-1] > 0.7
    np.testing.assert_array_equal(colourise(np.array([np.nan, -1.0, 2.0])), ramp()[[0, 0, 255]])


def test_depth_marks_missing_returns_and_empty_range():
    image = colourise_depth(np.array([[0.0, np.inf, 0.3, 5.0, 9.0]], np.float32))
    assert tuple(image[0, 0]) == NO_RETURN
    assert tuple(image[0, 1]) == BEYOND_RANGE
    np.testing.assert_array_equal(image[0, 2], ramp()[255])
    np.testing.assert_array_equal(image[0, 3], ramp()[0])
    np.testing.assert_array_equal(image[0, 4], ramp()[0])


def test_logarithmic_colours_bear_zeros_and_nothing_at_all():
    assert np.all(colourise_log(np.zeros((2, 2), np.float32)) == NO_RETURN)
    image = colourise_log(np.array([[0.0, 1.0, 1000.0]], np.float32), decades=3.0)
    assert tuple(image[0, 0]) == NO_RETURN
    assert image[0, 2].sum() > image[0, 1].sum()
