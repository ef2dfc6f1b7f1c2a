"""An event loop on a thread of its own, for servers of the tests."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE_S = 30.0


class OwnLoop:
    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def call(self, work: Coroutine[Any, Any, Any]) -> Any:
        """From any other thread: its result."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(PATIENCE_S)

    @contextmanager
    def running(
        self, serve: Callable[[threading.Event, asyncio.Event], Coroutine[Any, Any, None]]
    ) -> Iterator[None]:
        """`serve` sets the first event when it is ready, and ends with the second."""
        ready, over = threading.Event(), asyncio.Event()
        work = serve(ready, over)
        thread = threading.Thread(target=lambda: self._loop.run_until_complete(work), daemon=True)
        thread.start()
        assert ready.wait(PATIENCE_S)
        try:
            yield
        finally:
            self._loop.call_soon_threadsafe(over.set)
            thread.join(PATIENCE_S)
            self._loop.close()
