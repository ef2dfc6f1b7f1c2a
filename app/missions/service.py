"""`MissionService`: every mission there is, and the commands an operator has."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from typing import Any

from app.errors import Conflict, Invalid, NotFound, Unavailable
from app.missions.child import ChildTask
from app.missions.directives import with_directives
from app.missions.display import DisplayView, slot_bytes
from app.missions.mission import Mission
from app.missions.moments import MomentArchive
from app.missions.states import MissionState
from app.missions.supervisor import Outcome, Supervisor
from app.missions.transport import ArraySlot
from app.settings import Settings
from app.storage.missions import MissionStore
from app.storage.tables import MissionRecord
from hgs_core.errors import HgsError
from hgs_core.mission.clock import ClockKind
from hgs_core.mission.commands import Decide
from hgs_core.mission.config import resolve_mission_config
from hgs_core.planning.directives import Directives

log = logging.getLogger(__name__)

DEFAULT_RUNNER = "hgs_core.mission.run:run_mission"
NOBODY = "anyone"
"""Who commands where no tokens are set."""

ViewListener = Callable[[str, int, DisplayView], None]
EventListener = Callable[[str, dict[str, Any]], None]
EndListener = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class MissionOrder:
    """A checked wish for a mission. `preset` and `scene` are as chosen, their `_source` is what runs."""

    scene: str
    scene_source: str
    preset: str
    preset_source: str
    seed: int
    max_time_s: float | None
    clock: ClockKind | None = None
    overrides: dict[str, str] = field(default_factory=dict)
    extends: str | None = None
    """The mission whose maps it begins with."""
    directives: Directives = Directives()
    """As ordered, or else the preset's; `overrides` have none."""


@dataclass(frozen=True, kw_only=True)
class Idempotency:
    """A client's name for one creation, and the SHA-256 of what it asked for."""

    key: str
    digest: str


