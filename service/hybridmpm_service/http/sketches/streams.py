"""Trajectories whose frames are sent as they are computed."""

import asyncio
import struct
from collections.abc import AsyncIterator
from typing import Any, TypeAlias

from starlette.responses import StreamingResponse

from hybridmpm.control import Sketch
from hybridmpm.simulator import Simulator
from hybridmpm.stream_frames import encode
from hybridmpm_service.sessions.session import Session
from hybridmpm_service.sessions.sketches.planning import Check
from hybridmpm_service.sessions.sketches.tracing import frame_of, traced

FRAMES = "application/x-hybridmpm-frames"
"""Media type of frames one after the other, each with its length before it."""
_LENGTH = struct.Struct("<I")
_END = _LENGTH.pack(0)
"""Stands behind the last frame; a stream without it has been cut off."""

_Piece: TypeAlias = bytes | None


async def streamed(session: Session, sketch: Sketch, chosen: dict[str, Any]) -> StreamingResponse:
    """Return the answer whose body is the frames of a sketch that a copy of a session follows.

    Parameters
    ----------
    session : Session
    sketch : Arrow or Ellipse
    chosen : dict
        Arguments of `traced`.

    Raises
    ------
    ConfigError, SketchError, SimulationError
        As `traced`, for what is found before the first frame; later the stream is cut off.
    """
    loop = asyncio.get_running_loop()
    pieces: asyncio.Queue[_Piece] = asyncio.Queue()

    def follow(twin: Simulator, check: Check) -> None:
        def send(_done: int, _total: int) -> None:
            message = encode(frame_of(twin))
            loop.call_soon_threadsafe(pieces.put_nowait, _LENGTH.pack(len(message)) + message)

        traced(twin, check, sketch, on_frame=send, **chosen)

    async def work() -> None:
        try:
            await session.beside(follow)
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
    first: _Piece, pieces: "asyncio.Queue[_Piece]", working: "asyncio.Task[None]"
) -> AsyncIterator[bytes]:
    piece = first
    try:
        while piece is not None:
            yield piece
            piece = await pieces.get()
        await working
    finally:
        working.cancel()
