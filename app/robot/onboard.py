"""`Onboard`: the seam between the connection and what is connected: a robot, or a camera that is carried."""

from __future__ import annotations

from typing import Protocol

from hgs_core.live.messages import (
    Ack,
    Bye,
    Cloud,
    FollowPath,
    Frame,
    Hello,
    LimitSpeed,
    Report,
    Stop,
    Welcome,
)


class Link(Protocol):
    """What the client offers to what is on board; from any thread."""

    def may_send_frame(self) -> bool:
        """Whether there is a connection, and a credit for a frame that is not taken yet."""
        ...

    def send_frame(self, frame: Frame, taken_s: float) -> None:
        """`taken_s` is when the camera took it, by the robot's clock. Lost without a connection."""
        ...

    def send_cloud(self, cloud: Cloud) -> None:
        """It costs no credit. Lost without a connection."""
        ...

    def acknowledge(self, ack: Ack) -> None:
        """What became of a command."""
        ...

    def finish(self, bye: Bye) -> None:
        """The stream is over."""
        ...


class Onboard(Protocol):
    """Begins to live with `start`; calls come from the client's thread and must not block."""

    def start(self, link: Link) -> None: ...

    def close(self) -> None:
        """Ends its threads."""
        ...

    def hello(self) -> Hello: ...

    def report(self) -> Report | None:
        """Where it is; None for a camera that is carried."""
        ...

    def welcomed(self, welcome: Welcome, received_s: float) -> None: ...

    def heard(self, now_s: float, received_s: float) -> None:
        """A message of the service's time `now_s` has come."""
        ...

    def obey(self, command: FollowPath | Stop | LimitSpeed, received_s: float) -> None: ...

    def halt(self) -> None:
        """Stop for good: whatever comes, nothing moves it any more."""
        ...

    @property
    def standing(self) -> bool: ...
