"""MCAP files with ROS 2 messages: what is written is what is read."""

import itertools

import numpy as np
import pytest

from hgs_core.errors import StreamError
from hgs_core.sensing.raw_frame import FrameSource
from hgs_core.sensing.recording import RecordedSequence, open_recording
from hgs_core.sensing.ros.topics import TopicOptions
from tests.sensing import bags
from tests.sensing.walk import (
    COLOUR,
    COMPRESSED,
    FOCAL,
    IMAGE,
    INFO,
    ODOMETRY,
    OPTICAL,
    POSE,
    SIZE,
    TF,
    add_images,
    depth_m_of,
    depth_of,
    rgb_of,
    uncompressed,
    with_poses,
    written,
)


def test_a_recording_becomes_frames(tmp_path):
    path = written(tmp_path, with_poses)
    source = open_recording(path)
    assert isinstance(source, FrameSource)
    assert (source.name, len(source), source.n_unmatched) == ("walk", 3, 0)
    np.testing.assert_allclose(source.timestamps_s, [0.0, 0.1, 0.2])
    for _ in range(2):  # again and again
        for k, raw in enumerate(source):
            np.testing.assert_array_equal(raw.rgb, rgb_of(k))
            np.testing.assert_array_equal(raw.depth_m, depth_m_of(k))
            np.testing.assert_allclose(raw.T_world_camera.translation, [1.0, 2.0, 0.5 * k])
            assert raw.sequence == k
    frames = list(RecordedSequence(path))
    assert len(frames) == 3
    camera = frames[0].intrinsics
    # (width - 1) / 2 from the centre of the first pixel is width / 2 from its corner.
    assert (camera.width, camera.height, camera.fx, camera.cx, camera.cy) == (16, 12, FOCAL, 8.0, 6.0)


@pytest.mark.parametrize("padding", [0, 3])
@pytest.mark.parametrize(
    ("colour", "encoding"),
    [
        (rgb_of(0), "rgb8"),
        (rgb_of(0)[..., ::-1], "bgr8"),
        (np.dstack([rgb_of(0), rgb_of(0)[..., :1]]), "rgba8"),
        (np.dstack([rgb_of(0)[..., ::-1], rgb_of(0)[..., :1]]), "bgra8"),
    ],
    ids=["rgb8", "bgr8", "rgba8", "bgra8"],
)
def test_uncompressed_colours(tmp_path, colour, encoding, padding):
    path = written(tmp_path, uncompressed(colour, encoding, depth_of(0), "16UC1", padding))
    raw = next(iter(open_recording(path)))
    np.testing.assert_array_equal(raw.rgb, rgb_of(0))
    np.testing.assert_array_equal(raw.depth_m, depth_m_of(0))


def metres() -> np.ndarray:
    depth = depth_m_of(0)
    depth[0, :4] = [np.nan, np.inf, -np.inf, 0.0]
    return depth


@pytest.mark.parametrize("depth", [metres(), metres().astype(">f4")], ids=["little", "big"])
def test_uncompressed_depth_in_metres(tmp_path, depth):
    path = written(tmp_path, uncompressed(rgb_of(0), "rgb8", depth, "32FC1", 4))
    raw = next(iter(open_recording(path)))
    np.testing.assert_array_equal(raw.depth_m[0, :4], [0.0, np.inf, 0.0, 0.0])
    np.testing.assert_array_equal(raw.depth_m[1:], depth_m_of(0)[1:])


def test_depth_quantised_from_metres(tmp_path):
    """Inverse depth: raw = A / depth + B; the error grows with the square of the distance."""
    a, b = 100.0 * 101.0, 1.0 - 100.0 * 101.0 / 10.0  # of depth_max 10, depth_quantization 100
    depth = depth_m_of(0)
    raw = np.where(depth > 0, np.round(a / np.maximum(depth, 1e-3) + b), 0).astype(np.uint16)

    def add(bag: bags.Bag) -> None:
        add_images(bag, times=(0.0,))
        data = bags.compressed_depth(raw, a, b)
        bag.add("/fine", COMPRESSED, 0.0, bags.compressed(0.0, data, "32FC1; compressedDepth png", OPTICAL))

    read = next(
        iter(
            open_recording(
                written(tmp_path, add), TopicOptions(depth="/fine", depth_info="/camera/depth/camera_info")
            )
        )
    )
    np.testing.assert_allclose(read.depth_m, depth, atol=0.5 * 1.3**2 / a)
    assert read.depth_m[0, 0] == 0.0


