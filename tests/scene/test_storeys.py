"""Of several storeys one is explored: the roomiest, or the one that is asked for."""

from pathlib import Path

import numpy as np
import pytest

from hgs_core.scene.options import SceneOptions
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.scene.scene import open_scene
from hgs_core.scene.storeys import find_floors_z
from hgs_core.scene.textured_mesh import TexturedMesh, concatenated
from tests.scene.scans import write_glb
from tests.scene.worlds import box, room


def two_storeys() -> TexturedMesh:
    """A lower floor full of shelves, and an empty upper one 2.9 m above; each 6 x 4 x 2.5 m."""
    lower = [room(), *(box((x, -1.8, 0.0), (x + 0.3, 1.8, 1.5)) for x in (-2.0, -1.0, 0.0, 1.0, 2.0))]
    upper = room().moved(np.eye(3), np.array([0.0, 0.0, 2.9]))
    return concatenated([*lower, upper])


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    path = tmp_path / "00802-wcojb4TFT35" / "wcojb4TFT35.glb"
    write_glb(path, two_storeys(), z_up=True)
    return path.parent


def test_the_floors_are_found_upwards() -> None:
    np.testing.assert_allclose(find_floors_z(RayCaster(two_storeys())), [0.0, 2.9], atol=0.02)
    assert find_floors_z(RayCaster(room())) == pytest.approx((0.0,), abs=0.02)


def test_the_storey_with_most_free_floor_is_chosen_and_stated(scan: Path) -> None:
    scene = open_scene(scan)
    np.testing.assert_allclose(scene.bounds.size_m, [6, 4, 2.5], atol=5e-3)
    assert scene.bounds.lower_m[2] == pytest.approx(0.0, abs=5e-3)
    assert len(scene.mesh.triangles) == len(room().triangles)
    assert any("2 storeys, with floors at z = 0.00 m" in notice for notice in scene.notices)
    assert any("floor found at z = 2.900" in notice for notice in scene.notices)
    assert any("other storeys are left out" in notice for notice in scene.notices)


def test_a_storey_is_chosen_by_the_height_of_its_floor(scan: Path) -> None:
    lower = open_scene(scan, SceneOptions(floor_z_m=0.0), radius_m=0.15)
    np.testing.assert_allclose(lower.bounds.size_m, [6, 4, 2.5], atol=5e-3)
    assert len(lower.mesh.triangles) == len(two_storeys().triangles) - len(room().triangles)


def test_all_storeys_are_kept_on_request(scan: Path) -> None:
    whole = open_scene(scan, SceneOptions(all_storeys=True))
    assert len(whole.mesh.triangles) == len(two_storeys().triangles)
    np.testing.assert_allclose(whole.bounds.size_m, [6, 4, 5.4], atol=5e-3)
    assert whole.bounds.lower_m[2] == pytest.approx(-2.9, abs=5e-3)


def test_a_floor_given_by_hand_needs_none_to_be_found(tmp_path: Path) -> None:
    """Under open sky and tables alone nothing counts as a floor."""
    path = tmp_path / "low.glb"
    write_glb(path, box((-3.0, -2.0, 0.0), (3.0, 2.0, 1.6)), z_up=False)
    scene = open_scene(path, SceneOptions(floor_z_m=0.0), height_m=1.1)
    assert scene.bounds.lower_m[2] == pytest.approx(0.0, abs=5e-3)
