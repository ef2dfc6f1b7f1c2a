import json

import numpy as np
import pytest
from PIL import Image

from hgs_core.errors import StreamError
from hgs_core.sensing.raw_frame import FrameSource
from hgs_core.sensing.recording import RecordedSequence, open_recording
from hgs_core.sensing.ros.topics import TopicOptions


@pytest.fixture
def folder(tmp_path):
    """Three frames of 4 x 3 pixels; depth and poses are up to 10 ms off the colours."""
    (tmp_path / "rgb").mkdir()
    (tmp_path / "depth").mkdir()
    for k in range(3):
        Image.fromarray(np.full((3, 4, 3), 50 * k, dtype=np.uint8)).save(tmp_path / f"rgb/{k}.png")
        raw = np.full((3, 4), 1500 + k, dtype=np.uint16)
        raw[0, 0], raw[0, 1] = 0, 65535
        Image.fromarray(raw).save(tmp_path / f"depth/{k}.png")
    (tmp_path / "rgb.txt").write_text("# colour\n0.0 rgb/0.png\n0.1 rgb/1.png\n0.2 rgb/2.png\n")
    (tmp_path / "depth.txt").write_text("0.005 depth/0.png\n0.11 depth/1.png\n0.19 depth/2.png\n")
    (tmp_path / "groundtruth.txt").write_text(
        "# timestamp tx ty tz qx qy qz qw\n0.0 1 2 3 0 0 0 1\n0.1 1 2 4 0 0 1 0\n\n0.2 1 2 5 0 0 0 1\n"
    )
    intrinsics = {"width": 4, "height": 3, "fx": 5.0, "fy": 5.0, "cx": 2.0, "cy": 1.5, "depth_scale": 1000}
    (tmp_path / "intrinsics.json").write_text(json.dumps(intrinsics))
    return tmp_path


def test_frames_are_joined_by_time(folder):
    sequence = RecordedSequence(folder)
    frames = list(sequence)
    assert len(sequence) == len(frames) == 3
    assert [frame.timestamp_s for frame in frames] == [0.0, 0.1, 0.2]
    assert [frame.sequence for frame in frames] == [0, 1, 2]
    np.testing.assert_allclose(frames[2].T_world_camera.translation, [1, 2, 5])
    np.testing.assert_allclose(frames[1].T_world_camera.rotation, np.diag([-1, -1, 1]), atol=1e-12)
    assert (frames[1].rgb == 50).all()
    np.testing.assert_allclose(frames[1].depth_m[1:], 1.501)


def test_raw_0_and_65535_are_no_return(folder):
    depth = next(iter(RecordedSequence(folder))).depth_m
    assert depth[0, 0] == depth[0, 1] == 0.0
    assert depth[0, 2] == 1.5


def test_colours_without_depth_or_pose_are_left_out(folder):
    (folder / "depth.txt").write_text("0.005 depth/0.png\n0.15 depth/1.png\n0.19 depth/2.png\n")
    sequence = RecordedSequence(folder)
    assert len(sequence) == 2
    assert sequence.n_unmatched == 1


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("rgb.txt", "0.0 rgb/0.png\n0.1\n", r"rgb\.txt:2: 1 fields"),
        ("rgb.txt", "0.0 rgb/0.png\nsoon rgb/1.png\n", r"rgb\.txt:2: 'soon' is not a number"),
        ("rgb.txt", "0.1 rgb/0.png\n0.1 rgb/1.png\n", r"rgb\.txt:2: timestamp 0\.1 is not after"),
        ("rgb.txt", "# nothing\n", r"rgb\.txt: no rows"),
        ("rgb.txt", "9.0 rgb/0.png\n", "no colour image has a depth image within 0.02 s"),
        ("groundtruth.txt", "9.0 1 2 3 0 0 0 1\n", "no colour image has a depth image and a pose"),
        ("groundtruth.txt", "0.0 1 2 3 0 0 0\n", r"groundtruth\.txt:1: 7 fields"),
        ("groundtruth.txt", "0.0 1 nan 3 0 0 0 1\n", r"groundtruth\.txt:1: 'nan' is not finite"),
        ("groundtruth.txt", "0.0 1 2 3 0 0 0 2\n", r"groundtruth\.txt:1: quaternion wxyz has norm 2"),
        ("intrinsics.json", '{"width": 4}', r"intrinsics\.json: KeyError\('height'\)"),
        ("intrinsics.json", "{\n oops", r"intrinsics\.json:2: not valid JSON"),
    ],
)
def test_malformed_lists_are_refused_with_file_and_line(folder, file, text, message):
    (folder / file).write_text(text)
    with pytest.raises(StreamError, match=message):
        RecordedSequence(folder)


