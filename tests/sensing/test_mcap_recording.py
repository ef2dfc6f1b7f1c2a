"""MCAP files with ROS 2 messages: what is written is what is read, and what is wrong is said."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from hgs_core.errors import StreamError
from hgs_core.sensing.point_scan import McapScans
from hgs_core.sensing.raw_frame import FrameSource
from hgs_core.sensing.recording import RecordedSequence, open_recording
from hgs_core.sensing.ros.topics import TopicOptions
from tests.sensing import bags

COLOUR = "/camera/color/image_raw/compressed"
DEPTH = "/camera/depth/image_raw/compressedDepth"
IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
INFO, TF = "sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage"
POSE, ODOMETRY = "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Odometry"
CLOUD = "sensor_msgs/msg/PointCloud2"
SIZE, FOCAL = (16, 12), 14.0
OPTICAL = "camera_optical"


def rgb_of(k: int) -> np.ndarray:
    v, u = np.mgrid[:12, :16]
    return np.stack([8 * u + k, 8 * v, 4 * (u + v)], axis=-1).astype(np.uint8)


def depth_of(k: int) -> np.ndarray:
    """In millimetres; two pixels without a return."""
    v, u = np.mgrid[:12, :16]
    raw = (1000 + 10 * u + v + 100 * k).astype(np.uint16)
    raw[0, 0], raw[0, 1] = 0, 65535
    return raw


def depth_m_of(k: int) -> np.ndarray:
    return np.where(np.isin(depth_of(k), (0, 65535)), 0, depth_of(k)).astype(np.float32) / np.float32(1000)


def add_images(bag: bags.Bag, times=(0.0, 0.1, 0.2), depth_lag_s: float = 0.004) -> None:
    """PNG colour and compressedDepth of three frames, and their calibration."""
    for topic in ("/camera/color/camera_info", "/camera/depth/camera_info"):
        bag.add(topic, INFO, 0.0, bags.camera_info(0.0, SIZE, FOCAL, OPTICAL))
    for k, t in enumerate(times):
        colour = bags.compressed(t, bags.encoded(rgb_of(k), "PNG"), "rgb8; png compressed bgr8", OPTICAL)
        bag.add(COLOUR, COMPRESSED, t + 0.001, colour)
        lagging = t + depth_lag_s
        depth = bags.compressed_depth(depth_of(k))
        bag.add(
            DEPTH, COMPRESSED, lagging, bags.compressed(lagging, depth, "16UC1; compressedDepth", OPTICAL)
        )


def written(tmp_path: Path, add=add_images) -> Path:
    path = tmp_path / "walk.mcap"
    with bags.Bag(path) as bag:
        add(bag)
    return path


def with_poses(bag: bags.Bag) -> None:
    add_images(bag)
    for k in range(3):
        bag.add("/slam/pose", POSE, 0.1 * k, bags.pose_stamped(0.1 * k, (1.0, 2.0, 0.5 * k)))


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


def uncompressed(colour: np.ndarray, encoding: str, depth: np.ndarray, depth_encoding: str, padding: int):
    def add(bag: bags.Bag) -> None:
        for kind in ("color", "depth"):
            topic = f"/camera/{kind}/camera_info"
            bag.add(topic, INFO, 0.0, bags.camera_info(0.0, SIZE, FOCAL, OPTICAL))
        bag.add("/camera/color/image", IMAGE, 0.0, bags.image(0.0, colour, encoding, OPTICAL, padding))
        bag.add("/camera/depth/image", IMAGE, 0.0, bags.image(0.0, depth, depth_encoding, OPTICAL, padding))

    return add


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


def test_a_file_that_is_cut_short_is_refused(tmp_path):
    path = written(tmp_path, with_poses)
    whole = path.read_bytes()
    for size in (0, 4, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(StreamError, match=r"walk\.mcap is cut short or damaged .*mcap recover"):
            open_recording(path)


def test_a_file_with_flipped_bits_is_refused_or_read_as_it_was(tmp_path):
    path = written(tmp_path, with_poses)
    whole = path.read_bytes()
    refused = 0
    for at in np.random.default_rng(0).integers(0, len(whole), 60):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            assert len(list(open_recording(path))) == 3
        except StreamError:
            refused += 1
    assert refused > 20


def broken(colour=None, depth=None, info=None):
    """The images of one frame, one of its messages being another."""

    def add(bag: bags.Bag) -> None:
        good = bags.camera_info(0.0, SIZE, FOCAL, OPTICAL)
        for kind in ("color", "depth"):
            given = info(good) if info and kind == "color" else good
            if given is not None:
                bag.add(f"/camera/{kind}/camera_info", INFO, 0.0, given)
        png = bags.compressed(0.0, bags.encoded(rgb_of(0), "PNG"), "png", OPTICAL)
        bag.add(COLOUR, COMPRESSED, 0.0, colour or png)
        data = bags.compressed_depth(depth_of(0))
        bag.add(
            DEPTH, COMPRESSED, 0.0, depth or bags.compressed(0.0, data, "16UC1; compressedDepth", OPTICAL)
        )

    return add


PNG = bags.encoded(rgb_of(0), "PNG")


@pytest.mark.parametrize(
    ("add", "message"),
    [
        (
            broken(colour=bags.compressed(0, PNG[:60], "png", OPTICAL)),
            f"{COLOUR}, message 0: 60 bytes are no readable JPEG or PNG",
        ),
        (broken(colour=bags.compressed(0, b"", "jpeg", OPTICAL)), "0 bytes are no readable JPEG or PNG"),
        (
            broken(depth=bags.compressed(0, bytes(12), "16UC1; compressedDepth", OPTICAL)),
            f"{DEPTH}, message 0: 12 bytes are no compressedDepth",
        ),
        (
            broken(depth=bags.compressed(0, bytes(12) + PNG, "16UC1; compressedDepth", OPTICAL)),
            "expected a 16 bit PNG of one channel",
        ),
        (
            broken(depth=bags.compressed(0, bytes(50), "16UC1; compressedDepth rvl", OPTICAL)),
            "record with compressedDepth's format png",
        ),
        (
            broken(
                depth=bags.compressed(0, bags.compressed_depth(depth_of(0)), "8UC1; compressedDepth", OPTICAL)
            ),
            "the encoding '8UC1'",
        ),
        (
            broken(
                depth=bags.compressed(
                    0, bags.compressed_depth(depth_of(0)), "32FC1; compressedDepth", OPTICAL
                )
            ),
            r"quantisation A = 0\.0",
        ),
        (
            broken(info=lambda i: {**i, "k": [0.0] * 9}),
            "/camera/color/camera_info, message 0: K = .* no calibrated camera",
        ),
        (
            broken(info=lambda i: {**i, "distortion_model": "kb8"}),
            "no distortion model 'kb8'; there are: none, plumb_bob",
        ),
        (broken(info=lambda i: {**i, "d": [0.1, 0.2]}), "plumb_bob takes 4 or 5 coefficients, got 2"),
        (broken(info=lambda i: {**i, "binning_x": 2}), "binning 2 x 0 is not read"),
        (broken(info=lambda i: {**i, "roi": {**i["roi"], "width": 3}}), "a region of interest is not read"),
        (
            broken(info=lambda i: {**i, "width": 20}),
            "the colour image measures 16 x 12 pixels, its camera 20 x 12; name the CameraInfo",
        ),
    ],
)
def test_malformed_messages_are_refused_with_topic_and_remedy(tmp_path, add, message):
    with pytest.raises(StreamError, match=message):
        list(open_recording(written(tmp_path, add)))


@pytest.mark.parametrize(
    ("colour", "depth", "message"),
    [
        (
            bags.image(0.0, rgb_of(0), "yuv422", OPTICAL),
            None,
            "encoding 'yuv422' is not read; those that are: rgb8",
        ),
        (None, bags.image(0.0, depth_of(0), "bayer_rggb16", OPTICAL), "encoding 'bayer_rggb16' is not read"),
        (
            None,
            {**bags.image(0.0, depth_of(0), "16UC1", OPTICAL), "step": 4},
            "in rows of 4 cannot hold 16 x 12",
        ),
        (None, bags.image(0.0, -depth_m_of(1), "32FC1", OPTICAL), "depth of -1.* m; expected metres above 0"),
    ],
)
def test_malformed_uncompressed_images_are_refused(tmp_path, colour, depth, message):
    def add(bag: bags.Bag) -> None:
        bag.add("/camera_info", INFO, 0.0, bags.camera_info(0.0, SIZE, FOCAL, OPTICAL))
        bag.add("/image", IMAGE, 0.0, colour or bags.image(0.0, rgb_of(0), "rgb8", OPTICAL))
        bag.add("/depth", IMAGE, 0.0, depth or bags.image(0.0, depth_of(0), "16UC1", OPTICAL))

    with pytest.raises(StreamError, match=message):
        list(open_recording(written(tmp_path, add)))


def test_a_missing_calibration_is_named_with_the_topics_there_are(tmp_path):
    def add(bag: bags.Bag) -> None:
        bag.add("/a/image", IMAGE, 0.0, bags.image(0.0, rgb_of(0), "rgb8", OPTICAL))
        bag.add("/b/image", IMAGE, 0.0, bags.image(0.0, depth_of(0), "16UC1", OPTICAL))

    expected = (
        r"no topic holds CameraInfo of /a/image; name it with the option 'colour_info'.*/b/image \(sensor"
    )
    with pytest.raises(StreamError, match=expected):
        open_recording(written(tmp_path, add))


def test_missing_images_and_unknown_names_are_told_with_the_topics_there_are(tmp_path):
    path = written(tmp_path, lambda bag: bag.add("/pose", POSE, 0.0, bags.pose_stamped(0.0, (0, 0, 0))))
    with pytest.raises(StreamError, match=r"no topic holds colour images.*There are: /pose \(geometry_msgs"):
        open_recording(path)
    path = written(tmp_path)
    with pytest.raises(StreamError, match=r"topic /there holds no depth images; .*There are: /camera/color"):
        open_recording(path, TopicOptions(depth="/there"))
    with pytest.raises(StreamError, match=r"no colour image has .* a pose; .*walk.mcap has no poses"):
        RecordedSequence(path)


@pytest.mark.parametrize(
    ("poses", "message"),
    [
        ([(0.0, (np.nan, 0.0, 0.0), 1.0)], r"/pose, message 0: position \[nan, 0\.0, 0\.0\] is not finite"),
        (
            [(0.0, (0.0, 0.0, 0.0), 1.0), (0.1, (0.0, 0.0, 0.0), 3.0)],
            "/pose, message 1: quaternion wxyz has norm",
        ),
    ],
)
def test_bad_poses_are_refused(tmp_path, poses, message):
    def add(bag: bags.Bag) -> None:
        add_images(bag)
        for t, translation, w in poses:
            posed = bags.pose_stamped(t, translation)
            posed["pose"]["orientation"]["w"] = w
            bag.add("/pose", POSE, t, posed)

    with pytest.raises(StreamError, match=message):
        open_recording(written(tmp_path, add))


def test_frames_with_two_parents_and_circles_are_refused(tmp_path):
    def add(bag: bags.Bag, *edges) -> None:
        add_images(bag)
        bag.add("/tf_static", TF, 0.0, bags.transforms(0.0, *((*edge, (0, 0, 0), 0.0) for edge in edges)))

    two = (("map", "base"), ("odom", "base"))
    with pytest.raises(StreamError, match="frame 'base' has two parents, 'map' and 'odom'"):
        open_recording(written(tmp_path, lambda bag: add(bag, *two)))
    circle = (("map", OPTICAL), (OPTICAL, "map"))
    with pytest.raises(StreamError, match="tf goes in a circle"):
        open_recording(written(tmp_path, lambda bag: add(bag, *circle)))


def test_times_that_go_back_are_refused(tmp_path):
    path = tmp_path / "walk.mcap"
    with bags.Bag(path) as bag:
        add_images(bag)
        again = bags.compressed(0.1, PNG, "png", OPTICAL)
        bag.add(COLOUR, COMPRESSED, 0.5, again)
    with pytest.raises(StreamError, match=r"message 3: its time 0\.100000 s is not after 0\.200000 s"):
        open_recording(path)


def test_only_the_images_of_a_few_frames_are_held(tmp_path):
    """Depth that no colour image needs, and images whose frame is done, are let go."""
    path = written(tmp_path, lambda bag: add_images(bag, times=[0.1 * k for k in range(8)]))
    source = open_recording(path)
    assert [raw.sequence for raw in itertools.islice(source, 3)] == [0, 1, 2]
    assert len(list(source)) == 8
