"""The file of keys: a line for each, with the hash of its token. Tokens are in no file.

    secret 5f...                                       (signs the links)
    key anna view,steer,create sha256:9c... sessions=4 load=2 jobs=4 bytes=2000000000
    key screen view sha256:1d... of=anna               (acts on what belongs to anna)

A token has 256 random bits, so a plain hash of it cannot be searched, as that of a password could.
"""

import hashlib
import os
import re
import secrets
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hybridmpm.errors import ConfigError
from hybridmpm_service.keys.callers import SCOPES, Quota, Scope

KEY_START, LINK_START = "hmpm_", "hmpl_"
"""Starts of tokens of keys and of links; scanners of secrets may look for them."""
NAME = re.compile(r"[a-z0-9][a-z0-9-]{0,31}")
_SECRET = re.compile(r"[0-9a-f]{64}")
_HASH = re.compile(r"sha256:([0-9a-f]{64})")
_MAX_BYTES = 1 << 20
QUOTAS = ("sessions", "load", "jobs", "bytes")
"""Kinds of quotas."""


@dataclass(frozen=True, kw_only=True)
class Key:
    """A line of the file."""

    name: str
    owner: str
    """Name of the key that its sessions belong to."""
    scopes: frozenset[Scope]
    hashed: str
    """SHA-256 of the token, in hexadecimal digits."""
    quota: Quota = field(default_factory=Quota)


@dataclass(frozen=True)
class KeyFile:
    """Contents of a file of keys."""

    secret: str
    """Secret that signs links."""
    keys: Mapping[str, Key]
    """The keys by name."""


def hashed(token: str) -> str:
    """Return the hash of a token, in hexadecimal digits."""
    return hashlib.sha256(token.encode()).hexdigest()


def read(path: Path) -> KeyFile:
    """Return the contents of a file.

    Raises
    ------
    ConfigError
        It cannot be read, others may read or write it, or a line is wrong; the message names the line.
    """
    try:
        with path.open("rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_MAX_BYTES + 1)
    except OSError as err:
        raise ConfigError(
            f"keys: {path} cannot be read ({err.strerror or err}); make it: hybridmpm key NAME --file {path}"
        ) from None
    if os.name == "posix" and stat.S_ISREG(mode) and mode & 0o027:
        raise ConfigError(
            f"keys: {path} has the mode {stat.S_IMODE(mode):04o}, so that others may read or change it: "
            f"chmod 600 {path}"
        )
    if len(data) > _MAX_BYTES:
        raise ConfigError(f"keys: {path} is larger than {_MAX_BYTES} bytes")
    secret, found = "", dict[str, Key]()
    # Other ends of lines that Unicode knows would make the numbers of lines differ from those of an editor.
    for number, line in enumerate(data.replace(b"\r\n", b"\n").split(b"\n"), 1):
        try:
            match line.decode().partition("#")[0].split():
                case []:
                    pass
                case ["secret", *words]:
                    secret = _secret(words, secret)
                case words:
                    key = _key(words)
                    _check_new(key, found)
                    found[key.name] = key
        except ValueError as err:
            text = "it is not UTF-8" if isinstance(err, UnicodeDecodeError) else str(err)
            raise ConfigError(f"keys: line {number} of {path}: {text}") from None
    for key in found.values():
        _check_owner(key, found, path)
    if not secret:
        raise ConfigError(f"keys: {path} has no line `secret` with 64 hexadecimal digits: see its guide")
    return KeyFile(secret, found)


def _secret(words: Sequence[str], before: str) -> str:
    if before or len(words) != 1 or not _SECRET.fullmatch(words[0]):
        raise ValueError("there is one secret, of 64 hexadecimal digits")
    return words[0]


def _check_new(key: Key, found: Mapping[str, Key]) -> None:
    if key.name in found:
        raise ValueError(f"there is a key {key.name!r} above")


def _check_owner(key: Key, found: Mapping[str, Key], path: Path) -> None:
    owner = key if key.owner == key.name else found.get(key.owner)
    if owner is None or owner.owner != owner.name:
        raise ConfigError(f"keys: {path}: {key.name!r} is of {key.owner!r}, which is no key of its own there")


def _key(words: Sequence[str]) -> Key:
    if len(words) < 4 or words[0] != "key":
        raise ValueError("a line is `secret DIGITS` or `key NAME SCOPES sha256:DIGITS QUOTAS`")
    _, name, scopes, digest, *rest = words
    if not NAME.fullmatch(name):
        raise ValueError(f"a name has up to 32 small letters, digits and dashes, not {name!r}")
    given = scopes.split(",")
    unknown = [one for one in given if one not in SCOPES]
    if unknown or len(set(given)) < len(given):
        raise ValueError(f"scopes are some of {','.join(SCOPES)}, not {scopes!r}")
    digits = _HASH.fullmatch(digest)
    if digits is None:
        raise ValueError("the hash of a token is `sha256:` and 64 hexadecimal digits")
    chosen = dict[str, str]()
    for one in rest:
        kind, sign, value = one.partition("=")
        if not sign or kind in chosen or kind not in {"of", *QUOTAS}:
            raise ValueError(f"{one!r} is none of of=NAME, {', '.join(f'{kind}=NUMBER' for kind in QUOTAS)}")
        chosen[kind] = value
    owner = chosen.pop("of", name)
    if owner != name and chosen:
        raise ValueError(f"quotas stand with the key {owner!r}, whose sessions these are")
    limits = {kind: _number(kind, value) for kind, value in chosen.items()}
    scoped: frozenset[Scope] = frozenset(one for one in SCOPES if one in given)
    return Key(name=name, owner=owner, scopes=scoped, hashed=digits[1], quota=Quota(**limits))  # type: ignore[arg-type]


def _number(kind: str, text: str) -> int | float:
    if not re.fullmatch(r"\d{1,15}(\.\d{1,9})?" if kind == "load" else r"\d{1,15}", text, re.ASCII):
        raise ValueError(f"{kind} is a number from 0 on, not {text!r}")
    return float(text) if kind == "load" else int(text)


def add(path: Path, name: str, scopes: str, rest: Sequence[str] = ()) -> str:
    """Add a key to a file, which is made if there is none, and return its token.

    Raises
    ------
    ConfigError
        The file cannot be read or written, the name is taken, or a word is not allowed.
    """
    token = f"{KEY_START}{name}_{secrets.token_urlsafe(32)}"
    words = ["key", name, scopes, f"sha256:{hashed(token)}", *rest]
    known: Mapping[str, Key] = {}
    lines = [" ".join(words)]
    if path.exists():
        known = read(path).keys
    else:
        lines.insert(0, f"secret {secrets.token_hex(32)}")
    try:
        key = _key(words)
        _check_new(key, known)
    except ValueError as err:
        raise ConfigError(str(err)) from None
    _check_owner(key, known, path)
    try:
        # Nobody else may read what is new.
        number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o600)
        with os.fdopen(number, "r+b", buffering=0) as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - 1))
            start = "" if file.read(1) in {b"", b"\n"} else "\n"
            file.write((start + "\n".join(lines) + "\n").encode())
            os.fsync(file.fileno())
    except OSError as err:
        raise ConfigError(f"{path} cannot be written: {err.strerror or err}") from None
    return token
