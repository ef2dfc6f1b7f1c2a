"""`Rosbridge`: the connection to a rosbridge server (protocol 2, JSON over a WebSocket), by roslibpy."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from typing import Any, Final

from hgs_core.errors import ConfigError, StreamError

_CONNECT_S: Final = 10.0
_ANSWER_S: Final = 10.0
_RECONNECT_S: Final = 5.0
"""Longest wait between two attempts to connect again."""
_PING_S: Final = 2.0
"""A connection on which a ping is not answered for so long is lost, though nobody has closed it."""


class Rosbridge:
    """Connects again by itself when the connection is lost, and subscribes anew.

    Callbacks come from a thread of the library's and must not block. Raises `ConfigError` where the library
    is not installed, and `StreamError` where no server answers.
    """

    def __init__(self, url: str) -> None:
        try:
            import roslibpy
            from roslibpy.comm.comm_asyncio import AsyncioRosBridgeClientFactory
        except ImportError as error:
            raise ConfigError("rosbridge needs roslibpy: pip install 'hgs[ros]'") from error
        self.url = url
        self._library = roslibpy
        AsyncioRosBridgeClientFactory.set_max_delay(_RECONNECT_S)
        try:
            self._ros = roslibpy.Ros(url, transport="asyncio")
            # It is connecting already, but takes these when the other side has answered.
            self._ros.factory.setProtocolOptions(autoPingInterval=_PING_S, autoPingTimeout=_PING_S)
            self._ros.run(timeout=_CONNECT_S)
        except roslibpy.core.RosTimeoutError as error:
            self._ros.factory._stop = True  # or it would try for ever in the background
            raise StreamError(
                f"no rosbridge server answers at {url}: start one on the robot with "
                "`ros2 launch rosbridge_server rosbridge_websocket_launch.xml`"
            ) from error
        except Exception as error:  # the library raises bare Exceptions for addresses it cannot read
            raise StreamError(
                f"{url!r} is no address of a rosbridge server, ws://HOST:PORT: {error}"
            ) from error

    def topics(self) -> dict[str, str]:
        """Every topic's type, as `rosapi` (which comes with the server) tells."""
        service = self._library.Service(self._ros, "/rosapi/topics", "rosapi_msgs/srv/Topics")
        try:
            answer = service.call(self._library.ServiceRequest(), timeout=_ANSWER_S)
            return dict(zip(answer["topics"], answer["types"], strict=True))
        except Exception as error:  # the library raises a bare Exception when nobody answers
            raise StreamError(
                f"{self.url} does not tell its topics: start the node rosapi beside rosbridge, as its launch "
                f"file does ({error})"
            ) from error

    def subscribe(
        self, topic: str, schema: str, callback: Callable[[dict[str, Any]], None], *, interval_s: float = 0.0
    ) -> None:
        """`interval_s`: the server leaves out messages that follow sooner, and keeps one that waits."""
        throttle_ms = math.floor(1000.0 * interval_s)
        self._library.Topic(
            self._ros, topic, schema, throttle_rate=throttle_ms, queue_length=1 if interval_s else 0
        ).subscribe(callback)

    def publisher(self, topic: str, schema: str) -> Callable[[dict[str, Any]], None]:
        """What is said while there is no connection is lost: it must not be heard when there is one again."""
        advertised = self._library.Topic(self._ros, topic, schema, queue_size=1)
        advertised.advertise()

        def publish(content: dict[str, Any]) -> None:
            # The library's own way would keep it for the next connection.
            connection = self._ros.factory._proto
            if connection is not None:
                message = {"op": "publish", "topic": topic, "msg": content}
                connection.send_ros_message(self._library.Message(message))

        return publish

    def close(self) -> None:
        self._ros.factory._stop = True  # connects no more
        with contextlib.suppress(self._library.core.RosTimeoutError):
            self._ros.close()
