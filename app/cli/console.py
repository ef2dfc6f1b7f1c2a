"""Where the command line writes: results to standard output, the rest to standard error."""

from rich.console import Console

OUTPUT = Console()
ERRORS = Console(stderr=True)
