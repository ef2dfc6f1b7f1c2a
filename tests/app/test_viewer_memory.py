"""A viewer that shows a mission over and over: as many updates as hours bring, and no more memory."""

import sys
import threading

import psutil
import pytest
import viser
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from app.settings import DisplaySettings
from app.viewer.scene import MissionScene
from app.viewer.server import proof_headers
from tests.app.test_viewer import display


class Onlooker:
    """A client that reads everything, as a browser does, and keeps nothing."""

    def __init__(self, scene: MissionScene) -> None:
        self._socket = connect(
            scene.url.replace("http", "ws"),
            subprotocols=[f"viser-v{viser.__version__}"],
            additional_headers=proof_headers(),
            max_size=None,
        )
        self.received_bytes = 0
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._socket.close()
        self._thread.join(10)

    def _read(self) -> None:
        try:
            for message in self._socket:
                self.received_bytes += len(message)
        except ConnectionClosed:
            return


def looped(updates: int, n_splats: int) -> tuple[list[int], list[float], int]:
    """Show a growing mission again and again, every layer on: the messages that viser keeps and the resident
    memory [MiB] at the beginning, in the middle and at the end, and the bytes that a client was sent."""
    moments = [
        display(n_splats * (k + 1) // 10, n_candidates=4 * (k + 1), time_s=float(k)) for k in range(10)
    ]
    scene = MissionScene(DisplaySettings(interval_s=0.05))
    for layer in scene._layers:
        layer.set_visible(True)
    onlooker = Onlooker(scene)
    kept, resident_mib = [], []
    process = psutil.Process()
    try:
        for number in range(updates):
            if number in (updates // 5, updates // 2):
                kept.append(len(scene.server._websock_server._broadcast_buffer.message_from_id))
                resident_mib.append(process.memory_info().rss / 2**20)
            scene._draw(moments[number % 10])
            scene.server.flush()
        kept.append(len(scene.server._websock_server._broadcast_buffer.message_from_id))
        resident_mib.append(process.memory_info().rss / 2**20)
    finally:
        onlooker.close()
        scene.close()
    return kept, resident_mib, onlooker.received_bytes


def test_what_viser_keeps_for_new_clients_does_not_grow_with_the_updates():
    kept, _, received_bytes = looped(40, 2_000)
    assert received_bytes > 0
    assert kept[1] == kept[2] <= kept[0] + 5


@pytest.mark.slow
def test_hours_of_updates_take_no_more_memory_than_minutes(capsys):
    """7,200 updates are two hours at one a second."""
    kept, resident_mib, received_bytes = looped(7_200, 40_000)
    with capsys.disabled():
        figures = ", ".join(f"{value:.0f}" for value in resident_mib)
        sys.stdout.write(
            f"viewer: 7200 updates, {received_bytes / 2**20:.0f} MiB sent; resident after a fifth, half and "
            f"all of them: {figures} MiB; messages kept {kept}\n"
        )
    assert resident_mib[2] < resident_mib[1] + 50
    assert kept[1] == kept[2]