def test_jpeg_colours(tmp_path):
    def add(bag: bags.Bag) -> None:
        add_images(bag)
        jpeg = bags.encoded(rgb_of(0), "JPEG")
        bag.add("/other/image/compressed", COMPRESSED, 0.0, bags.compressed(0.0, jpeg, "jpeg", OPTICAL))

    path = written(tmp_path, add)
    options = TopicOptions(colour="/other/image/compressed", colour_info="/camera/color/camera_info")
    raw = next(iter(open_recording(path, options)))
    assert np.abs(raw.rgb.astype(int) - rgb_of(0)).mean() < 4
    with pytest.raises(StreamError, match=r"2 topics hold colour images .*option 'colour'.*/camera/color"):
        open_recording(path)


def test_colour_without_depth_in_time_is_left_out_and_depth_without_colour_ignored(tmp_path):
    def add(bag: bags.Bag) -> None:
        add_images(bag, times=(0.0, 0.1, 0.2), depth_lag_s=0.015)
        for t in (0.15, 0.3):  # colour alone
            png = bags.encoded(rgb_of(9), "PNG")
            bag.add(COLOUR, COMPRESSED, t, bags.compressed(t, png, "png", OPTICAL))

    path = written(tmp_path, add)
    source = open_recording(path)
    assert (len(source), source.n_unmatched) == (3, 2)
    np.testing.assert_allclose([raw.depth_m[1, 1] for raw in source], [1.011, 1.111, 1.211], rtol=1e-6)
    with pytest.raises(StreamError, match=r"within 0\.01 s; raise max_depth_offset_s"):
        open_recording(path, TopicOptions(max_depth_offset_s=0.01))


def test_poses_between_two_are_interpolated_and_gaps_have_none(tmp_path):
    def add(bag: bags.Bag) -> None:
        add_images(bag, times=(0.0, 0.05, 0.1, 0.6))
        for t, x in ((0.0, 0.0), (0.1, 1.0), (1.0, 5.0)):
            bag.add("/pose", POSE, t, bags.pose_stamped(t, (x, 0.0, 0.0), yaw_rad=0.4 * x))

    source = open_recording(written(tmp_path, add))
    assert source.is_posed.tolist() == [True, True, True, False]
    middle = list(source)[1].T_world_camera
    # Along one screw: half the turn of 0.4 rad, and half way along the arc whose chord is 1 m.
    np.testing.assert_allclose(np.arctan2(middle.rotation[1, 0], middle.rotation[0, 0]), 0.2)
    np.testing.assert_allclose(np.linalg.norm(middle.translation), 0.5 / np.cos(0.1), rtol=1e-6)


def test_tf_chains_from_the_map_to_the_camera(tmp_path):
    """map -> odom (moving) -> base (moving) -> mast (static) -> optical (static)."""

    def add(bag: bags.Bag) -> None:
        add_images(bag)
        static = bags.transforms(
            0.0, ("base", "mast", (0.1, 0.0, 0.8), 0.0), ("mast", OPTICAL, (0.0, 0.05, 0.0), np.pi / 2)
        )
        bag.add("/tf_static", TF, 0.0, static)
        for k in range(3):
            t = 0.1 * k
            bag.add("/tf", TF, t, bags.transforms(t, ("map", "odom", (10.0, 0.0, 0.0), 0.0)))
            bag.add("/tf", TF, t, bags.transforms(t, ("odom", "base", (1.0 * k, 0.0, 0.0), np.pi / 2)))

    path = written(tmp_path, add)
    frames = list(open_recording(path))
    # base at (10 + k, 0), turned left: its x is the map's y.
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.T_world_camera.translation, [10 + k - 0.05, 0.1, 0.8], atol=1e-9)
    np.testing.assert_allclose(frames[0].T_world_camera.rotation, np.diag([-1, -1, 1]), atol=1e-9)
    from_odom = next(iter(open_recording(path, TopicOptions(world_frame="odom"))))
    np.testing.assert_allclose(from_odom.T_world_camera.translation, [-0.05, 0.1, 0.8], atol=1e-9)
    assert not open_recording(path, TopicOptions(pose="none")).is_posed.any()
    with pytest.raises(
        StreamError, match=r"no transform leads from 'camera_optical' to 'moon'; tf has .*base"
    ):
        open_recording(path, TopicOptions(pose="tf", world_frame="moon"))


