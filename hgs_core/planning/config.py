"""`PlannerConfig`: the hierarchical planner's settings, each level's beside that level."""

from __future__ import annotations

from pydantic import Field

from hgs_core.config.base import StrictConfig
from hgs_core.planning.global_planner import GlobalConfig
from hgs_core.planning.local_planner import LocalConfig
from hgs_core.planning.navigation_grid import NavigationConfig
from hgs_core.planning.roadmap import RoadmapConfig
from hgs_core.planning.subspaces import SubspaceConfig
from hgs_core.planning.views import ViewMemoryConfig


class PlannerConfig(StrictConfig):
    """Settings of `HierarchicalPlanner` (HGS-Planner section III-D)."""

    gain_threshold: float = Field(0.5, gt=0)
    """g_thres of Algorithm 1, on the total gain (1 = the gain configuration's scales): less is not worth a
    stop."""
    abandon_share: float = Field(0.5, gt=0, le=1)
    """A view on the way is given up when its gain fell below this share of the threshold."""
    recheck_interval_s: float = Field(1.0, gt=0)
    """While driving, the next view's gain is looked at again this often [s of mission time]."""
    navigation: NavigationConfig = NavigationConfig()
    roadmap: RoadmapConfig = RoadmapConfig()
    subspaces: SubspaceConfig = SubspaceConfig()
    global_level: GlobalConfig = GlobalConfig()
    local_level: LocalConfig = LocalConfig()
    memory: ViewMemoryConfig = ViewMemoryConfig()
