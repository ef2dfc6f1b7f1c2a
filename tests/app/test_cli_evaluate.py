"""`hgs evaluate` on folders written by hand."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.evaluation.report import MissionReport
from hgs_core.evaluation.trajectory import Trajectory, write_trajectory
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.ply import write_ply
from hgs_core.geometry.camera import level_camera_pose
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.mesh_file import write_mesh
from hgs_core.mapping.volume_fusion import SurfaceMesh
from hgs_core.mission.config import resolve_mission_config

ROOM_M = (4.0, 3.0, 2.5)
SMALL_CAMERA = {
    "threads": "1",
    "sensor.camera.width": "96",
    "sensor.camera.height": "56",
    "sensor.camera.focal_px": "48",
}


def hgs(*arguments: str):
    return CliRunner().invoke(application, list(arguments))


def write_room(path: Path) -> None:
    """An empty room with z up, as PLY: eight corners, twelve triangles."""
    corners = [(x, y, z) for x in (0, ROOM_M[0]) for y in (0, ROOM_M[1]) for z in (0, ROOM_M[2])]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(corners)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, corner)) for corner in corners]
    lines += ["3 " + " ".join(map(str, face)) for face in faces]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run that was interrupted: a map of the floor, 1 cm too high, one frame, no quality figures."""
    monkeypatch.setenv("HGS_CACHE_DIR", str(tmp_path / "cache"))
    scene, folder = tmp_path / "room.ply", tmp_path / "run"
    folder.mkdir()
    write_room(scene)
    config = resolve_mission_config("quick", SMALL_CAMERA)
    content = {
        "scene": str(scene),
        "preset": "quick",
        "seed": 0,
        "start": {"x_m": 2.0, "y_m": 1.5, "yaw_rad": 0.0},
        "mission": config.model_dump(mode="json"),
    }
    (folder / "config.yaml").write_text(yaml.safe_dump(content))
    grid = np.stack(np.meshgrid(np.arange(0.02, 4, 0.04), np.arange(0.02, 3, 0.04)), axis=-1).reshape(-1, 2)
    parameters = np.zeros((len(grid), 8), np.float32)
    parameters[:, :2], parameters[:, 2] = grid, 0.01
    parameters[:, 3:6], parameters[:, 6], parameters[:, 7] = 0.5, np.log(0.03), 3.0
    gaussians = GaussianMap()
    gaussians.append(parameters, anchor_keyframe=0)
    write_ply(gaussians, folder / "map.ply")
    pose = level_camera_pose(1.0, 1.5, 1.0, 0.0)
    poses = SE3(rotation=pose.rotation[None], translation=pose.translation[None])
    write_trajectory(Trajectory(timestamps_s=np.zeros(1), poses=poses), folder / "trajectory.txt")
    MissionReport(
        scene="room",
        seed=0,
        planner="quick",
        stop_reason="interrupted",
        frames=1,
        keyframes=1,
        n_gaussians=len(grid),
        path_length_m=7.5,
        versions={},
        kernel_variant="test",
        threads=1,
    ).write(folder / "report.json")
    return folder


def test_a_folder_gets_its_figures_and_keeps_them(run_folder: Path) -> None:
    """The floor is 12 of 59 m2, and 1 cm off. The mission's own facts stay; a second time changes nothing."""
    result = hgs("evaluate", str(run_folder))
    assert result.exit_code == 0, result.output
    report = json.loads((run_folder / "report.json").read_text())
    assert report["accuracy_cm"] == pytest.approx(1.0, abs=0.01)
    assert report["completion_ratio"] == pytest.approx(12 / 59, abs=0.03)
    assert 0.9 < report["observable_fraction"] < 1
    assert report["held_out_views"] == 40
    assert 0 < report["observed_mask_share"] < 1
    assert report["psnr_db"] is not None
    assert (report["stop_reason"], report["path_length_m"]) == ("interrupted", 7.5)
    assert "1.00 cm" in result.stdout

    assert hgs("evaluate", str(run_folder)).exit_code == 0
    again = json.loads((run_folder / "report.json").read_text())
    assert {**again, "evaluation_s": None} == {**report, "evaluation_s": None}


def test_a_mesh_in_the_folder_is_measured_as_well(run_folder: Path) -> None:
    """A flat square 2 cm above the floor: accuracy 2 cm; without the file the columns are null again."""
    corners = np.array([(1, 1, 0.02), (2, 1, 0.02), (2, 2, 0.02), (1, 2, 0.02)], np.float32)
    square = SurfaceMesh(
        vertices_m=corners,
        triangles=np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        rgb=np.full((4, 3), 128, np.uint8),
    )
    write_mesh(square, run_folder / "mesh.ply")
    assert hgs("evaluate", str(run_folder)).exit_code == 0
    report = json.loads((run_folder / "report.json").read_text())
    assert report["n_vertices_mesh"] == 4
    assert report["accuracy_cm_mesh"] == pytest.approx(2.0, abs=0.01)
    assert report["accuracy_cm"] == pytest.approx(1.0, abs=0.01)
    (run_folder / "mesh.ply").unlink()
    assert hgs("evaluate", str(run_folder)).exit_code == 0
    assert json.loads((run_folder / "report.json").read_text())["accuracy_cm_mesh"] is None


def test_held_out_views_are_listed_and_shown(run_folder: Path) -> None:
    """The floor is all that the map holds: its views have figures where the only frame saw floor."""
    assert hgs("evaluate", str(run_folder)).exit_code == 0
    report = json.loads((run_folder / "report.json").read_text())
    images = report["held_out_images"]
    assert len(images) == 40
    measured = [image["psnr_db"] for image in images if image["psnr_db"] is not None]
    assert np.mean(measured) == pytest.approx(report["psnr_db"], abs=1e-6)
    (run_folder / "events.jsonl").write_text("")
    result = hgs("report", str(run_folder))
    assert result.exit_code == 0, result.output
    page = (run_folder / "report.html").read_text()
    assert "Held-out views, from poses that no frame was taken from" in page
    assert f"Best view: {max(measured):.1f} dB" in page
    assert f"Worst view: {min(measured):.1f} dB" in page


@pytest.mark.parametrize("name", ["config.yaml", "map.ply", "trajectory.txt", "report.json"])
def test_a_missing_or_damaged_file_is_named_and_nothing_is_rewritten(run_folder: Path, name: str) -> None:
    before = (run_folder / "report.json").read_bytes()
    (run_folder / name).write_text("rubbish")
    result = hgs("evaluate", str(run_folder))
    assert result.exit_code == 2
    assert name in result.stderr
    (run_folder / name).unlink()
    result = hgs("evaluate", str(run_folder))
    assert result.exit_code == 2
    assert name in result.stderr
    if name != "report.json":
        assert (run_folder / "report.json").read_bytes() == before


def test_no_folder_at_all(tmp_path: Path) -> None:
    result = hgs("evaluate", str(tmp_path / "absent"))
    assert result.exit_code == 2
    assert "absent" in result.stderr