class MissionService:
    """At most `missions_at_once` missions have a process; those started beyond that are queued, in order.

    Missions that have not ended are held here, the others are read from the store. `runner` is the
    `module:function` that a mission process calls, with the signature of `hgs_core.mission.run.run_mission`.
    """

    def __init__(self, settings: Settings, store: MissionStore, *, runner: str = DEFAULT_RUNNER) -> None:
        self._settings = settings
        self._runner = runner
        self._store = store
        self._lock = threading.RLock()
        self._unfinished: dict[str, Mission] = {}
        self._view_listeners: list[ViewListener] = []
        self._event_listeners: list[EventListener] = []
        self._end_listeners: list[EndListener] = []
        self._drop_listeners: list[Callable[[int], None]] = []
        self._make_room: Callable[[], None] = lambda: None
        self._closing = False

    @property
    def closing(self) -> bool:
        """Whether it is shutting down: nothing new is begun."""
        return self._closing

    def begin(self) -> None:
        """Take up what an earlier service left: what ran then is interrupted, unless its process came to its
        end; what was queued is started, and with `resume_on_start` what is interrupted."""
        for record in self._store.unfinished():
            mission = self._mission_of(record)
            if mission.state.active:
                mission.recover(f"the service ended while the mission was {record.state}")
            if not mission.state.ended:
                self._unfinished[record.id] = mission
            if self._settings.resume_on_start and mission.state is MissionState.INTERRUPTED:
                mission.enqueue("resume", "resumed by the service, which has started again")
        self._start_queued()

    def check_extended(self, order: MissionOrder) -> None:
        """Raises `Invalid` where the order extends a mission whose maps it cannot begin with."""
        if order.extends is None:
            return
        from hgs_core.mission.old_map import OldMap  # not for a service that extends nothing

        try:
            config = resolve_mission_config(order.preset_source, order.overrides)
            OldMap.check(self.get(order.extends).results_dir, order.scene_source, config)
        except HgsError as error:
            problem = {"field": "extends", "value": order.extends, "message": str(error)}
            raise Invalid(str(error), errors=[problem]) from error

    def replay(self, idempotency: Idempotency) -> Mission | None:
        """The mission that this key made before; None for a new key.

        Raises `Conflict` when the key was used for another request.
        """
        record = self._store.find_by_key(idempotency.key)
        if record is None:
            return None
        if record.request_digest != idempotency.digest:
            raise Conflict(
                f"Idempotency-Key {idempotency.key!r} belongs to mission {record.id}, which "
                "differs; use a new key for a new mission"
            )
        return self.get(record.id)

    def create(
        self, order: MissionOrder, *, idempotency: Idempotency | None = None, created_by: str = NOBODY
    ) -> tuple[Mission, bool]:
        """A new mission in `created`, and true; for a key seen before, its mission and false.

        Raises `NoRoom` when it would find none on the disk.
        """
        self._make_room()
        with self._lock:
            known = self.replay(idempotency) if idempotency is not None else None
            if known is not None:
                return known, False
            record = MissionRecord(
                id=_new_id(),
                scene=order.scene,
                scene_source=order.scene_source,
                preset=order.preset,
                preset_source=order.preset_source,
                seed=order.seed,
                max_time_s=order.max_time_s,
                clock=order.clock,
                extends=order.extends,
                overrides=with_directives(order.overrides, order.directives),
                idempotency_key=idempotency.key if idempotency is not None else None,
                request_digest=idempotency.digest if idempotency is not None else None,
                created_by=created_by,
                created_at=time.time(),
            )
            self._store.add(record)
            mission = self._mission_of(record)
            self._unfinished[record.id] = mission
            return mission, True

    def start(self, mission_id: str) -> Mission:
        """Launch the mission, or queue it when as many run as may. Raises `Conflict` unless created, and
        `NoRoom`.
        """
        self._make_room()
        mission = self.get(mission_id)
        self._start_or_queue(mission, "start")
        return mission

    def pause(self, mission_id: str) -> Mission:
        mission = self.get(mission_id)
        mission.pause()
        return mission

    def resume(self, mission_id: str) -> Mission:
        """Let a paused mission go on, or launch an interrupted one again (or queue it) to go on from its last
        checkpoint. Raises `Conflict` in other states, and `NoRoom`."""
        mission = self.get(mission_id)
        if mission.state is not MissionState.INTERRUPTED:
            mission.resume()
        elif mission.settle_by_results():  # its process lived on after its service, and came to its end
            self._forget_if_ended(mission)
        else:
            self._make_room()
            self._start_or_queue(mission, "resume")
        return mission

    def direct(self, mission_id: str, directives: Directives) -> Mission:
        """Ask something else of a mission that has not ended. Raises `Conflict` otherwise."""
        mission = self.get(mission_id)
        mission.direct(directives)
        return mission

    def decide(self, mission_id: str, decision: Decide) -> Mission:
        """Pass on the operator's word on the view that the mission waits with."""
        mission = self.get(mission_id)
        mission.decide(decision)
        return mission

    def stop(self, mission_id: str) -> Mission:
        """Waits for no other command: neither the queue nor another mission's launch is in its way."""
        mission = self.get(mission_id)
        mission.stop()
        self._forget_if_ended(mission)
        return mission

    def held(self, mission_id: str) -> Mission | None:
        """A mission that has not ended, from memory."""
        return self._unfinished.get(mission_id)

    def get(self, mission_id: str) -> Mission:
        """Raises `NotFound`."""
        mission = self._unfinished.get(mission_id)
        if mission is not None:
            return mission
        record = self._store.find(mission_id)
        if record is None:
            raise NotFound(f"there is no mission {mission_id!r}")
        return self._unfinished.get(mission_id) or self._mission_of(record)

    def page(
        self,
        limit: int,
        *,
        before: tuple[float, str] | None = None,
        states: Collection[MissionState] | None = None,
    ) -> list[Mission]:
        """Up to `limit` missions, newest first; see `MissionStore.page`."""
        records = self._store.page(limit, before=before, states=states)
        return [self._unfinished.get(record.id) or self._mission_of(record) for record in records]

    def unfinished(self) -> list[Mission]:
        """Missions that have not ended."""
        return list(self._unfinished.values())

    def running(self) -> list[Mission]:
        """Missions that have a process, oldest first."""
        active = [mission for mission in tuple(self._unfinished.values()) if mission.state.active]
        return sorted(active, key=lambda mission: (mission.record.started_at or 0.0, mission.id))

    def queued(self) -> list[Mission]:
        """Missions that wait for a free place, in the order in which they will start."""
        waiting = [m for m in tuple(self._unfinished.values()) if m.state is MissionState.QUEUED]
        return sorted(waiting, key=lambda mission: (mission.record.queued_at or 0.0, mission.id))

    def add_view_listener(self, listener: ViewListener) -> None:
        """Call `listener(mission_id, sequence, view)` for every view, from the mission's thread; be quick."""
        self._view_listeners.append(listener)

    def add_event_listener(self, listener: EventListener) -> None:
        """Call `listener(mission_id, event)` for every event of a mission process; be quick."""
        self._event_listeners.append(listener)

    def add_end_listener(self, listener: EndListener) -> None:
        """Call `listener(mission_id)` when a mission process has ended; be quick."""
        self._end_listeners.append(listener)

    def add_drop_listener(self, listener: Callable[[int], None]) -> None:
        """Call `listener(number)` when a mission process had to drop telemetry; be quick."""
        self._drop_listeners.append(listener)

    def ask_for_room(self, make_room: Callable[[], None]) -> None:
        """Before a mission is created or begins: `make_room` raises `NoRoom` when it would find none."""
        self._make_room = make_room

    def shutdown(self) -> None:
        """Suspend the running missions: politely, then by force. The next service can resume them, and queued
        ones wait for it."""
        limits = self._settings.supervision
        with self._lock:
            self._closing = True
        missions = self.running()
        for mission in missions:
            mission.suspend("the service shuts down")
        deadline = time.monotonic() + limits.shutdown_s
        for mission in missions:
            if not mission.join(max(0.0, deadline - time.monotonic())):
                mission.force("the service shut down before it had finished")
        for mission in missions:
            mission.join(2 * limits.terminate_s)

    def _mission_of(self, record: MissionRecord) -> Mission:
        folder = self._settings.missions_dir / record.id
        moments = MomentArchive(
            folder / "moments", self._settings.moments, below_m=self._settings.display.clip_height_m
        )
        return Mission(record, self._store, folder, moments)

    def _start_or_queue(self, mission: Mission, command: str) -> None:
        with self._lock:
            if self._free_slots() > 0 and not self.queued():
                try:
                    mission.begin(self._launch, command)
                finally:
                    self._forget_if_ended(mission)
                return
            at_once = self._settings.missions_at_once
            missions_run = "missions run" if at_once > 1 else "mission runs"
            mission.enqueue(command, f"waits for a free place: {at_once} {missions_run} at a time")
            self._start_queued()  # there may be a free place if one before could not be started

    def _free_slots(self) -> int:
        return self._settings.missions_at_once - len(self.running())

    def _start_queued(self) -> None:
        with self._lock:
            while not self._closing and self._free_slots() > 0 and (waiting := self.queued()):
                try:
                    waiting[0].begin(self._launch)
                except Conflict:
                    log.info("a mission was stopped before its turn", extra={"mission": waiting[0].id})
                except Unavailable as error:
                    log.error("%s", error, extra={"mission": waiting[0].id})  # it has ended as failed
                except Exception:
                    # Still queued, so nobody else's turn comes: the next that ends or comes tries again.
                    log.exception("a mission could not be started", extra={"mission": waiting[0].id})
                    return
                self._forget_if_ended(waiting[0])

    def _forget_if_ended(self, mission: Mission) -> None:
        if mission.state.ended:
            self._unfinished.pop(mission.id, None)

    def _results_of(self, mission_id: str | None) -> str | None:
        return None if mission_id is None else str(self.get(mission_id).results_dir)

    def _launch(self, mission: Mission) -> Supervisor:
        self._make_room()
        record, display = mission.record, self._settings.display
        slot = ArraySlot.create(slot_bytes(display.max_splats, display.max_image_width))
        task = ChildTask(
            mission_id=mission.id,
            runner=self._runner,
            scene=record.scene_source,
            preset=record.preset_source,
            seed=record.seed,
            out=str(mission.results_dir),
            max_time_s=record.max_time_s,
            clock=str(record.clock) if record.clock is not None else None,
            overrides=record.overrides,
            extends=self._results_of(record.extends),
            threads=self._settings.threads_per_mission,
            log_file=str(mission.log_file),
            log_style=str(self._settings.logs.style),
            log_level=str(self._settings.logs.level),
            slot_name=slot.name,
            display_interval_s=display.interval_s,
            max_splats=display.max_splats,
            max_image_width=display.max_image_width,
            orphan_s=self._settings.supervision.orphan_s,
        )

        def on_view(sequence: int, view: DisplayView) -> None:
            mission.on_view(sequence, view)
            for listener in self._view_listeners:
                listener(mission.id, sequence, view)

        def on_event(event: dict[str, Any]) -> None:
            mission.on_event(event)
            for listener in self._event_listeners:
                listener(mission.id, event)

        def on_end(outcome: Outcome) -> None:
            mission.on_end(outcome)
            self._forget_if_ended(mission)
            for listener in self._end_listeners:
                listener(mission.id)
            self._start_queued()

        def on_dropped(number: int) -> None:
            for listener in self._drop_listeners:
                listener(number)

        try:
            return Supervisor(
                task,
                slot,
                self._settings.supervision,
                on_event=on_event,
                on_view=on_view,
                on_end=on_end,
                on_dropped=on_dropped,
            )
        except Exception:
            slot.close()
            raise


def _new_id() -> str:
    """Sorts by time, hard to guess, fine in a path: `20260102-030405-1a2b3c4d5e6f`."""
    return f"{time.strftime('%Y%m%d-%H%M%S', time.gmtime())}-{secrets.token_hex(6)}"
