"""Plans again on recorded maps, in an interpreter in which no ground truth can be imported.

    python -m tests.planning.replan_recorded RECORDINGS ANSWERS PRESET...

RECORDINGS is a file of `recorded_maps.save`; ANSWERS becomes a JSON file with one list a preset, one answer a
recording.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

GROUND_TRUTH = ("hgs_core.scene", "hgs_core.simulation", "hgs_core.evaluation", "hgs_core.mission")


class NoGroundTruth:
    """An import finder that refuses what knows the true world."""

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name.startswith(GROUND_TRUTH):
            raise ImportError(f"{name} is ground truth: no planner may import it")
        return None


def answers_of(preset: str, recordings: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A planner of that preset, new for each recording: what it answers, and the room its path has."""
    import numpy as np

    from hgs_core.config.presets import load_preset
    from hgs_core.geometry.boxes import Box
    from hgs_core.planning.navigation_grid import build_navigation_grid
    from hgs_core.planning.plan import Plan
    from hgs_core.planning.registry import build_planner, planner_config
    from hgs_core.planning.survey import PlannerContext
    from hgs_core.robot.differential import DifferentialConfig
    from tests.planning import recorded_maps

    config = planner_config(load_preset("planner", preset))
    answers = []
    for recording in recordings:
        snapshot, robot = recorded_maps.play_back(recording)
        region = Box(lower_m=np.array(recording["lower_m"]), upper_m=np.array(recording["upper_m"]))
        context = PlannerContext(
            robot=DifferentialConfig(),
            camera=recorded_maps.PLANNED_FOR,
            camera_height_m=recorded_maps.CAMERA_HEIGHT_M,
            camera_range_m=recorded_maps.RANGE_M,
            region=region,
        )
        answer = build_planner(config, context).plan(snapshot, robot, np.random.default_rng(0))
        kept: dict[str, Any] = {
            "kind": type(answer).__name__,
            "reason": answer.reason,
            "candidates": [
                [c.x_m, c.y_m, c.coverage_gain, c.quality_gain, c.total_gain, str(c.status)]
                for c in answer.candidates
            ],
        }
        if isinstance(answer, Plan):
            grid = build_navigation_grid(
                snapshot.voxels,
                config.navigation,
                context.robot,
                robot_xy_m=np.array([robot.x_m, robot.y_m]),
                gaussians=snapshot.gaussians,
            )
            kept["positions_m"] = answer.path.positions_m.tolist()
            kept["n_views"] = int(np.isfinite(answer.path.yaws_rad).sum())
            kept["clearance_m"] = grid.path_clearance_m(answer.path.positions_m).tolist()
            kept["robot_m"] = [robot.x_m, robot.y_m]
            kept["radius_m"] = context.robot.radius_m
        else:
            kept["unseen"] = [str(region.reason) for region in answer.unseen]
        answers.append(kept)
    return answers


def main() -> None:
    recordings_file, answers_file, *presets = sys.argv[1:]
    sys.meta_path.insert(0, NoGroundTruth())  # type: ignore[arg-type]
    from tests.planning import recorded_maps

    recordings = recorded_maps.load(Path(recordings_file))
    answers = {preset: answers_of(preset, recordings) for preset in presets}
    loaded = sorted(name for name in sys.modules if name.startswith(GROUND_TRUTH))
    Path(answers_file).write_text(json.dumps({"answers": answers, "ground_truth_loaded": loaded}))


if __name__ == "__main__":
    main()
