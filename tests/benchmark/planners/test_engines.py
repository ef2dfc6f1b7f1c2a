"""Cells in processes of their own: on this machine, on a Ray, and with equal figures on both."""

import filecmp
import json
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import psutil
import pytest

from hgs_core.benchmark.planners import ray_engine
from hgs_core.benchmark.planners.cell import CellFiles, CellStatus
from hgs_core.benchmark.planners.engine import Engine, ProcessEngine
from hgs_core.benchmark.planners.fingerprint import source_version
from hgs_core.benchmark.planners.grid import GridRequest, plan_cells
from hgs_core.benchmark.planners.outputs import write_outputs
from hgs_core.benchmark.planners.ray_engine import RayEngine
from hgs_core.benchmark.planners.run import run_grid
from hgs_core.benchmark.planners.task import CellTask
from hgs_core.errors import ConfigError
from hgs_core.mission.versions import software_versions
from hgs_core.native import kernels
from tests.benchmark.planners.fake_cells import DYING, FAILING, HANGING, RUNNER, Watcher, asked, run_fake_grid
from tests.scene.worlds import room, textured, y_up

FIGURES = ("path_length_m", "sim_time_s", "n_gaussians", "accuracy_cm", "completion_cm", "psnr_db", "ssim")


@pytest.fixture(autouse=True)
def _children_find_the_tests(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(repository))


