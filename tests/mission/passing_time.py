"""Time that passes only when it is told to."""


class PassingTime:
    def __init__(self) -> None:
        self.began_s = 1000.0
        self._now_s = self.began_s

    def now(self) -> float:
        return self._now_s

    def sleep(self, duration_s: float) -> None:
        """Like a real one, never shorter than asked for, and never of no time at all."""
        self._now_s += max(duration_s, 1e-9)
