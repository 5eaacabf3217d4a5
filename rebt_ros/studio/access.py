"""Who may see and change what: checks that every request passes before it is looked at.

A page of another site must not reach a studio on the same machine.  A browser says in ``Host``
whom it means and in ``Origin`` whose page asks: both must be this studio's own.  What changes
something also needs the token of the session, which the browser keeps in a cookie that it sends to
nobody else and for nobody else's pages.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import urlsplit

COOKIE: Final = "rebt_ros_studio"

#: Sent with every answer.
HEADERS: Final[Mapping[str, str]] = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}

_LOCAL: Final = frozenset({"localhost", "127.0.0.1", "::1"})


@dataclass(frozen=True, slots=True)
class Access:
    """The rules of one session.

    Args:
        host: The address that the server listens on.
        port: Its port.
    """

    host: str
    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    """Of the session; never in a log line but the one that prints the URL."""

    @property
    def is_local(self) -> bool:
        """Whether only this machine can reach the server."""
        return self.host in _LOCAL

    @property
    def url(self) -> str:
        """What to open in a browser; from elsewhere it takes the token that is in it."""
        if self.is_local:
            return f"http://localhost:{self.port}"
        name = socket.gethostname() if _is_any(self.host) else self.host
        name = f"[{name}]" if ":" in name else name
        return f"http://{name}:{self.port}/?token={self.token}"

    def knows_host(self, host: str | None) -> bool:
        """Whether ``Host`` names this studio.

        A name that an attacker has made lead to this machine is none of its names; an address
        cannot be made to lead here.
        """
        parts = _split(f"//{host}") if host else None
        if parts is None:
            return False
        name, port = parts
        if port != self.port:
            return False
        if name in _LOCAL:
            return self.is_local or _is_any(self.host)
        if self.is_local:
            return False
        if name == self.host.lower():
            return True
        return _is_any(self.host) and (_is_address(name) or name == socket.gethostname().lower())

    def knows_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a page of this studio asks: ``Origin`` is exactly what ``Host`` says."""
        return self.knows_host(host) and origin is not None and origin == f"http://{host}"

    def has_token(self, given: str | None) -> bool:
        """Whether a token is that of the session; takes equally long whatever is given."""
        return given is not None and hmac.compare_digest(given.encode(), self.token.encode())


def _split(authority: str) -> tuple[str, int] | None:
    """Name and port of an authority; None where it is none."""
    try:
        parts = urlsplit(authority)
        if parts.username is not None or parts.path or parts.query or parts.fragment:
            return None
        return (parts.hostname or "", parts.port or 80)
    except ValueError:
        return None


def _is_any(host: str) -> bool:
    """Whether it stands for all addresses of the machine."""
    return host in {"0.0.0.0", "::", ""}


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
