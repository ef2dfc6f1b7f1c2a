"""`hgs serve`: the service with the operator page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import ERRORS


def serve(
    host: Annotated[str, typer.Option(help="Address to listen on; this machine's own only.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 8000,
    data_dir: Annotated[Path, typer.Option(help="Where missions and their results are kept.")] = Path("runs"),
    demo: Annotated[bool, typer.Option("--demo", help="Start a mission in the built-in house.")] = False,
) -> None:
    """Serve the operator page and the HTTP interface until Ctrl-C.

    Exit codes: 0 stopped, 2 an option is wrong, 4 the address cannot be used.
    """
    from app import main

    ERRORS.print(f"hgs serves on http://{host}:{port}", highlight=False)
    main.serve(host=host, port=port, data_dir=data_dir, demo=demo)
