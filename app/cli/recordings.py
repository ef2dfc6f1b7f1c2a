"""Recordings on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from app.cli.run import parse_settings

if TYPE_CHECKING:
    from hgs_core.sensing.ros.topics import TopicOptions

T = TypeVar("T", bound="TopicOptions")

TopicSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--topic",
        metavar="KEY=VALUE",
        help="In an MCAP file: colour, depth, colour_info, depth_info, pose, ...; may be repeated.",
    ),
]


def parse_topics(settings: list[str] | None) -> TopicOptions | None:
    """What the `--topic` options say of a recording; None without any. A wrong one is a usage error."""
    from hgs_core.sensing.ros.topics import TopicOptions

    return parse_topic_options(settings, TopicOptions) if settings else None


def parse_topic_options(settings: list[str] | None, options: type[T]) -> T:
    """The same as `options` of a kind, their defaults without any."""
    from pydantic import ValidationError

    try:
        return options.model_validate(parse_settings(settings or []))
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}" for e in error.errors()
        )
        known = ", ".join(options.model_fields)
        raise typer.BadParameter(f"{wrong}. There are: {known}", param_hint="--topic") from error
