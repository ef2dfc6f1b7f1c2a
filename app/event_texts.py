"""Events as they are sent: written once for all who read them. A plan's candidates take their time."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from typing import Final

import msgspec

from app.storage.missions import Event

_KEPT: Final = 64


class EventText:
    """One event, as JSON and as a server-sent event."""

    def __init__(self, event: Event) -> None:
        self.bytes: Final = msgspec.json.encode(event)
        """JSON."""
        self._number = event.get("sequence")

    @cached_property
    def text(self) -> str:
        return self.bytes.decode()

    @cached_property
    def server_sent(self) -> bytes:
        """With its number as `id`; one without a number says `alive` and sets no `Last-Event-ID`."""
        if self._number is None:
            return b"event: alive\ndata: %b\n\n" % self.bytes
        return b"id: %d\ndata: %b\n\n" % (self._number, self.bytes)


class EventTexts:
    """The newest ones of all missions."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[str, int], EventText] = OrderedDict()

    def of(self, mission_id: str, event: Event) -> EventText:
        number = event.get("sequence")
        if number is None:
            return EventText(event)
        known = self._known.get((mission_id, number))
        if known is None:
            known = self._known[mission_id, number] = EventText(event)
            if len(self._known) > _KEPT:
                self._known.popitem(last=False)
        return known
