"""Which topics of a robot hold what: named by the user, or found among those that are published."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from hgs_core.errors import StreamError
from hgs_core.sensing.ros.images import COMPRESSED_IMAGE, IMAGE
from hgs_core.sensing.ros.poses import ODOMETRY
from hgs_core.sensing.ros.topics import NONE, TopicChoice, TopicOptions, Topics

LASER_SCAN: Final = "sensor_msgs/msg/LaserScan"
_DEPTH_TRANSPORT: Final = "/compressedDepth"
_COLOUR_TRANSPORT: Final = "/compressed"


class RosTopicOptions(TopicOptions):
    """As for recordings, and the scanner. Poses come from an Odometry alone."""

    scan: str | None = None
    """LaserScan, or `none`; without a name: the only one there is, else none."""


@dataclass(frozen=True, kw_only=True)
class RosTopics:
    images: Topics
    odometry: str
    scan: str | None


def chosen_topics(schemas: dict[str, str], options: RosTopicOptions, *, source: str) -> RosTopics:
    """Raises `StreamError` naming what is missing or unclear, and what there is."""
    described = ", ".join(f"{topic} ({schema})" for topic, schema in sorted(schemas.items())) or "nothing"
    named = {options.colour, options.depth}
    choice = TopicChoice(
        {topic: schema for topic, schema in schemas.items() if topic in named or _is_best(topic, schemas)},
        source=source,
        described=described,
        is_depth=_is_depth,
        tf_reaches=lambda _: False,
    )
    unread = (options.world_frame, options.pose_frame, options.cloud)
    if options.pose in ("tf", NONE) or any(option is not None for option in unread):
        raise StreamError(
            f"{source}: a robot's pose is read from an Odometry alone, in its own frames: leave out pose=tf, "
            "pose=none, world_frame, pose_frame and cloud"
        )
    return RosTopics(
        images=choice.choose(options.model_copy(update={"pose": NONE})),
        odometry=choice.only(options.pose, "pose", (ODOMETRY,)),
        scan=_scan(choice, schemas, options.scan),
    )


def _scan(choice: TopicChoice, schemas: dict[str, str], named: str | None) -> str | None:
    if named == NONE or (named is None and LASER_SCAN not in schemas.values()):
        return None
    return choice.only(named, "scan", (LASER_SCAN,))


def _is_best(topic: str, schemas: dict[str, str]) -> bool:
    """Of an image that is published raw and compressed, too, the fitting compressed one; all that is none."""
    schema = schemas[topic]
    if schema == IMAGE:
        transport = _DEPTH_TRANSPORT if _is_depth(topic) else _COLOUR_TRANSPORT
        return schemas.get(topic + transport) != COMPRESSED_IMAGE
    if schema != COMPRESSED_IMAGE:
        return True
    for transport, depth in ((_DEPTH_TRANSPORT, True), (_COLOUR_TRANSPORT, False)):
        if topic.endswith(transport):
            return _is_depth(topic.removesuffix(transport)) == depth
    return True


def _is_depth(topic: str) -> bool:
    return "depth" in topic.lower()
