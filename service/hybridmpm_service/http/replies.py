"""Large answers as JSON, npz, point clouds or a stream of frames, encoded off the event loop."""

import asyncio
import io
import re
import struct
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from hybridmpm.export import Cloud
from hybridmpm.simulator import Simulator
from hybridmpm.stream_frames import encode
from hybridmpm_service.sessions import scene_work
from hybridmpm_service.sessions.inputs import Goals
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.turns import Turns
from hybridmpm_service.sessions.view import frame_of
from hybridmpm_service.sessions.work import Check, traced

NPZ = "application/x-npz"
"""Media type of numpy's npz."""
PLY = "application/x-ply"
"""Media type of a point cloud for mesh tools."""
VTP = "application/x-vtp"
"""Media type of a point cloud for ParaView."""
_NUMBERS_HERE = 4096
"""Largest count of numbers that are encoded in this process."""
JSON = "application/json"


def preferred(request: Request, *others: str) -> str:
    """Return the media type, JSON or one of `others`, that a request ranks highest (RFC 9110, 12.5.1).

    The quality of a type is that of the most specific range that has it. Among equals the more specific
    range goes first, then the earlier one. JSON is returned where none is acceptable.
    """
    ranges = list(_ranges(",".join(request.headers.getlist("accept"))))

    def rank(media_type: str) -> tuple[float, int, int]:
        kind = media_type.partition("/")[0]
        for specificity, name in ((3, media_type), (2, f"{kind}/*"), (1, "*/*")):
            for place, (given, quality) in enumerate(ranges):
                if given == name:
                    return (quality, specificity, -place) if quality else (0.0, 0, 0)
        return 0.0, 0, 0

    return max((JSON, *others), key=rank)


def _ranges(header: str) -> Iterator[tuple[str, float]]:
    """Yield the media ranges of a header with their qualities, without those of no valid quality."""
    for part in header.split(","):
        name, *parameters = (piece.strip().lower() for piece in part.split(";"))
        found = [piece[2:].strip() for piece in parameters if piece.startswith("q=")]
        if not found:
            yield name, 1.0
        elif re.fullmatch(r"0(\.\d{0,3})?|1(\.0{0,3})?", found[0]):
            yield name, float(found[0])


def prefers_async(request: Request) -> bool:
    """Return whether a request prefers an answer before its work is done (RFC 7240)."""
    return "respond-async" in _tokens(request, "prefer")


def _tokens(request: Request, header: str) -> list[str]:
    """Return the items of a list header, in lower case and without parameters."""
    lines = ",".join(request.headers.getlist(header))
    return [part.partition(";")[0].strip().lower() for part in lines.split(",")]


async def numbers_response(turns: Turns, values: Mapping[str, Any], *, as_npz: bool) -> Response:
    """Return numbers, lists and arrays as a JSON object, or arrays as npz."""
    if as_npz:
        return Response(await turns.run(lambda: npz(values), short=False), media_type=NPZ)
    size, encode = sum(map(np.size, values.values())), partial(scene_work.json_object, values)
    return Response(await _encoded(turns, size, encode), media_type=JSON)


def npz(arrays: Mapping[str, npt.ArrayLike]) -> bytes:
    """Return arrays as an npz file that `numpy.load` reads without pickle."""
    data = io.BytesIO()
    np.savez(data, allow_pickle=False, **{name: np.asarray(value) for name, value in arrays.items()})
    return data.getvalue()


async def cloud_response(turns: Turns, cloud: Cloud, media_type: str) -> Response:
    """Return a point cloud as `PLY` or `VTP`."""
    encode = cloud.ply if media_type == PLY else cloud.vtp
    return Response(await _encoded(turns, cloud.positions.size, encode), media_type=media_type)


async def _encoded(turns: Turns, size: int, encode: Callable[[], bytes]) -> bytes:
    """Return numbers as text; where there are thousands, it would keep Python's global lock for long."""
    return await (turns.run(encode) if size <= _NUMBERS_HERE else turns.apart(encode))


FRAMES = "application/x-hybridmpm-frames"
"""Media type of a sequence of frames, each after its length."""
_LENGTH = struct.Struct("<I")
_END = _LENGTH.pack(0)
"""Follows the last frame; a stream without it has been cut off."""


async def streamed(session: Session, sketch: Goals, chosen: dict[str, Any]) -> StreamingResponse:
    """Return an answer whose body is the frames of a copy of a session that follows a sketch.

    Parameters
    ----------
    session : Session
    sketch : Arrow, Ellipse, Shape or list of Keyframe
    chosen : dict
        Arguments of `traced`.

    Raises
    ------
    ConfigError, SketchError, SimulationError
        As `traced`, before the first frame; later errors cut the stream off.
    """
    loop = asyncio.get_running_loop()
    pieces: asyncio.Queue[bytes | None] = asyncio.Queue()

    def follow(twin: Simulator, check: Check) -> None:
        def send(_done: int, _total: int) -> None:
            message = encode(frame_of(twin))
            loop.call_soon_threadsafe(pieces.put_nowait, _LENGTH.pack(len(message)) + message)

        traced(twin, check, sketch, on_frame=send, **chosen)

    async def work() -> None:
        try:
            await session.on_copy(follow)
            pieces.put_nowait(_END)
        finally:
            pieces.put_nowait(None)

    working = asyncio.create_task(work())
    try:
        first = await pieces.get()
    except asyncio.CancelledError:
        working.cancel()
        raise
    if first is None:
        await working
    return StreamingResponse(_body(first, pieces, working), media_type=FRAMES)


async def _body(
    first: bytes | None, pieces: "asyncio.Queue[bytes | None]", working: "asyncio.Task[None]"
) -> AsyncIterator[bytes]:
    piece = first
    try:
        while piece is not None:
            yield piece
            piece = await pieces.get()
        await working
    finally:
        working.cancel()
