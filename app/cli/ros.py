"""`hgs ros`: a robot that speaks ROS 2, through a rosbridge server."""

from __future__ import annotations

from typing import Annotated

import typer

from app.cli.console import OUTPUT
from app.cli.live_missions import (
    SERVER,
    GiveUpOption,
    MissionOption,
    PresetOption,
    RangeOption,
    ServerOption,
    SettingsOption,
    TokenOption,
    exit_for,
    print_delays,
    say,
)
from app.cli.recordings import parse_topic_options
from app.cli.run import parse_settings


def ros(
    bridge: Annotated[str, typer.Option(help="The robot's rosbridge server.")] = "ws://127.0.0.1:9090",
    server: ServerOption = SERVER,
    token: TokenOption = None,
    robot: Annotated[
        str,
        typer.Option(help="Preset of its drive and size (`configs/robot`): wheeled, holonomic, ackermann."),
    ] = "wheeled",
    drive: Annotated[
        list[str] | None,
        typer.Option(
            "--drive", metavar="KEY=VALUE", help="Change a setting of that, as radius_m=0.2; may be repeated."
        ),
    ] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option(
            "--topic",
            metavar="KEY=VALUE",
            help="colour, depth, colour_info, depth_info, pose, scan, ...; may be repeated.",
        ),
    ] = None,
    mount: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(
            metavar="X Y Z PITCH",
            help="Where the colour camera sits on the base [m] and how far it looks down [degrees].",
            show_default="as /tf_static tells",
        ),
    ] = None,
    velocity_topic: Annotated[str, typer.Option(help="geometry_msgs/Twist goes there.")] = "/cmd_vel",
    path_topic: Annotated[str, typer.Option(help="nav_msgs/Path goes there, to be looked at.")] = "/hgs/path",
    mission: MissionOption = None,
    preset: PresetOption = "best",
    settings: SettingsOption = None,
    frame_rate: Annotated[
        float, typer.Option(min=0.1, max=60.0, metavar="HZ", help="At most so many frames a second.")
    ] = 2.5,
    range_m: RangeOption = 5.0,
    give_up_after: GiveUpOption = 60.0,
) -> None:
    """Let a ROS 2 robot explore: its camera, odometry and scanner come over rosbridge, velocities go back.

    Needs the extra `ros` here, and on the robot rosbridge_server with rosapi; no ROS is needed here.

        hgs serve
        hgs ros --bridge ws://robot.local:9090 --drive radius_m=0.2 --drive max_speed_mps=0.4

    The robot stands when the service, the bridge or its odometry falls silent, and with Ctrl-C.

    Exit codes:
    0 - the mission is over;
    2 - an option is wrong, the robot lacks a topic or set its clock back, or the service refuses it;
    4 - the service was out of reach for too long;
    130 - it was interrupted.
    """
    import numpy as np

    from app.robot.ros.program import RosOptions, run_ros
    from app.robot.ros.ros_robot import RosRobotOptions
    from app.robot.ros.topics import RosTopicOptions
    from hgs_core.geometry.camera import level_camera_pose
    from hgs_core.geometry.se3 import SE3
    from hgs_core.mission.config import resolve_mission_config

    drive_settings = {"robot": robot} | {f"robot.{k}": v for k, v in parse_settings(drive or []).items()}
    camera = None
    if mount is not None:
        x_m, y_m, z_m, pitch_deg = mount
        tilted = SE3.exp(np.array([0.0, 0.0, 0.0, -np.radians(pitch_deg), 0.0, 0.0]))
        camera = level_camera_pose(x_m, y_m, z_m, 0.0) @ tilted
    options = RosOptions(
        bridge=bridge,
        server=server,
        robot=RosRobotOptions(
            name=f"{robot} robot at {bridge}",
            drive=resolve_mission_config(preset, drive_settings).robot,
            topics=parse_topic_options(topics, RosTopicOptions),
            camera_on_base=camera,
            velocity_topic=velocity_topic,
            path_topic=path_topic,
            range_m=range_m,
            frame_interval_s=1.0 / frame_rate,
        ),
        token=token,
        mission=mission,
        preset=preset,
        settings=parse_settings(settings or []),
        give_up_after_s=give_up_after,
    )
    run = run_ros(options, say)
    delays, link = run.sent_to_map_s, run.link
    OUTPUT.print(
        f"{run.path_length_m:.1f} m driven; {link.sent} frames sent, {link.taken} in the map, "
        f"{link.dropped} overtaken, {link.refused} refused, {run.skipped} skipped, {run.unread} unread; "
        f"{run.commands_obeyed} commands obeyed, {run.commands_refused} refused, "
        f"{run.dead_man_stops} stops for silence",
        highlight=False,
        soft_wrap=True,
    )
    print_delays(delays)
    OUTPUT.print(f"mission {run.mission}: {run.ending}", highlight=False, soft_wrap=True)
    raise exit_for(run.outcome)
