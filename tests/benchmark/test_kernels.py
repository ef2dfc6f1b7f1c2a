"""`hgs bench kernels`: that it measures what it says; how fast anything is, no test may say."""

import json

import numpy as np
import pytest
import torch

import hgs_core.benchmark.kernels as benchmark
from hgs_core.benchmark.room import BenchmarkRoom
from hgs_core.benchmark.torch_tiles import TorchIteration, splat_tiles
from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.gaussians.optimise import LearningRates, LossWeights, optimise_step, time_step
from hgs_core.gaussians.render import render
from hgs_core.gaussians.torch_backend import splat
from hgs_core.native import kernels

ROOM_M = (3.0, 2.5, 2.2)


def target(room: BenchmarkRoom) -> tuple[np.ndarray, np.ndarray]:
    drawn = render(room.gaussians, *room.view(60, 34))
    return (np.clip(drawn.colour, 0, 1) * 255).astype(np.uint8), drawn.depth_m.astype(np.float32)


def test_torch_over_tiles_is_the_oracle() -> None:
    room = BenchmarkRoom.furnished(ROOM_M, 700)
    parameters = torch.from_numpy(room.gaussians.parameters[:700]).double()
    gradients = []
    for tiled in (False, True):
        own = parameters.clone().requires_grad_()
        view = room.view(60, 34)
        colour, depth, silhouette = splat_tiles(own, *view) if tiled else splat(own, own[:, :0], *view)
        (colour.square().sum() + depth.sum() + silhouette.sum()).backward()
        gradients.append((colour.detach(), depth.detach(), silhouette.detach(), own.grad))
    for truth, ours in zip(*gradients, strict=True):
        torch.testing.assert_close(ours, truth, rtol=1e-9, atol=1e-9)


def test_a_step_in_torch_lowers_its_loss() -> None:
    room = BenchmarkRoom.furnished(ROOM_M, 700)
    rgb, depth_m = target(room)
    moved = benchmark._jittered(room.gaussians, np.random.default_rng(0))
    iteration = TorchIteration(moved.parameters[:700], rgb, depth_m, *room.view(60, 34))
    losses = [iteration.step() for _ in range(20)]
    assert losses[-1] < losses[0]


def test_a_timed_step_is_a_step() -> None:
    room = BenchmarkRoom.furnished(ROOM_M, 3000)
    rgb, depth_m = target(room)
    maps: list[GaussianMap] = []
    for step in (optimise_step, time_step):
        maps.append(benchmark._jittered(room.gaussians, np.random.default_rng(0)))
        step(maps[-1], rgb, depth_m, *room.view(60, 34), weights=LossWeights(), rates=LearningRates(rgb=0.01))
    moved = np.abs(maps[0].parameters[:3000] - maps[1].parameters[:3000]).max(axis=1)
    # The loss is a mean over one pixel more, which Adam hardly notices; what lies far behind is left alone.
    assert np.mean(moved < 1e-4) > 0.9
    assert np.count_nonzero(maps[1].adam_steps[:3000]) > 500


def test_evaluations_are_pairs_of_splats_and_pixels() -> None:
    room = BenchmarkRoom.furnished(ROOM_M, 400)
    rgb, depth_m = target(room)
    camera, pose = room.view(60, 34)
    stages = time_step(
        benchmark._jittered(room.gaussians, np.random.default_rng(0)),
        rgb,
        depth_m,
        camera,
        pose,
        weights=LossWeights(),
        rates=LearningRates(),
    )
    in_camera = pose.inverse().apply(room.gaussians.centres_m.astype(float))
    front = in_camera[:, 2] > 0.1
    pixels, _ = camera.project(in_camera[front])
    reach = 3.4 * (camera.fx * room.gaussians.radii_m[front] / in_camera[front, 2] + 0.55)
    u, v = np.meshgrid(np.arange(60) + 0.5, np.arange(34) + 0.5)
    away = np.hypot(u[..., None] - pixels[:, 0], v[..., None] - pixels[:, 1])
    touched = np.count_nonzero(away < reach)
    # Not all are visible; but patches are taken whole.
    assert 0.2 * touched < stages.evaluations < 16 * touched
    assert min(stages.prepare_s, stages.forward_s, stages.backward_s, stages.step_s) > 0


def test_the_peak_counts_every_thread() -> None:
    threads = kernels.threads()
    operations = []
    for n in (1, 2):
        kernels.set_threads(n)
        operations.append(kernels.multiply_add(1000))
    kernels.set_threads(threads)
    assert operations[0] > 0
    assert operations[1] == 2 * operations[0]


def test_a_run_has_all_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(benchmark, "MAP_SIZES", (2000,))
    monkeypatch.setattr(benchmark, "IMAGE_SIZES", ((60, 34), (30, 17)))
    monkeypatch.setattr(benchmark, "TORCH_IMAGE", (30, 17))
    monkeypatch.setattr(benchmark, "PLANNER_MAP_SIZES", (3000,))
    told: list[str] = []
    figures = benchmark.run_kernel_benchmark(repeats=1, with_torch=True, progress=told.append)
    written = json.loads(figures.model_dump_json())
    assert {"cpu", "threads", "variant", "peak_gflops", "cases", "planner"} <= set(written)
    assert written["peak_gflops"] > 0.1
    assert [case["width"] for case in written["cases"]] == [60, 30]
    large, small = written["cases"]
    for key in (
        "forward_ms",
        "backward_ms",
        "iteration_ms",
        "forward_percent_of_peak",
        "backward_percent_of_peak",
    ):
        assert large[key] > 0
    assert large["torch_reference_ratio"] is None
    assert small["torch_reference_ratio"] > 0
    (planner,) = written["planner"]
    assert planner["viewpoints"] == 25
    assert min(planner["coverage_ms"], planner["quality_ms"], planner["total_ms"]) > 0
    assert len(told) == 5
