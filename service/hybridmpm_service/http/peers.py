"""The other nodes, whose sessions and jobs stand in the lists of this one."""

import asyncio
from collections.abc import Sequence
from typing import TypeVar

import httpx
from pydantic import BaseModel, TypeAdapter, ValidationError
from starlette.requests import Request

from hybridmpm.errors import ConfigError

_SECONDS = 2.0
"""Longest time that another node may take [s]."""
T = TypeVar("T", bound=BaseModel)


class Peers:
    """The other nodes.

    Parameters
    ----------
    addresses : sequence of str
        Name and address of each, e.g. "01=http://10.0.0.2:8000".

    Raises
    ------
    ConfigError
        One has another form.
    """

    def __init__(self, addresses: Sequence[str]) -> None:
        self._addresses: dict[str, str] = {}
        for one in addresses:
            node, _, address = one.partition("=")
            if len(node) != 2 or not address.startswith(("http://", "https://")):
                raise ConfigError(f"a peer is written 01=http://host:port, got {one!r}")
            self._addresses[node] = address.rstrip("/")

    async def rows(
        self, kind: str, row: type[T], request: Request | None = None
    ) -> tuple[list[T], list[str]]:
        """Return the "sessions" or "jobs" of the other nodes, and the names of those that did not answer.

        The nodes have the same keys, so each is asked with the key of the request, and shows what that sees.
        """
        found: list[T] = []
        missing: list[str] = []
        if not self._addresses:
            return found, missing
        key = None if request is None else request.headers.get("authorization")
        headers = {} if key is None else {"Authorization": key}
        # What the environment says of proxies and passwords is not meant for calls between nodes.
        async with httpx.AsyncClient(
            timeout=_SECONDS, params={"here": "true"}, headers=headers, trust_env=False
        ) as client:
            calls = (client.get(f"{address}/v1/{kind}") for address in self._addresses.values())
            answers = await asyncio.gather(*calls, return_exceptions=True)
        rows = TypeAdapter(dict[str, list[row]])  # type: ignore[valid-type]
        for node, answer in zip(self._addresses, answers, strict=True):
            try:
                if isinstance(answer, BaseException) or not answer.is_success:
                    raise TypeError  # noqa: TRY301 - as an answer of something else
                found += rows.validate_json(answer.content)[kind]
            except (TypeError, KeyError, ValidationError):
                missing.append(node)
        return found, missing
