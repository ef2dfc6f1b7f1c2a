"""A live mission's robot, as the interface tells of it: angles in degrees."""

from __future__ import annotations

import math
import time

from app.missions.robot_link import RobotLink
from app.schemas import RobotCommand, RobotDetail, RobotReport
from hgs_core.live.messages import FollowPath, Report, Stop


def robot_detail(link: RobotLink) -> RobotDetail:
    figures, report, command = link.figures, link.report, link.command
    return RobotDetail(
        connected=figures.connected,
        robot=figures.robot,
        connections=figures.connections,
        frames=figures.frames,
        frames_dropped=figures.frames_dropped,
        missed=figures.missed,
        refused=figures.refused,
        heard_at=figures.heard_at,
        report=None if report is None else _report(report),
        command=None if command is None else _command(command),
    )


def _report(report: Report) -> RobotReport:
    return RobotReport(
        x_m=report.x_m,
        y_m=report.y_m,
        yaw_deg=math.degrees(report.yaw_rad),
        path_length_m=report.path_length_m,
        standing=report.standing,
        command=report.command,
        waypoints_passed=report.waypoints_passed,
        collisions=report.collisions,
    )


def _command(command: FollowPath | Stop) -> RobotCommand:
    age_s = max(0.0, time.monotonic() - command.now_s)
    if isinstance(command, Stop):
        return RobotCommand(type="stop", command=command.command, age_s=age_s, reason=command.reason)
    headings, timed = command.headings_rad, dict(command.timed)
    timed["yaw_deg"] = [math.degrees(yaw) for yaw in timed.pop("yaw_rad")]
    return RobotCommand(
        type="path",
        command=command.command,
        age_s=age_s,
        valid_for_s=command.valid_for_s,
        positions_m=command.positions_m,
        yaws_deg=[None if yaw is None else math.degrees(yaw) for yaw in command.yaws_rad],
        headings_deg=None if headings is None else [math.degrees(heading) for heading in headings],
        timed=timed,
    )
