"""A robot of your own: python own_robot.py ws://127.0.0.1:8000/api/v1/ingest/MISSION [TOKEN]

MISSION (scene "live") was started; `room_robot.Robot` is your robot. Needs websockets msgspec numpy pillow.
"""

import io
import sys
import time

import msgspec
import numpy as np
from PIL import Image
from room_robot import CAMERA, DRIVE, REGION_M, Robot
from websockets.sync.client import connect


class Client:
    def __init__(self, socket, robot: Robot) -> None:
        self.socket, self.robot = socket, robot
        self.command, self.credits, self.sequence = 0, 0, 0  # the newest command that was obeyed
        self.heard_s, self.least_s, self.dead_man_s = time.monotonic(), np.inf, 1.0

    def say(self, kind: str, **content) -> None:
        self.socket.send(msgspec.msgpack.encode({"type": kind, **content}))

    def report(self) -> dict:
        return {"time_s": time.monotonic(), "command": self.command, **self.robot.report()}

    def live(self) -> str:
        hello = {"protocol": 1, "name": "my robot", "camera": CAMERA, "robot": DRIVE, "region_m": REGION_M}
        self.say("hello", **hello, report={"type": "report", **self.report()})
        lived_s = reported_s = framed_s = time.monotonic()
        while True:
            try:
                message = msgspec.msgpack.decode(self.socket.recv(timeout=0.02))
            except TimeoutError:
                message = None
            now_s = time.monotonic()
            if message is not None:
                if message["type"] == "end":
                    return message["reason"]
                self.hear(message, now_s)
            if now_s - self.heard_s > self.dead_man_s:
                self.robot.stop()  # nobody talks to it: it stands
            self.robot.step(now_s - lived_s)
            lived_s = now_s
            if now_s - reported_s > 0.1:
                reported_s = now_s
                self.say("report", **self.report())
            if self.credits > 0 and now_s - framed_s > CAMERA["frame_interval_s"]:
                framed_s = now_s
                self.send_frame(now_s)

    def hear(self, message: dict, now_s: float) -> None:
        # The quickest message so far tells how far the two clocks are apart: what came later was on its way.
        self.heard_s, self.least_s = now_s, min(self.least_s, now_s - message["now_s"])
        if message["type"] == "welcome":
            self.credits, self.dead_man_s = message["credits"], message["dead_man_s"]
        elif message["type"] == "answer":
            self.credits += 1
        elif message["type"] in ("path", "stop", "limit_speed"):
            why_not = self.obey(message, now_s)
            if not why_not:
                self.command = max(self.command, message["command"])
            self.say("ack", command=message["command"], accepted=not why_not, reason=why_not)

    def obey(self, command: dict, now_s: float) -> str:
        if command["type"] == "stop":
            self.robot.stop()
        elif command["type"] == "path":
            (x_m, y_m), *_ = command["positions_m"]
            if now_s - command["now_s"] - self.least_s > command["valid_for_s"]:
                return "it comes too late"
            if command["command"] < self.command:
                return f"command {self.command} is newer"
            if np.hypot(x_m - self.robot.x_m, y_m - self.robot.y_m) > 0.25:
                return "it does not begin where the robot is"
            self.robot.follow(command["positions_m"], command["yaws_rad"])
        else:
            self.robot.limit_mps = command["max_speed_mps"]
        return ""

    def send_frame(self, now_s: float) -> None:
        pose, colour, depth_m = self.robot.capture()
        files = io.BytesIO(), io.BytesIO()
        Image.fromarray(colour).save(files[0], "PNG")
        Image.fromarray((1000 * depth_m).astype(np.uint16)).save(files[1], "PNG")  # millimetres
        images = {"colour": files[0].getvalue(), "colour_format": "png", "depth": files[1].getvalue()}
        self.say("frame", sequence=self.sequence, time_s=now_s, pose=pose.ravel().tolist(), **images)
        self.sequence, self.credits = self.sequence + 1, self.credits - 1


if __name__ == "__main__":
    (url, *token), robot = sys.argv[1:], Robot()
    headers = {"Authorization": f"Bearer {token[0]}"} if token else {}
    try:
        with connect(url, additional_headers=headers, compression=None) as websocket:
            sys.stdout.write(f"the mission is over: {Client(websocket, robot).live()}\n")
    finally:
        robot.stop()
