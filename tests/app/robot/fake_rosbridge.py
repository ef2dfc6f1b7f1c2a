"""A rosbridge server (protocol 2, JSON) with a ROS 2 robot behind it, on the loopback address."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import math
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from PIL import Image
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from hgs_core.config.presets import load_preset
from hgs_core.geometry.camera import CameraIntrinsics, level_camera_pose
from hgs_core.robot.motion import STILL, GroundPose, Twist, moved
from hgs_core.robot.vehicle import robot_config
from hgs_core.scene.obstacles import BodyObstacles
from hgs_core.scene.scene import Scene
from hgs_core.simulation.body import Body
from tests.app.robot.own_loop import OwnLoop

DRIVE = robot_config(load_preset("robot", "wheeled"))
CAMERA = CameraIntrinsics.centred(60, 34, 30.0)
MOUNT_M = (0.1, 1.0)
"""Ahead of and above the base."""
SCANNER_M = 0.15
N_RAYS = 36
_TICK_S = 0.02
_VELOCITY_HOLDS_S = 0.5
"""A base that is told nothing for so long stands."""
_OPTICAL = {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5}
"""Of a camera that looks along the base's x."""

TYPES = {
    "/camera/color/image_raw": "sensor_msgs/msg/Image",
    "/camera/color/image_raw/compressed": "sensor_msgs/msg/CompressedImage",
    "/camera/color/image_raw/compressedDepth": "sensor_msgs/msg/CompressedImage",
    "/camera/color/camera_info": "sensor_msgs/msg/CameraInfo",
    "/camera/depth/image_rect": "sensor_msgs/msg/Image",
    "/camera/depth/image_rect/compressed": "sensor_msgs/msg/CompressedImage",
    "/camera/depth/image_rect/compressedDepth": "sensor_msgs/msg/CompressedImage",
    "/camera/depth/camera_info": "sensor_msgs/msg/CameraInfo",
    "/odom": "nav_msgs/msg/Odometry",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/rosout": "rcl_interfaces/msg/Log",
}


