"""Recordings on the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from app.cli.run import parse_settings

if TYPE_CHECKING:
    from hgs_core.sensing.ros.topics import TopicOptions

TopicSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--topic",
        metavar="KEY=VALUE",
        help="In an MCAP file: colour, depth, colour_info, depth_info, pose, ...; may be repeated.",
    ),
]


def parse_topics(settings: list[str] | None) -> TopicOptions | None:
    """What the `--topic` options say; None without any. A wrong one is a usage error."""
    if not settings:
        return None
    from pydantic import ValidationError

    from hgs_core.sensing.ros.topics import TopicOptions

    try:
        return TopicOptions.model_validate(parse_settings(settings))
    except ValidationError as error:
        wrong = "; ".join(
            f"{'.'.join(map(str, e['loc']))} = {e['input']!r}: {e['msg']}" for e in error.errors()
        )
        known = ", ".join(TopicOptions.model_fields)
        raise typer.BadParameter(f"{wrong}. There are: {known}", param_hint="--topic") from error
