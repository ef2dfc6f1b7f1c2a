"""A short walk with a camera, written as an MCAP file of ROS 2 messages."""

from pathlib import Path

import numpy as np

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


def uncompressed(colour: np.ndarray, encoding: str, depth: np.ndarray, depth_encoding: str, padding: int):
    def add(bag: bags.Bag) -> None:
        for kind in ("color", "depth"):
            topic = f"/camera/{kind}/camera_info"
            bag.add(topic, INFO, 0.0, bags.camera_info(0.0, SIZE, FOCAL, OPTICAL))
        bag.add("/camera/color/image", IMAGE, 0.0, bags.image(0.0, colour, encoding, OPTICAL, padding))
        bag.add("/camera/depth/image", IMAGE, 0.0, bags.image(0.0, depth, depth_encoding, OPTICAL, padding))

    return add


PNG = bags.encoded(rgb_of(0), "PNG")
"""The colour image of the first frame."""
