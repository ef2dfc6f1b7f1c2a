"""`hgs bench`: what this machine attains."""

from __future__ import annotations

import os
import tempfile
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from app.cli.bench_planners import planners, tables
from app.cli.console import ERRORS, OUTPUT
from app.cli.interrupts import InterruptCommands
from app.cli.localisation_table import print_localisation
from app.cli.progress import MissionProgress
from app.cli.recordings import TopicSettings, parse_topics
from app.cli.run import parse_settings

if TYPE_CHECKING:
    from pydantic import BaseModel

    from hgs_core.benchmark.ablation import AblationRow
    from hgs_core.benchmark.gains import GainBenchmark
    from hgs_core.benchmark.kernels import KernelBenchmark
    from hgs_core.benchmark.mission import MissionBenchmark
    from hgs_core.benchmark.recording import RecordingBenchmark

bench = typer.Typer(no_args_is_help=True, help="Measure what this machine attains.")
bench.command()(planners)
bench.command()(tables)

JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the figures here.")]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the preset; may be repeated."),
]
Threads = Annotated[int, typer.Option(min=1, help="Threads of the kernels.", show_default="all processors")]


@bench.command()
def kernels(
    json: JsonFile = None,
    threads: Threads = os.cpu_count() or 1,
    repeats: Annotated[int, typer.Option(min=1, help="Runs of each; their median counts.")] = 9,
    torch: Annotated[bool, typer.Option(help="Compare with torch, which takes a minute.")] = True,
) -> None:
    """Measure rendering, optimisation and viewpoint evaluation against the processor's own peak.

    Times depend on what else the machine does: compare the ratios and the shares of the peak.
    HGS_KERNEL_VARIANT=portable, avx2 or avx512 chooses the instruction set. Exit code 0.
    """
    from hgs_core.benchmark.kernels import run_kernel_benchmark
    from hgs_core.native import kernels as native

    native.set_threads(threads)
    with ERRORS.status("measuring") as status:
        figures = run_kernel_benchmark(repeats=repeats, with_torch=torch, progress=status.update)
    _print_kernels(figures)
    write_figures(figures, json)


@bench.command()
def mission(
    scene: Annotated[str, typer.Option(help="house, building, NAME:SEED, or a mesh file.")],
    preset: Annotated[str, typer.Option(help="Mission preset; `hgs presets` lists them.")] = "paper",
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same trajectory.")] = 0,
    max_time: Annotated[
        float | None, typer.Option(min=0.0, metavar="S", help="Simulated seconds after which to stop.")
    ] = None,
    settings: Settings = None,
    json: JsonFile = None,
) -> None:
    """Run a mission and tell how long its planning cycles and frames took, and how that grew.

    The mission's folder is thrown away; `hgs run` keeps one. Ctrl-C ends the mission and tells what there is.
    Exit codes: 0 measured, 2 an option, preset or scene is wrong.
    """
    overrides = parse_settings(settings or [])
    from hgs_core.benchmark.mission import run_mission_benchmark
    from hgs_core.mission.request import MissionRequest

    with tempfile.TemporaryDirectory(prefix="hgs-bench-") as folder:
        request = MissionRequest(
            scene=scene,
            preset=preset,
            seed=seed,
            out=Path(folder) / "run",
            max_time_s=max_time,
            overrides=overrides,
        )
        progress = MissionProgress(ERRORS)
        with progress, InterruptCommands(progress.say) as commands:
            figures = run_mission_benchmark(request, observer=progress, commands=commands)
    _print_mission(figures)
    write_figures(figures, json)


