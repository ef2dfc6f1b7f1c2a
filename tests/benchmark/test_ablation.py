"""`hgs bench ablation`: the same frames, each mechanism off in turn."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.ablation import ABLATIONS, AS_IT_IS
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.config import MappingConfig
from hgs_core.mission.config import resolve_mission_config
from hgs_core.scene.scene import open_scene

DENSE = "plain walls as dense as detail"

SETTINGS = {
    "threads": "1",
    "sensor.camera.width": "160",
    "sensor.camera.height": "96",
    "sensor.camera.focal_px": "80",
}


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a run in the house leaves, as far as it is needed: a turn on the spot in nine frames."""
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "cache"))
    config = resolve_mission_config("quick", SETTINGS)
    start = open_scene("house", radius_m=config.robot.radius_m, height_m=config.robot.height_m).start
    content = {
        "scene": "house",
        "start": {"x_m": start.x_m, "y_m": start.y_m, "yaw_rad": start.yaw_rad},
        "mission": config.model_dump(mode="json"),
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(content))
    yaws = np.linspace(0.0, 2 * np.pi, 9, endpoint=False)
    poses = [level_camera_pose(start.x_m, start.y_m, 1.0, yaw) for yaw in yaws]
    batch = SE3(
        rotation=np.stack([pose.rotation for pose in poses]),
        translation=np.stack([pose.translation for pose in poses]),
    )
    write_trajectory(Trajectory(timestamps_s=np.arange(9.0), poses=batch), tmp_path / "trajectory.txt")
    return tmp_path


def bench(folder: Path, *more: str) -> tuple[int, str]:
    result = CliRunner().invoke(
        application, ["bench", "ablation", str(folder), *more], env={"COLUMNS": "160"}
    )
    return result.exit_code, result.output


def test_every_ablation_changes_the_settings() -> None:
    plain = MappingConfig(primitive="disc")
    for name, changes in ABLATIONS.items():
        content = plain.model_dump()
        for key, value in changes.items():
            content[key] = {**content[key], **value} if isinstance(value, dict) else value
        assert (MappingConfig.model_validate(content) == plain) == (name == AS_IT_IS)


def test_the_same_frames_are_mapped_with_one_thing_changed(run_folder: Path) -> None:
    path = run_folder / "rows.json"
    # So small a camera's pixels stand farther apart than plain walls' Gaussians may.
    few = ("--set", "mapping.insertion.widest_m=1.0")
    code, output = bench(run_folder, "--only", DENSE, "--every", "1", *few, "--json", str(path))
    assert code == 0, output
    assert DENSE in output
    rows = {row["name"]: row for row in json.loads(path.read_text())}
    assert list(rows) == [AS_IT_IS, DENSE]
    assert rows[DENSE]["n_gaussians"] > 1.1 * rows[AS_IT_IS]["n_gaussians"]
    assert rows[DENSE]["completion_cm_observable"] < rows[AS_IT_IS]["completion_cm_observable"]
    for row in rows.values():
        assert 0.0 < row["accuracy_cm"] < 3.0
        assert 0.0 < row["completion_ratio_observable"] < 1.0


def test_a_wrong_name_is_told_with_those_there_are(run_folder: Path) -> None:
    code, output = bench(run_folder, "--only", "no magic")
    assert code == 2
    assert "no magic" in output
    assert "no optimisation" in output
