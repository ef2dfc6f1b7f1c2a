"""Which topics of a recording hold what: named by the user, or found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.errors import StreamError
from hgs_core.sensing.ros.cameras import CAMERA_INFO
from hgs_core.sensing.ros.images import COMPRESSED_IMAGE, IMAGE
from hgs_core.sensing.ros.poses import ODOMETRY, POSE_STAMPED

TF: Final = "tf"
NONE: Final = "none"
_TRANSPORTS: Final = ("compressed", "compressedDepth")
_POSES: Final = (POSE_STAMPED, ODOMETRY)


class TopicOptions(StrictConfig):
    """Topics to read, where they are not to be found, and how far apart in time things may be joined."""

    colour: str | None = None
    """Image or CompressedImage; without a name: the only one with colour."""
    depth: str | None = None
    """Image or CompressedImage (compressedDepth); without a name: the only one with depth."""
    colour_info: str | None = None
    """CameraInfo; without a name: `camera_info` beside the colour topic, or the only one there is."""
    depth_info: str | None = None
    """CameraInfo; without a name: `camera_info` beside the depth topic, or the only one there is."""
    pose: str | None = None
    """PoseStamped or Odometry, or `tf`, or `none`; without a name: the only topic there is, else tf where it
    leads from the world to the camera, else none."""
    cloud: str | None = None
    """PointCloud2 of a lidar, which `hgs replay` sends; without a name: the only one there is."""
    world_frame: str | None = None
    """Where poses are given from tf; without a name: the first of map, odom, world that tf has."""
    pose_frame: str | None = None
    """What a PoseStamped is the pose of; without a name: the colour camera (its optical frame)."""
    depth_is_registered: bool = False
    """Depth stands where the colour camera does although its frame_id says otherwise."""
    max_depth_offset_s: float = Field(0.02, ge=0)
    """Farthest in time [s] that a depth image may be from its colour image."""
    max_pose_offset_s: float = Field(0.02, ge=0)
    """Farthest in time [s] that a pose may be from its image where it is not between two."""
    max_pose_gap_s: float = Field(0.25, ge=0)
    """Poses so far apart [s] at most are interpolated."""


@dataclass(frozen=True, kw_only=True)
class Topics:
    """What to read."""

    colour: str
    depth: str
    colour_info: str
    depth_info: str
    pose: str | None
    """A topic, or `tf`; None: there are no poses."""


class TopicChoice:
    """Finds the topics of a file whose `schemas` are known by topic.

    `is_depth` looks into a topic's first message; `tf_reaches` tells, of a colour topic, whether tf leads
    from the world to its camera. Raises `StreamError` naming the topics there are.
    """

    def __init__(
        self,
        schemas: dict[str, str],
        *,
        source: str,
        described: str,
        is_depth: Callable[[str], bool],
        tf_reaches: Callable[[str], bool],
    ) -> None:
        self._schemas = schemas
        self._source = source
        self._described = described
        self._is_depth = is_depth
        self._tf_reaches = tf_reaches

    def choose(self, options: TopicOptions) -> Topics:
        colour = self._image(options.colour, "colour", depth=False)
        depth = self._image(options.depth, "depth", depth=True)
        return Topics(
            colour=colour,
            depth=depth,
            colour_info=self._info(options.colour_info, "colour_info", colour),
            depth_info=self._info(options.depth_info, "depth_info", depth),
            pose=self._pose(options.pose, colour),
        )

    def only(self, named: str | None, option: str, schemas: tuple[str, ...]) -> str:
        """The named topic, or the only one of these types."""
        return self._only(named, option, self._of(*schemas), " or ".join(schemas))

    def _image(self, named: str | None, option: str, *, depth: bool) -> str:
        images = self._of(IMAGE, COMPRESSED_IMAGE)
        if named is None:
            images = [topic for topic in images if self._is_depth(topic) == depth]
        return self._only(named, option, images, f"{option} images")

    def _info(self, named: str | None, option: str, image: str) -> str:
        infos = self._of(CAMERA_INFO)
        if named is None:
            parts = image.split("/")
            if parts[-1] in _TRANSPORTS:
                parts.pop()
            beside = "/".join([*parts[:-1], "camera_info"])
            if beside in infos:
                return beside
        return self._only(named, option, infos, f"CameraInfo of {image}")

    def _pose(self, named: str | None, colour: str) -> str | None:
        if named in (TF, NONE):
            return TF if named == TF else None
        topics = self._of(*_POSES)
        if named is not None or len(topics) == 1:
            return self._only(named, "pose", topics, "poses")
        if self._tf_reaches(colour):
            return TF
        if topics:
            raise self._unclear("pose", f"{len(topics)} topics hold poses ({', '.join(topics)})")
        return None

    def _only(self, named: str | None, option: str, candidates: list[str], what: str) -> str:
        if named is not None:
            if named not in candidates:
                raise self._unclear(option, f"topic {named} holds no {what}")
            return named
        if len(candidates) != 1:
            found = (
                f"{len(candidates)} topics hold {what} ({', '.join(candidates)})"
                if candidates
                else (f"no topic holds {what}")
            )
            raise self._unclear(option, found)
        return candidates[0]

    def _of(self, *schemas: str) -> list[str]:
        return [topic for topic, schema in self._schemas.items() if schema in schemas]

    def _unclear(self, option: str, problem: str) -> StreamError:
        return StreamError(
            f"{self._source}: {problem}; name it with the option {option!r}. There are: {self._described}"
        )
