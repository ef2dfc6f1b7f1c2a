"""Recordings as frames with poses, wherever they come from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from hgs_core.errors import StreamError
from hgs_core.sensing.frame import Frame
from hgs_core.sensing.mcap_recording import McapRecording
from hgs_core.sensing.raw_frame import FrameSource
from hgs_core.sensing.rectifier import Rectifier
from hgs_core.sensing.ros.topics import TopicOptions
from hgs_core.sensing.tum import TumRecording


def open_recording(path: Path, options: TopicOptions | None = None) -> FrameSource:
    """A folder in the TUM layout, or an MCAP file, of which `options` names the topics.

    Raises `StreamError` when there is neither or it is malformed.
    """
    if path.is_dir():
        if options is not None:
            raise StreamError(f"{path} is a folder in the TUM layout, which has no topics to choose")
        return TumRecording(path)
    if path.suffix == ".mcap":
        return McapRecording(path, options or TopicOptions())
    there_is = "it ends otherwise" if path.exists() else "it is missing"
    raise StreamError(
        f"{path} is no recording ({there_is}): expected a folder with rgb.txt, depth.txt and "
        "intrinsics.json, or a file .mcap"
    )


class RecordedSequence:
    """The frames of a recording that come with a pose, rectified (`Rectifier`) and numbered from 0.

    Iterating reads images one by one. Frames without a pose are left out and count as unmatched. Raises
    `StreamError` for a recording that is malformed, or none of whose frames has a pose.
    """

    def __init__(self, path: Path, options: TopicOptions | None = None) -> None:
        self._source = open_recording(path, options)
        self._n = int(self._source.is_posed.sum())
        self.n_unmatched = self._source.n_unmatched + len(self._source) - self._n
        if self._n == 0:
            raise StreamError(
                f"{path}: no colour image has a depth image and a pose; {self._source.pose_origin}"
            )

    def __len__(self) -> int:
        return self._n

    def __iter__(self) -> Iterator[Frame]:
        rectifier, sequence = Rectifier(), 0
        for raw in self._source:
            if raw.T_world_camera is not None:
                frame = rectifier.rectify(raw).at(raw.T_world_camera)
                yield replace(frame, sequence=sequence)
                sequence += 1