@bench.command()
def gains(
    scene: Annotated[str, typer.Option(help="house, building, NAME:SEED, or a mesh file.")],
    preset: Annotated[str, typer.Option(help="Mission preset; `hgs presets` lists them.")] = "paper",
    seed: Annotated[int, typer.Option(min=0, help="Of the mission and of the views.")] = 0,
    until: Annotated[
        float, typer.Option(min=1.0, metavar="S", help="Simulated seconds after which the map is taken.")
    ] = 60.0,
    views: Annotated[int, typer.Option(min=20, help="Views that are scored both ways.")] = 60,
    settings: Settings = None,
    json: JsonFile = None,
) -> None:
    """Run a mission for a while and tell whether the planner's gains rank views as the exact scores do.

    Exact means: from every pixel of the full image (quality), or from slices of it drawn to every depth
    (coverage). Views stand where the planner's candidates stood and look anywhere. A few seconds a view.
    Exit codes: 0 measured, 2 an option, preset or scene is wrong, or the time too short.
    """
    overrides = parse_settings(settings or [])
    from hgs_core.benchmark.gains import run_gain_benchmark
    from hgs_core.mission.request import MissionRequest

    request = MissionRequest(
        scene=scene, preset=preset, seed=seed, out=Path(), max_time_s=until, overrides=overrides
    )
    progress = MissionProgress(ERRORS)
    with progress, InterruptCommands(progress.say) as commands:
        figures = run_gain_benchmark(
            request, n_views=views, observer=progress, commands=commands, progress=progress.say
        )
    _print_gains(figures)
    write_figures(figures, json)


@bench.command()
def ablation(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder that `hgs run` left behind.")],
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="One mechanism to switch off; may be repeated.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, help="Map every n-th frame, with the steps of n.")] = 3,
    settings: Settings = None,
    json: JsonFile = None,
) -> None:
    """Map the frames of a finished run again, with each mechanism of the mapper off, one at a time.

    All maps see the same frames with the same noise and are compared with the true scene on the same held-out
    views. Takes some minutes a map. Exit codes: 0 measured, 2 the folder is not a run's, or a name is wrong.
    """
    from hgs_core.benchmark.ablation import ABLATIONS, AS_IT_IS, run_ablation
    from hgs_core.evaluation.trajectory import read_trajectory
    from hgs_core.mission.finished_run import FinishedRun

    run = FinishedRun.open(folder, parse_settings(settings or []))
    scene = run.open_scene()
    with ERRORS.status("opening the run") as status:
        rows = run_ablation(
            run.config,
            scene,
            read_trajectory(folder / "trajectory.txt").poses,
            start_xy=run.start_xy,
            every=every,
            names=only or [name for name in ABLATIONS if name != AS_IT_IS],
            progress=status.update,
        )
    _print_ablation(rows)
    if json is not None:
        rows_json = [row.model_dump() for row in rows]
        json.write_text(dumps(rows_json, indent=2) + "\n", encoding="utf-8")
        OUTPUT.print(f"figures: {json}", highlight=False, soft_wrap=True)


@bench.command()
def recording(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="RECORDING",
            help="TUM layout (rgb.txt, depth.txt, groundtruth.txt, intrinsics.json), or a ROS 2 file .mcap.",
        ),
    ],
    preset: Annotated[str, typer.Option(help="Mission preset whose mapping is measured.")] = "paper",
    hold_out: Annotated[
        int, typer.Option(min=2, metavar="N", help="Every N-th frame is kept from the map, and measured.")
    ] = 5,
    threads: Annotated[
        int | None, typer.Option(min=1, help="Threads of the kernels.", show_default="the preset's, 2")
    ] = None,
    settings: Settings = None,
    topics: TopicSettings = None,
    json: JsonFile = None,
) -> None:
    """Map a recorded RGB-D sequence with known poses, and tell how the map shows frames that it never got.

    Beside it, the same with a plain SplaTAM-like configuration (preset `splatam`; --set changes both). The
    recording is played as if a frame came every `sensor.camera.frame_interval_s`, so each gets as many steps
    of optimisation as a mission's: `mapping.iterations_per_s` times that. Times depend on what else the
    machine does. Exit codes: 0 measured, 2 an option, preset or the recording is wrong.
    """
    overrides = parse_settings(settings or [])
    if threads is not None:
        overrides["threads"] = str(threads)
    from hgs_core.benchmark.recording import run_recording_benchmark

    with ERRORS.status("mapping") as status:
        figures = run_recording_benchmark(
            folder,
            preset=preset,
            hold_out=hold_out,
            overrides=overrides,
            progress=status.update,
            topics=parse_topics(topics),
        )
    _print_recording(figures)
    write_figures(figures, json)


