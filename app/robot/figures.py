"""What became of a robot's frames, commands and connections: `robot.json`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.storage.data_dir import write_whole
from hgs_core.evaluation.report_parts import Figure, ReportPart

SCHEMA_VERSION = 1


class Delays(ReportPart):
    """Of frames that were taken into the map [s]."""

    p50: Figure = None
    p95: Figure = None
    max: Figure = None

    @staticmethod
    def of(delays_s: Sequence[float]) -> Delays:
        if not delays_s:
            return Delays()
        p50, p95 = np.quantile(delays_s, [0.5, 0.95]).tolist()
        return Delays(p50=p50, p95=p95, max=max(delays_s))


class RobotReport(ReportPart):
    """`robot.json`: how robot and service got on with each other."""

    schema_version: int = SCHEMA_VERSION
    mission: str
    """The service's name for the mission."""
    ending: str
    """Why the robot stopped, in words."""
    seed: int
    vehicle: str | None
    """None for a recording."""
    faults: dict[str, float]
    """The faults that were asked for, by their options' names."""
    frames_sent: int
    frames_taken: int
    """Of those sent: in the map."""
    frames_dropped: int
    """Of those sent: overtaken by a newer one before the mission had time for them."""
    frames_refused: int
    frames_unanswered: int
    """Of those sent: the connection or the mission ended before the answer came."""
    frames_skipped: int
    """Not taken, as there was no connection or no credit."""
    frames_late: int
    """Not taken, as the camera was still busy with the one before."""
    frames_lost: int
    """Lost on purpose before they were sent, or with the connection."""
    frames_overtaken: int
    """Sent after the next one, on purpose."""
    connections: int
    """Those that the service welcomed."""
    reconnects: int
    not_understood: int
    """Messages from the service that were none."""
    refusals: int
    """Messages that the service did not accept, frames aside."""
    commands_obeyed: int
    commands_refused: int
    dead_man_stops: int
    dead_man_stopping_m: tuple[float, ...]
    """Way from the moment at which the dead-man's handle tripped while the robot drove to its stand [m]."""
    sent_to_map_s: Delays
    """From sending a frame to the answer that it is in the map."""
    captured_to_map_s: Delays
    """From taking it to that answer."""
    real_time_factor: Figure
    """Seconds that the body lived through a second of wall time."""
    control_late_s: Delays
    """By how much ticks of the control loop came late."""

    def write(self, path: Path) -> None:
        """Write `path` whole or not at all."""
        content = self.model_dump_json(indent=2).encode() + b"\n"
        write_whole(path, lambda file: file.writelines([content]))


@dataclass
class LinkFigures:
    """Counted while the robot is connected, or tries to be."""

    sent: int = 0
    taken: int = 0
    dropped: int = 0
    refused: int = 0
    skipped: int = 0
    late: int = 0
    lost: int = 0
    clouds_sent: int = 0
    clouds_lost: int = 0
    """For want of a connection, or as too much waited for it."""
    connections: int = 0
    not_understood: int = 0
    refusals: int = 0
    taken_sequences: list[int] = field(default_factory=list)
    sent_to_map_s: list[float] = field(default_factory=list)
    captured_to_map_s: list[float] = field(default_factory=list)
