"""`MissionService`: every mission there is, and the commands an operator has."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from app.errors import Conflict, NotFound
from app.missions.child import ChildTask
from app.missions.display import DisplayView, slot_bytes
from app.missions.mission import Mission
from app.missions.states import MissionState
from app.missions.supervisor import Supervisor
from app.missions.transport import ArraySlot
from app.settings import Settings
from app.store import MissionRecord, MissionStore
from hgs_core.mission.clock import ClockKind

log = logging.getLogger(__name__)

DEFAULT_RUNNER = "hgs_core.mission.run:run_mission"

ViewListener = Callable[[str, int, DisplayView], None]


@dataclass(frozen=True, kw_only=True)
class MissionOrder:
    """A checked wish for a mission."""

    scene: str
    scene_source: str
    preset: str
    seed: int
    max_time_s: float | None
    clock: ClockKind | None = None
    overrides: dict[str, str] = field(default_factory=dict)


class MissionService:
    """One mission runs at a time; the others wait in `created`.

    `runner` is the `module:function` that the mission process calls, with the signature of
    `hgs_core.mission.run.run_mission`.
    """

    def __init__(self, settings: Settings, *, runner: str = DEFAULT_RUNNER) -> None:
        self._settings = settings
        self._runner = runner
        self._store = MissionStore(settings.missions_dir)
        self._lock = threading.Lock()
        self._missions: dict[str, Mission] = {}
        self._view_listeners: list[ViewListener] = []
        for record in self._store.load_all():
            mission = Mission(record, self._store)
            self._missions[record.id] = mission
            if mission.state.active:
                mission.abandon("the service ended while the mission ran")

    def create(self, order: MissionOrder, *, idempotency_key: str | None = None) -> tuple[Mission, bool]:
        """A new mission in `created`, and true; for a key seen before, its mission and false.

        Raises `Conflict` when the key was used for another order.
        """
        with self._lock:
            if idempotency_key is not None:
                known = self._by_key(idempotency_key)
                if known is not None:
                    if _order_of(known.record) != order:
                        raise Conflict(
                            f"Idempotency-Key {idempotency_key!r} belongs to mission {known.id}, which "
                            "differs; use a new key for a new mission"
                        )
                    return known, False
            record = MissionRecord(
                id=self._new_id(),
                scene=order.scene,
                scene_source=order.scene_source,
                preset=order.preset,
                seed=order.seed,
                max_time_s=order.max_time_s,
                clock=order.clock,
                overrides=order.overrides,
                idempotency_key=idempotency_key,
                created_at=time.time(),
            )
            self._store.save(record)
            mission = Mission(record, self._store)
            self._missions[record.id] = mission
            return mission, True

    def start(self, mission_id: str) -> Mission:
        mission = self.get(mission_id)
        with self._lock:
            running = self._running()
            if running is not None and running is not mission and mission.state is MissionState.CREATED:
                raise Conflict(
                    f"mission {running.id} ({running.record.scene}, {running.record.preset}) is "
                    f"{running.state}, and one mission runs at a time: stop it or wait for its end",
                    errors=[{"field": "running_mission", "value": running.id}],
                )
            mission.begin(self._launch)
        return mission

    def pause(self, mission_id: str) -> Mission:
        mission = self.get(mission_id)
        mission.pause()
        return mission

    def resume(self, mission_id: str) -> Mission:
        mission = self.get(mission_id)
        mission.resume()
        return mission

    def stop(self, mission_id: str) -> Mission:
        mission = self.get(mission_id)
        mission.stop()
        return mission

    def get(self, mission_id: str) -> Mission:
        try:
            return self._missions[mission_id]
        except KeyError:
            raise NotFound(f"there is no mission {mission_id!r}") from None

    def missions(self) -> list[Mission]:
        """All missions, newest first."""
        with self._lock:
            return sorted(
                self._missions.values(), key=lambda mission: mission.record.created_at, reverse=True
            )

    def running(self) -> Mission | None:
        """The mission that has a process."""
        with self._lock:
            return self._running()

    def add_view_listener(self, listener: ViewListener) -> None:
        """Call `listener(mission_id, sequence, view)` for every view, from the mission's thread; be quick."""
        self._view_listeners.append(listener)

    def shutdown(self) -> None:
        """Stop the running mission: politely, then by force."""
        limits = self._settings.supervision
        mission = self.running()
        if mission is None:
            return
        mission.stop("the service shuts down")
        if not mission.join(limits.shutdown_s):
            mission.force("the service shut down before it had finished")
            mission.join(2 * limits.terminate_s)

    def _launch(self, mission: Mission) -> Supervisor:
        record, display = mission.record, self._settings.display
        slot = ArraySlot.create(slot_bytes(display.max_splats, display.max_image_width))
        task = ChildTask(
            runner=self._runner,
            scene=record.scene_source,
            preset=record.preset,
            seed=record.seed,
            out=str(mission.results_dir),
            max_time_s=record.max_time_s,
            clock=str(record.clock) if record.clock is not None else None,
            overrides=record.overrides,
            threads=self._settings.mission_threads,
            log_file=str(mission.log_file),
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

        try:
            return Supervisor(
                task,
                slot,
                self._settings.supervision,
                on_event=mission.on_event,
                on_view=on_view,
                on_end=mission.on_end,
            )
        except Exception:
            slot.close()
            raise

    def _running(self) -> Mission | None:
        return next((mission for mission in self._missions.values() if mission.state.active), None)

    def _by_key(self, key: str) -> Mission | None:
        return next((m for m in self._missions.values() if m.record.idempotency_key == key), None)

    def _new_id(self) -> str:
        """Sorts by time, unique, hard to guess, fine in a path: `20260102-030405-1a2b3c`."""
        stamp = time.strftime("%Y%m%d-%H%M%S", time.gmtime())
        while True:
            candidate = f"{stamp}-{secrets.token_hex(3)}"
            if candidate not in self._missions:
                return candidate


def _order_of(record: MissionRecord) -> MissionOrder:
    return MissionOrder(
        scene=record.scene,
        scene_source=record.scene_source,
        preset=record.preset,
        seed=record.seed,
        max_time_s=record.max_time_s,
        clock=record.clock,
        overrides=record.overrides,
    )
