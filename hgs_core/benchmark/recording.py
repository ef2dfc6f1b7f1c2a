"""`hgs bench recording`: mapping a recorded RGB-D sequence, against a plain SplaTAM-like configuration.

Every n-th frame is held out: the mapper never gets it, and the map is measured by how it shows it. Each
configuration runs in a process of its own, so that one's peak memory does not hide the other's.
"""

from __future__ import annotations

import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float32
from numpy import ndarray
from pydantic import BaseModel, ConfigDict

import hgs_core.native.kernels as kernels
from hgs_core.benchmark.kernels import processor_name
from hgs_core.errors import ConfigError, MapError
from hgs_core.evaluation.images import masked_mean, psnr_db, ssim_map
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.render import render
from hgs_core.mission.build import build_mapper
from hgs_core.mission.config import resolve_mission_config
from hgs_core.sensing.frame import Frame
from hgs_core.sensing.recording import RecordedSequence
from hgs_core.sensing.ros.topics import TopicOptions

BASELINE: Final = "splatam"
"""The mission preset whose mapping is compared with."""
COVERED: Final = 0.5
"""Pixels of which the map draws at least this much count as covered."""
_MAPPER_SEED: Final = 0
_SPAWN: Final = multiprocessing.get_context("spawn")
_PROCESS_STATUS: Final = Path("/proc/self/status")


