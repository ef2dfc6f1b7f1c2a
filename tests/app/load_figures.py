"""What tests of load share: waiting for a mission's end, and telling figures with the machine's load."""

from __future__ import annotations

import os
import sys
import time

import httpx


def until_ended(client: httpx.Client, mission: str, *, patience_s: float = 1800.0) -> dict:
    """The mission, once it has ended."""
    deadline = time.monotonic() + patience_s
    while True:
        found = client.get(f"/missions/{mission}").json()
        if found["ended_at"] is not None:
            return found
        assert found["state"] != "interrupted", found
        assert time.monotonic() < deadline, found
        time.sleep(0.5)


def say(capsys, text: str) -> None:
    """Print `text` whatever pytest captures."""
    with capsys.disabled():
        sys.stdout.write(f"\n{text}; load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors\n")
