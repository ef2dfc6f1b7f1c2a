"""Directives in a mission's record: one of the settings that differ from its preset's."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Final

from hgs_core.planning.directives import Directives

_SETTING: Final = "directives"


def directives_of(overrides: Mapping[str, str]) -> Directives:
    """What the operator asks of the mission that has these settings."""
    text = overrides.get(_SETTING)
    return Directives() if text is None else _parsed(text)


def with_directives(overrides: Mapping[str, str], directives: Directives) -> dict[str, str]:
    """The settings, asking for `directives`."""
    rest = without_directives(overrides)
    return rest if directives == Directives() else {**rest, _SETTING: directives.model_dump_json()}


def without_directives(overrides: Mapping[str, str]) -> dict[str, str]:
    """The other settings."""
    return {key: value for key, value in overrides.items() if key.partition(".")[0] != _SETTING}


@lru_cache(maxsize=256)
def _parsed(text: str) -> Directives:
    return Directives.model_validate_json(text)
