"""One mission as the service holds it: its record, its events, its newest picture, its process."""

from __future__ import annotations

import json
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from app.errors import Conflict, Invalid, Unavailable
from app.missions.degrees import in_degrees
from app.missions.directives import directives_of, with_directives
from app.missions.display import DisplayView
from app.missions.event_log import EventLog
from app.missions.mission_views import MissionViews
from app.missions.moments import MomentArchive
from app.missions.retelling import Retelling
from app.missions.robot_link import RobotLink
from app.missions.states import COMMANDS, DIRECTABLE, TRANSITIONS, MissionState
from app.missions.supervisor import Outcome, Supervisor
from app.storage.database import StorageError
from app.storage.missions import MissionStore
from app.storage.tables import FilesKept, MissionRecord
from hgs_core.mission.commands import Decide, Direct, as_text
from hgs_core.mission.folder import partial_of
from hgs_core.planning.directives import Directives
from hgs_core.scene.sources.live import LIVE

log = logging.getLogger(__name__)

_GIVEN_UP = {FilesKept.LIGHT: "large files", FilesKept.NONE: "files"}
_PHASE_STATES = {
    "running": MissionState.RUNNING,
    "awaiting_approval": MissionState.RUNNING,
    "returning": MissionState.RUNNING,
    "paused": MissionState.PAUSED,
    "evaluating": MissionState.STOPPING,
}


