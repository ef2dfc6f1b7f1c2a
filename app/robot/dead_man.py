"""The dead-man's handle: a robot that nobody talks to stands."""

from __future__ import annotations

import math


class DeadMan:
    """Trips once when nothing was heard for its limit; whatever is heard then sets it again.

    Without a limit, before the first `Welcome`, it is taken to have tripped: nobody has sent the robot
    anywhere. All times are of one clock.
    """

    def __init__(self) -> None:
        self.limit_s = math.inf
        self._heard_s = -math.inf
        self._tripped = True

    def arm(self, limit_s: float, now_s: float) -> None:
        """With the service's limit, which it has just said."""
        self.limit_s = limit_s
        self.heard(now_s)

    def heard(self, now_s: float) -> None:
        """A message that was understood has just come."""
        if math.isfinite(self.limit_s):
            self._heard_s, self._tripped = now_s, False

    def trips(self, now_s: float) -> bool:
        """Whether the limit has passed since this was last asked, and nothing was heard."""
        if self._tripped or now_s - self._heard_s <= self.limit_s:
            return False
        self._tripped = True
        return True