@bench.command()
def localisation(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SOURCE",
            help="A folder that `hgs run` left behind, or a recording with poses (TUM layout, or .mcap).",
        ),
    ],
    method: Annotated[str, typer.Option(help="given, rgbd-odometry or lidar-odometry.")],
    interval: Annotated[
        float, typer.Option(metavar="S", help="Along a run's path, so long between two frames.")
    ] = 0.2,
    maps: Annotated[
        bool,
        typer.Option(
            "--maps", help="Also map a run's frames from the poses found, and tell what the errors cost."
        ),
    ] = False,
    settings: Settings = None,
    topics: TopicSettings = None,
    json: JsonFile = None,
) -> None:
    """Localise the camera along a known path, and tell how far off that is: ATE, RPE and drift.

    A run's path is driven again with its camera's noise and, for lidar-odometry, with a simulated VLP-16; no
    method sees the true poses, which the errors are taken against. --set changes the method's settings. Exit
    codes: 0 measured, 2 an option or the source is wrong.
    """
    overrides = parse_settings(settings or [])
    from hgs_core.benchmark.localisation import localisation_settings, run_localisation_benchmark

    config = localisation_settings(method, overrides)
    with ERRORS.status("localising") as status:
        figures = run_localisation_benchmark(
            source,
            config,
            interval_s=interval,
            topics=parse_topics(topics),
            with_maps=maps,
            progress=status.update,
        )
    print_localisation(figures)
    write_figures(figures, json)


def write_figures(figures: BaseModel, path: Path | None) -> None:
    """As `--json` asks, and say where."""
    if path is not None:
        path.write_text(figures.model_dump_json(indent=2) + "\n", encoding="utf-8")
        OUTPUT.print(f"figures: {path}", highlight=False, soft_wrap=True)


def _print_kernels(figures: KernelBenchmark) -> None:
    OUTPUT.print(
        f"{figures.cpu}, {figures.threads} threads, {figures.variant}: "
        f"{figures.peak_gflops:.0f} GFLOP/s multiply-add peak",
        highlight=False,
    )
    table = Table(title="rendering", title_justify="left")
    for name in ("Gaussians", "image", "forward ms", "backward ms", "iteration ms", "10^9 evaluations/s"):
        table.add_column(name, justify="right")
    table.add_column("% of peak, forward", justify="right")
    table.add_column("% of peak, backward", justify="right")
    table.add_column("torch takes", justify="right")
    for case in figures.cases:
        table.add_row(
            f"{case.gaussians:,}",
            f"{case.width} x {case.height}",
            f"{case.forward_ms:.1f}",
            f"{case.backward_ms:.1f}",
            f"{case.iteration_ms:.1f}",
            f"{case.forward_evaluations_per_s / 1e9:.1f}",
            f"{case.forward_percent_of_peak:.0f}",
            f"{case.backward_percent_of_peak:.0f}",
            "-" if case.torch_reference_ratio is None else f"{case.torch_reference_ratio:.0f} times as long",
        )
    OUTPUT.print(table)
    OUTPUT.print(f"other renderers: {figures.other_renderers}", highlight=False, markup=False, soft_wrap=True)
    table = Table(title="viewpoint evaluation, the full circle each", title_justify="left")
    for name in ("Gaussians", "viewpoints", "coverage ms", "quality ms", "both ms"):
        table.add_column(name, justify="right")
    for row in figures.planner:
        table.add_row(
            f"{row.gaussians:,}",
            str(row.viewpoints),
            f"{row.coverage_ms:.1f}",
            f"{row.quality_ms:.1f}",
            f"{row.total_ms:.1f}",
        )
    OUTPUT.print(table)


def _print_mission(figures: MissionBenchmark) -> None:
    OUTPUT.print(
        f"{figures.scene}, {figures.preset}, seed {figures.seed}: {figures.stop_reason} after "
        f"{figures.cycles} planning cycles and {figures.frames} frames; {figures.threads} threads, "
        f"{figures.variant}",
        highlight=False,
        soft_wrap=True,
    )
    table = Table("", "median ms", "95th percentile ms")
    for name, spread in (
        ("T_P, a planning cycle", figures.planning_ms),
        ("T_VE, evaluating viewpoints", figures.viewpoint_evaluation_ms),
        ("T_LP, local tour and path", figures.local_ms),
        ("T_GP, survey and global tour", figures.global_ms),
        ("mapping a frame", figures.mapping_ms),
    ):
        table.add_row(name, _ms(spread.median), _ms(spread.p95))
    OUTPUT.print(table)
    table = Table(title="as the map grows", title_justify="left")
    for name in (
        "until s",
        "Gaussians",
        "observed m3",
        "T_P median ms",
        "T_GP median ms",
        "mapping median ms",
    ):
        table.add_column(name, justify="right")
    for part in figures.parts:
        table.add_row(
            f"{part.until_s:.0f}",
            f"{part.n_gaussians:,}",
            f"{part.observed_volume_m3:.0f}",
            _ms(part.planning_ms.median),
            _ms(part.global_ms.median),
            _ms(part.mapping_ms.median),
        )
    OUTPUT.print(table)


