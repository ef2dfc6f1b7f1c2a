"""Gain evaluators by name: an entry point of the group `hgs.gains` names a function that builds one.

A gain from another package is one file and one line in that package's `pyproject.toml`:

    [project.entry-points."hgs.gains"]
    my-gain = "my_package.my_gain:build"

`build(config, camera, range_m)` returns a `GainEvaluator` for a level camera that measures depth as far as
`range_m`. Planner settings ask for it with `gain.method: my-gain`.
"""

from __future__ import annotations

from typing import Final

from hgs_core.config.plugins import load_plugin, plugin_names
from hgs_core.gain.viewpoint import GainConfig, GainEvaluator
from hgs_core.geometry.camera import CameraIntrinsics

GROUP: Final = "hgs.gains"


def gain_methods() -> list[str]:
    """Names of all registered evaluators."""
    return plugin_names(GROUP)


def build_evaluator(config: GainConfig, camera: CameraIntrinsics, range_m: float) -> GainEvaluator:
    """The evaluator that `config.method` names. Raises `ConfigError` naming what there is."""
    evaluator: GainEvaluator = load_plugin(GROUP, config.method, kind="gain")(config, camera, range_m)
    return evaluator
