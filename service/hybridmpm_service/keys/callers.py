"""The caller of a request: what it may do, and which sessions and jobs it may see.

Without keys there is one caller, who may do everything. With keys the door sets the caller of each request,
and sessions and jobs are found through it, so that no route can forget to ask.
"""

from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Literal, Protocol, get_args

from hybridmpm_service.errors import KeyRefusedError, QuotaError, ScopeError

Scope = Literal["view", "steer", "create", "admin"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
"""view: see; steer: change; create: begin and end; admin: all of that, with the sessions of all keys."""


class Owned(Protocol):
    """A session or a job."""

    @property
    def id(self) -> str:
        """Name."""

    @property
    def owner(self) -> str:
        """Name of the key that it belongs to; empty without keys."""


@dataclass(frozen=True, kw_only=True)
class Caller:
    """A key, a link, everybody where there are no keys, or nobody."""

    name: str
    """Name for the log."""
    owner: str = ""
    """Name of the key that its sessions and jobs belong to."""
    scopes: frozenset[Scope] = frozenset(SCOPES)
    session: str | None = None
    """The only session that it sees; None unless it is a link."""
    links: int = 0
    """Number of times that the links of the session had been taken back when this one was made."""
    is_valid: Callable[[], bool] = field(default=lambda: True, compare=False)
    """Returns whether the key or link is still valid; open streams ask again and again."""

    def may(self, scope: Scope) -> bool:
        """Return whether it has a scope."""
        return scope in self.scopes or "admin" in self.scopes

    def require(self, scope: Scope) -> None:
        """Raise `ScopeError` unless it has a scope."""
        if not self.may(scope):
            raise ScopeError(f"{self.name} may not do this: it needs the scope {scope}")

    def sees(self, thing: Owned) -> bool:
        """Return whether it may know of a session or a job."""
        if self.session is not None:
            return thing.id == self.session and thing.owner == self.owner
        return "admin" in self.scopes or (bool(self.owner) and thing.owner == self.owner)

    def check_link(self, taken_back: int) -> None:
        """Raise `KeyRefusedError` if it is a link of before the links of its session were last taken back."""
        if self.session is not None and self.links != taken_back:
            raise KeyRefusedError("this link was taken back: ask for a new one")


EVERYBODY = Caller(name="everybody")
"""The caller where there are no keys; also the service itself."""
NOBODY = Caller(name="nobody", scopes=frozenset())
"""The caller of a request without a key, to an address that is open to all."""
CALLER: ContextVar[Caller] = ContextVar("caller", default=EVERYBODY)
"""Caller of the present request; tasks inherit it."""


@dataclass(frozen=True, kw_only=True)
class Quota:
    """Largest share of the service that the sessions and jobs of a key may take; None is no limit."""

    sessions: int | None = None
    """Number of sessions."""
    load: float | None = None
    """Load of the sessions that play [cores]."""
    jobs: int | None = None
    """Number of jobs, those that have ended among them."""
    bytes: int | None = None
    """Files of its sessions and jobs, when it begins another one [bytes]."""


class Quotas:
    """The quotas of all keys.

    Attributes
    ----------
    of : callable
        Returns the quota of a key by its name.
    stored : list of callable
        Each returns the bytes of the files of a key.
    """

    def __init__(self) -> None:
        self.of: Callable[[str], Quota] = lambda _owner: Quota()
        self.stored: list[Callable[[str], int]] = []

    def check_bytes(self, owner: str) -> None:
        """Raise `QuotaError` if the files of a key leave no room for more."""
        most = self.of(owner).bytes
        if most is None:
            return
        found = sum(one(owner) for one in self.stored)
        if found >= most:
            raise QuotaError(
                f"the sessions and jobs of the key {owner!r} take {found} bytes, and it may have {most}: "
                "delete one"
            )

    def check_number(self, owner: str, number: int, what: Literal["sessions", "jobs"]) -> None:
        """Raise `QuotaError` if a key has as many sessions or jobs as it may have."""
        most = getattr(self.of(owner), what)
        if most is not None and number >= most:
            raise QuotaError(
                f"the key {owner!r} has {number} {what}, and may have {most}: delete one, or wait for an end"
            )
