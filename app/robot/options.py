"""What a robot is told on its way."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from app.robot.link_faults import LinkFaults
from hgs_core.errors import ConfigError
from hgs_core.mission.config import MissionConfig, resolve_mission_config
from hgs_core.simulation.driven_world import BodyFaults

VEHICLES: Final = {"differential": "wheeled", "ackermann": "ackermann", "holonomic": "holonomic"}
"""Preset of the robot by its drive."""


@dataclass(frozen=True, kw_only=True)
class RobotOptions:
    """The options of `hgs robot`, for a robot or a recording that connects to a service."""

    server: str
    out: Path
    token: str | None = None
    mission: str | None = None
    """None: one is made, and started."""
    scene: str | None = None
    """None: the recording's."""
    vehicle: str = "differential"
    seed: int = 0
    preset: str = "paper"
    settings: dict[str, str] = field(default_factory=dict)
    sensor: str = "rgbd_5m_small"
    frame_rate_hz: float = 2.5
    depth_format: str = "png"
    recorded: Path | None = None
    body_faults: BodyFaults = BodyFaults()
    link_faults: LinkFaults = LinkFaults()
    clock_offset_s: float = 0.0
    give_up_after_s: float = 60.0
    evaluate: bool = True

    def overrides(self) -> dict[str, str]:
        """What the robot is, as settings on top of the preset; explicit settings count."""
        if self.vehicle not in VEHICLES:
            raise ConfigError(f"--vehicle {self.vehicle!r}: must be one of {', '.join(VEHICLES)}")
        return {
            "sensor": self.sensor,
            "robot": VEHICLES[self.vehicle],
            "sensor.camera.frame_interval_s": repr(1.0 / self.frame_rate_hz),
            **self.settings,
        }

    def config(self) -> MissionConfig:
        """Raises `ConfigError` for what is not allowed."""
        return resolve_mission_config(self.preset, self.overrides())

    def faults(self) -> dict[str, float]:
        """Those that were asked for, by name."""
        everything = {
            **self.body_faults.model_dump(),
            **self.link_faults.model_dump(),
            "clock_offset_s": self.clock_offset_s,
        }
        return {name: value for name, value in everything.items() if value}
