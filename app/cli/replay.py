"""`hgs replay`: a recording sent to a service as a live stream."""

from __future__ import annotations

from pathlib import Path
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
from app.cli.recordings import TopicSettings, parse_topics
from app.cli.run import parse_settings


def replay(
    source: Annotated[Path, typer.Argument(help="A folder in the TUM layout, or an MCAP file.")],
    server: ServerOption = SERVER,
    token: TokenOption = None,
    mission: MissionOption = None,
    preset: PresetOption = "best",
    settings: SettingsOption = None,
    topics: TopicSettings = None,
    speed: Annotated[
        float, typer.Option(min=0.01, max=100.0, help="So many times as fast as it was recorded.")
    ] = 1.0,
    every_frame: Annotated[
        bool,
        typer.Option(
            "--every-frame", help="Wait for the mission rather than skip frames; it may take longer."
        ),
    ] = False,
    poses: Annotated[
        bool,
        typer.Option(help="Tell the poses that the recording has; else the mission finds them by itself."),
    ] = True,
    range_m: RangeOption = 5.0,
    depth_format: Annotated[str, typer.Option(help="How depth travels: png or zstd.")] = "zstd",
    give_up_after: GiveUpOption = 60.0,
) -> None:
    """Send a recorded RGB-D stream to `hgs serve` as if it were taken now, and watch the map grow.

    Its lens is undone and its depth aligned with colour by the service. Nobody drives a recording: no plans
    are made, and the mission ends with it. Clouds of a lidar go along where the mission is made to find its
    poses by them, or where their topic is named: --topic cloud=/...

        hgs serve
        hgs replay rgbd_dataset_freiburg1_desk
        hgs replay drive.mcap --topic colour=/camera/color/image_raw/compressed --speed 2
        hgs replay drive.mcap --every-frame --no-poses --set localisation.method=lidar-odometry

    Exit codes:
    0 - the recording is over, and the mission has its results;
    2 - an option or the recording is wrong, or the service refuses it;
    4 - the service was out of reach for too long;
    130 - it was interrupted.
    """
    from app.robot.replay import ReplayOptions, run_replay
    from hgs_core.live.messages import FORMATS

    if depth_format not in FORMATS["depth"]:
        there_are = ", ".join(FORMATS["depth"])
        raise typer.BadParameter(f"{depth_format!r}: must be one of {there_are}", param_hint="--depth-format")
    run = run_replay(
        ReplayOptions(
            source=source,
            server=server,
            token=token,
            mission=mission,
            preset=preset,
            settings=parse_settings(settings or []),
            topics=parse_topics(topics),
            speed=speed,
            every_frame=every_frame,
            with_poses=poses,
            range_m=range_m,
            depth_format=depth_format,
            give_up_after_s=give_up_after,
        ),
        say,
    )
    delays, link = run.sent_to_map_s, run.link
    OUTPUT.print(
        f"{run.n_frames} frames: {link.sent} sent, {link.taken} in the map, {link.dropped} overtaken, "
        f"{link.refused} refused, {run.skipped} skipped",
        highlight=False,
    )
    if link.clouds_sent or link.clouds_lost:
        OUTPUT.print(f"{link.clouds_sent} clouds sent, {link.clouds_lost} lost", highlight=False)
    print_delays(delays)
    OUTPUT.print(f"mission {run.mission}: {run.ending}", highlight=False, soft_wrap=True)
    raise exit_for(run.outcome)
