"""What commands about live missions share: their options, and how they tell what became of one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from app.cli.console import ERRORS, OUTPUT
from app.cli.exit_codes import ExitCode

if TYPE_CHECKING:
    from app.robot.figures import Delays
    from app.robot.outcome import Outcome

ServerOption = Annotated[str, typer.Option(help="The service, http://HOST:PORT.")]
SERVER = "http://127.0.0.1:8000"
TokenOption = Annotated[
    str | None,
    typer.Option(
        envvar="HGS_OPERATOR_TOKEN",
        help="An operator's token, where the service asks for one.",
        show_default=False,
    ),
]
MissionOption = Annotated[
    str | None,
    typer.Option(metavar="ID", help="A mission that waits for its robot.", show_default="one is made"),
]
PresetOption = Annotated[str, typer.Option(help="Preset of the mission that is made.")]
SettingsOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the preset; may be repeated."),
]
RangeOption = Annotated[
    float, typer.Option("--range", min=0.1, max=100.0, metavar="M", help="Depth beyond is not used.")
]
GiveUpOption = Annotated[
    float, typer.Option(min=0.0, metavar="S", help="How long to try to reach a service that is away.")
]


def say(message: str) -> None:
    ERRORS.print(Text(message), soft_wrap=True)


def print_delays(delays: Delays) -> None:
    """From a frame's sending until it was in the map; nothing where no frame was."""
    if delays.p95 is not None:
        OUTPUT.print(f"frame to map: median {delays.p50:.2f} s, p95 {delays.p95:.2f} s", highlight=False)


def exit_for(outcome: Outcome) -> typer.Exit:
    from app.robot.outcome import Outcome

    if outcome is Outcome.INTERRUPTED:
        return typer.Exit(ExitCode.INTERRUPTED)
    return typer.Exit(ExitCode.FAILED if outcome is Outcome.GIVEN_UP else ExitCode.COMPLETE)
