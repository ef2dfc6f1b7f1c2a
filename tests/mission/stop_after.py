"""An observer and operator who stops a mission early."""

from hgs_core.mission.commands import Command
from hgs_core.mission.events import MissionEvent, MissionView


class StopAfter:
    """Stops the mission at its n-th poll; hears and wants nothing."""

    def __init__(self, polls: int) -> None:
        self._left = polls

    def poll(self) -> Command | None:
        self._left -= 1
        return Command.STOP if self._left == 0 else None

    def on_event(self, event: MissionEvent) -> None: ...

    def wants_view(self) -> bool:
        return False

    def on_view(self, view: MissionView) -> None: ...