def test_frames_without_a_pose_are_there_for_those_who_can_do_without(folder):
    (folder / "groundtruth.txt").write_text("0.0 1 2 3 0 0 0 1\n0.2 1 2 5 0 0 0 1\n")
    source = open_recording(folder)
    assert isinstance(source, FrameSource)
    assert source.is_posed.tolist() == [True, False, True]
    assert [raw.T_world_camera is None for raw in source] == [False, True, False]
    sequence = RecordedSequence(folder)
    assert (len(sequence), sequence.n_unmatched) == (2, 1)
    assert [(frame.sequence, frame.timestamp_s) for frame in sequence] == [(0, 0.0), (1, 0.2)]
    (folder / "groundtruth.txt").unlink()
    assert not open_recording(folder).is_posed.any()


def test_the_lens_of_a_recording_is_undone(folder):
    camera = json.loads((folder / "intrinsics.json").read_text())
    lens = {"distortion_model": "plumb_bob", "distortion": [5.0, 0.0, 0.0, 0.0]}
    (folder / "intrinsics.json").write_text(json.dumps({**camera, **lens}))
    frame = next(iter(RecordedSequence(folder)))
    assert frame.intrinsics.fx > 5.0
    (folder / "intrinsics.json").write_text(json.dumps({**camera, "distortion": [0.5]}))
    with pytest.raises(StreamError, match=r"intrinsics\.json: .*none takes 0 coefficients"):
        RecordedSequence(folder)


def test_what_is_no_recording_is_refused(tmp_path):
    for name in ("nowhere", "film.avi"):
        with pytest.raises(StreamError, match=r"is no recording .it is missing"):
            open_recording(tmp_path / name)
    (tmp_path / "film.avi").touch()
    with pytest.raises(StreamError, match="it ends otherwise"):
        open_recording(tmp_path / "film.avi")
    with pytest.raises(StreamError, match="has no topics to choose"):
        open_recording(tmp_path, TopicOptions())


@pytest.mark.parametrize("file", ["rgb.txt", "depth.txt", "groundtruth.txt", "intrinsics.json"])
def test_missing_lists_are_refused(folder, file):
    (folder / file).unlink()
    with pytest.raises(StreamError, match=f"{file} is missing"):
        RecordedSequence(folder)


def test_missing_and_broken_images_are_refused_with_the_line_that_names_them(folder):
    (folder / "rgb/1.png").write_bytes(b"not an image")
    with pytest.raises(StreamError, match=r"rgb\.txt:3: .* not a readable image"):
        list(RecordedSequence(folder))
    (folder / "rgb/1.png").unlink()
    with pytest.raises(StreamError, match=r"rgb\.txt:3: .* is missing"):
        list(RecordedSequence(folder))


def test_images_of_another_size_than_the_camera_are_refused(folder):
    Image.fromarray(np.zeros((5, 5, 3), dtype=np.uint8)).save(folder / "rgb/0.png")
    with pytest.raises(StreamError, match=r"rgb\.txt:2: rgb/0\.png measures 5 x 5"):
        next(iter(RecordedSequence(folder)))


def test_a_real_sequence(shared_dir):
    sequence = RecordedSequence(shared_dir / "rgbd" / "seven_scenes_excerpt")
    assert len(sequence) == 100
    frame = next(iter(sequence))
    assert frame.rgb.shape == (480, 640, 3)
    measured = frame.depth_m[frame.depth_m > 0]
    assert 0.3 < measured.min() < measured.max() < 10.0
    assert measured.size > 0.5 * frame.depth_m.size
