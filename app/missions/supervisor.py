"""Runs one mission process and answers for its end: it always comes, whatever the process does."""

from __future__ import annotations

import contextlib
import fcntl
import json
import logging
import multiprocessing
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from structlog.contextvars import bind_contextvars

from app.missions.child import EXIT_ORPHANED, ChildTask, run_child
from app.missions.display import DisplayView
from app.missions.robot_link import RobotLink
from app.missions.transport import ArraySlot
from app.settings import SupervisionSettings
from hgs_core.scene.sources.live import LIVE

log = logging.getLogger(__name__)

_ORDERS_BYTES = 1 << 20
"""The longest order, directives of 32 areas with 64 corners each, takes less than a tenth of it."""

_SPAWN = multiprocessing.get_context("spawn")  # never fork: threads and numerical libraries do not survive it


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a mission process ended. `error` is None when it finished by itself."""

    error: str | None
    stopped: bool
    """Whether it was asked to stop."""
    forced: bool
    """Whether it had to be terminated or killed."""
    final: bool
    """Whether it refused to go on, so that another process would, too."""


class Supervisor:
    """One process, one thread that listens to it. Callbacks come from that thread.

    STOP escalates: the process is asked; when it has not read the request in time, or does not finish in
    time after that, it is terminated, and at last killed.
    """

    def __init__(
        self,
        task: ChildTask,
        slot: ArraySlot,
        limits: SupervisionSettings,
        *,
        on_event: Callable[[dict[str, Any]], None],
        on_view: Callable[[int, DisplayView], None],
        on_end: Callable[[Outcome], None],
        on_dropped: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._mission_id = task.mission_id
        self._limits = limits
        self._slot = slot
        self._on_event = on_event
        self._on_view = on_view
        self._on_end = on_end
        self._on_dropped = on_dropped
        self._events, child_events = _SPAWN.Pipe(duplex=False)
        child_commands, self._commands = _SPAWN.Pipe(duplex=False)
        self.link: RobotLink | None = None
        """To the process of a mission with a live robot."""
        child_link = None
        if task.scene == LIVE:
            ours, child_link = _SPAWN.Pipe(duplex=True)
            self.link = RobotLink(ours)
        # Room for orders that a busy process has not read yet: STOP must never wait to be written.
        fcntl.fcntl(self._commands.fileno(), fcntl.F_SETPIPE_SZ, _ORDERS_BYTES)
        self._send_lock = threading.Lock()
        self._process_lock = threading.Lock()
        """Never held while anything is waited for: ending a process by force must not wait."""
        self._over = False
        """Whether the process has ended and its descriptors are given back."""
        self._heard = False
        self._stopping = False
        self._stop_requested = threading.Event()
        self._deadline: float | None = time.monotonic() + limits.start_s
        self._deadline_meaning = f"it said nothing for {limits.start_s:g} s after its start"
        self._forced: str | None = None
        self._verdict: dict[str, Any] | None = None
        self._process = _SPAWN.Process(
            target=run_child,
            args=(task, child_events, child_commands, child_link),
            name=f"mission {task.scene}",
            daemon=True,
        )
        self._process.start()
        self._pid = self._process.pid
        child_events.close()
        child_commands.close()
        if child_link is not None:
            child_link.close()
        self._thread = threading.Thread(target=self._run, name="mission-supervisor", daemon=True)

    @property
    def pid(self) -> int | None:
        return self._pid

    def listen(self) -> None:
        """Begin to pass on what the process says."""
        self._thread.start()
        if self.link is not None:
            self.link.begin()

    def send(self, command: str) -> None:
        """Pass a command on. A process that is gone is no error: its end is reported by `on_end`."""
        with self._send_lock, contextlib.suppress(OSError):
            self._commands.send_bytes(command.encode())

    def stop(self) -> None:
        """Ask the process to stop; calling it again changes nothing."""
        if not self._stop_requested.is_set():
            self._stop_requested.set()
            self.send("stop")
            if self.link is not None:
                self.link.halt("the operator stops the mission")

    def suspend(self) -> None:
        """Ask the process to save a checkpoint and end."""
        self.send("suspend")

    def join(self, timeout_s: float | None = None) -> bool:
        """Wait for the end; whether it has come."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def force(self, reason: str) -> None:
        """Terminate the process now (kill it later if need be)."""
        self._terminate(reason)

    def _run(self) -> None:
        bind_contextvars(mission=self._mission_id)  # of this thread alone
        try:
            self._listen_to_the_end()
        except Exception as error:
            log.exception("mission supervision failed")
            self._process.kill()
            self._verdict = {"control": "failed", "error": type(error).__name__, "message": str(error)}
        self._process.join()
        outcome = self._outcome()
        self._events.close()
        with self._send_lock:
            self._commands.close()
        with self._process_lock:
            self._over = True
            self._process.close()  # or its descriptors would wait for the garbage collector
        self._slot.close()
        if self.link is not None:
            self.link.close("the mission's process has ended")
        self._on_end(outcome)

    def _listen_to_the_end(self) -> None:
        open_pipe = True
        while open_pipe or self._process.is_alive():
            sources: list[Any] = [self._process.sentinel, *([self._events] if open_pipe else [])]
            ready = wait(sources, timeout=0.1)
            if open_pipe and self._events in ready:
                open_pipe = self._receive(self._events)
            elif self._process.sentinel in ready:
                return  # nothing more in the pipe, and nobody left to write
            self._watch_deadlines()

    def _receive(self, events: Connection) -> bool:
        """Handle one message; whether the pipe is still open."""
        try:
            message = json.loads(events.recv_bytes())
        except (EOFError, OSError):
            return False
        if not self._heard:
            self._heard = True
            if not self._stopping:
                self._deadline = None
        control = message.get("control")
        if control is None:
            self._on_event(message)
        elif control == "view":
            found = self._slot.read()
            if found is not None:
                sequence, arrays, meta = found
                self._on_view(sequence, DisplayView.of(arrays, meta))
        elif control == "dropped":
            self._on_dropped(int(message["events"]))
        elif control == "stop_read":
            if self._forced is None:
                self._expect(
                    self._limits.finish_s, f"it had not finished {self._limits.finish_s:g} s after STOP"
                )
        else:
            self._verdict = message
        return True

    def _watch_deadlines(self) -> None:
        if self._stop_requested.is_set() and not self._stopping:
            self._stopping = True
            self._expect(
                self._limits.stop_acknowledged_s,
                f"it did not react to STOP within {self._limits.stop_acknowledged_s:g} s",
            )
        if self._deadline is None or time.monotonic() < self._deadline:
            return
        if self._forced is None:
            self._terminate(self._deadline_meaning)
        else:
            self._process.kill()
            self._deadline = None

    def _terminate(self, reason: str) -> None:
        with self._process_lock:
            if self._over:
                return
            self._forced = reason
            self._process.terminate()
        log.warning(
            "terminating the mission process %s: %s", self.pid, reason, extra={"mission": self._mission_id}
        )
        self._expect(self._limits.terminate_s, reason)

    def _expect(self, within_s: float, meaning: str) -> None:
        self._deadline = time.monotonic() + within_s
        self._deadline_meaning = meaning

    def _outcome(self) -> Outcome:
        return Outcome(
            error=self._error(),
            stopped=self._stop_requested.is_set(),
            forced=self._forced is not None,
            final=self._verdict is not None and bool(self._verdict.get("final")),
        )

    def _error(self) -> str | None:
        code = self._process.exitcode
        if self._verdict is not None and self._verdict["control"] == "finished":
            return None
        if self._verdict is not None:
            return str(self._verdict["message"]) or str(self._verdict["error"])
        if self._forced is not None:
            return f"the mission process was ended by force: {self._forced}"
        if code is not None and code < 0:
            return f"the mission process was killed by signal {signal.Signals(-code).name}"
        if code == EXIT_ORPHANED:
            return "the mission process lost its service"
        return f"the mission process ended with exit code {code} and without a word; see its log"