@pytest.fixture(scope="module")
def ray(repository: Path) -> Iterator[RayEngine]:
    """A Ray of its own on this machine, one processor."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("PYTHONPATH", str(repository))
        engine = RayEngine("local", threads=1, slots=1)
        yield engine
        engine.close()


def task(folder: Path, seed: int) -> CellTask:
    return CellTask(
        name=f"seed {seed}",
        scene="house",
        preset="robust",
        planner="paper",
        seed=seed,
        overrides={},
        out=str(folder / "cell"),
        log=str(folder / "cell.log"),
        threads=1,
        kernel_variant=kernels.variant(),
        versions=software_versions(),
        commit=source_version(),
        runner=RUNNER,
    )


def gone(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def within(seconds: float, condition: object) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.05)
    return False


def test_a_process_answers_for_every_end_of_its_cell(tmp_path: Path) -> None:
    request, cells = asked(tmp_path, planners=["paper"], seeds=[0, FAILING, DYING])
    seen = run_fake_grid(request, cells, ProcessEngine(slots=2))
    results = {result.key.seed: result for result in seen.ended}
    assert results[0].status is CellStatus.FINISHED
    assert results[0].record.processor
    assert "Fatal" not in CellFiles(tmp_path, results[0].key).log.read_text(), "the leash hinders the end"
    assert results[FAILING].message == "SceneError: no floor & nowhere to stand: 50% of {x_1}"
    assert results[DYING].message == "its process ended with exit code 9; see paper-17.log"
    assert "Traceback" in CellFiles(tmp_path, results[FAILING].key).log.read_text()
    assert not list(tmp_path.rglob("*.partial"))


def test_stop_ends_what_is_under_way_and_throws_it_away(tmp_path: Path) -> None:
    request, cells = asked(tmp_path, planners=["paper"], seeds=[HANGING, 0])
    folder = CellFiles(tmp_path, cells[0].key).partial
    began: list[bool] = []

    class OnceBegun(Watcher):
        def poll(self):
            if not began and folder.exists():
                began.append(True)
            return super().poll() if began else None

    engine = ProcessEngine(slots=1)
    run_fake_grid(request, cells, engine, watcher=OnceBegun(stop_after=0))
    assert began
    assert not folder.exists()
    assert engine.ended(0.0) == []
    assert CellFiles(tmp_path, cells[0].key).read().status is CellStatus.UNFINISHED


def test_a_cell_ends_with_whoever_started_it(tmp_path: Path) -> None:
    program = (
        "import json, os, sys\n"
        "from hgs_core.benchmark.planners.cell_process import CellProcess\n"
        "from hgs_core.benchmark.planners.task import CellTask\n"
        "cell = CellProcess(CellTask(**json.loads(sys.argv[1])))\n"
        "print(cell._process.pid, flush=True)\n"
        "os._exit(0)\n"
    )
    starter = [sys.executable, "-c", program, json.dumps(asdict(task(tmp_path, HANGING)))]
    pid = int(subprocess.run(starter, capture_output=True, text=True, check=True).stdout)
    assert within(60, lambda: gone(pid))


def test_another_installation_is_refused(tmp_path: Path) -> None:
    engine = ProcessEngine(slots=1)
    engine.start(replace(task(tmp_path, 0), commit="0000000"))
    ((_, answer),) = engine.ended(120.0)
    assert f"commit {source_version()} instead of 0000000" in str(answer.failure)
    assert not (tmp_path / "cell").exists()


def test_ray_tells_what_became_of_its_cells(tmp_path: Path, ray: RayEngine) -> None:
    assert ray.slots == 1
    answers = {}
    for seed in (FAILING, DYING):
        ray.start(task(tmp_path, seed))
        ((ended, answer),) = ray.ended(120.0)
        answers[ended.name] = answer.failure
        for partial in tmp_path.glob("*.partial"):
            partial.rename(tmp_path / f"{seed}")
    assert answers[f"seed {FAILING}"].startswith("SceneError: no floor")
    assert answers[f"seed {DYING}"] == "its process ended with exit code 9; see cell.log"
    ray.start(replace(task(tmp_path, 0), out="/nowhere/cells/house/paper-0"))
    ((_, answer),) = ray.ended(120.0)
    assert "does not see /nowhere/cells/house" in str(answer.failure)


def test_a_cell_has_the_same_figures_on_every_engine(tmp_path: Path, ray: RayEngine) -> None:
    y_up(textured(room())).export(tmp_path / "room.glb")
    folders = {}
    for name, engine in (("processes", ProcessEngine(slots=1)), ("ray", ray)):
        request = GridRequest(
            scenes=[str(tmp_path / "room.glb")],
            planners=["paper"],
            seeds=[3],
            preset="robust",
            overrides={"limits.max_time_s": "6"},
            out=tmp_path / name,
        )
        folders[name] = run_one_cell(request, Borrowed(engine))
    reports = {name: json.loads((folder / "report.json").read_text()) for name, folder in folders.items()}
    for key in FIGURES:
        assert reports["processes"][key] == reports["ray"][key] is not None, key
    for name in ("trajectory.txt", "map.ply"):
        assert filecmp.cmp(folders["processes"] / name, folders["ray"] / name, shallow=False), name
    tables = (tmp_path / "ray" / "tables.md").read_text()
    assert "1 of 1 missions finished; preset robust with limits.max_time_s=6" in tables


class Borrowed:
    """An engine that others go on using: `close` is left to its owner."""

    def __init__(self, engine: Engine) -> None:
        self.name, self.slots = engine.name, engine.slots
        self.start, self.ended = engine.start, engine.ended

    def close(self) -> None:
        """Not ours to close."""


def run_one_cell(request: GridRequest, engine: Engine) -> Path:
    watcher = Watcher()
    (cell,) = plan_cells(request)
    run_grid(
        request,
        [cell],
        engine,
        observer=watcher,
        commands=watcher,
        write_outputs=lambda: write_outputs(request.out),
    )
    assert [result.message for result in watcher.ended] == ["time limit of 6 s reached"]
    return CellFiles(request.out, cell.key).folder


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"pip install hgs\[ray\]"):
        RayEngine("local", threads=1)


def test_a_cluster_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class Unreachable:
        def init(self, **options: object) -> None:
            raise ConnectionError("Could not find any running Ray instance")

    monkeypatch.setattr(ray_engine, "_imported_ray", Unreachable)
    with pytest.raises(ConfigError, match=r"no Ray cluster at 'auto'.*ray start --head"):
        RayEngine("auto", threads=1)
