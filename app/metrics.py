"""What the service measures of itself, for Prometheus.

Gauges are read when they are asked for; histograms and counters are told. Labels take as many values as there
are routes, states and missions that run: nothing that a client sends becomes a label.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final

import psutil
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, ProcessCollector, generate_latest
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric

from app.missions.mission import Mission
from app.missions.service import MissionService
from app.missions.states import MissionState
from app.storage.database import StorageError
from app.storage.missions import MissionStore
from app.storage.space import Space

log = logging.getLogger(__name__)

_STEP_BUCKETS: Final = (0.01, 0.025, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0, 2.0, 5.0, 10.0)
"""Of what a mission does again and again [s]."""
_REQUEST_BUCKETS: Final = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0)

_TELEMETRY: Final = {
    "time_s": ("hgs_mission_time_seconds", "Mission time"),
    "path_length_m": ("hgs_mission_path_metres", "Path driven"),
    "observed_volume_m3": ("hgs_mission_observed_cubic_metres", "Volume observed"),
    "missing_volume_m3": ("hgs_mission_missing_cubic_metres", "Volume still to be observed"),
    "n_gaussians": ("hgs_mission_gaussians", "Gaussians in the map"),
    "n_keyframes": ("hgs_mission_keyframes", "Keyframes kept"),
    "psnr_current_db": ("hgs_mission_psnr_decibels", "Newest image against the map"),
    "collisions": ("hgs_mission_collisions", "Contacts of the robot"),
    "frames_dropped": ("hgs_mission_frames_dropped", "Frames that came too late to be taken"),
}
"""Figures of the newest telemetry, of missions that run."""

CONTENT_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"


class Metrics:
    """One registry of its own a service; safe to use from any thread."""

    def __init__(self) -> None:
        registry = self._registry = CollectorRegistry(auto_describe=True)
        ProcessCollector(registry=registry)
        self._frames = Histogram(
            "hgs_frame_seconds",
            "Wall time from one frame of a mission to the next",
            buckets=_STEP_BUCKETS,
            registry=registry,
        )
        self._mapping = Histogram(
            "hgs_mapping_seconds",
            "Wall time of mapping for a frame, optimisation included",
            buckets=_STEP_BUCKETS,
            registry=registry,
        )
        self._planning = Histogram(
            "hgs_planning_seconds",
            "Wall time of a planning cycle (T_P), and of its parts",
            ["part"],
            buckets=_STEP_BUCKETS,
            registry=registry,
        )
        self._requests = Histogram(
            "hgs_http_request_seconds",
            "Wall time until the answer to a request began",
            ["method", "route", "status"],
            buckets=_REQUEST_BUCKETS,
            registry=registry,
        )
        self._subscribers = Gauge(
            "hgs_stream_subscribers", "Open streams of events and 3D scenes", ["kind"], registry=registry
        )
        self._skipped = Counter(
            "hgs_stream_telemetry_skipped",
            "Telemetry events that readers of streams missed because they were slow",
            registry=registry,
        )
        self._dropped = Counter(
            "hgs_mission_telemetry_dropped",
            "Telemetry events that mission processes dropped because the service was slow",
            registry=registry,
        )
        self._storage_errors = Counter(
            "hgs_database_errors", "Transactions that the database failed to do", registry=registry
        )
        self._removed = Counter(
            "hgs_retention_removed_bytes", "Missions' files removed to make room", registry=registry
        )
        self._last_wall_s: dict[str, float] = {}

    def watch(self, service: MissionService, store: MissionStore, space: Space) -> None:
        """Read the state of missions and of the disk whenever somebody asks."""
        self._registry.register(_Missions(store, service))
        self._registry.register(_Disk(space))

    def text(self) -> bytes:
        """Everything, in Prometheus' text format."""
        return generate_latest(self._registry)

    def request(self, method: str, route: str, status: int, seconds: float) -> None:
        self._requests.labels(method, route, str(status)).observe(seconds)

    def mission_event(self, mission_id: str, event: dict[str, Any]) -> None:
        """Take in an event of a mission process."""
        kind = event["kind"]
        if kind == "telemetry":
            before, now = self._last_wall_s.get(mission_id), float(event["wall_s"])
            self._last_wall_s[mission_id] = now
            if before is not None and now >= before:
                self._frames.observe(now - before)
            self._mapping.observe(float(event["mapping_s"]))
        elif kind == "plan":
            for part in ("planning_s", "viewpoint_evaluation_s", "local_s", "global_s"):
                name = "total" if part == "planning_s" else part.removesuffix("_s")
                self._planning.labels(name).observe(float(event[part]))

    def mission_ended(self, mission_id: str) -> None:
        self._last_wall_s.pop(mission_id, None)

    @contextmanager
    def subscriber(self, kind: str) -> Iterator[None]:
        """An open stream of that kind: `sse`, `websocket` or `viewer`."""
        gauge = self._subscribers.labels(kind)
        gauge.inc()
        try:
            yield
        finally:
            gauge.dec()

    def telemetry_skipped(self, number: int) -> None:
        self._skipped.inc(number)

    def telemetry_dropped(self, number: int) -> None:
        self._dropped.inc(number)

    def storage_error(self) -> None:
        self._storage_errors.inc()

    def files_removed(self, n_bytes: int) -> None:
        self._removed.inc(n_bytes)


