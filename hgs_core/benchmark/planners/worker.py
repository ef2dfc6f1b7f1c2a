"""The process of one cell: `python -m hgs_core.benchmark.planners.worker`, a `CellTask` on standard input.

Standard input stays open as a leash: when it closes, whoever wanted the cell is gone, and the process ends at
once. The answer goes to standard output, everything else that is printed to the task's log.
"""

from __future__ import annotations

import importlib
import json
import os
import platform
import sys
import threading
import traceback
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hgs_core.benchmark.planners.task import CellAnswer, CellTask

if TYPE_CHECKING:
    from hgs_core.mission.events import MissionEvent, MissionView

EXIT_ABANDONED: Final = 3


def main() -> None:
    """Run the cell that standard input names, and answer."""
    task = CellTask(**json.loads(sys.stdin.buffer.readline()))
    threading.Thread(target=_end_with, args=(sys.stdin.fileno(),), name="leash", daemon=True).start()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    _print_to(Path(task.log))
    with answers:
        answers.write(json.dumps(asdict(_run(task))) + "\n")


def _run(task: CellTask) -> CellAnswer:
    try:
        from hgs_core.benchmark.kernels import processor_name
        from hgs_core.mission.request import MissionRequest
        from hgs_core.mission.run import NoCommands

        fault = _unequal_footing(task)
        if fault is None:
            module, _, function = task.runner.partition(":")
            request = MissionRequest(
                scene=task.scene,
                preset=task.preset,
                planner=task.planner,
                seed=task.seed,
                out=Path(task.out),
                max_time_s=None,
                overrides=dict(task.overrides),
            )
            run = getattr(importlib.import_module(module), function)
            run(request, observer=_Unobserved(), commands=NoCommands())
        return CellAnswer(failure=fault, processor=processor_name())
    except Exception as error:
        traceback.print_exc()
        return CellAnswer(failure=f"{type(error).__name__}: {error}")


def _unequal_footing(task: CellTask) -> str | None:
    """Why this process would not give the figures that the grid asks for; None when it would."""
    from hgs_core.benchmark.planners.fingerprint import source_version
    from hgs_core.mission.versions import software_versions
    from hgs_core.native import kernels

    here = {**software_versions(), "commit": source_version(), "kernel variant": kernels.variant()}
    asked = {**task.versions, "commit": task.commit, "kernel variant": task.kernel_variant}
    unequal = [
        f"{name} {here.get(name)} instead of {asked.get(name)}"
        for name in {**here, **asked}
        if here.get(name) != asked.get(name)
    ]
    if not unequal:
        return None
    return f"{platform.node()} is not equal to where the grid was started: {', '.join(unequal)}"


class _Unobserved:
    """A `MissionObserver` that looks away: the run's folder keeps all events."""

    def on_event(self, event: MissionEvent) -> None:
        """Not followed."""

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None:
        """Never asked for."""


def _end_with(leash: int) -> None:
    # By its descriptor: a file object that a thread reads from cannot be closed when the interpreter ends.
    while os.read(leash, 64):
        pass
    os._exit(EXIT_ABANDONED)


def _print_to(log: Path) -> None:
    """Send standard output and error, also those of native code, to `log`."""
    descriptor = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)


if __name__ == "__main__":
    main()
