"""A room with a few boxes in it: opened in no time, explored in half a minute of mission time."""

from pathlib import Path

from tests.scene.scans import write_glb
from tests.scene.worlds import with_boxes

TINY = {
    "sensor": "rgbd_5m_tiny",
    "evaluate": "false",
    "threads": "1",
    "mapping.iterations_per_s": "2.5",
    "mesh.enabled": "false",
    "checkpoint.interval_s": "2",
    "checkpoint.most_share": "1",
}
"""Settings of missions that are killed and go on: a sixteenth of the pixels, and a checkpoint every 2 s."""
_BOXES = (
    ((-1.0, 0.2, 0.0), (-0.2, 2.0, 1.6)),
    ((1.2, -2.0, 0.0), (1.6, -0.4, 2.2)),
    ((1.8, 0.8, 0.0), (2.6, 1.6, 0.7)),
)


def write_small_room(folder: Path) -> Path:
    """The room as a mesh file in `folder`."""
    path = folder / "room.glb"
    write_glb(path, with_boxes(*_BOXES), z_up=False)
    return path
