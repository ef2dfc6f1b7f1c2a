"""MCAP files that are damaged, or say something that cannot be: what is wrong is said."""

import numpy as np
import pytest

from hgs_core.errors import StreamError
from hgs_core.sensing.recording import RecordedSequence, open_recording
from hgs_core.sensing.ros.topics import TopicOptions
from tests.sensing import bags
from tests.sensing.walk import (
    COLOUR,
    COMPRESSED,
    DEPTH,
    FOCAL,
    IMAGE,
    INFO,
    OPTICAL,
    PNG,
    POSE,
    SIZE,
    TF,
    add_images,
    depth_m_of,
    depth_of,
    rgb_of,
    with_poses,
    written,
)


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
