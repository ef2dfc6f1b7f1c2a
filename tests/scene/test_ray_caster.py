import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_erosion

from hgs_core.errors import SceneError
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.scene.appearance import TexturePyramids, fixed_light
from hgs_core.scene.ray_caster import BACKGROUND_RGB, RayCaster, uneven_pixels
from tests.scene.worlds import CHECKER, quad, room, with_boxes

CAMERA = CameraIntrinsics.centred(64, 48, 32.0)
GREY = np.full((1, 1, 3), 128, np.uint8)


def naive_distance(corners, origin, direction):
    """Nearest hit by Moller and Trumbore over all triangles."""
    best = np.inf
    for a, b, c in corners.astype(float):
        p = np.cross(direction, c - a)
        determinant = (b - a) @ p
        if abs(determinant) < 1e-12:
            continue
        u = (origin - a) @ p / determinant
        q = np.cross(origin - a, b - a)
        v = direction @ q / determinant
        t = (c - a) @ q / determinant
        if u >= 0 and v >= 0 and u + v <= 1 and t > 0:
            best = min(best, t)
    return best


@pytest.fixture(scope="module")
def furnished():
    return RayCaster(with_boxes(((0.5, 0.5, 0.0), (1.5, 1.2, 0.8)), ((-2.0, -1.5, 1.5), (-1.0, -1.0, 2.0))))


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_distances_agree_with_the_naive_search(furnished, seed):
    rng = np.random.default_rng(seed)
    origin = rng.uniform([-2.9, -1.9, 0.1], [2.9, 1.9, 2.4])
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    expected = naive_distance(furnished.mesh.corners_m, origin, direction)
    assert furnished.cast(origin, direction) == pytest.approx(expected, abs=2e-4)


def test_depth_is_z_depth_of_a_wall_seen_head_on(furnished):
    caster = RayCaster(room())
    _, depth = caster.render(CAMERA, level_camera_pose(0.0, 0.0, 1.25, 0.0))
    # 90 degrees across at 3 m: the middle rows meet the wall at x = 3 up to the side walls at |y| = 2.
    ahead = depth[24, np.abs(np.arange(64) + 0.5 - 32) * 3 / 32 < 1.9]
    np.testing.assert_allclose(ahead, 3.0, atol=1e-4)


def test_depth_ends_at_the_range_and_colour_does_not():
    caster = RayCaster(room())
    pose = level_camera_pose(0.0, 0.0, 1.25, 0.0)
    rgb_far, far = caster.render(CAMERA, pose)
    rgb_near, near = caster.render(CAMERA, pose, range_m=2.5)
    np.testing.assert_array_equal(rgb_far, rgb_near)
    np.testing.assert_array_equal(near, np.where(far <= 2.5, far, np.inf))
    assert np.isinf(near).any()


def test_rays_that_leave_the_world_get_the_background():
    caster = RayCaster(quad([(2, -1, 0), (2, 1, 0), (2, 1, 2), (2, -1, 2)]))
    rgb, depth = caster.render(CAMERA, level_camera_pose(0.0, 0.0, 1.0, np.pi))
    assert np.isinf(depth).all()
    assert (rgb == BACKGROUND_RGB).all()


def test_textures_stand_upright_and_are_not_mirrored():
    # Seen from the origin towards +x, the right of the picture is -y.
    caster = RayCaster(quad([(2, 1, 0), (2, -1, 0), (2, -1, 2), (2, 1, 2)], CHECKER))
    rgb, _ = caster.render(CAMERA, level_camera_pose(0.0, 0.0, 1.0, 0.0))
    light = fixed_light(np.array([[1.0, 0.0, 0.0]]))[0]
    for row, column, texel in ((16, 24, (8, 8)), (16, 40, (8, 24)), (32, 24, (24, 8)), (32, 40, (24, 24))):
        np.testing.assert_allclose(rgb[row, column], np.minimum(CHECKER[texel] * light, 255), atol=1)


def test_a_point_has_the_same_colour_from_either_side_and_every_angle():
    caster = RayCaster(quad([(2, 1, 0), (2, -1, 0), (2, -1, 2), (2, 1, 2)], CHECKER))
    target = np.array([2.0, 0.5, 1.5])
    seen = []
    for x, y in ((0.5, 0.0), (0.8, 1.2), (3.5, 0.4), (3.0, -0.2)):
        pose = level_camera_pose(x, y, 1.0, float(np.arctan2(target[1] - y, target[0] - x)))
        pixel, inside = CAMERA.project(pose.inverse().apply(target[None]))
        assert inside[0]
        rgb, _ = caster.render(CAMERA, pose)
        seen.append(rgb[int(pixel[0, 1]), int(pixel[0, 0])].astype(int))
    assert np.ptp(np.array(seen), axis=0).max() <= 1