class _Collector(ABC):
    """What is read when it is asked for. A part that fails is left out and logged: the rest is told."""

    def describe(self) -> Iterable[Metric]:
        return ()

    def collect(self) -> Iterator[Metric]:
        for read in self._parts():
            try:
                yield from read()
            except (StorageError, OSError, psutil.Error) as error:
                log.warning("a measurement is missing: %s", error)

    @abstractmethod
    def _parts(self) -> Iterable[Callable[[], Iterable[Metric]]]: ...


class _Missions(_Collector):
    def __init__(self, store: MissionStore, service: MissionService) -> None:
        self._store = store
        self._service = service

    def _parts(self) -> Iterable[Callable[[], Iterable[Metric]]]:
        return (self._by_state, self._queue, self._running)

    def _by_state(self) -> Iterable[Metric]:
        family = GaugeMetricFamily("hgs_missions", "Missions there are", labels=["state"])
        counted = self._store.count_by_state()
        for state in MissionState:
            family.add_metric([str(state)], counted.get(state, 0))
        yield family

    def _queue(self) -> Iterable[Metric]:
        waiting = len(self._service.queued())
        yield GaugeMetricFamily("hgs_missions_queued", "Missions that wait for a free place", value=waiting)

    def _running(self) -> Iterable[Metric]:
        missions = self._service.running()
        newest = {mission.id: mission.log.newest("telemetry") or {} for mission in missions}
        for key, (name, meaning) in _TELEMETRY.items():
            family = GaugeMetricFamily(name, meaning, labels=["mission"])
            for mission_id, event in newest.items():
                if (value := event.get(key)) is not None:
                    family.add_metric([mission_id], float(value))
            yield family
        yield _each(missions, "hgs_mission_silent_seconds", "Since the process was heard", _silence)
        yield _each(missions, "hgs_mission_resident_bytes", "Memory of the mission process", _memory)
        yield _each(missions, "hgs_mission_events_unsaved", "Events the database has not taken", _unsaved)


class _Disk(_Collector):
    def __init__(self, space: Space) -> None:
        self._space = space

    def _parts(self) -> Iterable[Callable[[], Iterable[Metric]]]:
        return (self._disk,)

    def _disk(self) -> Iterable[Metric]:
        disk = self._space.disk()
        yield GaugeMetricFamily("hgs_disk_free_bytes", "Free on the data folder's disk", value=disk.free)
        yield GaugeMetricFamily("hgs_disk_size_bytes", "Size of the data folder's disk", value=disk.total)
        yield GaugeMetricFamily("hgs_missions_files_bytes", "Missions' files", value=self._space.used_bytes)


def _each(
    missions: Iterable[Mission], name: str, meaning: str, read: Callable[[Mission], float | None]
) -> Metric:
    family = GaugeMetricFamily(name, meaning, labels=["mission"])
    for mission in missions:
        if (value := read(mission)) is not None:
            family.add_metric([mission.id], value)
    return family


def _silence(mission: Mission) -> float | None:
    return mission.silent_s


def _memory(mission: Mission) -> float | None:
    try:
        return float(psutil.Process(mission.pid).memory_info().rss) if mission.pid is not None else None
    except psutil.NoSuchProcess:
        return None  # it has just ended


def _unsaved(mission: Mission) -> float | None:
    return float(mission.log.n_unsaved)
