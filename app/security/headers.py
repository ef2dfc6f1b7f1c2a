"""What browsers are told of every page: nothing comes from elsewhere, nobody frames it."""

from __future__ import annotations

RawHeaders = list[tuple[bytes, bytes]]

_COMMON: RawHeaders = [
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), microphone=(), geolocation=(), usb=()"),
]


def security_headers(path: str, host: str) -> RawHeaders:
    """Headers for the answer to a request for `path` under the (allowed) name `host`."""
    policy = _viewer_policy(host) if path.startswith("/viewer/") else _page_policy(host)
    headers = [*_COMMON, (b"content-security-policy", policy.encode("latin-1"))]
    if path.startswith("/api/"):
        headers.append((b"cache-control", b"no-store"))
    return headers


def _page_policy(host: str) -> str:
    return (
        "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; script-src 'self'; "
        f"connect-src 'self' {_sockets(host)}; frame-src 'self'; object-src 'none'; base-uri 'none'; "
        "form-action 'self'; frame-ancestors 'none'"
    )


def _viewer_policy(host: str) -> str:
    """viser's page is one file that unpacks itself; without `unsafe-eval` its splats draw unsorted.

    Connections go to this service alone: a link with `?websocket=` elsewhere would let a stranger draw, and
    run scripts, in the operator's viewer.
    """
    return (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' blob:; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; font-src 'self' data:; "
        f"worker-src 'self' blob: data:; connect-src 'self' blob: data: {_sockets(host)}; object-src 'none'; "
        "base-uri 'none'; form-action 'none'; frame-src 'none'; frame-ancestors 'self'"
    )


def _sockets(host: str) -> str:
    return f"ws://{host} wss://{host}"