class FakeRosRobot:
    """Drives as it is told by `/cmd_vel`, among true obstacles, and publishes what drivers would."""

    def __init__(self, scene: Scene, *, camera: CameraIntrinsics = CAMERA) -> None:
        self.body = Body(DRIVE, BodyObstacles(scene.mesh, DRIVE.height_m), scene.start)
        self.types = dict(TYPES)
        self.mute: set[str] = set()
        """Topics whose drivers have died."""
        self.spoil: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {}
        """What is done to the messages of a topic."""
        self.odometry_late_s = 0.0
        """By how much it comes late, as behind images on a slow line."""
        self.clock_s = 1_700_000_000.0
        self.heard: list[tuple[str, dict[str, Any]]] = []
        """What was published by clients."""
        self.port = 0
        self._caster = scene.caster
        self._camera = camera
        self._twist, self._told_s = STILL, -math.inf
        self._began_s = time.monotonic()
        self._subscribed: set[str] = set()
        self._clients: set[ServerConnection] = set()
        self._own = OwnLoop()

    @property
    def pose(self) -> GroundPose:
        """Where it is; its odometry is perfect."""
        return self.body.pose

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    def of(self, topic: str) -> list[dict[str, Any]]:
        return [message for name, message in list(self.heard) if name == topic]

    @property
    def moves(self) -> bool:
        return not self._twist.is_still and time.monotonic() - self._told_s < _VELOCITY_HOLDS_S

    def cut(self) -> None:
        """Every connection is lost at once."""

        async def abort() -> None:
            for client in list(self._clients):
                client.transport.abort()

        self._own.call(abort())

    @contextmanager
    def serving(self) -> Iterator[FakeRosRobot]:
        with self._own.running(self._run):
            yield self

    # On the server's own thread.

    async def _run(self, ready: threading.Event, over: asyncio.Event) -> None:
        async with serve(self._serve, "127.0.0.1", 0, max_size=None) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            ready.set()
            living = asyncio.create_task(self._live())
            await over.wait()
            living.cancel()

    async def _serve(self, socket: ServerConnection) -> None:
        self._clients.add(socket)
        with suppress(ConnectionClosed):
            async for content in socket:
                await self._answer(socket, json.loads(content))
        self._clients.discard(socket)

    async def _answer(self, socket: ServerConnection, message: dict[str, Any]) -> None:
        match message["op"]:
            case "subscribe":
                self._subscribed.add(message["topic"])
                if message["topic"] == "/tf_static" and "/tf_static" not in self.mute:
                    await self._publish("/tf_static", self._transforms())
            case "call_service":
                assert message["service"] == "/rosapi/topics"
                values = {"topics": list(self.types), "types": list(self.types.values())}
                answer = {"op": "service_response", "service": message["service"], "id": message["id"]}
                await socket.send(json.dumps({**answer, "values": values, "result": True}))
            case "publish":
                self.heard.append((message["topic"], message["msg"]))
                if message["topic"] == "/cmd_vel":
                    linear, angular = message["msg"]["linear"], message["msg"]["angular"]
                    self._twist = Twist(
                        forward_mps=linear["x"], left_mps=linear["y"], turn_radps=angular["z"]
                    )
                    self._told_s = time.monotonic()
            case "advertise" | "unsubscribe" | "unadvertise":
                pass
            case unknown:
                raise AssertionError(unknown)

    async def _live(self) -> None:
        lived_s, ticks = time.monotonic(), 0
        waiting: deque[tuple[float, dict[str, Any]]] = deque()
        while True:
            await asyncio.sleep(_TICK_S)
            while lived_s + _TICK_S <= time.monotonic():
                lived_s += _TICK_S
                self.clock_s += _TICK_S
                if self.moves:
                    self.body.move_to(moved(self.pose, self._twist, _TICK_S))
            ticks += 1
            waiting.append((time.monotonic(), self._odometry()))
            while waiting and time.monotonic() - waiting[0][0] >= self.odometry_late_s:
                await self._publish("/odom", waiting.popleft()[1])
            if ticks % 5 == 0:
                await self._publish("/scan", self._scan())
            if ticks % 10 == 0:
                for name in ("color", "depth"):
                    await self._publish(f"/camera/{name}/camera_info", self._info())
                rgb, depth_m = self._caster.render(self._camera, self._camera_pose(), 5.0)
                await self._publish("/camera/color/image_raw/compressed", self._colour(rgb))
                await self._publish("/camera/depth/image_rect/compressedDepth", self._depth(depth_m))

    async def _publish(self, topic: str, content: dict[str, Any]) -> None:
        if topic not in self._subscribed or topic in self.mute:
            return
        content = self.spoil.get(topic, lambda same: same)(content)
        text = json.dumps({"op": "publish", "topic": topic, "msg": content})
        for client in list(self._clients):
            with suppress(ConnectionClosed):
                await client.send(text)

    def _header(self, frame: str) -> dict[str, Any]:
        seconds = math.floor(self.clock_s)
        return {"stamp": {"sec": seconds, "nanosec": int(1e9 * (self.clock_s - seconds))}, "frame_id": frame}

    def _camera_pose(self):
        pose, (ahead, up) = self.pose, MOUNT_M
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        return level_camera_pose(pose.x_m + ahead * cos, pose.y_m + ahead * sin, up, pose.yaw_rad)

    def _odometry(self) -> dict[str, Any]:
        pose, twist = self.pose, self._twist if self.moves else STILL
        return {
            "header": self._header("odom"),
            "child_frame_id": "base_link",
            "pose": {
                "pose": {
                    "position": {"x": pose.x_m, "y": pose.y_m, "z": 0.0},
                    "orientation": {
                        "x": 0.0,
                        "y": 0.0,
                        "z": math.sin(pose.yaw_rad / 2),
                        "w": math.cos(pose.yaw_rad / 2),
                    },
                },
                "covariance": [0.0] * 36,
            },
            "twist": {
                "twist": {
                    "linear": {"x": twist.forward_mps, "y": twist.left_mps, "z": 0.0},
                    "angular": {"x": 0.0, "y": 0.0, "z": twist.turn_radps},
                },
                "covariance": [0.0] * 36,
            },
        }

    def _transforms(self) -> dict[str, Any]:
        def placed(child: str, x: float, z: float, rotation: dict[str, float]) -> dict[str, Any]:
            return {
                "header": self._header("base_link"),
                "child_frame_id": child,
                "transform": {"translation": {"x": x, "y": 0.0, "z": z}, "rotation": rotation},
            }

        level = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        return {"transforms": [placed("optical", *MOUNT_M, _OPTICAL), placed("laser", 0.0, SCANNER_M, level)]}

    def _info(self) -> dict[str, Any]:
        camera = self._camera
        centre = [camera.cx - 0.5, camera.cy - 0.5]
        return {
            "header": self._header("optical"),
            "width": camera.width,
            "height": camera.height,
            "distortion_model": "plumb_bob",
            "d": [],
            "k": [camera.fx, 0.0, centre[0], 0.0, camera.fy, centre[1], 0.0, 0.0, 1.0],
            "binning_x": 0,
            "binning_y": 0,
            "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
        }

    def _colour(self, rgb: np.ndarray) -> dict[str, Any]:
        packed = io.BytesIO()
        Image.fromarray(rgb).save(packed, "jpeg", quality=95)
        data = base64.b64encode(packed.getvalue()).decode()
        return {"header": self._header("optical"), "format": "rgb8; jpeg compressed bgr8", "data": data}

    def _depth(self, depth_m: np.ndarray) -> dict[str, Any]:
        packed = io.BytesIO()
        millimetres = np.where(np.isfinite(depth_m), 1000.0 * depth_m, 0.0).round().astype(np.uint16)
        Image.fromarray(millimetres).save(packed, "png")
        data = base64.b64encode(struct.pack("<iff", 0, 0.0, 0.0) + packed.getvalue()).decode()
        return {"header": self._header("optical"), "format": "16UC1; compressedDepth png", "data": data}

    def _scan(self) -> dict[str, Any]:
        bearings = self.pose.yaw_rad - math.pi + np.arange(N_RAYS) * 2 * math.pi / N_RAYS
        directions = np.stack([np.cos(bearings), np.sin(bearings), np.zeros(N_RAYS)], axis=1)
        origin = np.broadcast_to([self.pose.x_m, self.pose.y_m, SCANNER_M], (N_RAYS, 3))
        ranges = self._caster.cast(origin, directions)
        return {
            "header": self._header("laser"),
            "angle_min": -math.pi,
            "angle_max": math.pi,
            "angle_increment": 2 * math.pi / N_RAYS,
            "range_min": 0.05,
            "range_max": 10.0,
            "ranges": [float(r) if math.isfinite(r) else None for r in ranges],  # as rosbridge writes them
            "intensities": [],
        }
