"""Large answers: complete JSON, though it is made in pieces."""

import asyncio
import json
import threading
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from hybridmpm_service.errors import UnavailableError
from hybridmpm_service.http.replies import json_response, npz_response
from hybridmpm_service.sessions.turns import Turns


def _response(respond: Any, body: dict[str, Any]) -> Any:
    async def make() -> Any:
        turns = Turns(1)
        try:
            return await respond(turns, body)
        finally:
            turns.close(UnavailableError("the test ends"))

    return asyncio.run(make())


def _round_trip(value: Any) -> Any:
    return json.loads(bytes(_response(json_response, {"value": value, "name": "x"}).body))["value"]


@pytest.mark.parametrize(
    "shape", [(0,), (3,), (5000,), (0, 2), (7, 2), (9000, 3), (3, 5000, 2), (2, 3, 2), (3, 0, 2)]
)
def test_an_array_of_any_shape_comes_back(shape: tuple[int, ...]) -> None:
    array: npt.NDArray[np.float32] = np.random.default_rng(0).random(shape, dtype=np.float32)
    assert _round_trip(array) == array.tolist()


@pytest.mark.parametrize("respond", [json_response, npz_response])
def test_encoding_runs_in_another_thread(respond: Any) -> None:
    threads: list[int] = []

    class Body(dict[str, Any]):
        def items(self) -> Any:
            threads.append(threading.get_ident())
            return super().items()

    _response(respond, Body(value=np.zeros(3)))
    assert threads
    assert threading.get_ident() not in threads


def test_nan_in_json_raises() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        _round_trip(np.array([np.nan]))
