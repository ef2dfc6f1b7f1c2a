"""The 3D scenes that are open: one viser server a mission, from the first look at it on."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from app.errors import Unavailable
from app.missions.display import DisplayView
from app.missions.mission import Mission
from app.settings import DisplaySettings
from app.viewer.scene import MissionScene

MOST_OPEN: Final = 4
"""Scenes held open at once; the one that nobody has looked at for longest makes room."""


class Scenes:
    """Safe to use from any thread. A mission that nobody looks at costs nothing here."""

    def __init__(self, display: DisplaySettings) -> None:
        self._display = display
        self._lock = threading.Lock()
        self._open: OrderedDict[str, MissionScene] = OrderedDict()
        self._lookers: dict[str, int] = {}

    def show(self, mission_id: str, sequence: int, view: DisplayView) -> None:
        """Draw `view` soon if somebody looks; returns at once."""
        scene = self._open.get(mission_id)
        if scene is not None:
            scene.show(view)

    @contextmanager
    def looking_at(self, mission: Mission) -> Iterator[MissionScene]:
        """The scene of `mission`, held open. Raises `Unavailable` when too many others are looked at."""
        scene = self._enter(mission)
        try:
            yield scene
        finally:
            with self._lock:
                self._lookers[mission.id] -= 1

    def close(self) -> None:
        with self._lock:
            scenes, self._open = list(self._open.values()), OrderedDict()
        for scene in scenes:
            scene.close()

    def _enter(self, mission: Mission) -> MissionScene:
        with self._lock:
            scene = self._open.get(mission.id)
            if scene is None:
                self._make_room()
                scene = MissionScene(self._display, mission.results_dir / "mesh.ply")
                self._open[mission.id] = scene
                self._lookers[mission.id] = 0
                newest = mission.views.newest()
                if newest is not None:
                    scene.show(newest[1])
            self._open.move_to_end(mission.id)
            self._lookers[mission.id] += 1
            return scene

    def _make_room(self) -> None:
        if len(self._open) < MOST_OPEN:
            return
        idle = next((mission_id for mission_id in self._open if self._lookers[mission_id] == 0), None)
        if idle is None:
            raise Unavailable(f"{MOST_OPEN} missions are being looked at; close one of their viewers first")
        self._open.pop(idle).close()
        del self._lookers[idle]
