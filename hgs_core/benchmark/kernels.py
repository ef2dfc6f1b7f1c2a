"""`hgs bench kernels`: rendering and viewpoint evaluation, against what the processor can do at most.

Times are medians of several runs of one process; ratios and shares of the peak are what can be compared.
"""

from __future__ import annotations

import itertools
import platform
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float, Float32, UInt8
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

import hgs_core.native.kernels as kernels
from hgs_core.benchmark.room import PLANNING_ROOM_M, RENDERING_ROOM_M, BenchmarkRoom
from hgs_core.errors import ConfigError
from hgs_core.gain.evaluator import PanoramaGainEvaluator
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.gsplat_backend import GsplatBackend
from hgs_core.gaussians.optimise import LearningRates, LossWeights, optimise_step, time_step
from hgs_core.gaussians.render import render
from hgs_core.geometry.camera import CameraIntrinsics
from hgs_core.geometry.se3 import SE3
from hgs_core.mapping.snapshot import MapSnapshot

MAP_SIZES: Final = (100_000, 300_000, 1_000_000)
IMAGE_SIZES: Final = ((1200, 680), (600, 340), (300, 170))
TORCH_IMAGE: Final = (300, 170)
"""Where torch is measured: larger images take it minutes."""
PLANNER_MAP_SIZES: Final = (67_000, 200_000, 668_000)
VIEWPOINTS: Final = 25
PLANNER_RANGE_M: Final = 6.0
DEPTH_NOISE_M: Final = 0.02

Progress = Callable[[str], None]