class _Figures(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class HeldOutFigures(_Figures):
    """How the map shows the frames that it never got; null where there was no pixel to compare.

    Means of the frames' figures, over pixels with a measured depth within the camera's range.
    """

    n_frames: int
    covered_share: float
    """Of the measured pixels, how many the map covers (a silhouette of at least 0.5)."""
    psnr_db: float | None
    """Over the measured pixels that the map covers."""
    ssim: float | None
    psnr_db_measured: float | None
    """Over all measured pixels: where the map draws nothing at all, black is compared."""
    ssim_measured: float | None
    depth_l1_cm: float | None
    """Mean absolute difference of rendered and measured depth, over covered pixels."""
    median_depth_error_cm: float | None
    """Median of it over the covered pixels of all frames. The sensor's own noise is in both."""


class RecordingMap(_Figures):
    """What one configuration made of the recording."""

    preset: str
    frames: int
    """That were mapped."""
    iterations: int
    """Steps of optimisation, over all frames."""
    mapping_s: float
    """Wall time of the mapper alone: reading images and measuring the result are left out."""
    mapping_cpu_s: float
    """Processor time of the mapper, of all threads: depends less on what else the machine does."""
    frames_per_s: float
    """By wall time."""
    peak_rss_mib: float
    """Largest resident memory of the process, up to the end of mapping [MiB]; the interpreter is in it."""
    n_gaussians: int
    held_out: HeldOutFigures


class RecordingBenchmark(_Figures):
    """A configuration of this project and a plain SplaTAM-like one on the same recording."""

    cpu: str
    threads: int
    variant: str
    """Which instruction set's kernels ran."""
    recording: str
    """Name of its folder."""
    hold_out: int
    """Every so many-th frame was held out."""
    frame_interval_s: float
    """The recording was played with so long a time [s] between two mapped frames."""
    ours: RecordingMap
    baseline: RecordingMap


def run_recording_benchmark(
    folder: Path,
    *,
    preset: str,
    hold_out: int,
    overrides: dict[str, str],
    progress: Callable[[str], None],
    topics: TopicOptions | None = None,
) -> RecordingBenchmark:
    """Map the recording twice, with `preset` and with `splatam`, `overrides` changing both.

    It is a folder in the TUM layout or an MCAP file, whose `topics` may be named. Of the presets, the
    sections mapping, voxels, sensor.camera (range and interval) and threads count. Raises `StreamError` for a
    recording that cannot be read, `ConfigError` for a preset, an override or a `hold_out` that leaves nothing
    to map or to measure, and `MapError` when a process ends without an answer.
    """
    config = resolve_mission_config(preset, overrides)
    n_frames = len(RecordedSequence(folder, topics))
    if not 2 <= hold_out <= n_frames:
        raise ConfigError(
            f"--hold-out {hold_out}: {folder.name} has {n_frames} frames, so hold out every 2nd to every "
            f"{n_frames}th of them"
        )
    maps = []
    for name in (preset, BASELINE):
        progress(f"{n_frames} frames of {folder.name} with preset {name}")
        maps.append(_in_own_process(folder, name, overrides, hold_out, topics))
    return RecordingBenchmark(
        cpu=processor_name(),
        threads=config.threads,
        variant=kernels.variant(),
        recording=folder.name,
        hold_out=hold_out,
        frame_interval_s=config.sensor.camera.frame_interval_s,
        ours=maps[0],
        baseline=maps[1],
    )


def map_recording(
    folder: Path,
    preset: str,
    overrides: dict[str, str],
    hold_out: int,
    topics: TopicOptions | None = None,
) -> RecordingMap:
    """Map all frames but every `hold_out`-th, and measure the map at those. Sets the kernels' threads."""
    config = resolve_mission_config(preset, overrides)
    kernels.set_threads(config.threads)
    sequence = RecordedSequence(folder, topics)
    range_m = config.sensor.camera.range_m
    with tempfile.TemporaryDirectory(prefix="hgs-bench-") as keyframes:
        mapper = build_mapper(
            config, region=None, keyframe_folder=Path(keyframes), rng=np.random.default_rng(_MAPPER_SEED)
        )
        frames, iterations, mapping_s, mapping_cpu_s = 0, 0, 0.0, 0.0
        for frame in played_frames(sequence, hold_out, config.sensor.camera.frame_interval_s):
            frame = _within_range(frame, range_m)
            began, began_cpu = time.perf_counter(), time.process_time()
            mapper.integrate(frame)
            iterations += mapper.optimise(interrupted=lambda: False)
            mapping_s += time.perf_counter() - began
            mapping_cpu_s += time.process_time() - began_cpu
            frames += 1
        peak_rss_mib = _peak_rss_mib()
        held_out = (frame for frame in sequence if is_held_out(frame, hold_out))
        return RecordingMap(
            preset=preset,
            frames=frames,
            iterations=iterations,
            mapping_s=mapping_s,
            mapping_cpu_s=mapping_cpu_s,
            frames_per_s=frames / mapping_s,
            peak_rss_mib=peak_rss_mib,
            n_gaussians=mapper.gaussians.size,
            held_out=_measure(mapper.gaussians, (_within_range(frame, range_m) for frame in held_out)),
        )


def is_held_out(frame: Frame, hold_out: int) -> bool:
    """Whether this is the last of `hold_out` frames: the first frame of a recording is always mapped."""
    return frame.sequence % hold_out == hold_out - 1


def played_frames(sequence: RecordedSequence, hold_out: int, interval_s: float) -> Iterator[Frame]:
    """The frames to map, as if one came every `interval_s`: each pays for as many steps of optimisation as a
    mission's does, however fast the recording was."""
    mapped = (frame for frame in sequence if not is_held_out(frame, hold_out))
    for number, frame in enumerate(mapped):
        yield replace(frame, timestamp_s=number * interval_s)


def _in_own_process(
    folder: Path, preset: str, overrides: dict[str, str], hold_out: int, topics: TopicOptions | None
) -> RecordingMap:
    with ProcessPoolExecutor(1, mp_context=_SPAWN) as process:
        try:
            return process.submit(map_recording, folder, preset, overrides, hold_out, topics).result()
        except BrokenProcessPool as error:
            raise MapError(
                f"the process that mapped {folder.name} with preset {preset!r} ended without an answer: "
                "probably the memory ran out; lower mapping.max_gaussians"
            ) from error


def _within_range(frame: Frame, range_m: float) -> Frame:
    """What lies farther counts as nothing within range, as with the simulated camera."""
    return replace(
        frame, depth_m=np.where(frame.depth_m > range_m, np.float32(np.inf), frame.depth_m).astype(np.float32)
    )


def _peak_rss_mib() -> float:
    """Of this program. `getrusage` would also count its parent's memory at the moment that it was spawned."""
    for line in _PROCESS_STATUS.read_text(encoding="ascii", errors="replace").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024.0
    raise MapError(f"{_PROCESS_STATUS} does not tell the peak memory: this benchmark needs Linux")


def _measure(gaussians: GaussianMap, frames: Iterator[Frame]) -> HeldOutFigures:
    shares, colours, depth_errors = [], [], []
    for frame in frames:
        view = render(gaussians, frame.intrinsics, frame.T_world_camera)
        observed = frame.rgb.astype(np.float32) / np.float32(255.0)
        colour = np.clip(view.colour, 0.0, 1.0)
        similarity = ssim_map(colour, observed)
        measured = (frame.depth_m > 0) & np.isfinite(frame.depth_m)
        covered = measured & (view.silhouette >= COVERED)
        shares.append(covered.sum() / max(measured.sum(), 1))
        colours.append(
            (
                psnr_db(colour, observed, covered),
                masked_mean(similarity, covered),
                psnr_db(colour, observed, measured),
                masked_mean(similarity, measured),
            )
        )
        depth_errors.append(np.abs(view.depth_m - frame.depth_m)[covered])
    psnr, ssim, psnr_measured, ssim_measured = (_mean(column) for column in np.array(colours).T)
    return HeldOutFigures(
        n_frames=len(shares),
        covered_share=float(np.mean(shares)),
        psnr_db=psnr,
        ssim=ssim,
        psnr_db_measured=psnr_measured,
        ssim_measured=ssim_measured,
        depth_l1_cm=_cm(_mean(np.array([_mean_of_pixels(errors) for errors in depth_errors]))),
        median_depth_error_cm=_cm(_median(np.concatenate(depth_errors))),
    )


def _mean(figures: ndarray) -> float | None:
    """Of those frames that had any pixel to compare."""
    known = figures[~np.isnan(figures)]
    return float(np.mean(known)) if known.size else None


def _mean_of_pixels(errors: Float32[ndarray, " n"]) -> float:
    return float(np.mean(errors, dtype=float)) if errors.size else float("nan")


def _median(errors: Float32[ndarray, " n"]) -> float | None:
    return float(np.median(errors)) if errors.size else None


def _cm(metres: float | None) -> float | None:
    return None if metres is None else 100.0 * metres
