"""`hgs bench localisation`: along a recording, and along the path of a finished run."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.localisation import LocalisationBenchmark, localisation_settings
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.localisation.given import GivenConfig
from hgs_core.mission.config import resolve_mission_config
from hgs_core.mission.settings_schema import settings_schema
from tests.benchmark.test_recording import write_recording
from tests.mission.small_room import TINY, write_small_room


def bench(source: Path, *more: str) -> tuple[int, str]:
    result = CliRunner().invoke(
        application, ["bench", "localisation", str(source), *more], env={"COLUMNS": "200"}
    )
    return result.exit_code, " ".join(result.output.split())


def write_run(folder: Path) -> Path:
    """What is read of a finished run: a camera that drove 0.8 m and turned by 40 degrees in 2 s."""
    run = folder / "run"
    run.mkdir()
    config = resolve_mission_config("quick", TINY)
    described = {
        "scene": str(write_small_room(folder)),
        "start": {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0},
        "mission": config.model_dump(mode="json"),
    }
    (run / "config.yaml").write_text(yaml.safe_dump(described))
    steps = [level_camera_pose(-0.1 * k, -0.5, 1.0, np.radians(5.0 * k)) for k in range(9)]
    poses = SE3(
        rotation=np.array([pose.rotation for pose in steps]),
        translation=np.array([pose.translation for pose in steps]),
    )
    write_trajectory(Trajectory(timestamps_s=0.25 * np.arange(9), poses=poses), run / "trajectory.txt")
    return run


@pytest.mark.parametrize(
    ("method", "ate_cm"), [("given", 1e-3), ("rgbd-odometry", 8.0), ("lidar-odometry", 4.0)]
)
def test_the_path_of_a_run_is_driven_again(tmp_path: Path, method: str, ate_cm: float) -> None:
    path = tmp_path / "figures.json"
    code, output = bench(write_run(tmp_path), "--method", method, "--json", str(path))
    assert code == 0, output
    figures = LocalisationBenchmark.model_validate_json(path.read_text())
    assert (figures.method, figures.frames, figures.lost) == (method, 10, 0)
    assert figures.first_pose.length_m == pytest.approx(0.72, abs=0.02)
    assert 100 * figures.umeyama.ate_m.rmse < ate_cm
    assert figures.umeyama.ate_m.rmse <= figures.first_pose.ate_m.rmse + 1e-9
    for word in ("ATE cm, nearest alignment (Umeyama)", "RPE degrees, 1 frame on", "drift at the end"):
        assert word in output


def test_maps_tell_what_wrong_poses_cost(tmp_path: Path) -> None:
    path, run = tmp_path / "figures.json", write_run(tmp_path)
    code, output = bench(run, "--method", "lidar-odometry", "--maps", "--json", str(path))
    assert code == 0, output
    assert "what it costs the map" in output
    maps = LocalisationBenchmark.model_validate_json(path.read_text()).maps
    assert maps is not None
    assert maps.true_poses.accuracy_cm < maps.nearest.accuracy_cm < 4.0
    assert maps.true_poses.psnr_db > max(maps.nearest.psnr_db, maps.first_pose.psnr_db)
    code, _ = bench(run, "--method", "given", "--maps", "--json", str(path))
    same = LocalisationBenchmark.model_validate_json(path.read_text()).maps
    assert same is not None
    assert code == 0
    assert same.first_pose == same.true_poses


def test_lost_frames_are_counted_and_told_why(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "wall", n_frames=8, turned=(3, 4))
    code, output = bench(recording, "--method", "given")
    assert code == 0, output
    assert "8 frames, 2 lost" in output
    assert "lost, the first because frame 3 refused: turned 180.0 degrees" in output


def test_what_cannot_be_measured_is_refused(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "wall")
    for more, message in (
        (["--method", "gps"], "must be one of given, rgbd-odometry, lidar-odometry"),
        (["--method", "lidar-odometry"], "a lidar is simulated along a run's path alone"),
        (["--method", "given", "--maps"], "maps are compared with a true scene, which a recording has not"),
        (["--method", "given", "--set", "limits.max_speed_mps=-1"], "localisation.limits.max_speed_mps"),
    ):
        code, output = bench(recording, *more)
        assert code == 2, output
        assert message in output
    (recording / "groundtruth.txt").unlink()
    code, output = bench(recording, "--method", "given")
    assert code == 2
    assert "nothing to compare with" in output


def test_localisation_is_a_section_of_the_preset() -> None:
    assert resolve_mission_config("paper", {}).localisation == GivenConfig()
    config = localisation_settings("rgbd-odometry", {"min_fitness": "0.5"})
    assert config.model_dump()["min_fitness"] == 0.5
    schema = settings_schema(resolve_mission_config("paper", {"localisation.method": "lidar-odometry"}))
    assert "LidarOdometryConfig" in schema["$defs"]


def test_a_simulated_mission_knows_where_it_is(tmp_path: Path) -> None:
    odometry = ("--set", "localisation.method=rgbd-odometry")
    options = [
        "--scene",
        str(write_small_room(tmp_path)),
        "--preset",
        "quick",
        "--out",
        str(tmp_path / "run"),
    ]
    result = CliRunner().invoke(application, ["run", *options, *odometry], env={"COLUMNS": "200"})
    assert result.exit_code == 2
    assert "a simulated mission has the simulator's poses" in " ".join(result.output.split())
