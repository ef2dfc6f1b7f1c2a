"""Clouds of a lidar in MCAP files."""

import numpy as np
import pytest

from hgs_core.errors import StreamError
from hgs_core.sensing.point_scan import McapScans
from tests.sensing import bags
from tests.sensing.walk import (
    CLOUD,
    written,
)


def test_clouds_become_scans(tmp_path):
    points = np.random.default_rng(0).normal(size=(20, 3)).astype(np.float32)
    points[3, 1] = np.nan

    def add(bag: bags.Bag) -> None:
        for k in range(2):
            bag.add("/velodyne", CLOUD, 0.1 * k, bags.point_cloud(0.1 * k, points + k))

    path = written(tmp_path, add)
    scans = list(McapScans(path))
    assert [(scan.sequence, scan.timestamp_s) for scan in scans] == [(0, 0.0), (1, 0.1)]
    np.testing.assert_array_equal(scans[1].points_m, np.delete(points, 3, axis=0) + 1)
    assert scans[0].T_world_lidar is None
    with pytest.raises(StreamError, match=r"topic /points holds no sensor_msgs/msg/PointCloud2.*/velodyne"):
        McapScans(path, "/points")


def test_a_cloud_without_coordinates_is_refused(tmp_path):
    def add(bag: bags.Bag) -> None:
        bag.add("/velodyne", CLOUD, 0.0, bags.point_cloud(0.0, np.zeros((2, 2)), names="xyi"))

    with pytest.raises(StreamError, match="message 0: the cloud has no field z; it has x, y, i"):
        list(McapScans(written(tmp_path, add)))
