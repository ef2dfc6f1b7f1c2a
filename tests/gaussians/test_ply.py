"""`map.ply`: what is written is read back, by us and by an independent reader."""

from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial.transform import Rotation

from hgs_core.errors import MapError
from hgs_core.gaussians.gaussian_map import GaussianMap, Primitive
from hgs_core.gaussians.ply import PROPERTIES, SH_C0, read_ply, write_ply
from tests.gaussians.maps import gaussian_map


def random_map(n: int, seed: int = 0, primitive: Primitive = "isotropic") -> GaussianMap:
    rng = np.random.default_rng(seed)
    parameters = rng.normal(size=(n, 8)).astype(np.float32)
    parameters[:, 3:6] = rng.random((n, 3))
    return gaussian_map(primitive, parameters, rng)


@pytest.mark.parametrize("n", [0, 1, 1000])
def test_round_trip(tmp_path: Path, n: int) -> None:
    gaussians = random_map(n)
    write_ply(gaussians, tmp_path / "map.ply")
    again = read_ply(tmp_path / "map.ply")
    assert again.size == n
    np.testing.assert_allclose(again.parameters[:n], gaussians.parameters[:n], atol=1e-6)
    assert [path.name for path in tmp_path.iterdir()] == ["map.ply"]


@pytest.mark.parametrize("n", [1, 1000])
def test_round_trip_of_discs(tmp_path: Path, n: int) -> None:
    gaussians = random_map(n, primitive="disc")
    gaussians.normals[0] = [0.0, 0.0, -1.0]
    write_ply(gaussians, tmp_path / "map.ply")
    again = read_ply(tmp_path / "map.ply")
    assert again.primitive == "disc"
    np.testing.assert_allclose(again.parameters[:n], gaussians.parameters[:n], atol=1e-6)
    # A normal and its opposite are the same disc.
    cosines = np.sum(again.normals[:n] * gaussians.normals[:n], axis=1)
    np.testing.assert_allclose(np.abs(cosines), 1.0, atol=1e-6)


def test_independent_reader_sees_discs_as_flat_gaussians(tmp_path: Path) -> None:
    """The covariance that 3DGS viewers draw: R diag(scale^2) R', R from the quaternion wxyz, by scipy."""
    gaussians = random_map(50, primitive="disc")
    write_ply(gaussians, tmp_path / "map.ply")
    cloud = o3d.t.io.read_point_cloud(str(tmp_path / "map.ply"))
    turned = Rotation.from_quat(cloud.point["rot"].numpy()[:, [1, 2, 3, 0]]).as_matrix()
    scales = cloud.point["scale"].numpy().astype(float)
    covariance = turned @ (scales[:, :, None] ** 2 * turned.transpose(0, 2, 1))
    n = gaussians.normals[:50].astype(float)
    expected = np.eye(3) - n[:, :, None] * n[:, None, :]
    relative = covariance / gaussians.radii_m[:, None, None] ** 2
    np.testing.assert_allclose(relative, expected, atol=1e-5)


def test_rows_that_are_only_room_to_grow_are_not_written(tmp_path: Path) -> None:
    gaussians = random_map(10)
    assert len(gaussians.parameters) > 10
    write_ply(gaussians, tmp_path / "map.ply")
    assert b"element vertex 10\n" in (tmp_path / "map.ply").read_bytes()


def test_independent_reader_sees_the_standard_attributes(tmp_path: Path) -> None:
    gaussians = random_map(50)
    write_ply(gaussians, tmp_path / "map.ply")
    cloud = o3d.t.io.read_point_cloud(str(tmp_path / "map.ply"))
    np.testing.assert_allclose(cloud.point.positions.numpy(), gaussians.centres_m, atol=1e-6)
    logit = np.log(gaussians.opacities / (1 - gaussians.opacities))
    np.testing.assert_allclose(cloud.point["opacity"].numpy()[:, 0], logit, atol=1e-4)
    # open3d knows the layout: it groups columns, and takes the exponential of scale.
    np.testing.assert_allclose(
        cloud.point["f_dc"].numpy().reshape(50, 3), (gaussians.rgb - 0.5) / SH_C0, atol=1e-5
    )
    np.testing.assert_allclose(
        cloud.point["scale"].numpy(), gaussians.radii_m[:, None].repeat(3, axis=1), rtol=1e-5
    )
    np.testing.assert_array_equal(cloud.point["rot"].numpy(), np.tile([1, 0, 0, 0], (50, 1)))


def test_foreign_order_and_view_dependent_colour_are_accepted(tmp_path: Path) -> None:
    gaussians = random_map(5)
    write_ply(gaussians, tmp_path / "map.ply")
    body = (tmp_path / "map.ply").read_bytes().partition(b"end_header\n")[2]
    table = np.frombuffer(body, "<f4").reshape(5, len(PROPERTIES))
    names = [*reversed(PROPERTIES), "f_rest_0"]
    extended = np.concatenate([table[:, ::-1], np.ones((5, 1), "<f4")], axis=1)
    header = "ply\nformat binary_little_endian 1.0\ncomment ours\nelement vertex 5\n"
    header += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    (tmp_path / "foreign.ply").write_bytes(header.encode() + extended.astype("<f4").tobytes())
    again = read_ply(tmp_path / "foreign.ply")
    np.testing.assert_allclose(again.parameters[:5], gaussians.parameters[:5], atol=1e-6)


def test_damaged_files_are_refused_with_the_reason(tmp_path: Path) -> None:
    write_ply(random_map(20), tmp_path / "map.ply")
    whole = (tmp_path / "map.ply").read_bytes()

    def refused(content: bytes, reason: str) -> None:
        (tmp_path / "bad.ply").write_bytes(content)
        with pytest.raises(MapError, match=reason):
            read_ply(tmp_path / "bad.ply")

    refused(whole[:-1], "cut short")
    refused(b"solid cube", "not a PLY")
    refused(whole.replace(b"binary_little_endian", b"ascii"), "ascii")
    refused(whole.replace(b"property float opacity", b"property float opaceety"), "lacks.*opacity")
    refused(whole.replace(b"element vertex", b"element facess"), "vertex")
    with pytest.raises(MapError, match="cannot read"):
        read_ply(tmp_path / "absent.ply")


def test_anisotropic_and_non_finite_maps_are_refused(tmp_path: Path) -> None:
    write_ply(random_map(4), tmp_path / "map.ply")
    head, separator, body = (tmp_path / "map.ply").read_bytes().partition(b"end_header\n")
    for column, value, reason in (
        ("scale_1", 9.0, "anisotropic"),
        ("scale_2", -9.0, "anisotropic"),
        ("x", np.nan, "NaN"),
    ):
        table = np.frombuffer(body, "<f4").reshape(4, len(PROPERTIES)).copy()
        table[2, PROPERTIES.index(column)] = value
        (tmp_path / "bad.ply").write_bytes(head + separator + table.tobytes())
        with pytest.raises(MapError, match=reason):
            read_ply(tmp_path / "bad.ply")