class Mission:
    """Safe to use from any thread. Every change of state is saved together with the event that tells it.

    What only looks waits for no lock: one is held while an event is saved.
    """

    def __init__(
        self, record: MissionRecord, store: MissionStore, folder: Path, moments: MomentArchive
    ) -> None:
        """`folder` holds its files: what the process writes, its output, the last view."""
        self._store = store
        self._folder = folder
        self._lock = threading.RLock()
        self._record = record
        self._supervisor: Supervisor | None = None
        self._stop_reason: str | None = None
        self._end_message: str | None = None
        self._phase: str | None = None
        self._phase_reason = ""
        self._retelling = Retelling(lambda: self.log)
        self._requested: str | None = None
        self._heard_at: float | None = None
        self._log: EventLog | None = None
        self.views = MissionViews(
            folder / "last_view.npz",
            moments,
            saved=lambda: self._record.view_sequence,
            failed=self._on_moments_failed,
        )

    @property
    def record(self) -> MissionRecord:
        """What is known and saved; a change of state shows here before anybody is told of it."""
        return self._record

    @property
    def id(self) -> str:
        return self._record.id

    @property
    def log(self) -> EventLog:
        """Its events."""
        if self._log is not None:
            return self._log
        with self._lock:
            if self._log is None:
                self._log = EventLog(self._store, self.id)
            return self._log

    @property
    def in_memory(self) -> bool:
        """Whether what there is to say of it waits for no database."""
        log = self._log
        return log is not None and all(log.knows(kind) for kind in ("telemetry", "plan", "approval"))

    @property
    def state(self) -> MissionState:
        return self._record.state

    @property
    def phase(self) -> str | None:
        """The mission's own word for what it does now."""
        return self._phase

    @property
    def pid(self) -> int | None:
        supervisor = self._supervisor
        return supervisor.pid if supervisor is not None and self.state.active else None

    @property
    def live(self) -> bool:
        """Whether its robot is a live one."""
        return self._record.scene_source == LIVE

    @property
    def link(self) -> RobotLink | None:
        """The way to its robot; None without a process, or where the robot is simulated."""
        supervisor = self._supervisor
        return supervisor.link if supervisor is not None and self.state.active else None

    @property
    def folder(self) -> Path:
        """Where all its files lie."""
        return self._folder

    @property
    def results_dir(self) -> Path:
        return self._folder / "run"

    @property
    def log_file(self) -> Path:
        return self._folder / "process.log"

    @property
    def silent_s(self) -> float | None:
        """Seconds since the process was last heard; None when there is no process."""
        heard = self._heard_at
        return time.monotonic() - heard if heard is not None and self.state.active else None

    @property
    def directives(self) -> Directives:
        """What is asked of it now; a mission that runs takes it at its next step."""
        return directives_of(self._record.overrides)

    @property
    def approval(self) -> dict[str, Any] | None:
        """The `approval` event of the view that waits for the operator's word; None when none does."""
        event = self.log.newest("approval") if self.state.active else None
        return event if event is not None and event["state"] == "waiting" else None

    def enqueue(self, command: str, reason: str) -> None:
        """Go to queued, from created by start, from interrupted by resume. Raises `Conflict` otherwise."""
        with self._lock:
            self._require_without_process(command)
            self._change(MissionState.QUEUED, reason, queued_at=time.time())

    def begin(self, launch: Callable[[Mission], Supervisor], command: str = "start") -> None:
        """Go to starting, from queued, or as `enqueue` does, and launch the process, which goes on from a
        checkpoint where an earlier one left any. Raises `Conflict` otherwise.
        """
        with self._lock:
            if self.state is not MissionState.QUEUED:
                self._require_without_process(command)
            began_before = self._record.started_at is not None
            self._stop_reason = self._end_message = self._phase = self._requested = None
            self.views.begin()
            self._change(
                MissionState.STARTING,
                f"the mission process is starting{' again' if began_before else ''}",
                started_at=self._record.started_at or time.time(),
                stop_reason=None,
            )
            self._heard_at = time.monotonic()
            try:
                self._supervisor = launch(self)
            except Exception as error:
                reason = f"the mission process could not be started: {error}"
                if began_before:
                    self._interrupt(reason)
                else:
                    self._end(MissionState.FAILED, reason)
                raise Unavailable(reason) from error
            self._supervisor.listen()

    def pause(self) -> None:
        self._command("pause")

    def resume(self) -> None:
        self._command("resume")

    def direct(self, directives: Directives) -> None:
        """Ask for `directives` from now on, whole. Raises `Conflict` when it is about to end or has ended."""
        with self._lock:
            self._require("direct", DIRECTABLE)
            overrides = with_directives(self._record.overrides, directives)
            record = self._record.model_copy(update={"overrides": overrides})
            if self._supervisor is not None and self.state.active:
                self._store.save([], record, self.id)
                self._supervisor.send(as_text(Direct(directives=directives)))
            else:
                told = {"kind": "directives", "directives": directives.model_dump(mode="json")}
                self._append(told, record)
            self._record = record

    def _ask_again(self) -> None:
        """A checkpoint may be older than what was asked last, and no-go areas must not be forgotten."""
        if self._supervisor is not None and self.log.newest("directives") is not None:
            self._supervisor.send(as_text(Direct(directives=self.directives)))

    def decide(self, decision: Decide) -> None:
        """Pass on the operator's word. Raises `Conflict` unless the view of that plan waits for it, and
        `Invalid` for a candidate that the plan does not have."""
        with self._lock:
            waiting = self.approval
            if waiting is None or waiting["plan_sequence"] != decision.plan_sequence:
                now = "none does" if waiting is None else f"one of plan {waiting['plan_sequence']} does"
                raise Conflict(
                    f"no view of plan {decision.plan_sequence} of mission {self.id} awaits approval: {now}",
                    errors=[{"field": "plan_sequence", "value": decision.plan_sequence}],
                )
            if decision.candidate is not None:
                self._require_candidate(decision.candidate)
            assert self._supervisor is not None
            self._supervisor.send(as_text(decision))

    def _require_candidate(self, index: int) -> None:
        plan = self.log.newest("plan") or {}
        n_candidates = len(plan.get("candidates", ()))
        if index >= n_candidates:
            raise Invalid(
                f"candidate {index} is not known: the plan has {n_candidates}, counted from 0",
                errors=[{"field": "candidate", "value": index, "allowed": f"0 to {n_candidates - 1}"}],
            )

    def stop(self, reason: str = "stopped by the operator") -> None:
        """Stop, in any state; a mission that has ended or is stopping stays as it is."""
        supervisor = self._supervisor
        if supervisor is not None and self.state.active:
            supervisor.stop()  # before the lock, which may be held by an event that is being saved
        with self._lock:
            if self.state.ended:
                return
            if not self.state.active:
                began = self._record.started_at is not None
                self._stop_reason = "interrupted" if began else None
                when = "after it was interrupted" if began else "before it started"
                self._end(MissionState.ABORTED, f"{reason} {when}")
                return
            if self._supervisor is not None:
                self._supervisor.stop()
            if self.state is not MissionState.STOPPING:
                self._change(MissionState.STOPPING, f"{reason}; it writes its results")

    def suspend(self, reason: str) -> None:
        """Let its process save a checkpoint and end, to be resumed later. One that is stopping goes on with
        that as long as it may."""
        with self._lock:
            if self._supervisor is None or not self.state.active or self.state is MissionState.STOPPING:
                return
            self._supervisor.suspend()
            self._change(MissionState.STOPPING, f"{reason}; it saves a checkpoint")

    def force(self, reason: str) -> None:
        supervisor = self._supervisor
        if supervisor is not None and self.state.active:
            supervisor.force(reason)

    def join(self, timeout_s: float) -> bool:
        """Wait for the process to end; whether there is none (any more)."""
        supervisor = self._supervisor
        return supervisor is None or supervisor.join(timeout_s)

    def on_event(self, event: dict[str, Any]) -> None:
        """Take in an event of the mission process."""
        self._heard_at = time.monotonic()
        with self._lock:
            if event["kind"] == "telemetry":
                event["view_sequence"] = self.views.sequence
            if event["kind"] == "resumed":
                self._retelling.go_on_from(float(event["time_s"]), partial_of(self.results_dir))
                self._ask_again()
            shown = in_degrees(event)
            is_new = self._retelling.is_news(shown)
            if is_new:
                shown = self.log.append({"received_at": time.time(), **shown})
            if event["kind"] == "phase":
                self._follow_phase(str(event["phase"]), str(event["reason"]))
            elif event["kind"] == "ended":
                self._stop_reason = str(event["stop_reason"])
                self._end_message = str(event["message"])
        if is_new and event["kind"] == "telemetry":
            self.views.take_figures(shown)  # it draws and writes: nobody who asks waits for that

    def on_view(self, sequence: int, view: DisplayView) -> None:
        self._heard_at = time.monotonic()
        self.views.take(sequence, view, is_news=view.time_s > self._retelling.told_until_s)

    def on_end(self, outcome: Outcome) -> None:
        """Settle the final state. Nothing the process did or failed to do keeps a mission from ending."""
        with self._lock:
            if outcome.error is None and self._phase == "suspended":
                self._interrupt(f"suspended: {self._phase_reason}")
            elif outcome.error is None:
                self._settle(self._stop_reason, self._end_message)
            elif self.settle_by_results():
                log.warning("mission %s had come to its end: %s", self.id, outcome.error)
            elif outcome.stopped and (outcome.forced or outcome.final):
                self._end(MissionState.ABORTED, outcome.error)
            elif outcome.final:
                self._end(MissionState.FAILED, outcome.error)
            else:
                self._interrupt(outcome.error)

    def recover(self, reason: str) -> None:
        """Settle a mission whose process another service had: it has ended, or is interrupted."""
        with self._lock:
            if not self.settle_by_results():
                self._interrupt(reason)

    def settle_by_results(self) -> bool:
        """End as the results say, where the mission's folder is complete; whether it is."""
        with self._lock:
            found = _end_of_run(self.results_dir)
            if found is None:
                return False
            self._retelling.tell_what_was_missed(self.results_dir)
            self._settle(*found)
            return True

    def pin(self, pinned: bool, by: str) -> None:
        """Keep its files whatever room others need, or let them go with the others'."""
        with self._lock:
            if self._record.pinned is not pinned:
                message = f"{by} pinned it: its files stay" if pinned else f"{by} unpinned it"
                self._note(message, pinned=pinned)

    def note_removal(self, kept: FilesKept, why: str) -> None:
        """Write down that its files are about to go, but for `kept`."""
        with self._lock:
            self._note(f"its {_GIVEN_UP[kept]} are removed: {why}", files=kept)

    def _note(self, message: str, **changes: Any) -> None:
        record = self._record.model_copy(update=changes)
        self._append({"kind": "notice", "level": "info", "message": message}, record)
        if self.log.n_unsaved:
            raise StorageError(f"the database did not take what was noted of mission {self.id}")

    def _command(self, command: str) -> None:
        with self._lock:
            self._require(command)
            if self._supervisor is None:
                raise Conflict(f"cannot {command} mission {self.id} now: {self.record.reason}")
            if self._requested == command:
                return  # already on its way
            self._requested = command
            self._supervisor.send(command)

    def _settle(self, stop_reason: str | None, message: str | None) -> None:
        """End as the mission itself says that it has ended."""
        self._stop_reason = stop_reason
        if stop_reason == "failed":
            self._end(MissionState.FAILED, message or "the mission failed")
        elif stop_reason == "interrupted":
            self._end(MissionState.ABORTED, message or "stopped by the operator")
        else:
            self._end(MissionState.COMPLETED, message or "the mission ended by itself")

    def _interrupt(self, reason: str) -> None:
        """What is known stays, and another process may go on."""
        views = self.views.keep() or self._record.view_sequence
        self._supervisor = None
        self._change(MissionState.INTERRUPTED, reason, stop_reason="interrupted", view_sequence=views)

    def _require_without_process(self, command: str) -> None:
        """`_require`, for a command that needs a process to be launched."""
        self._require(command)
        if self.state.active:
            raise Conflict(f"cannot {command} mission {self.id}: its process runs")

    def _require(self, command: str, allowed: frozenset[MissionState] | None = None) -> None:
        allowed = COMMANDS[command] if allowed is None else allowed
        if self.state not in allowed:
            raise Conflict(
                f"cannot {command} mission {self.id}: it is {self.state} ({self.record.reason}); "
                f"{command} needs {' or '.join(sorted(allowed))}",
                errors=[{"field": "state", "value": str(self.state), "allowed": sorted(allowed)}],
            )

    def _follow_phase(self, phase: str, reason: str) -> None:
        self._phase, self._phase_reason = phase, reason
        state = _PHASE_STATES.get(phase)
        if state is None:
            return
        # Of the same state only a running mission has news: what it waits for, or that it drives home.
        is_news = (
            state in TRANSITIONS[self.state] if state is not self.state else state is MissionState.RUNNING
        )
        if not is_news:
            return
        self._requested = None
        self._tell(state, reason or phase)

    def _change(self, state: MissionState, reason: str, **changes: Any) -> None:
        if state not in TRANSITIONS[self.state]:
            raise Conflict(f"mission {self.id} cannot go from {self.state} to {state}")
        self._tell(state, reason, **changes)

    def _tell(self, state: MissionState, reason: str, **changes: Any) -> None:
        record = self._record.model_copy(update={"state": state, "reason": reason, **changes})
        self._append({"kind": "state", "state": str(state), "reason": reason}, record)
        log.info("the mission is %s: %s", state, reason, extra={"mission": self.id, "state": str(state)})

    def _append(self, told: dict[str, Any], record: MissionRecord) -> None:
        """Save both, and show the record before the event wakes anybody who may ask for it."""

        def show() -> None:
            self._record = record

        self.log.append({"received_at": time.time(), **told}, record, saved=show)

    def _end(self, state: MissionState, reason: str) -> None:
        sequence = self.views.keep()
        self._change(
            state, reason, ended_at=time.time(), stop_reason=self._stop_reason, view_sequence=sequence
        )
        self.views.let_go()

    def _on_moments_failed(self, why: str, time_s: float) -> None:
        self.on_event({"kind": "notice", "time_s": time_s, "level": "warning", "message": why})


def _end_of_run(folder: Path) -> tuple[str | None, str | None] | None:
    """Why the run in `folder` ended, and in which words; None where there is no complete run."""
    try:
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return report.get("stop_reason"), report.get("stop_message")