def _print_gains(figures: GainBenchmark) -> None:
    OUTPUT.print(
        f"{figures.scene}, {figures.preset}, seed {figures.seed}: {figures.n_views} views in the map after "
        f"{figures.time_s:.0f} s, {figures.n_gaussians:,} Gaussians",
        highlight=False,
        soft_wrap=True,
    )
    table = Table("", "rank correlation", "of views that gain anything", "best of 20 among the first three")
    for name, fidelity in (("coverage", figures.coverage), ("quality", figures.quality)):
        table.add_row(
            name,
            f"{fidelity.spearman:.3f}",
            f"{fidelity.spearman_gaining:.3f} of {fidelity.n_gaining}",
            f"{100 * fidelity.best_among_first:.0f} %",
        )
    OUTPUT.print(table)


def _print_ablation(rows: list[AblationRow]) -> None:
    table = Table(
        "", "PSNR dB", "SSIM", "depth cm", "accuracy cm", "completion cm", "ratio", "Gaussians", "s a frame"
    )
    for row in rows:
        table.add_row(
            row.name,
            f"{row.psnr_db:.2f}",
            f"{row.ssim:.3f}",
            f"{row.median_depth_error_cm:.2f}",
            f"{row.accuracy_cm:.2f}",
            f"{row.completion_cm_observable:.2f}",
            f"{row.completion_ratio_observable:.3f}",
            f"{row.n_gaussians:,}",
            f"{row.mapping_s_per_frame:.2f}",
        )
    OUTPUT.print(table)


def _print_recording(figures: RecordingBenchmark) -> None:
    ours, baseline = figures.ours, figures.baseline
    OUTPUT.print(
        f"{figures.recording}: {ours.frames} frames mapped, every {figures.hold_out}th of all held out "
        f"({ours.held_out.n_frames}); {figures.threads} threads, {figures.variant}",
        highlight=False,
        soft_wrap=True,
    )
    table = Table("held-out frames", title_justify="left")
    table.add_column(ours.preset, justify="right")
    table.add_column(baseline.preset, justify="right")
    table.add_column("", justify="right")
    mine, theirs = ours.held_out, baseline.held_out
    for name, a, b, form, as_ratio in (
        ("PSNR dB", mine.psnr_db, theirs.psnr_db, ".2f", False),
        ("SSIM", mine.ssim, theirs.ssim, ".3f", False),
        ("PSNR dB, all measured pixels", mine.psnr_db_measured, theirs.psnr_db_measured, ".2f", False),
        ("SSIM, all measured pixels", mine.ssim_measured, theirs.ssim_measured, ".3f", False),
        ("share of them covered", mine.covered_share, theirs.covered_share, ".3f", False),
        ("depth L1 cm", mine.depth_l1_cm, theirs.depth_l1_cm, ".2f", True),
        ("median depth error cm", mine.median_depth_error_cm, theirs.median_depth_error_cm, ".2f", True),
        ("frames/s, mapping alone", ours.frames_per_s, baseline.frames_per_s, ".1f", True),
        ("processor time s", ours.mapping_cpu_s, baseline.mapping_cpu_s, ".1f", True),
        ("peak memory MiB", ours.peak_rss_mib, baseline.peak_rss_mib, ".0f", True),
        ("Gaussians", ours.n_gaussians, baseline.n_gaussians, ",", True),
        ("optimisation steps", ours.iterations, baseline.iterations, ",", True),
    ):
        if a is None or b is None:
            table.add_row(name, *("-" if value is None else f"{value:{form}}" for value in (a, b)), "-")
            continue
        beside = ("-" if b == 0 else f"x {a / b:.2f}") if as_ratio else f"{a - b:+{form}}"
        table.add_row(name, f"{a:{form}}", f"{b:{form}}", beside)
    OUTPUT.print(table)


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}"
