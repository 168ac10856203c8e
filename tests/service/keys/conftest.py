"""A service with keys, and clients that have them."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from tests.service.conftest import SMALL_SCENE, WAIT_SECONDS, Service, running

from hybridmpm_service import Settings
from hybridmpm_service.keys.file import add


class Keyed:
    """A service with a file of keys."""

    def __init__(self, stack: ExitStack, folder: Path, **settings: Any) -> None:
        self.file = folder / "keys"
        self.tokens: dict[str, str] = {}
        self.add("anna", "view,steer,create")
        self.add("bob", "view,steer,create")
        self.add("screen", "view", "of=anna")
        self.add("hand", "view,steer", "of=anna")
        self.add("boss", "admin")
        self._stack, self._clients = stack, dict[str, httpx.Client]()
        self.service: Service = stack.enter_context(
            running(Settings(port=0, keys=str(self.file), max_sessions=40, **settings))
        )

    def add(self, name: str, scopes: str, *rest: str) -> None:
        """Add a key to the file."""
        self.tokens[name] = add(self.file, name, scopes, rest)

    def reload(self) -> None:
        """Read the file again, as SIGHUP makes the service do."""
        self.service.app.state.ring.reload()

    def client(self, name: str) -> httpx.Client:
        """Return a client with a key by its name; or with a token; or, for nothing, without one."""
        if name not in self._clients:
            token = self.tokens.get(name, name)
            client = httpx.Client(
                base_url=f"http://{self.service.address}",
                timeout=WAIT_SECONDS,
                headers={"Authorization": f"Bearer {token}"} if token else {},
                # Certificates would be read for each client.
                verify=False,  # noqa: S501
            )
            self._clients[name] = self._stack.enter_context(client)
        return self._clients[name]

    def create(self, name: str = "anna") -> str:
        """Create a session of a key, and return its path."""
        answer = self.client(name).post("/v1/sessions", json={"scene": SMALL_SCENE})
        assert answer.status_code == 201, answer.text
        return str(answer.json()["links"]["self"])


@pytest.fixture(scope="module")
def keyed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Keyed]:
    """Return a service with keys, shared by a module."""
    with ExitStack() as stack:
        yield Keyed(stack, tmp_path_factory.mktemp("keys"))


@pytest.fixture
def start_keyed(tmp_path: Path) -> Iterator[Callable[..., Keyed]]:
    """Return a function that starts a service with keys and given settings."""
    with ExitStack() as stack:
        yield lambda **settings: Keyed(stack, tmp_path, **settings)
