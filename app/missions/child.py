"""The mission's own process: one mission, then the end.

Only the standard library is imported before the thread caps are set: numerical libraries read them once.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from app.missions.transport import ArraySlot, CommandReceiver, EventSender
    from hgs_core.mission.commands import Order
    from hgs_core.mission.events import MissionEvent, MissionView

log = logging.getLogger(__name__)

_OFTEN = frozenset({"telemetry", "plan"})
_TOLD = frozenset({"time_s", "phase", "reason", "level", "message", "stop_reason"})
"""What the log says of an event."""

EXIT_FAILED = 1
EXIT_ORPHANED = 3


@dataclass(frozen=True, kw_only=True)
class ChildTask:
    """Everything a mission process is told: plain data, so that it can be spawned."""

    mission_id: str
    runner: str
    """`module:function` with the signature of `hgs_core.mission.run.run_mission`."""
    scene: str
    preset: str
    seed: int
    out: str
    max_time_s: float | None
    clock: str | None
    overrides: dict[str, str]
    extends: str | None
    """Folder of the run whose maps it begins with."""
    threads: int
    log_file: str
    log_style: str
    log_level: str
    slot_name: str
    display_interval_s: float
    max_splats: int
    max_image_width: int
    orphan_s: float


def run_child(
    task: ChildTask, events: Connection, commands: Connection, robot: Connection | None = None
) -> None:
    """Entry point of the spawned process. `robot` leads to the robot of a live mission."""
    _write_output_to(Path(task.log_file))
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C goes to the service, which stops its mission
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = str(task.threads)

    from app.logs import LogLevel, LogStyle, configure_logging
    from app.missions.transport import ArraySlot, CommandReceiver, EventSender

    configure_logging(
        LogStyle(task.log_style), LogLevel(task.log_level), process="mission", mission=task.mission_id
    )
    sender = EventSender(events)
    receiver = CommandReceiver(commands)
    _watch_parent(receiver, task.orphan_s)
    slot = ArraySlot.attach(task.slot_name)
    code = _run(task, sender, receiver, slot, robot)
    slot.close()
    sender.close()
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    sys.exit(code)


def _run(
    task: ChildTask,
    sender: EventSender,
    receiver: CommandReceiver,
    slot: ArraySlot,
    robot: Connection | None,
) -> int:
    try:
        from hgs_core.live.link import PipeLink
        from hgs_core.mission.request import MissionRequest

        module, _, function = task.runner.partition(":")
        run = getattr(importlib.import_module(module), function)
        request = MissionRequest(
            scene=task.scene,
            preset=task.preset,
            seed=task.seed,
            out=Path(task.out),
            max_time_s=task.max_time_s,
            clock=task.clock,
            overrides=dict(task.overrides),
            extends=Path(task.extends) if task.extends is not None else None,
            resume=True,
        )
        run(
            request,
            observer=_Observer(task, sender, slot),
            commands=_Commands(receiver, sender),
            **({} if robot is None else {"link": PipeLink(robot, name=task.mission_id)}),
        )
    except Exception as error:
        with contextlib.suppress(OSError):  # a full disk takes no output either
            log.exception("the mission failed")
        sender.send(
            {
                "control": "failed",
                "error": type(error).__name__,
                "message": str(error),
                "final": _is_final(error),
            }
        )
        return EXIT_FAILED
    sender.send({"control": "finished"})
    return 0


def _is_final(error: Exception) -> bool:
    """Whether going on from the last checkpoint would come to the same: refused on purpose, but for a
    checkpoint that another version of this software can read."""
    from hgs_core.errors import CheckpointError, HgsError

    return isinstance(error, HgsError) and not isinstance(error, CheckpointError)


class _Observer:
    """Passes events to the pipe and views to the shared slot."""

    def __init__(self, task: ChildTask, sender: EventSender, slot: ArraySlot) -> None:
        self._task = task
        self._sender = sender
        self._slot = slot
        self._next_view = 0.0
        self._view_failures = 0

    def on_event(self, event: MissionEvent) -> None:
        from app.missions.transport import plain_json

        self._sender.send(plain_json(event.as_json()))
        if event.kind not in _OFTEN:
            told = {key: value for key, value in event.as_json().items() if key in _TOLD}
            log.info("mission event: %s", event.kind, extra={"told": told})

    def wants_view(self) -> bool:
        return time.monotonic() >= self._next_view

    def on_view(self, view: MissionView) -> None:
        from app.missions.display_builder import display_view

        try:
            shown = display_view(
                view, max_splats=self._task.max_splats, max_image_width=self._task.max_image_width
            )
            sequence = self._slot.write(shown.arrays(), shown.meta())
        except Exception as error:
            # A picture that cannot be made must not end the mission: the operator is told, the robot goes on.
            self._view_failures += 1
            if self._view_failures in (1, 10, 100, 1000):
                log.exception("the view could not be made")
                message = f"the view could not be made ({self._view_failures}x): {error}"
                self._sender.send(
                    {"kind": "notice", "time_s": view.time_s, "level": "warning", "message": message}
                )
        else:
            self._sender.send({"control": "view", "view": sequence})
        self._next_view = time.monotonic() + self._task.display_interval_s


class _Commands:
    """`PromptCommands` that tell the service when STOP has been read."""

    def __init__(self, receiver: CommandReceiver, sender: EventSender) -> None:
        self._receiver = receiver
        self._sender = sender
        self._told = False

    def on_stop(self, react: Callable[[], None]) -> None:
        def wait() -> None:
            if self._receiver.wait_for_stop():
                react()

        threading.Thread(target=wait, name="stop-watcher", daemon=True).start()

    def poll(self) -> Order | None:
        from hgs_core.mission.commands import order_of

        text = self._receiver.poll()
        if text == "stop" and not self._told:
            self._told = True
            self._sender.send({"control": "stop_read"})
        return order_of(text) if text is not None else None


def _watch_parent(receiver: CommandReceiver, orphan_s: float) -> None:
    """End this process soon after the service died: first by SUSPEND, which saves a checkpoint for the next
    service to go on from, then hard."""
    parent: Any = parent_process()

    def wait() -> None:
        parent.join()
        receiver.suspend_now()
        time.sleep(orphan_s)
        os._exit(EXIT_ORPHANED)

    threading.Thread(target=wait, name="parent-watcher", daemon=True).start()


def _write_output_to(path: Path) -> None:
    """Send standard output and error, also those of native code, to `path`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    os.close(descriptor)
