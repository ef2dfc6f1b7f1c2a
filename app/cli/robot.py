"""`hgs robot`: a robot that connects to a service, simulated from its wheels to its network."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode
from app.cli.live_missions import (
    SERVER,
    GiveUpOption,
    MissionOption,
    PresetOption,
    ServerOption,
    SettingsOption,
    print_delays,
    say,
)
from app.cli.report_table import report_table
from app.cli.run import parse_settings

if TYPE_CHECKING:
    from app.robot.options import RobotOptions

_FAULTS = "Faults"
_RECORDINGS = "Recordings"


def robot(
    server: ServerOption = SERVER,
    token: Annotated[
        str | None,
        typer.Option(
            envvar="HGS_OPERATOR_TOKEN",
            help="An operator's token, where the service asks for one; a robot's is enough with --mission.",
            show_default=False,
        ),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            help="Where the robot is: what `hgs run` takes; `hgs scenes` lists.", show_default=False
        ),
    ] = None,
    vehicle: Annotated[str, typer.Option(help="differential, ackermann or holonomic.")] = "differential",
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; must be absent or empty.", show_default=False)
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Noise and faults draw from it.")] = 0,
    mission: MissionOption = None,
    preset: PresetOption = "paper",
    settings: SettingsOption = None,
    sensor: Annotated[str, typer.Option(help="Preset of camera and scanner.")] = "rgbd_5m_small",
    frame_rate: Annotated[
        float, typer.Option(min=0.1, max=60.0, metavar="HZ", help="Frames a second.")
    ] = 2.5,
    depth_format: Annotated[str, typer.Option(help="How depth travels: png or zstd.")] = "png",
    give_up_after: GiveUpOption = 60.0,
    evaluate: Annotated[
        bool, typer.Option(help="Compare the finished map with the true scene; takes up to a minute.")
    ] = True,
    wheel_slip: Annotated[
        float,
        typer.Option(
            min=0.0, max=0.9, help="A wheel loses up to this share of its motion.", rich_help_panel=_FAULTS
        ),
    ] = 0.0,
    pose_drift: Annotated[
        tuple[float, float],
        typer.Option(
            metavar="PERCENT DEG",
            help="The robot's idea of its pose drifts: by this share of the first metre and by so many "
            "degrees on it (standard deviations of a random walk).",
            rich_help_panel=_FAULTS,
        ),
    ] = (0.0, 0.0),
    depth_holes: Annotated[
        float,
        typer.Option(
            min=0.0, max=0.9, help="Share of the depth image that is missing.", rich_help_panel=_FAULTS
        ),
    ] = 0.0,
    latency: Annotated[
        float,
        typer.Option(
            min=0.0, max=60.0, metavar="S", help="Every message takes so long.", rich_help_panel=_FAULTS
        ),
    ] = 0.0,
    drop_frames: Annotated[
        float, typer.Option(min=0.0, max=1.0, help="Share of frames that get lost.", rich_help_panel=_FAULTS)
    ] = 0.0,
    reorder_frames: Annotated[
        float,
        typer.Option(
            min=0.0, max=1.0, help="Share of frames that the next one overtakes.", rich_help_panel=_FAULTS
        ),
    ] = 0.0,
    clock_offset: Annotated[
        float,
        typer.Option(metavar="S", help="The robot's clock is so far ahead.", rich_help_panel=_FAULTS),
    ] = 0.0,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Render the frames along a path into DIR, and do nothing else.",
            rich_help_panel=_RECORDINGS,
            show_default=False,
        ),
    ] = None,
    along: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR|FILE",
            help="With --record: the folder of a run, or a trajectory in the TUM layout.",
            rich_help_panel=_RECORDINGS,
            show_default=False,
        ),
    ] = None,
    recorded: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Send the frames in DIR: a camera that is carried along where that path went.",
            rich_help_panel=_RECORDINGS,
            show_default=False,
        ),
    ] = None,
) -> None:
    """Be a robot: connect to `hgs serve`, send frames, drive where the mission says, and stand when nobody
    talks to it.

    It is a program with a clock, a body and faults of its own, and tells the service nothing that a real
    robot could not. docs/robots.md has the protocol, for a robot of your own.

        hgs serve
        hgs robot --scene house --out seen
        hgs robot --scene house --vehicle ackermann --wheel-slip 0.1 --pose-drift 0.5 0.1 --out seen

    Large frames are rendered beforehand, along the path of a run, and sent at their rate:

        hgs robot --record frames --along run1 --scene house --sensor rgbd_5m --frame-rate 5
        hgs robot --recorded frames --out seen

    Ctrl-C lets the robot stand and leave; the mission is left to its operator.

    Exit codes:
    0 - the mission is over, and the results are written;
    2 - an option is wrong, or the service refuses the robot;
    4 - the mission failed, or the service was out of reach for too long;
    130 - the robot was interrupted.
    """
    from app.robot.link_faults import LinkFaults
    from app.robot.options import VEHICLES, RobotOptions
    from hgs_core.live.messages import FORMATS
    from hgs_core.simulation.driven_world import BodyFaults

    for value, option, allowed in (
        (vehicle, "--vehicle", tuple(VEHICLES)),
        (depth_format, "--depth-format", FORMATS["depth"]),
    ):
        if value not in allowed:
            raise typer.BadParameter(f"{value!r}: must be one of {', '.join(allowed)}", param_hint=option)
    percent, degrees = pose_drift
    if not (0.0 <= percent < 100.0 and 0.0 <= degrees < 90.0):
        raise typer.BadParameter(
            f"{percent} {degrees}: expected 0 or more of each", param_hint="--pose-drift"
        )
    options = RobotOptions(
        server=server,
        out=out or Path(),
        token=token,
        mission=mission,
        scene=scene,
        vehicle=vehicle,
        seed=seed,
        preset=preset,
        settings=parse_settings(settings or []),
        sensor=sensor,
        frame_rate_hz=frame_rate,
        depth_format=depth_format,
        recorded=recorded,
        body_faults=BodyFaults(
            wheel_slip=wheel_slip, drift_percent=percent, drift_deg_per_m=degrees, depth_holes=depth_holes
        ),
        link_faults=LinkFaults(latency_s=latency, drop_frames=drop_frames, reorder_frames=reorder_frames),
        clock_offset_s=clock_offset,
        give_up_after_s=give_up_after,
        evaluate=evaluate,
    )
    if record is not None:
        if along is None or scene is None:
            raise typer.BadParameter(
                "needs --along and --scene: what is seen, and from where", param_hint="--record"
            )
        _record(options, record, along, scene)
        return
    if out is None:
        raise typer.BadParameter("is missing: where the results go", param_hint="--out")
    raise typer.Exit(_run(options))


def _run(options: RobotOptions) -> ExitCode:
    from app.robot.outcome import Outcome
    from app.robot.program import run_robot

    run = run_robot(options, say)
    OUTPUT.print(report_table(run.report))
    delays = run.robot.sent_to_map_s
    print_delays(delays)
    OUTPUT.print(f"results: {options.out}", highlight=False, soft_wrap=True)
    if run.outcome is Outcome.INTERRUPTED:
        say(
            "the mission goes on without its robot: stop it on the operator page, or send a robot with "
            "--mission"
        )
        return ExitCode.INTERRUPTED
    failed = run.outcome is Outcome.GIVEN_UP or run.report.stop_reason == "failed"
    return ExitCode.FAILED if failed else ExitCode.COMPLETE


def _record(options: RobotOptions, folder: Path, along: Path, source: str) -> None:
    import numpy as np

    from app.robot.program import region_of
    from app.robot.recording import record
    from hgs_core.evaluation.trajectory import read_trajectory
    from hgs_core.scene.scene import open_scene
    from hgs_core.simulation.depth_holes import DepthHoles

    config = options.config()
    path = read_trajectory(along / "trajectory.txt" if along.is_dir() else along)
    scene = open_scene(source, config.scene, radius_m=config.robot.radius_m, height_m=config.robot.height_m)
    noise_seed, holes_seed = np.random.SeedSequence(options.seed).spawn(2)
    holes = DepthHoles(options.body_faults.depth_holes, np.random.default_rng(holes_seed))
    with ERRORS.status("rendering") as status:
        n_frames = record(
            scene,
            source,
            path,
            folder,
            camera=config.sensor.camera,
            scanner=config.sensor.scanner,
            region_m=region_of(scene),
            depth_format=options.depth_format,
            holes=holes,
            rng=np.random.default_rng(noise_seed),
            progress=lambda k, n: status.update(f"rendering frame {k + 1} of {n}"),
        )
    OUTPUT.print(f"{n_frames} frames: {folder}", highlight=False, soft_wrap=True)
