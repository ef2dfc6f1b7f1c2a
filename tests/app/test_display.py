import numpy as np
import pytest

from app.missions.display import (
    CANDIDATE_STATUSES,
    PANORAMA_PX,
    SUBSPACE_STATES,
    VOXEL_KINDS,
    DisplayView,
    slot_bytes,
)
from app.missions.display_builder import GAP_FACTOR, display_view
from app.missions.display_layers import panorama_image, shown_voxels, splat_quality
from app.missions.transport import ArraySlot
from hgs_core.evaluation.colour_maps import (
    BEYOND_RANGE,
    NO_RETURN,
    colourise,
    colourise_depth,
    colourise_log,
    ramp,
)
from hgs_core.gain.viewpoint import GainPanorama
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.geometry.boxes import Box
from hgs_core.planning.plan import CandidateStatus, SubspaceState
from hgs_core.voxels.voxel_map import VoxelConfig, VoxelMap, VoxelState
from tests.app.fake_world import furnished_room


@pytest.fixture(scope="module")
def mission_view():
    return furnished_room()


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


def test_what_layers_show_of_maps_and_plan():
    """A floor with one wall, beside it something missing; a map that was learnt in part."""
    voxels = VoxelMap(VoxelConfig(min_missing_cluster=1), region=Box(lower_m=np.zeros(3), upper_m=np.ones(3)))
    voxels.states[:] = VoxelState.FREE
    voxels.states[4] = VoxelState.OCCUPIED
    voxels.states[9, 9, 9] = VoxelState.UNOBSERVED
    voxels.note_change()
    centres, kinds, size_m = shown_voxels(voxels, np.array([0.5, 0.5]))
    counts = [int((kinds == k).sum()) for k in range(len(VOXEL_KINDS))]
    assert counts == [100, 3, 1]
    np.testing.assert_allclose(centres[kinds == 2], [[0.95, 0.95, 0.95]])
    assert size_m == pytest.approx(0.1)

    gaussians = GaussianMap()
    gaussians.append(np.zeros((4, 8), np.float32), anchor_keyframe=0)
    gaussians.information[:4, 3:6] = np.array([0.0, 9.0, 999.0, 1e9])[:, None]
    np.testing.assert_array_equal(splat_quality(gaussians, 1, 1.0), [255, 170, 0, 0])

    ahead = np.zeros((8, 60), np.float32)
    ahead[6, 30] = 1.0  # up and ahead, along +x
    left = np.zeros((4, 60), np.float32)
    left[1, 45] = 1.0  # down and to the left, along +y
    image = panorama_image(GainPanorama(coverage=ahead, quality=left, tan_low=-0.5, tan_high=0.5))
    brightness = image.astype(int).sum(axis=2)
    height, width = PANORAMA_PX
    row, column = np.unravel_index(brightness[: height // 2].argmax(), (height // 2, width))
    assert row < height // 4
    assert column / width == pytest.approx(0.5, abs=0.03)
    row, column = np.unravel_index(brightness[height // 2 :].argmax(), (height - height // 2, width))
    assert row > height // 4
    assert column / width == pytest.approx(0.25, abs=0.03)


def test_views_that_an_earlier_version_kept_show_nothing_in_later_layers(mission_view):
    made = display_view(mission_view, max_splats=1_000, max_image_width=640)
    later = ("splat_quality", "voxel_centres_m", "voxel_kinds", "voxel_size_m", "roadmap_m")
    areas = ("panorama_m", "panorama", "region_m", "no_go_m", "no_go_sizes")
    arrays = {name: array for name, array in made.arrays().items() if name not in (*later, *areas)}
    read = DisplayView.of(arrays, {**made.meta(), "schema": 2})
    assert len(read.voxel_kinds) == len(read.roadmap_m) == len(read.region_m) == 0
    assert len(read.splat_quality) == len(read.splat_centres_m)
