"""`hgs bench recording`: a recorded sequence against a plain SplaTAM-like configuration."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from app.cli.application import application
from hgs_core.benchmark.recording import RecordingBenchmark, map_recording, played_frames
from hgs_core.errors import ConfigError, StreamError
from hgs_core.mission.config import resolve_mission_config
from hgs_core.sensing.recording import RecordedSequence
from hgs_core.sensing.ros.topics import TopicOptions
from tests.sensing import bags

WIDTH, HEIGHT, FOCAL, WALL_M = 96, 64, 80.0, 1.5
SMALL = {"threads": "1", "mapping.iterations_per_s": "10"}


def write_recording(folder: Path, *, n_frames: int = 6, turned: tuple[int, ...] = ()) -> Path:
    """A camera that moves 2 cm a frame along a patterned wall, 1.5 m in front of it; `turned` frames look the
    other way, at a wall as far, with the same pattern."""
    for kind in ("rgb", "depth"):
        (folder / kind).mkdir(parents=True)
    poses = []
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    for k in range(n_frames):
        x_m = 0.02 * k + (u + 0.5 - WIDTH / 2) / FOCAL * WALL_M
        y_m = (v + 0.5 - HEIGHT / 2) / FOCAL * WALL_M
        waves = [np.sin(9.0 * x_m), np.cos(7.0 * y_m), np.sin(6.0 * (x_m + y_m))]
        rgb = np.clip(127.5 + 80.0 * np.stack(waves, axis=-1), 0, 255).astype(np.uint8)
        Image.fromarray(rgb).save(folder / f"rgb/{k}.png")
        Image.fromarray(np.full((HEIGHT, WIDTH), 1000 * WALL_M, np.uint16)).save(folder / f"depth/{k}.png")
        rotation = "0 1 0 0" if k in turned else "0 0 0 1"
        poses.append(f"{0.1 * k:.1f} {0.02 * k} 0 0 {rotation}\n")
    for kind in ("rgb", "depth"):
        rows = [f"{0.1 * k:.1f} {kind}/{k}.png\n" for k in range(n_frames)]
        (folder / f"{kind}.txt").write_text("".join(rows))
    (folder / "groundtruth.txt").write_text("".join(poses))
    camera = {"width": WIDTH, "height": HEIGHT, "fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    (folder / "intrinsics.json").write_text(json.dumps({**camera, "depth_scale": 1000}))
    return folder


@pytest.mark.parametrize("preset", ["paper", "splatam"])
def test_a_simple_wall_is_shown_well_from_where_no_frame_was_mapped(tmp_path: Path, preset: str) -> None:
    figures = map_recording(write_recording(tmp_path / "wall"), preset, SMALL, 3)
    assert (figures.frames, figures.held_out.n_frames) == (4, 2)
    assert figures.iterations == 3 * 4  # 0.4 s between frames, and nothing is earned before the first
    assert figures.n_gaussians > 500
    assert figures.peak_rss_mib > 20.0
    shown = figures.held_out
    assert shown.covered_share > 0.95
    assert shown.psnr_db is not None
    assert shown.psnr_db > 25.0
    assert shown.psnr_db_measured is not None
    assert 25.0 < shown.psnr_db_measured <= shown.psnr_db  # here, what is not covered is shown worse
    assert shown.ssim is not None
    assert shown.ssim > 0.85
    assert shown.depth_l1_cm is not None
    assert shown.depth_l1_cm < 0.5
    assert shown.median_depth_error_cm is not None
    assert shown.median_depth_error_cm < 0.5


def test_held_out_frames_never_reach_the_mapper(tmp_path: Path) -> None:
    """The held-out frames alone look at the other wall: mapped, it would be covered."""
    folder = write_recording(tmp_path / "walls", turned=(2, 5))
    shown = map_recording(folder, "paper", SMALL, 3).held_out
    assert shown.covered_share == 0.0
    assert shown.psnr_db is shown.ssim is shown.depth_l1_cm is shown.median_depth_error_cm is None
    assert shown.psnr_db_measured is not None  # of the observed picture against black
    assert shown.psnr_db_measured < 10.0
    # With only the last of them held out, the other is mapped, and its wall is seen.
    assert map_recording(folder, "paper", SMALL, 6).held_out.covered_share > 0.9


def test_the_recording_is_played_at_a_steady_rate_without_the_held_out_frames(tmp_path: Path) -> None:
    sequence = RecordedSequence(write_recording(tmp_path / "wall"))
    played = list(played_frames(sequence, 3, 0.5))
    assert [frame.sequence for frame in played] == [0, 1, 3, 4]
    assert [frame.timestamp_s for frame in played] == [0.0, 0.5, 1.0, 1.5]


def test_depth_beyond_the_range_is_neither_mapped_nor_compared(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "wall")
    figures = map_recording(folder, "paper", {**SMALL, "sensor.camera.range_m": "1.0"}, 3)
    assert figures.n_gaussians == 0
    assert figures.held_out.psnr_db_measured is None


def test_the_baseline_plans_as_paper_does_and_maps_otherwise() -> None:
    paper, splatam = (resolve_mission_config(name, {}) for name in ("paper", "splatam"))
    different = {name for name in type(paper).model_fields if getattr(paper, name) != getattr(splatam, name)}
    assert different == {"description", "mapping"}
    assert splatam.mapping.iterations_per_s == paper.mapping.iterations_per_s


def bench_recording(folder: Path, *more: str) -> tuple[int, str]:
    arguments = ["bench", "recording", str(folder), "--threads", "1", *more]
    result = CliRunner().invoke(application, arguments, env={"COLUMNS": "160"})
    return result.exit_code, result.output


def test_both_configurations_are_compared(tmp_path: Path) -> None:
    path = tmp_path / "figures.json"
    code, output = bench_recording(
        write_recording(tmp_path / "wall"),
        *("--hold-out", "3", "--set", "mapping.iterations_per_s=5", "--json", str(path)),
    )
    assert code == 0, output
    for word in ("paper", "splatam", "PSNR dB", "depth L1 cm", "frames/s", "peak memory MiB", "4 frames"):
        assert word in output
    figures = RecordingBenchmark.model_validate_json(path.read_text())
    assert (figures.recording, figures.hold_out, figures.threads) == ("wall", 3, 1)
    assert (figures.ours.preset, figures.baseline.preset) == ("paper", "splatam")
    for one in (figures.ours, figures.baseline):
        assert one.iterations == 3 * 2
        assert one.frames_per_s == pytest.approx(one.frames / one.mapping_s)
        assert one.held_out.covered_share > 0.9


def test_a_ros_recording_is_mapped_with_the_topics_that_are_named(tmp_path: Path) -> None:
    sequence = RecordedSequence(write_recording(tmp_path / "wall"))
    path = tmp_path / "wall.mcap"
    with bags.Bag(path) as bag:
        info = bags.camera_info(0.0, (WIDTH, HEIGHT), FOCAL, "camera")
        bag.add("/camera_info", "sensor_msgs/msg/CameraInfo", 0.0, info)
        for frame in sequence:
            t, x_m = frame.timestamp_s, float(frame.T_world_camera.translation[0])
            png = bags.encoded(frame.rgb, "PNG")
            depth = bags.compressed_depth((frame.depth_m * 1000).astype(np.uint16))
            for topic in ("/rgb", "/other"):
                image = bags.compressed(t, png, "png", "camera")
                bag.add(topic, "sensor_msgs/msg/CompressedImage", t, image)
            image = bags.compressed(t, depth, "16UC1; compressedDepth", "camera")
            bag.add("/depth", "sensor_msgs/msg/CompressedImage", t, image)
            bag.add("/pose", "geometry_msgs/msg/PoseStamped", t, bags.pose_stamped(t, (x_m, 0.0, 0.0)))
    figures = map_recording(path, "paper", SMALL, 3, TopicOptions(colour="/rgb"))
    assert figures == map_recording(tmp_path / "wall", "paper", SMALL, 3).model_copy(
        update={
            name: getattr(figures, name)
            for name in ("mapping_s", "mapping_cpu_s", "frames_per_s", "peak_rss_mib")
        }
    )
    code, output = bench_recording(path)
    assert code == 2
    assert "2 topics hold colour images (/other, /rgb)" in output.replace("\n", " ")
    code, output = bench_recording(path, "--topic", "color=/rgb")
    assert code == 2
    assert "There are: colour, depth" in " ".join(output.split())


def test_what_cannot_be_measured_is_refused(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "wall")
    code, output = bench_recording(folder, "--hold-out", "7")
    assert code == 2
    assert "wall has 6 frames" in output
    code, output = bench_recording(tmp_path / "nowhere")
    assert code == 2
    assert "is no recording" in output
    with pytest.raises(ConfigError, match="no mission preset"):
        map_recording(folder, "unknown", {}, 3)
    with pytest.raises(StreamError):
        map_recording(tmp_path, "paper", {}, 3)
