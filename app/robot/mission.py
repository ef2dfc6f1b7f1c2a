"""What programs that take part in a mission share: make one, ask how it is, stay until it is over."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from app.missions.states import MissionState
from app.robot.client import RobotClient
from app.robot.clock import RobotClock
from app.robot.link_faults import FrameFaults, LinkFaults
from app.robot.onboard import Onboard
from app.robot.outcome import MissionWord, Outcome
from app.robot.rest import ServiceApi

_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM)
_NO_FAULTS: Final = LinkFaults()


def new_mission(
    api: ServiceApi, *, preset: str, seed: int, overrides: Mapping[str, str], say: Callable[[str], None]
) -> str:
    """A live mission, made and started; its id."""
    mission = api.create_live_mission(preset=preset, seed=seed, overrides=dict(overrides))
    api.start(mission)
    say(f"mission {mission} is made and started")
    return mission


def client_for(
    api: ServiceApi,
    mission: str,
    onboard: Onboard,
    *,
    token: str | None,
    clock: RobotClock,
    give_up_after_s: float,
    say: Callable[[str], None],
) -> RobotClient:
    """The connection of what is on board to a mission, with no faults but the network's own."""
    return RobotClient(
        api.ingest_url(mission),
        onboard,
        token=token,
        clock=clock,
        faults=_NO_FAULTS,
        frame_faults=FrameFaults(_NO_FAULTS, np.random.default_rng(0)),
        give_up_after_s=give_up_after_s,
        mission_word=lambda: mission_word(api.mission(mission)),
        say=say,
    )


async def until_over(client: RobotClient) -> Outcome:
    """Ctrl-C, which the main thread alone hears of, lets the robot stand and leave."""
    loop = asyncio.get_running_loop()
    heard = _SIGNALS if threading.current_thread() is threading.main_thread() else ()
    for number in heard:
        loop.add_signal_handler(number, client.interrupt)
    try:
        return await client.run()
    finally:
        for number in heard:
            loop.remove_signal_handler(number)


def mission_word(detail: dict[str, Any]) -> MissionWord:
    """How a mission is, from its detail."""
    state = MissionState(detail["state"])
    if state.ended or state is MissionState.STOPPING:
        return MissionWord(over=f"the mission is {state}: {detail['reason']}")
    waits = state in (MissionState.CREATED, MissionState.QUEUED, MissionState.STARTING)
    return MissionWord(waits=waits)
