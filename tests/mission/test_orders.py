"""What an operator says, as the loop takes it and as it is saved."""

import json
from pathlib import Path

import numpy as np
import pytest

from hgs_core.mission.commands import Command, Decide, Direct, Order, as_text, order_of
from hgs_core.mission.detour import Detour, Ending
from hgs_core.mission.events import StopReason
from hgs_core.mission.operator import Operator
from hgs_core.mission.state_file import StateWriter, read_state
from hgs_core.planning.directives import Directives
from hgs_core.planning.plan import UnseenReason, UnseenRegion
from hgs_core.robot.path import Path as RobotPath

ASKED = Directives(no_go=(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)),), max_path_m=12.5, approve_views=True)
SAID: list[Order] = [
    Command.PAUSE,
    Direct(directives=ASKED),
    Decide(plan_sequence=3, approved=True, candidate=7),
    Decide(plan_sequence=4, approved=False),
]


class Said:
    def __init__(self, orders: list[Order]) -> None:
        self._orders = list(orders)

    def poll(self) -> Order | None:
        return self._orders.pop(0) if self._orders else None


@pytest.mark.parametrize("order", [*SAID, *Command], ids=as_text)
def test_an_order_is_the_same_after_a_pipe(order: Order) -> None:
    assert order_of(as_text(order)) == order


def test_stop_counts_at_once_and_the_rest_when_it_is_taken() -> None:
    operator = Operator(Said([*SAID, Command.STOP]))
    assert not operator.has_news
    operator.listen()
    assert operator.stop_requested
    assert not operator.pause_requested, "the newest command counts"
    assert operator.take_directives() == ASKED
    assert operator.take_directives() is None
    assert operator.take_decision(3) is None, "the newest decision is on another plan"


def test_a_decision_counts_for_its_plan_alone_and_once() -> None:
    operator = Operator(Said(SAID[2:3]))
    operator.listen()
    decision = operator.take_decision(3)
    assert decision is not None
    assert decision.candidate == 7
    assert operator.take_decision(3) is None


def test_what_was_heard_and_not_acted_on_is_saved() -> None:
    operator, other = Operator(Said(SAID)), Operator(Said([]))
    operator.listen()
    other.restore(json.loads(json.dumps(operator.state())))
    assert other.take_directives() == ASKED
    assert other.take_decision(4) == SAID[3]


def test_ways_and_endings_under_way_are_saved(tmp_path: Path) -> None:
    path = RobotPath(positions_m=np.array([[0.0, 1.0], [2.0, 3.0]]), yaws_rad=np.array([np.nan, np.nan]))
    detour = Detour(path=path, done="out", leaving=True)
    region = UnseenRegion(
        lower_m=(0.0, 0.0, 0.0), upper_m=(1.0, 1.0, 1.0), volume_m3=0.5, reason=UnseenReason.PATH_BUDGET
    )
    ending = Ending(reason=StopReason.PATH_BUDGET, message="no further", unseen=(region,))
    with (tmp_path / "state").open("wb") as file:
        writer = StateWriter(file)
        writer.write({"detour": detour.state(), "ending": ending.state()})
        writer.close()
    found = read_state(tmp_path / "state")
    back = Detour.restore(found["detour"])
    np.testing.assert_array_equal(back.path.positions_m, path.positions_m)
    np.testing.assert_array_equal(back.path.yaws_rad, path.yaws_rad)
    assert (back.done, back.leaving) == ("out", True)
    assert Ending.restore(found["ending"]) == ending
