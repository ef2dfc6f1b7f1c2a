"""`hgs token`: a new token for the service."""

from __future__ import annotations

from typing import Annotated

import typer

from app.cli.console import ERRORS, OUTPUT


def token(
    role: Annotated[str, typer.Argument(help="operator, viewer or robot")],
    name: Annotated[str, typer.Argument(help="Who will hold it, for the audit.")],
) -> None:
    """Make a token: its line for the file that HGS_TOKEN_FILE names goes to standard output, the token itself
    to standard error, once. Only its hash is kept.

        hgs token operator alice >> tokens
    """
    from app.security.principal import Role
    from app.security.tokens import new_token

    if role not in set(Role):
        raise typer.BadParameter(f"{role!r} is no role; there are: {', '.join(Role)}")
    secret, made = new_token(Role(role), name)
    OUTPUT.print(made.line, highlight=False, soft_wrap=True, markup=False)
    ERRORS.print(f"token of {name}: {secret}", highlight=False, soft_wrap=True, markup=False)