def test_far_texture_is_averaged_and_not_sampled_at_random():
    stripes = np.zeros((512, 512, 3), dtype=np.uint8)
    stripes[:, ::2] = 255
    caster = RayCaster(quad([(20, 1, 0), (20, -1, 0), (20, -1, 2), (20, 1, 2)], stripes))
    rgb, depth = caster.render(CAMERA, level_camera_pose(0.0, 0.0, 1.0, 0.0))
    light = fixed_light(np.array([[1.0, 0.0, 0.0]]))[0]
    within = binary_erosion(np.isfinite(depth))  # the pixels of its border show what is behind it, too
    assert within.any()
    np.testing.assert_allclose(rgb[within], np.broadcast_to(127.5 * light, (int(within.sum()), 3)), atol=2)


def test_a_pixel_shows_the_share_of_what_is_in_it():
    """A plate's upright edge goes through a column of pixels at a known share of their width."""
    light = 128.0 * fixed_light(np.array([[1.0, 0.0, 0.0]]))[0]
    pixel_m = 2.0 / CAMERA.fx
    pose = level_camera_pose(0.0, 0.0, 1.0, 0.0)
    for share in (0.2, 0.4, 0.6, 0.8):
        edge_y = -share * pixel_m  # the column right of the middle, filled from its left by so much
        plate = quad([(2, 1, 0), (2, edge_y, 0), (2, edge_y, 2), (2, 1, 2)], GREY)
        rgb, depth = RayCaster(plate).render(CAMERA, pose)
        row = rgb[CAMERA.height // 2].astype(float)
        middle = CAMERA.width // 2
        np.testing.assert_allclose(row[middle - 1], light, atol=1)
        np.testing.assert_allclose(row[middle + 1], BACKGROUND_RGB, atol=1)
        expected = share * light + (1 - share) * BACKGROUND_RGB
        np.testing.assert_allclose(row[middle], expected, atol=0.11 * np.abs(light - BACKGROUND_RGB).max())
        # Depth is that of one ray: an average would be a surface that is not there.
        met = depth[CAMERA.height // 2]
        np.testing.assert_allclose(met[np.isfinite(met)], 2.0, atol=1e-5)


def test_only_uneven_pixels_are_looked_at_again():
    """Elsewhere the picture is that of one ray a pixel."""
    rgb = np.zeros((6, 7, 3), np.uint8)
    rgb[2, 3, 1] = 32
    assert not uneven_pixels(rgb).any()
    rgb[2, 3, 1] = 33
    found = uneven_pixels(rgb)
    assert found[1:4, 2:5].all()
    assert found.sum() == 9


def test_a_pyramid_ends_in_the_mean_and_keeps_its_levels_apart():
    pyramids = TexturePyramids.of([CHECKER, CHECKER[:5, :7]])
    assert pyramids.level_width.tolist() == [32, 16, 8, 4, 2, 1, 7, 3, 1]
    assert pyramids.level_height.tolist() == [32, 16, 8, 4, 2, 1, 5, 2, 1]
    assert pyramids.level_first.tolist() == [0, 6]
    np.testing.assert_allclose(
        pyramids.texels[pyramids.level_offset[5]], CHECKER.reshape(-1, 3).mean(axis=0), atol=2
    )


def test_visibility_is_blocked_by_what_stands_between_and_not_by_the_surface_itself(furnished):
    origin = np.array([2.5, 0.8, 0.4])
    on_box_near, on_box_far, on_wall_behind = [1.5, 0.8, 0.4], [0.5, 0.8, 0.4], [-3.0, 0.8, 0.4]
    seen = furnished.visible(origin, np.array([on_box_near, on_box_far, on_wall_behind]))
    assert seen.tolist() == [True, False, False]
    inside = np.array([1.0, 0.8, 0.4])
    assert bool(furnished.visible(inside, np.array([1.5, 0.8, 0.4])))


def test_distance_to_surface_is_exact_in_a_room():
    caster = RayCaster(room())
    points = np.array([[0.0, 0.0, 1.0], [2.5, 0.0, 1.0], [0.0, 0.0, 3.5]])
    np.testing.assert_allclose(caster.distance_to_surface(points), [1.0, 0.5, 1.0], atol=1e-5)


def test_a_mesh_without_triangles_is_refused():
    empty = room().kept(np.zeros(12, dtype=bool))
    with pytest.raises(SceneError, match="no triangles"):
        RayCaster(empty)
