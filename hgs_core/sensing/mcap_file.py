"""MCAP files with ROS 2 messages."""

from __future__ import annotations

import io
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from jaxtyping import Float
from mcap.reader import McapReader, make_reader
from mcap.records import Channel, Message, Schema
from mcap_ros2.decoder import DecoderFactory
from numpy import ndarray

from hgs_core.errors import StreamError


@dataclass(frozen=True, kw_only=True)
class Topic:
    """What a file holds of one topic."""

    name: str
    schema: str
    """Message type, `package/msg/Type`."""
    n_messages: int


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredMessage:
    """A message as it lies in the file."""

    topic: str
    number: int
    """Of its topic, from 0."""
    where: str
    """File, topic and number, for errors."""
    schema: Schema | None
    channel: Channel
    data: bytes

    def stamp_s(self) -> float:
        """Time [s] of the `std_msgs/Header` that the message begins with, without decoding the rest.

        Raises `StreamError` for a message too short to have one.
        """
        if len(self.data) < 12:
            raise StreamError(f"{self.where}: {len(self.data)} bytes are no message with a header")
        sec, nanosec = struct.unpack_from("<iI" if self.data[1] & 1 else ">iI", self.data, 4)
        return float(sec) + 1e-9 * float(nanosec)


class McapFile:
    """Reads a file's topics and, in order of their log times, its messages.

    Raises `StreamError` for a file that is missing, cut short or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._decoders = DecoderFactory()
        with self._open() as file:
            try:
                summary = make_reader(file, validate_crcs=True).get_summary()
            except Exception as error:  # whatever bytes that are none of MCAP's make go wrong
                raise self._damaged(error) from error
        if summary is None or summary.statistics is None:
            raise StreamError(f"{path} has no summary of its topics: rebuild it with `mcap recover`")
        counts: Counter[str] = Counter()
        for number, channel in summary.channels.items():
            counts[channel.topic] += summary.statistics.channel_message_counts.get(number, 0)
        schemas = {
            channel.topic: summary.schemas[channel.schema_id].name if channel.schema_id else "(no schema)"
            for channel in summary.channels.values()
        }
        self.topics = [
            Topic(name=name, schema=schemas[name], n_messages=counts[name]) for name in sorted(schemas)
        ]

    def described(self) -> str:
        """Its topics and their types, for messages."""
        return ", ".join(f"{topic.name} ({topic.schema})" for topic in self.topics) or "none"

    def messages(self, topics: Collection[str]) -> Iterator[StoredMessage]:
        """All messages of these topics, not decoded. Raises `StreamError` where the file is damaged."""
        counts: Counter[str] = Counter()
        if not topics:
            return
        with self._open() as file:
            for schema, channel, message in self._records(file, topics):
                number = counts[channel.topic]
                counts[channel.topic] += 1
                yield StoredMessage(
                    topic=channel.topic,
                    number=number,
                    where=f"{self.path}: topic {channel.topic}, message {number}",
                    schema=schema,
                    channel=channel,
                    data=message.data,
                )

    def first(self, topic: str) -> StoredMessage:
        """The first message of a topic. Raises `StreamError` when there is none."""
        for message in self.messages([topic]):
            return message
        raise StreamError(f"{self.path}: topic {topic} has no message; there are: {self.described()}")

    def stamps_s(self, topic: str) -> Float[ndarray, " n"]:
        """Times [s] in the headers of a topic's messages. Raises `StreamError` where they do not rise."""
        stamps = np.array([message.stamp_s() for message in self.messages([topic])])
        late = np.flatnonzero(np.diff(stamps) <= 0)
        if len(late):
            k = int(late[0])
            raise StreamError(
                f"{self.path}: topic {topic}, message {k + 1}: its time {stamps[k + 1]:.6f} s is not after "
                f"{stamps[k]:.6f} s before it; record with the sensor's own stamps"
            )
        return stamps

    def decode(self, message: StoredMessage) -> Any:
        """The message with the fields that its schema names. Raises `StreamError` when it has others."""
        try:
            decoder = self._decoders.decoder_for(message.channel.message_encoding, message.schema)
            decoded = None if decoder is None else decoder(message.data)
        except Exception as error:  # definitions and bytes are the file's: anything may go wrong in them
            raise StreamError(
                f"{message.where}: {len(message.data)} bytes are not what its type says: {error!r}"
            ) from error
        if decoded is None:
            raise StreamError(
                f"{message.where}: encoded as {message.channel.message_encoding!r}; expected ROS 2 messages "
                "(cdr) with their .msg definitions, as `ros2 bag record --storage mcap` writes them"
            )
        return decoded

    def _open(self) -> IO[bytes]:
        try:
            return io.BufferedReader(io.FileIO(self.path))
        except OSError as error:
            raise StreamError(f"cannot read {self.path}: {error.strerror}") from error

    def _records(
        self, file: IO[bytes], topics: Collection[str]
    ) -> Iterator[tuple[Schema | None, Channel, Message]]:
        try:
            reader: McapReader = make_reader(file, validate_crcs=True)
            # In a loop of its own: what a consumer of the messages raises is not the file's fault.
            records = reader.iter_messages(topics=list(topics))
        except Exception as error:
            raise self._damaged(error) from error
        while True:
            try:
                record = next(records)
            except StopIteration:
                return
            except Exception as error:  # whatever bytes that are none of MCAP's make go wrong
                raise self._damaged(error) from error
            yield record

    def _damaged(self, error: Exception) -> StreamError:
        return StreamError(
            f"{self.path} is cut short or damaged ({type(error).__name__} {error}): copy it again, or save "
            "what there is with `mcap recover`"
        )
