"""The other nodes, whose sessions and jobs stand in the lists of this one."""

import asyncio
from collections.abc import Sequence
from typing import Any

import httpx

from hybridmpm.errors import ConfigError

_SECONDS = 2.0
"""Longest time that another node may take [s]."""


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

    async def rows(self, kind: str) -> tuple[list[dict[str, Any]], list[str]]:
        """Return the "sessions" or "jobs" of the other nodes, and the names of those that did not answer."""
        found: list[dict[str, Any]] = []
        missing: list[str] = []
        if not self._addresses:
            return found, missing
        async with httpx.AsyncClient(timeout=_SECONDS, params={"here": "true"}) as client:
            calls = (client.get(f"{address}/v1/{kind}") for address in self._addresses.values())
            answers = await asyncio.gather(*calls, return_exceptions=True)
        for node, answer in zip(self._addresses, answers, strict=True):
            if isinstance(answer, BaseException) or not answer.is_success:
                missing.append(node)
            else:
                found += answer.json()[kind]
        return found, missing
