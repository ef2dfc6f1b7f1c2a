"""Messages that take a while, in the order in which they were sent."""

from __future__ import annotations

import asyncio
from typing import Generic, TypeVar

T = TypeVar("T")


class DelayLine(Generic[T]):
    """Of one event loop. Holds at most `most` items; see `put`."""

    def __init__(self, delay_s: float, *, most: int) -> None:
        self._delay_s = delay_s
        self._items: asyncio.Queue[tuple[float, T]] = asyncio.Queue(maxsize=most)

    def put(self, item: T) -> bool:
        """False, and the item is lost, when the line is full: nobody takes from its other end."""
        if self._items.full():
            return False
        self._items.put_nowait((asyncio.get_running_loop().time() + self._delay_s, item))
        return True

    async def get(self) -> T:
        due_s, item = await self._items.get()
        left_s = due_s - asyncio.get_running_loop().time()
        if left_s > 0.0:
            await asyncio.sleep(left_s)
        return item
