"""The command line put together: subcommands, `--version`, and how errors are told."""

from __future__ import annotations

from importlib.metadata import version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from app.cli.bench import bench
from app.cli.bench_paths import paths
from app.cli.bench_reference import reference
from app.cli.bundle import bundle
from app.cli.console import ERRORS, OUTPUT
from app.cli.evaluate import evaluate
from app.cli.exit_codes import ExitCode
from app.cli.mesh import mesh
from app.cli.picture import picture
from app.cli.presets import presets
from app.cli.refine import refine
from app.cli.replay import replay
from app.cli.report import report
from app.cli.resume import resume
from app.cli.robot import robot
from app.cli.ros import ros
from app.cli.run import run
from app.cli.scenes import scenes
from app.cli.serve import serve
from app.cli.token import token
from hgs_core.errors import HgsError


class _ExplainingGroup(TyperGroup):
    """Tells expected errors in one line; anything else is a defect and keeps its traceback (exit code 1)."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except HgsError as error:
            ERRORS.print(f"error: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
            raise typer.Exit(ExitCode.USAGE) from error
        except BrokenPipeError:
            raise  # the reader of our output is gone: the command line's own way to end quietly
        except OSError as error:
            ERRORS.print(f"error: {error}", style="red", markup=False, highlight=False, soft_wrap=True)
            raise typer.Exit(ExitCode.FAILED) from error


application = typer.Typer(
    name="hgs",
    cls=_ExplainingGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
application.command()(run)
application.command()(resume)
application.command()(evaluate)
application.command()(refine)
application.command()(report)
application.command()(mesh)
application.command()(picture)
application.command()(scenes)
application.command()(presets)
application.command()(serve)
application.command()(robot)
application.command()(replay)
application.command()(ros)
application.command()(token)
application.command()(bundle)
bench.command()(paths)
bench.command()(reference)
application.add_typer(bench, name="bench")


def _print_version(wanted: bool) -> None:
    if wanted:
        OUTPUT.print(f"hgs {version('hgs')}", highlight=False)
        raise typer.Exit


@application.callback()
def root(
    _version: Annotated[
        bool,
        typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    """Active scene reconstruction: a robot explores an unknown building, maps it with Gaussians, and stops
    by itself."""