class _Figures(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class RenderingCase(_Figures):
    """One map and image size."""

    gaussians: int
    width: int
    height: int
    forward_ms: float
    """Preparing (projection, culling, sort, lists by tile) and the forward sweep."""
    backward_ms: float
    """The loss, the backward sweep, the chain to parameters and Adam."""
    iteration_ms: float
    """One whole step of optimisation."""
    prepare_ms: float
    """The preparing alone, part of `forward_ms`."""
    evaluations: float
    """(splat, pixel) pairs that a sweep goes over."""
    forward_evaluations_per_s: float
    backward_evaluations_per_s: float
    forward_percent_of_peak: float
    """Of the forward sweep alone: 11 operations an evaluation."""
    backward_percent_of_peak: float
    """Of the backward sweep alone: 33 operations an evaluation."""
    torch_reference_ratio: float | None
    """How many times as long one step takes in torch on the same processor; null where not measured."""
    gsplat_forward_ratio: float | None
    """How many times as long drawing takes with gsplat on the CUDA device; null where there is none."""


class PlannerCase(_Figures):
    """One map size: both gains of all viewpoints over the full circle, the maps gathered anew."""

    gaussians: int
    viewpoints: int
    coverage_ms: float
    """With the coverage gain alone."""
    quality_ms: float
    """With the quality gain alone."""
    total_ms: float
    """With both."""


class KernelBenchmark(_Figures):
    """Everything that one run measured."""

    cpu: str
    threads: int
    variant: str
    """Which instruction set's kernels ran."""
    peak_gflops: float
    """Multiply-adds on registers, each counted as two operations."""
    cases: list[RenderingCase]
    planner: list[PlannerCase]
    other_renderers: str
    """Which other renderers were compared, or why none was."""


def run_kernel_benchmark(*, repeats: int, with_torch: bool, progress: Progress) -> KernelBenchmark:
    """Measure everything. `repeats` runs each (their median counts); torch takes a minute."""
    progress("peak multiply-add throughput")
    peak_gflops = measure_peak_gflops()
    gsplat, other_renderers = _gsplat()
    cases = []
    for n_gaussians in MAP_SIZES:
        progress(f"making a room of {n_gaussians:,} Gaussians")
        room = BenchmarkRoom.furnished(RENDERING_ROOM_M, n_gaussians)
        for width, height in IMAGE_SIZES:
            progress(f"{n_gaussians:,} Gaussians at {width} x {height}")
            torch_too = with_torch and (width, height) == TORCH_IMAGE
            cases.append(_rendering_case(room, width, height, peak_gflops, repeats, torch_too, gsplat))
    planner = []
    for n_gaussians in PLANNER_MAP_SIZES:
        progress(f"{VIEWPOINTS} viewpoints in a room of {n_gaussians:,} Gaussians")
        planner.append(_planner_case(n_gaussians, repeats))
    return KernelBenchmark(
        cpu=processor_name(),
        threads=kernels.threads(),
        variant=kernels.variant(),
        peak_gflops=peak_gflops,
        cases=cases,
        planner=planner,
        other_renderers=other_renderers,
    )


def measure_peak_gflops() -> float:
    """The best of several runs of about a tenth of a second."""
    rounds = 1_000_000
    best = 0.0
    for _ in range(6):
        began = time.perf_counter()
        operations = kernels.multiply_add(rounds)
        spent = time.perf_counter() - began
        best = max(best, operations / spent / 1e9)
        rounds = max(1_000_000, int(rounds * 0.1 / max(spent, 1e-4)))
    return best


def processor_name() -> str:
    """As the operating system calls it."""
    path = Path("/proc/cpuinfo")
    if path.is_file():
        for line in path.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _gsplat() -> tuple[GsplatBackend | None, str]:
    """The CUDA renderer where it can run, and what is to be said of it."""
    try:
        return GsplatBackend(), "gsplat on CUDA"
    except ConfigError as error:
        return None, f"none; {error}"


def _rendering_case(
    room: BenchmarkRoom,
    width: int,
    height: int,
    peak_gflops: float,
    repeats: int,
    with_torch: bool,
    gsplat: GsplatBackend | None,
) -> RenderingCase:
    camera, pose = room.view(width, height)
    seen = render(room.gaussians, camera, pose)
    rng = np.random.default_rng(3)
    rgb = (np.clip(seen.colour, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
    depth_m = (seen.depth_m + rng.uniform(-DEPTH_NOISE_M, DEPTH_NOISE_M, seen.depth_m.shape)).astype(
        np.float32
    )
    moved = _jittered(room.gaussians, rng)
    weights, rates = LossWeights(), LearningRates()

    def step() -> None:
        optimise_step(moved, rgb, depth_m, camera, pose, weights=weights, rates=rates)

    step()
    iteration_s = _median_s(step, repeats)
    stages = [
        time_step(moved, rgb, depth_m, camera, pose, weights=weights, rates=rates) for _ in range(repeats)
    ]
    prepare_s, forward_s, backward_s, step_s = (
        float(np.median([getattr(stage, name) for stage in stages]))
        for name in ("prepare_s", "forward_s", "backward_s", "step_s")
    )
    evaluations = stages[-1].evaluations
    return RenderingCase(
        gaussians=room.gaussians.size,
        width=width,
        height=height,
        forward_ms=1e3 * (prepare_s + forward_s),
        backward_ms=1e3 * (backward_s + step_s),
        iteration_ms=1e3 * iteration_s,
        prepare_ms=1e3 * prepare_s,
        evaluations=evaluations,
        forward_evaluations_per_s=evaluations / forward_s,
        backward_evaluations_per_s=evaluations / backward_s,
        forward_percent_of_peak=evaluations * kernels.FORWARD_OPERATIONS / forward_s / peak_gflops / 1e7,
        backward_percent_of_peak=evaluations * kernels.BACKWARD_OPERATIONS / backward_s / peak_gflops / 1e7,
        torch_reference_ratio=(
            _torch_step_s(moved, rgb, depth_m, camera, pose) / iteration_s if with_torch else None
        ),
        gsplat_forward_ratio=(
            None
            if gsplat is None
            else _median_s(lambda: gsplat.forward(moved, camera, pose), repeats) / (prepare_s + forward_s)
        ),
    )


def _jittered(gaussians: GaussianMap, rng: np.random.Generator) -> GaussianMap:
    """A copy that is off by millimetres and a few grey levels, so that a step has something to do."""
    moved = GaussianMap()
    parameters = gaussians.parameters[: gaussians.size].copy()
    parameters[:, :3] += rng.normal(0, 0.002, (len(parameters), 3)).astype(np.float32)
    parameters[:, 3:6] += rng.normal(0, 0.02, (len(parameters), 3)).astype(np.float32)
    moved.append(parameters, anchor_keyframe=0)
    return moved


def _torch_step_s(
    gaussians: GaussianMap,
    rgb: UInt8[ndarray, "height width 3"],
    depth_m: Float32[ndarray, "height width"],
    camera: CameraIntrinsics,
    pose: SE3,
) -> float:
    import torch

    from hgs_core.benchmark.torch_tiles import TorchIteration

    torch.set_num_threads(kernels.threads())
    parameters = gaussians.parameters[: gaussians.size]
    iteration = TorchIteration(parameters, rgb, depth_m, camera, pose)
    iteration.step()
    return _median_s(iteration.step, 2)


def _planner_case(n_gaussians: int, repeats: int) -> PlannerCase:
    room = BenchmarkRoom.furnished(PLANNING_ROOM_M, n_gaussians)
    snapshot = room.snapshot()
    positions = room.viewpoints_m(VIEWPOINTS)
    camera = CameraIntrinsics.centred(1200, 680, 600.0)
    times = {
        name: 1e3
        * _evaluation_s(PanoramaGainEvaluator(config, camera, PLANNER_RANGE_M), snapshot, positions, repeats)
        for name, config in (
            ("coverage", GainConfig(use_quality=False)),
            ("quality", GainConfig(use_coverage=False)),
            ("total", GainConfig()),
        )
    }
    return PlannerCase(
        gaussians=n_gaussians,
        viewpoints=VIEWPOINTS,
        coverage_ms=times["coverage"],
        quality_ms=times["quality"],
        total_ms=times["total"],
    )


def _evaluation_s(
    evaluator: PanoramaGainEvaluator,
    snapshot: MapSnapshot,
    positions_m: Float[ndarray, "n 3"],
    repeats: int,
) -> float:
    """Of one evaluation for which nothing had been gathered."""
    newer = itertools.count(snapshot.version)

    def evaluate() -> None:
        evaluator.evaluate(replace(snapshot, version=next(newer)), positions_m, observed_share=0.5)

    evaluate()
    return _median_s(evaluate, repeats)


def _median_s(work: Callable[[], object], repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        spent.append(time.perf_counter() - began)
    return float(np.median(spent))
