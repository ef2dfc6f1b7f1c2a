"""Depth in 16 bits: what has no length keeps its meaning, and an independent reader sees the lengths."""

from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from hgs_core.errors import MapError
from hgs_core.mapping.keyframe_files import (
    decode_depth,
    depth_unit_m,
    encode_depth,
    read_colour,
    read_depth,
    write_colour,
    write_depth,
)


def test_depth_survives_within_half_a_unit_and_keeps_its_two_special_values() -> None:
    rng = np.random.default_rng(0)
    depth = rng.uniform(0.001, 6.55, (30, 40)).astype(np.float32)
    depth[0], depth[1] = 0.0, np.inf
    again = decode_depth(encode_depth(depth, 1e-4), 1e-4)
    np.testing.assert_array_equal(again[0], 0.0)
    np.testing.assert_array_equal(again[1], np.inf)
    np.testing.assert_allclose(again[2:], depth[2:], atol=5.1e-5)


def test_what_is_too_far_for_16_bits_is_out_of_range_and_never_near() -> None:
    depth = np.array([[6.5534, 6.56, 100.0]], np.float32)
    assert encode_depth(depth, 1e-4).tolist() == [[65534, 65535, 65535]]


@pytest.mark.parametrize(("range_m", "unit_m"), [(5.0, 1e-4), (40.0, 44.0 / 65534)])
def test_the_unit_holds_the_whole_range_of_the_sensor(range_m: float, unit_m: float) -> None:
    assert depth_unit_m(range_m) == pytest.approx(unit_m)
    farthest = np.array([[1.05 * range_m]], np.float32)
    assert np.isfinite(decode_depth(encode_depth(farthest, unit_m), unit_m)).all()


def test_an_independent_reader_sees_the_same_images(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    encoded = rng.integers(0, 65536, (30, 40)).astype(np.uint16)
    write_depth(tmp_path / "d.png", encoded)
    np.testing.assert_array_equal(np.asarray(o3d.io.read_image(str(tmp_path / "d.png"))), encoded)
    np.testing.assert_array_equal(read_depth(tmp_path / "d.png"), encoded)
    gradient = np.linspace(0, 255, 80 * 60 * 3).reshape(60, 80, 3).astype(np.uint8)
    write_colour(tmp_path / "c.jpg", gradient)
    theirs = np.asarray(o3d.io.read_image(str(tmp_path / "c.jpg"))).astype(int)
    assert np.abs(theirs - gradient).max() <= 3
    assert np.abs(read_colour(tmp_path / "c.jpg").astype(int) - gradient).max() <= 3


def test_chroma_is_not_subsampled(tmp_path: Path) -> None:
    """Columns that alternate between two hues of one brightness would mix if two pixels shared a chroma."""
    stripes = np.zeros((32, 32, 3), np.uint8)
    stripes[:, 0::2] = (200, 60, 60)
    stripes[:, 1::2] = (60, 130, 60)
    write_colour(tmp_path / "c.jpg", stripes)
    again = read_colour(tmp_path / "c.jpg").astype(int)
    assert np.abs(again - stripes).mean() < 6


def test_what_is_no_such_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"nothing\.png"):
        read_depth(tmp_path / "nothing.png")
    (tmp_path / "text.png").write_text("no image")
    with pytest.raises(MapError, match=r"text\.png"):
        read_depth(tmp_path / "text.png")
    write_depth(tmp_path / "depth.png", np.ones((4, 4), np.uint16))
    with pytest.raises(MapError, match="RGB"):
        read_colour(tmp_path / "depth.png")
    write_colour(tmp_path / "colour.jpg", np.ones((4, 4, 3), np.uint8))
    with pytest.raises(MapError, match="16 bit"):
        read_depth(tmp_path / "colour.jpg")
