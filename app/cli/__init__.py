"""The `hgs` command: one file a subcommand."""

from app.cli.application import application


def main() -> None:
    """Entry point of the `hgs` command."""
    application()
