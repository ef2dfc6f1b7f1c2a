"""Listens to a simulated mission and records how complete its map is meanwhile."""

from __future__ import annotations

import time
from typing import Any

from hgs_core.evaluation.ceiling import observable_ceiling
from hgs_core.evaluation.completion_curve import CompletionTracker
from hgs_core.evaluation.report_parts import CurvePoint
from hgs_core.mapping.mapper import Mapper
from hgs_core.mission.ceiling import ceiling_request
from hgs_core.mission.clock import Clock
from hgs_core.mission.config import MissionConfig
from hgs_core.mission.events import (
    MissionEvent,
    MissionObserver,
    MissionPhase,
    MissionView,
    PhaseChanged,
    Telemetry,
)
from hgs_core.scene.scene import Scene


class CurveRecorder:
    """A `MissionObserver` that hands everything on, and takes a reading after so many metres or seconds.

    It knows the true surface; nothing of it goes back into the mission. Mission time stands still during a
    reading by either clock: the real one is stopped, as it is for the simulator.
    """

    def __init__(
        self,
        tracker: CompletionTracker,
        *,
        interval_m: float,
        interval_s: float,
        mapper: Mapper,
        clock: Clock,
        observer: MissionObserver,
    ) -> None:
        self.wall_s = 0.0
        """Wall seconds of all readings."""
        self._tracker = tracker
        self._interval_m = interval_m
        self._interval_s = interval_s
        self._mapper = mapper
        self._clock = clock
        self._observer = observer
        self._points: list[CurvePoint] = []

    @staticmethod
    def of(
        scene: Scene, config: MissionConfig, *, mapper: Mapper, clock: Clock, observer: MissionObserver
    ) -> CurveRecorder:
        """For a mission in `scene`, whose observable surface is worked out first where it is not known yet.

        Raises `SceneError` when the start is not free.
        """

        def preparing(message: str) -> None:
            observer.on_event(PhaseChanged(time_s=0.0, phase=MissionPhase.PREPARING, reason=message))

        ceiling = observable_ceiling(
            scene.caster,
            ceiling_request(config, (scene.start.x_m, scene.start.y_m)),
            progress=preparing,
        )
        return CurveRecorder(
            CompletionTracker(ceiling.samples_m[ceiling.observable]),
            interval_m=config.curve_interval_m,
            interval_s=config.curve_interval_s,
            mapper=mapper,
            clock=clock,
            observer=observer,
        )

    def on_event(self, event: MissionEvent) -> None:
        self._observer.on_event(event)
        if isinstance(event, Telemetry) and self._due(event):
            self._read(event.path_length_m, event.time_s)

    def wants_view(self) -> bool:
        return self._observer.wants_view()

    def on_view(self, view: MissionView) -> None:
        self._observer.on_view(view)

    def finished(self, path_m: float, time_s: float) -> tuple[CurvePoint, ...]:
        """All points, the last of them of the map as it is now, after `path_m` and `time_s`."""
        if self._points and self._points[-1].time_s >= time_s:
            self._points.pop()
        self._read(path_m, time_s)
        return tuple(self._points)

    def state(self) -> dict[str, Any]:
        """What later readings depend on besides the map."""
        points = [point.model_dump() for point in self._points]
        return {"points": points, "wall_s": self.wall_s, "tracker": self._tracker.state()}

    def restore(self, state: dict[str, Any]) -> None:
        self._points = [CurvePoint(**point) for point in state["points"]]
        self.wall_s = state["wall_s"]
        self._tracker.restore(state["tracker"])

    def _due(self, event: Telemetry) -> bool:
        if not self._points:
            return True
        last = self._points[-1]
        return (
            event.path_length_m - last.path_m >= self._interval_m
            or event.time_s - last.time_s >= self._interval_s
        )

    def _read(self, path_m: float, time_s: float) -> None:
        with self._clock.stopped():
            began = time.perf_counter()
            ratio = self._tracker.read(self._mapper.gaussians.centres_m)
            self.wall_s += time.perf_counter() - began
        self._points.append(CurvePoint(path_m=path_m, time_s=time_s, ratio=ratio))
