"""Configs refuse what they do not know and never change."""

from __future__ import annotations

import pytest
from pydantic import Field, ValidationError

from hgs_core.config.base import StrictConfig


class Example(StrictConfig):
    range_m: float = Field(5.0, gt=0)
    """How far it sees [m]."""


class DefaultOutOfRange(StrictConfig):
    range_m: float = Field(-1.0, gt=0)


def test_an_unknown_field_is_refused_by_name() -> None:
    with pytest.raises(ValidationError, match="rnage_m"):
        Example.model_validate({"rnage_m": 3.0})


def test_a_value_out_of_range_says_what_is_allowed() -> None:
    with pytest.raises(ValidationError, match="greater than 0") as caught:
        Example(range_m=-2.0)
    assert "range_m" in str(caught.value)


def test_a_default_is_held_to_the_same_rules() -> None:
    with pytest.raises(ValidationError):
        DefaultOutOfRange()


def test_a_config_is_frozen() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        Example().range_m = 3.0  # type: ignore[misc]


def test_docstrings_of_fields_become_their_descriptions() -> None:
    assert Example.model_fields["range_m"].description == "How far it sees [m]."
