"""The seam between the loop and whatever delivers images: a simulator, a recording, a live robot."""

from typing import Protocol, runtime_checkable

from hgs_core.sensing.frame import Frame, Scan


@runtime_checkable
class Sensor(Protocol):
    """An RGB-D camera that rides on a robot."""

    def capture(self) -> Frame:
        """The frame seen now. Raises `SensorError` when the sensor cannot deliver."""
        ...


@runtime_checkable
class Scanner(Protocol):
    """A planar 360-degree safety scanner that rides on a robot."""

    def scan(self) -> Scan:
        """One full turn, taken now. Raises `SensorError` when the scanner cannot deliver."""
        ...
