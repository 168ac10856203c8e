"""Who may pass the door: each route declares the scope that it needs, which a caller has or not."""

from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias, TypeVar
from urllib.parse import unquote

from starlette.routing import BaseRoute
from starlette.types import Scope as Connection

from hybridmpm_service.errors import KeyInAddressError, KeyRefusedError
from hybridmpm_service.keys.callers import NOBODY, Caller, Scope
from hybridmpm_service.keys.file import KEY_START, LINK_START
from hybridmpm_service.keys.ring import Ring

PROTOCOL = "hybridmpm"
"""Subprotocol of streams. A browser, which cannot send headers with them, offers its token as another one."""
KEY_NAME = "hybridmpm.key"
"""Name in the scope of a connection: the name of its caller, for the log."""
Need: TypeAlias = Literal["nothing"] | Scope
_F = TypeVar("_F", bound=Callable[..., Any])
_STARTS = (KEY_START, LINK_START)


def needs(scope: Need) -> Callable[[_F], _F]:
    """Declare the scope that a route needs; "nothing" opens it to those without a key."""

    def declare(endpoint: _F) -> _F:
        endpoint.needs = scope  # type: ignore[attr-defined]
        return endpoint

    return declare


def need_of(route: BaseRoute) -> Need:
    """Return the scope that a route needs.

    Raises
    ------
    TypeError
        It declares none.
    """
    need: Need | None = getattr(getattr(route, "endpoint", None), "needs", None)
    if need is None:
        raise TypeError(f"the route {route} declares no scope: add @needs(...)")
    return need


class Guard:
    """Guard of a service with keys.

    Parameters
    ----------
    ring : Ring
    routes : sequence of route
        All routes below /v1, and those about the health of the process; each declares its scope. All other
        addresses are files of the page and what describes the service, and are open for reading.
    """

    def __init__(self, ring: Ring, routes: Sequence[Any]) -> None:
        self._ring = ring
        self._needs = [(one.path_regex, getattr(one, "methods", None), need_of(one)) for one in routes]

    def admit(self, scope: Connection) -> Caller:
        """Return the caller of a request or a stream.

        Raises
        ------
        KeyInAddressError
            Its address contains a token.
        KeyRefusedError
            It needs a valid key and has none; or its key is not valid.
        ScopeError
            Its key does not have the scope.
        """
        query = scope.get("query_string", b"")
        if query and any(start in unquote(query.decode("latin-1")) for start in _STARTS):
            raise KeyInAddressError(
                "a key stands in the address, where logs and histories keep it: send it as "
                "Authorization: Bearer, and replace it"
            )
        method = str(scope.get("method", "")).replace("HEAD", "GET")
        if method == "OPTIONS":
            # Browsers ask without a key which methods an address takes; that is no secret.
            return NOBODY
        token = _token(scope)
        caller = NOBODY if token is None else self._ring.caller(token)
        scope[KEY_NAME] = caller.name
        need = self._need(scope["type"], scope["path"], method)
        if need == "nothing":
            return caller
        if token is None:
            raise KeyRefusedError("this service needs a key: send it as Authorization: Bearer KEY")
        caller.require(need)
        return caller

    def _need(self, kind: str, path: str, method: str) -> Need:
        """Return what a call needs: any key where there is no such route below /v1, which then says so."""
        here = [one for one in self._needs if one[0].match(path)]
        for _, methods, need in here:
            if (methods is None) == (kind == "websocket") and (methods is None or method in methods):
                return need
        is_page = kind == "http" and method == "GET" and not here and not path.startswith("/v1")
        return "nothing" if is_page else "view"


def _token(scope: Connection) -> str | None:
    """Return the token of a request; None without one."""
    headers = [value for name, value in scope["headers"] if name == b"authorization"]
    offered: list[str] = [one for one in scope.get("subprotocols", ()) if one.startswith(_STARTS)]
    if len(headers) + len(offered) > 1:
        raise KeyRefusedError("this request has more than one key: send one")
    if not headers:
        return offered[0] if offered else None
    kind, _, token = str(headers[0], "latin-1").partition(" ")
    if kind.lower() != "bearer" or not token:
        raise KeyRefusedError("the header must be Authorization: Bearer KEY")
    return token.strip(" ")
