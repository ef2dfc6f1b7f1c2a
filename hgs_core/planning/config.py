"""Settings that every planner has, and those of the hierarchical one, each level's beside that level."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.gain.viewpoint import GainConfig
from hgs_core.planning.car_ways import KinodynamicConfig
from hgs_core.planning.global_planner import GlobalConfig
from hgs_core.planning.local_planner import LocalConfig
from hgs_core.planning.navigation_grid import NavigationConfig
from hgs_core.planning.roadmap import RoadmapConfig
from hgs_core.planning.subspaces import SubspaceConfig
from hgs_core.planning.views import ViewMemoryConfig


class PlannerConfig(StrictConfig):
    """What all planners share: how views are scored, where the robot can drive, what still counts as open.

    Subclasses name their `method`, by which the registry finds them.
    """

    method: str
    """Which planner: a name that `planner_methods()` lists."""
    recheck_interval_s: float = Field(1.0, gt=0)
    """While driving, the next view's gain is looked at again this often [s of mission time]."""
    gain: GainConfig = GainConfig()
    navigation: NavigationConfig = NavigationConfig()
    kinodynamic: KinodynamicConfig = KinodynamicConfig()
    subspaces: SubspaceConfig = SubspaceConfig()
    memory: ViewMemoryConfig = ViewMemoryConfig()


class HierarchicalConfig(PlannerConfig):
    """Settings of `HierarchicalPlanner` (HGS-Planner section III-D)."""

    method: Literal["hierarchical"] = "hierarchical"
    gain_threshold: float = Field(0.5, gt=0)
    """g_thres of Algorithm 1, on the total gain (1 = the gain configuration's scales): less is not worth a
    stop."""
    abandon_share: float = Field(0.5, gt=0, le=1)
    """A view on the way is given up when its gain fell below this share of the threshold."""
    roadmap: RoadmapConfig = RoadmapConfig()
    global_level: GlobalConfig = GlobalConfig()
    local_level: LocalConfig = LocalConfig()
