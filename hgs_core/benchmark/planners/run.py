"""`run_grid`: runs what is missing of a grid, and keeps what is there."""

from __future__ import annotations

import fcntl
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final, Protocol, runtime_checkable

from hgs_core.benchmark.planners.cell import CellFiles, CellRecord, CellResult, CellStatus
from hgs_core.benchmark.planners.engine import Engine
from hgs_core.benchmark.planners.estimate import GridProgress
from hgs_core.benchmark.planners.fingerprint import differences, source_version
from hgs_core.benchmark.planners.grid import GridRequest, PlannedCell, remembered
from hgs_core.benchmark.planners.task import RUN_MISSION, CellAnswer, CellTask
from hgs_core.errors import ConfigError
from hgs_core.mission.commands import Command, CommandSource

_TICK_S: Final = 0.25


@runtime_checkable
class GridObserver(Protocol):
    """Is told how the grid gets on; must return quickly."""

    def cell_ended(self, result: CellResult, progress: GridProgress) -> None:
        """After every cell that was run."""
        ...

    def waiting(self, progress: GridProgress) -> None:
        """Some times a second."""
        ...


def run_grid(
    request: GridRequest,
    cells: Sequence[PlannedCell],
    engine: Engine,
    *,
    observer: GridObserver,
    commands: CommandSource,
    write_outputs: Callable[[], object],
    redo: bool = False,
    runner: str = RUN_MISSION,
) -> bool:
    """Run the cells that are not finished; whether the grid was left before its end, on STOP.

    Finished cells with equal settings are kept; failed and unfinished ones are run anew, their remains thrown
    away. STOP kills what is under way: nothing finished is lost. `write_outputs` is called after every cell.
    Raises `ConfigError` before anything runs for finished cells whose settings differ, unless `redo`, which
    runs these anew.
    """
    with _alone(request.out):
        grid_file = remembered(request, cells, redo=redo)
        left = _to_run(request.out, cells, redo=redo)
        grid_file.write(request.out)
        progress = GridProgress.begin(cells, left, slots=engine.slots)
        for cell in progress.kept:
            progress.learn(CellFiles(request.out, cell.key).read())
        grid = _Run(request, engine, source_version(), runner)
        stopped = False
        try:
            while (left or progress.running) and not stopped:
                while left and len(progress.running) < engine.slots:
                    progress.started(left[0].key)
                    grid.start(left.pop(0))
                for task, answer in engine.ended(_TICK_S):
                    result = grid.end(task, answer)
                    progress.ended(result)
                    observer.cell_ended(result, progress)
                    write_outputs()
                observer.waiting(progress)
                stopped = commands.poll() is Command.STOP
        finally:
            engine.close()
            for key in progress.running:
                shutil.rmtree(CellFiles(request.out, key).partial, ignore_errors=True)
        write_outputs()
        return stopped


class _Run:
    """Starts cells on an engine and writes down how they end."""

    def __init__(self, request: GridRequest, engine: Engine, commit: str, runner: str) -> None:
        self._request = request
        self._engine = engine
        self._commit = commit
        self._runner = runner
        self._under_way: dict[str, tuple[CellFiles, CellRecord]] = {}

    def start(self, cell: PlannedCell) -> None:
        files = CellFiles(self._request.out.resolve(), cell.key)
        record = CellRecord(
            fingerprint=cell.fingerprint,
            commit=self._commit,
            engine=self._engine.name,
            cells_at_once=self._engine.slots,
            lower_m=cell.scene.lower_m,
            upper_m=cell.scene.upper_m,
        )
        for remains in (files.partial, files.folder):
            if remains.exists():
                shutil.rmtree(remains)
        files.write_record(record)
        task = CellTask(
            name=str(cell.key),
            scene=cell.scene.source,
            preset=self._request.preset,
            planner=cell.key.planner,
            seed=cell.key.seed,
            overrides=self._request.overrides,
            out=str(files.folder),
            log=str(files.log),
            threads=cell.threads,
            kernel_variant=cell.fingerprint.kernel_variant,
            versions=cell.fingerprint.versions,
            commit=self._commit,
            runner=self._runner,
        )
        self._under_way[task.name] = (files, record)
        self._engine.start(task)

    def end(self, task: CellTask, answer: CellAnswer) -> CellResult:
        files, record = self._under_way.pop(task.name)
        ended = record.model_copy(update={"processor": answer.processor, "failure": answer.failure})
        files.write_record(ended)
        if files.partial.exists():
            shutil.rmtree(files.partial)
        return files.read()


def _to_run(root: Path, cells: Sequence[PlannedCell], *, redo: bool) -> list[PlannedCell]:
    """The cells that are not finished, or whose settings differ."""
    left, refused = [], []
    for cell in cells:
        result = CellFiles(root, cell.key).read()
        if result.status is not CellStatus.FINISHED:
            left.append(cell)
            continue
        if result.record is None:
            unequal = ["no record of its settings stands beside it"]
        else:
            unequal = differences(result.record.fingerprint, cell.fingerprint)
        if unequal and redo:
            left.append(cell)
        elif unequal:
            refused.append(f"{cell.key}: {'; '.join(unequal)}")
    if refused:
        more = f" (and {len(refused) - 1} more cells)" if len(refused) > 1 else ""
        raise ConfigError(
            f"{root} holds a finished cell that would not come out the same now: {refused[0]}{more}. "
            "--redo runs such cells again; another --out keeps them"
        )
    return left


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    """One grid at a time in a folder. Raises `ConfigError` while another runs there."""
    root.mkdir(parents=True, exist_ok=True)
    lock: IO[str]
    with (root / ".lock").open("w", encoding="utf-8") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ConfigError(
                f"another grid is running in {root}: wait for it or choose another --out"
            ) from error
        yield
