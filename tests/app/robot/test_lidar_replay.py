"""A recorded drive with a lidar, sent to the real service: the mission finds its poses by the clouds."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.robot.outcome import Outcome
from app.robot.replay import ReplayOptions, run_replay
from app.robot.rest import ServiceApi
from app.robot.results import finished_mission
from app.settings import Settings
from hgs_core.evaluation.trajectory import read_trajectory
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.lidar_odometry import LidarOdometryConfig
from hgs_core.scene.ray_caster import RayCaster
from hgs_core.sensing.lidar import LidarConfig
from hgs_core.simulation.lidar import SimulatedLidar, level_lidar_pose
from tests.app.live_service import serving
from tests.app.robot.robots import in_a_thread
from tests.scene.worlds import with_boxes
from tests.sensing import bags, walk

pytest.importorskip("kiss_icp", reason="the extra `lidar` is not installed")

CAMERA = CameraIntrinsics.centred(96, 64, 54.0)
MOUNTED = LidarOdometryConfig(camera_xyz_m=(0.1, 0.05, -0.2), camera_rpy_deg=(0.0, 5.0, 10.0))
FRAMES_S = 0.05 + 0.2 * np.arange(8)
CLOUDS_S = 0.1 * np.arange(17)
SETTINGS = {
    "localisation.method": "lidar-odometry",
    "mapping.iterations_per_s": "2.5",
    "mesh.enabled": "false",
    "threads": "1",
    "live.dead_man_s": "20",
    "live.frame_s": "30",
}


def lidar_at(time_s: float) -> SE3:
    """On a circle of 0.6 m, at 0.2 m/s, level, heading along it."""
    angle = 0.33 * time_s
    return level_lidar_pose(0.6 * math.cos(angle) - 0.6, 0.6 * math.sin(angle), 1.2, angle + 0.1)


def camera_at(time_s: float) -> SE3:
    return lidar_at(time_s) @ MOUNTED.T_lidar_camera()


def drive(folder: Path) -> Path:
    """Colour, depth and the clouds of a VLP-16 in a room with boxes; no poses, and where the camera sits."""
    caster = RayCaster(
        with_boxes(
            ((1.0, -0.5, 0.0), (1.6, 0.4, 1.2)),
            ((-2.4, 0.8, 0.0), (-1.6, 1.6, 1.8)),
            ((2.0, 1.0, 0.6), (2.8, 1.9, 1.5)),
        )
    )
    T_lidar_camera = MOUNTED.T_lidar_camera()
    lidar = SimulatedLidar(caster, LidarConfig(azimuth_step_deg=1.0), np.random.default_rng(0))

    def add(bag: bags.Bag) -> None:
        mounting = bags.transforms(
            0.0, ("lidar", walk.OPTICAL, tuple(T_lidar_camera.translation.tolist()), 0.0)
        )
        quaternion = Rotation.from_matrix(T_lidar_camera.rotation).as_quat().tolist()
        mounting["transforms"][0]["transform"]["rotation"] = dict(zip("xyzw", quaternion, strict=True))
        bag.add("/tf_static", walk.TF, 0.0, mounting)
        for kind in ("color", "depth"):
            info = bags.camera_info(0.0, (CAMERA.width, CAMERA.height), CAMERA.fx, walk.OPTICAL)
            bag.add(f"/camera/{kind}/camera_info", walk.INFO, 0.0, info)
        for time_s in FRAMES_S:
            rgb, depth_m = caster.render(CAMERA, camera_at(time_s), 5.0)
            for kind, pixels, encoding in (("color", rgb, "rgb8"), ("depth", depth_m, "32FC1")):
                image = bags.image(time_s, pixels, encoding, walk.OPTICAL)
                bag.add(f"/camera/{kind}/image", walk.IMAGE, time_s, image)
        for time_s in CLOUDS_S:
            scan = lidar.scan(lidar_at(time_s), time_s)
            bag.add("/velodyne", walk.CLOUD, time_s, bags.point_cloud(time_s, scan.points_m, names="xyz"))

    return walk.written(folder, add)


def test_frames_are_mapped_where_the_clouds_tell(tmp_path) -> None:
    said: list[str] = []
    with serving(Settings(data_dir=tmp_path / "data", mission_threads=1, viewer=False)) as service:
        options = ReplayOptions(
            source=drive(tmp_path),
            server=service.url,
            preset="quick",
            settings=SETTINGS,
            every_frame=True,
            with_poses=False,
        )
        run = in_a_thread(run_replay, options, said.append)
        api = ServiceApi(service.url, None)
        finished_mission(api, run.mission, patience_s=60.0, say=said.append)
        api.download(run.mission, "trajectory.txt", tmp_path / "found.txt")
    assert run.outcome is Outcome.ENDED, said
    assert (run.link.sent, run.link.refused, run.link.clouds_sent) == (len(FRAMES_S), 0, 15), said
    # The mission's world has the camera level, heading along x, one metre up when the first cloud was taken.
    T_world_room = level_camera_pose(0.0, 0.0, 1.0, 0.0) @ camera_at(CLOUDS_S[0]).inverse()
    found = read_trajectory(tmp_path / "found.txt")
    assert len(found) == len(run.link.taken_sequences) >= len(FRAMES_S) // 2
    for k, sequence in enumerate(run.link.taken_sequences):
        true = T_world_room @ camera_at(FRAMES_S[sequence])
        np.testing.assert_allclose(found.poses[k].translation, true.translation, atol=0.05)
        np.testing.assert_allclose(found.poses[k].rotation, true.rotation, atol=0.03)
