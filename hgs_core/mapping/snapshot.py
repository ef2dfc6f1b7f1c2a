"""What everything above the mapper sees of the maps."""

from __future__ import annotations

from dataclasses import dataclass

from hgs_core.gaussians.gaussian_map import GaussianMap
from hgs_core.voxels.voxel_map import VoxelMap


@dataclass(frozen=True, kw_only=True, eq=False)
class MapSnapshot:
    """Both maps at one moment: read-only by convention, versioned, never copied whole.

    Valid until the mapper's next `integrate`; equal `version`s mean that nothing changed.
    """

    gaussians: GaussianMap
    voxels: VoxelMap
    version: int
    timestamp_s: float

    def is_same(self, other: MapSnapshot | None) -> bool:
        """Whether both show the same maps in the same state."""
        return (
            other is not None
            and other.version == self.version
            and other.gaussians is self.gaussians
            and other.voxels is self.voxels
        )
