"""Logging in from a browser."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response, status

from app.deps import RatesDep, RulesDep, SessionsDep, SettingsDep, TokensDep
from app.errors import Unauthorized
from app.openapi import problems
from app.schemas import Login, SessionInfo
from app.security.access import COOKIE, AccessRules
from app.security.principal import Principal, principal_of

router = APIRouter(prefix="/session", tags=["session"])

_COOKIE_PATH = "/"


@router.get("", operation_id="getSession")
def get_session(request: Request, rules: RulesDep) -> SessionInfo:
    """Who you are; it needs no login."""
    return _info(rules, principal_of(request.scope))


@router.post(
    "",
    status_code=status.HTTP_201_CREATED,
    operation_id="openSession",
    responses={
        201: {"headers": {"Set-Cookie": {"schema": {"type": "string"}, "description": "HttpOnly, Strict"}}},
        **problems(401),
    },
)
def open_session(
    login: Login,
    request: Request,
    response: Response,
    settings: SettingsDep,
    tokens: TokensDep,
    sessions: SessionsDep,
    rates: RatesDep,
    rules: RulesDep,
) -> SessionInfo:
    """Log in with a token; the answer sets a cookie that stands for it until it expires."""
    if not rules.login_required:
        return _info(rules, principal_of(request.scope))
    rates.count_login(request.client.host if request.client is not None else "unknown")
    token = tokens.identify(login.token)
    if token is None:
        raise Unauthorized("the token is not one of this service's")
    secret, session = sessions.open(token)
    response.set_cookie(
        COOKIE,
        secret,
        max_age=int(settings.access.session_s),
        path=_COOKIE_PATH,
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    return SessionInfo(login_required=True, name=token.name, role=token.role, expires_at=session.expires_at)


@router.delete("", status_code=status.HTTP_204_NO_CONTENT, operation_id="closeSession")
def close_session(request: Request, response: Response, sessions: SessionsDep) -> None:
    """Log out: the session ends at once, and with it the streams that it opened."""
    principal = principal_of(request.scope)
    if principal is not None and principal.session is not None:
        sessions.close(principal.session)
    response.delete_cookie(COOKIE, path=_COOKIE_PATH, httponly=True, samesite="strict")


def _info(rules: AccessRules, principal: Principal | None) -> SessionInfo:
    return SessionInfo(
        login_required=rules.login_required,
        name=principal.name if principal is not None else None,
        role=principal.role if principal is not None else None,
        expires_at=principal.expires_at if principal is not None else None,
    )
