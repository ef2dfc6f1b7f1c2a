"""Cells on a Ray cluster, or on a Ray started for them on this machine (the extra `ray`).

Every node needs the same installation and must see the grid's folder and the scenes' files under the same
paths. A cell runs in a process of its own there, too, so that its figures are those of any other engine.
"""

from __future__ import annotations

import importlib
import logging
import os
import platform
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from hgs_core.benchmark.planners.cell_process import CellProcess
from hgs_core.benchmark.planners.engine import default_slots
from hgs_core.benchmark.planners.task import CellAnswer, CellTask
from hgs_core.errors import ConfigError

LOCAL: Final = "local"


class RayEngine:
    """Tasks of a Ray cluster, `threads` processors each.

    `address` is `local` (a Ray of its own on this machine, on the loopback interface), `auto` (the cluster
    that this machine belongs to) or a cluster's address. `slots` None: as many as the cluster has processors
    for. Raises `ConfigError` where Ray is missing or the cluster cannot be reached.
    """

    name = "ray"

    def __init__(self, address: str, *, threads: int, slots: int | None = None) -> None:
        self._ray = _imported_ray()
        self._threads = threads
        self._running: dict[Any, CellTask] = {}
        self._connect(address, slots)
        processors = int(self._ray.cluster_resources().get("CPU", 0))
        if processors < threads:
            self._ray.shutdown()
            raise ConfigError(
                f"the Ray cluster {address!r} has {processors} processors: a mission asks for {threads}"
            )
        self.slots = slots or processors // threads
        # Never tried again by Ray: a cell that dies is reported, and the next call of the grid runs it.
        self._remote = self._ray.remote(num_cpus=threads, max_retries=0)(run_cell)

    def _connect(self, address: str, slots: int | None) -> None:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        options: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False}
        if address == LOCAL:
            processors = self._threads * (slots or default_slots(self._threads))
            options |= {"num_cpus": processors, "include_dashboard": False, "_node_ip_address": "127.0.0.1"}
        try:
            self._ray.init(address=address, **options)
        except (ConnectionError, OSError, RuntimeError, ValueError) as error:
            raise ConfigError(
                f"no Ray cluster at {address!r}: {error}; start one with `ray start --head`, name another "
                "with --address, or use --address local"
            ) from error

    def start(self, task: CellTask) -> None:
        self._running[self._remote.remote(asdict(task))] = task

    def ended(self, timeout_s: float) -> list[tuple[CellTask, CellAnswer]]:
        if not self._running:
            return []
        ready, _ = self._ray.wait(list(self._running), num_returns=1, timeout=timeout_s)
        return [(self._running.pop(reference), self._answer(reference)) for reference in ready]

    def _answer(self, reference: Any) -> CellAnswer:
        try:
            return CellAnswer(**self._ray.get(reference))
        except self._ray.exceptions.RayError as error:
            first_line = str(error).strip().partition("\n")[0]
            return CellAnswer(failure=f"Ray lost the cell: {type(error).__name__}: {first_line}")

    def close(self) -> None:
        if not self._ray.is_initialized():
            return
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()
        self._ray.shutdown()


def run_cell(task: dict[str, Any]) -> dict[str, Any]:
    """Run one cell on the node that Ray chose: a `CellTask` and a `CellAnswer` as plain data."""
    cell = CellTask(**task)
    for path in (Path(cell.out).parent, *(path for path in [Path(cell.scene)] if path.is_absolute())):
        if not path.exists():
            failure = (
                f"{platform.node()} does not see {path}: all nodes must share the grid's folder and scenes"
            )
            return asdict(CellAnswer(failure=failure))
    return asdict(CellProcess(cell).answer())


def _imported_ray() -> Any:
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise ConfigError(f"the engine ray needs Ray ({error}): pip install hgs[ray]") from error