def test_odometry_of_the_base_needs_to_know_where_the_camera_sits(tmp_path):
    def add(bag: bags.Bag) -> None:
        add_images(bag)
        for k in range(3):
            bag.add("/odom", ODOMETRY, 0.1 * k, bags.odometry(0.1 * k, "base", (1.0 * k, 0.0, 0.0)))

    with pytest.raises(
        StreamError, match=r"/odom tells where 'base' is.*record /tf_static, or set pose_frame"
    ):
        open_recording(written(tmp_path, add))

    def add_with_tf(bag: bags.Bag) -> None:
        add(bag)
        bag.add("/tf_static", TF, 0.0, bags.transforms(0.0, ("base", OPTICAL, (0.2, 0.0, 1.0), 0.0)))

    frames = list(open_recording(written(tmp_path, add_with_tf)))
    np.testing.assert_allclose(
        [f.T_world_camera.translation for f in frames], [[0.2, 0, 1], [1.2, 0, 1], [2.2, 0, 1]]
    )


def test_depth_of_another_camera_needs_to_know_where_it_sits(tmp_path):
    def add(bag: bags.Bag, *, with_tf: bool) -> None:
        bag.add("/color/camera_info", INFO, 0.0, bags.camera_info(0.0, SIZE, FOCAL, OPTICAL))
        bag.add("/depth/camera_info", INFO, 0.0, bags.camera_info(0.0, (8, 6), 7.0, "depth_optical"))
        bag.add("/color/image", IMAGE, 0.0, bags.image(0.0, rgb_of(0), "rgb8", OPTICAL))
        depth = np.full((6, 8), 2000, np.uint16)
        bag.add("/depth/image", IMAGE, 0.0, bags.image(0.0, depth, "16UC1", "depth_optical"))
        bag.add("/pose", POSE, 0.0, bags.pose_stamped(0.0, (0.0, 0.0, 0.0)))
        if with_tf:
            beside = bags.transforms(0.0, (OPTICAL, "depth_optical", (0.3, 0.0, 0.1), 0.0))
            bag.add("/tf_static", TF, 0.0, beside)

    path = written(tmp_path, lambda bag: add(bag, with_tf=False))
    with pytest.raises(
        StreamError, match="tf does not tell how they stand: record /tf_static, or set depth_is"
    ):
        open_recording(path)
    registered = next(iter(RecordedSequence(path, TopicOptions(depth_is_registered=True))))
    assert (registered.depth_m == 2.0).all()
    frame = next(iter(RecordedSequence(written(tmp_path, lambda bag: add(bag, with_tf=True)))))
    # Seen 2 m before the depth camera, which stands 10 cm before and 30 cm beside the colour camera.
    known = frame.depth_m > 0
    np.testing.assert_allclose(frame.depth_m[known], 2.1, rtol=1e-6)
    assert not known[:, 0].any()  # 0.3 m at 2.1 m: two pixels
    assert known[1:-1, 4:-1].all()


def test_only_the_images_of_a_few_frames_are_held(tmp_path):
    """Depth that no colour image needs, and images whose frame is done, are let go."""
    path = written(tmp_path, lambda bag: add_images(bag, times=[0.1 * k for k in range(8)]))
    source = open_recording(path)
    assert [raw.sequence for raw in itertools.islice(source, 3)] == [0, 1, 2]
    assert len(list(source)) == 8
