"""`hgs serve`: the service with the operator page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import ERRORS


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; one that others reach needs HGS_OPERATOR_TOKEN.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 8000,
    data_dir: Annotated[
        Path, typer.Option(envvar="HGS_DATA_DIR", help="Where missions and their results are kept.")
    ] = Path("runs"),
    missions_at_once: Annotated[
        int,
        typer.Option(
            min=1, max=64, envvar="HGS_MISSIONS_AT_ONCE", help="Missions beside each other; more queue."
        ),
    ] = 1,
    demo: Annotated[bool, typer.Option("--demo", help="Start a mission in the built-in house.")] = False,
) -> None:
    """Serve the operator page and the HTTP interface until Ctrl-C.

    The environment says the rest: HGS_OPERATOR_TOKEN, HGS_VIEWER_TOKEN, HGS_TOKEN_FILE, HGS_ALLOWED_HOSTS,
    HGS_TRUSTED_PROXIES, HGS_DATABASE_URL, HGS_SCENES_DIR, HGS_RESUME_ON_START.
    Exit codes: 0 stopped, 2 an option or a variable is wrong, 4 the address cannot be used.
    """
    from app import main
    from app.settings import settings_from_environment

    settings = settings_from_environment(
        host=host, port=port, data_dir=data_dir, demo=demo, missions_at_once=missions_at_once
    )
    ERRORS.print(f"hgs serves on http://{host}:{port}", highlight=False)
    main.serve(settings)
