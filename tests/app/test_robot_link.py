"""The way from a robot's connection to the mission's process, which may be busy for long."""

from multiprocessing import Pipe

from app.missions.robot_link import RobotLink
from hgs_core.live.messages import Bye, Cloud, Report, encoded
from tests.live.test_messages import HELLO

POINTS = 100_000


class Silent:
    """A robot's connection that nothing comes back on."""

    def deliver(self, content: bytes, *, urgent: bool = False) -> None:
        raise AssertionError(f"nothing is to be said: {content[:100]!r}")

    def dismiss(self, code: int, reason: str) -> None:
        raise AssertionError(f"not to be dismissed: {reason}")


def test_what_a_busy_process_cannot_take_is_counted_and_a_goodbye_still_gets_through() -> None:
    ours, theirs = Pipe()
    link, robot = RobotLink(ours), Silent()
    assert link.connect(robot)
    link.take(robot, encoded(HELLO))
    for k in range(16):  # 1.2 MB each: after 14 of them more than 16 MiB wait
        link.take(robot, encoded(Cloud(sequence=k, time_s=0.1 * k, points_m=bytes(12 * POINTS))))
    assert link.figures.missed == 2
    standing = Report(time_s=2.0, x_m=0.0, y_m=0.0, yaw_rad=0.0, path_length_m=0.0, standing=True)
    link.take(robot, encoded(standing))
    assert link.figures.missed == 3
    assert link.report == standing
    link.take(robot, encoded(Bye(reason="enough")))
    assert (link.figures.missed, link.figures.refused) == (3, 0)

    link.begin()
    taken = [theirs.recv_bytes() for _ in range(16)]
    assert taken[0] == encoded(HELLO)
    assert taken[-1] == encoded(Bye(reason="enough"))
