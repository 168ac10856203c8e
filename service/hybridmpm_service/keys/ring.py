"""The keys of a running service: tokens and links become callers."""

import hmac
import logging
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

from itsdangerous import BadData, URLSafeSerializer

from hybridmpm.errors import ConfigError
from hybridmpm_service.errors import KeyRefusedError, ScopeError
from hybridmpm_service.keys.callers import Caller, Owned, Quota
from hybridmpm_service.keys.file import KEY_START, LINK_START, Key, KeyFile, hashed, read

LONGEST = 512
"""Largest length of a token [characters]."""
_PROOF = 16
"""Digits of a key's hash in its links: a key with a new token has no links."""
_UNKNOWN = "this key is not known here"
_log = logging.getLogger(__name__)


class Ring:
    """The keys of a file.

    Parameters
    ----------
    path : Path
    clock : callable
        Returns the time [s since 1970].

    Raises
    ------
    ConfigError
        As `hybridmpm_service.keys.file.read`.
    """

    def __init__(self, path: Path, clock: Callable[[], float] = time.time) -> None:
        self._path, self._clock = path, clock
        self._take(read(path))

    def reload(self) -> None:
        """Read the file again; one that is damaged is logged, and changes nothing."""
        try:
            self._take(read(self._path))
        except ConfigError as err:
            _log.error("the keys stay as they were: %s", err)
        else:
            _log.warning("the keys were read again: there are %d", len(self._file.keys))

    def quota(self, owner: str) -> Quota:
        """Return the quota of a key by its name; one that has gone has none, and begins nothing more."""
        key = self._file.keys.get(owner)
        return Quota() if key is None else key.quota

    def caller(self, token: str) -> Caller:
        """Return the caller of a token.

        Raises
        ------
        KeyRefusedError
            It is no key and no link, or no longer.
        """
        if len(token) > LONGEST or not token.isascii():
            raise KeyRefusedError(_UNKNOWN)
        if token.startswith(LINK_START):
            return self._link(token)
        name = token.removeprefix(KEY_START).partition("_")[0]
        key = self._file.keys.get(name) if token.startswith(KEY_START) else None
        # Compared also where there is no such key, in the same time.
        if not hmac.compare_digest(hashed(token), _NOBODY if key is None else key.hashed) or key is None:
            raise KeyRefusedError(_UNKNOWN)
        found = key.hashed, key.scopes, key.owner
        return Caller(
            name=name, owner=key.owner, scopes=key.scopes, is_valid=lambda: self._now(name) == found
        )

    def link(self, caller: Caller, session: Owned, links: int, seconds: float) -> tuple[str, int]:
        """Return a link of a caller to a session, and the time of its end [s since 1970].

        Raises
        ------
        ScopeError
            The caller is no key.
        """
        key = self._file.keys.get(caller.name)
        if key is None or caller.session is not None:
            raise ScopeError("a link is made with a key")
        until = int(self._clock() + seconds)
        content = [session.id, until, links, key.name, key.hashed[:_PROOF], session.owner]
        return LINK_START + str(self._signer.dumps(content)), until

    def _link(self, token: str) -> Caller:
        try:
            content: Any = self._signer.loads(token.removeprefix(LINK_START))
            session, until, links, name, proof, owner = content
        except (BadData, ValueError, TypeError):
            raise KeyRefusedError("this link was changed, or is not of this service") from None
        if self._clock() >= until:
            raise KeyRefusedError("this link has expired: ask for a new one")

        def is_valid() -> bool:
            key = self._file.keys.get(name)
            return key is not None and key.hashed.startswith(proof) and self._clock() < until

        if not is_valid():
            raise KeyRefusedError("the key that made this link has been taken back: ask for a new one")
        return Caller(
            name=f"link of {name}",
            owner=owner,
            scopes=frozenset({"view"}),
            session=session,
            links=links,
            is_valid=is_valid,
        )

    def _now(self, name: str) -> object:
        key: Key | None = self._file.keys.get(name)
        return None if key is None else (key.hashed, key.scopes, key.owner)

    def _take(self, file: KeyFile) -> None:
        self._file = file
        self._signer = URLSafeSerializer(
            file.secret,
            salt="hybridmpm link",
            signer_kwargs={"digest_method": sha256, "key_derivation": "hmac"},
        )


_NOBODY = hashed("")
