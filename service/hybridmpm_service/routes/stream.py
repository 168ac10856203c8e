"""Route of a session's live stream: frames and status go out, commands come in."""

import asyncio
import base64
import contextlib
import json
from functools import lru_cache
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from hybridmpm import MeshObstacle, Scene, SimulationError
from hybridmpm.scene import Obstacle
from hybridmpm.stream_frames import VERSIONS, FrameMessage
from hybridmpm_service.errors import (
    FieldError,
    KeyRefusedError,
    ServiceError,
    SessionNotFoundError,
    UnavailableError,
    field_path,
)
from hybridmpm_service.http.answers import HistoryBody, SessionBody
from hybridmpm_service.http.guard import PROTOCOL, needs
from hybridmpm_service.http.problems import MAX_DETAIL, row_of, shortened, urn_of
from hybridmpm_service.http.requests import (
    COMMAND,
    Command,
    EndLead,
    EndPush,
    Follow,
    Pause,
    Play,
    PullBody,
    PushFluid,
    Reset,
    Speed,
    StartLead,
    Step,
    read_json,
)
from hybridmpm_service.keys.callers import CALLER, EVERYBODY
from hybridmpm_service.routes.dependencies import Limits, SessionId, Sessions
from hybridmpm_service.sessions.inputs import HandInput, check_hand
from hybridmpm_service.sessions.manager import CLOSE_GOING_AWAY
from hybridmpm_service.sessions.session import CLOSE_DELETED, Session
from hybridmpm_service.sessions.viewers import Mailbox, MailboxClosed, Message, Signal
from hybridmpm_service.settings import Settings

router = APIRouter()

_LAST_WORDS_SECONDS = 0.3
"""Longest time for a client to read the last message when its stream ends."""
_SHOWN = {"name", "dim", "world", "frame_dt", "gravity", "walls", "emitters", "sinks"}
"""Fields of a scene for viewers, beside its obstacles."""
_MOST_TRIANGLES, _DIGITS = 5000, 5
"""Largest number of triangles of a surface that viewers draw, and decimals of its corners [m]."""
_SHOWN_OF_HANDS = {"point", "radius", "body", "grip", "target"}
"""Fields of hands for viewers."""
_BAR_SECONDS = 1.0
"""Time between two looks at the key of a stream [s]."""
_CLOSE_KEY = 4401
"""WebSocket close code of a stream whose key or link is not valid any more."""
_CLOSE_VERSION = 4406
"""WebSocket close code of a stream that is not available in the requested version."""


@router.websocket("/v1/sessions/{session_id}/stream")
@needs("view")
async def stream(
    websocket: WebSocket, session_id: SessionId, sessions: Sessions, limits: Limits, version: str = "1"
) -> None:
    """Serve one viewer until it leaves or the session ends.

    The version of the frames is in the address. A subprotocol would do the same, but a browser drops a
    connection whose subprotocol is refused, without a reason; a close code has one.
    """
    # Accepted first, because a refused handshake cannot carry a close code. A token that was offered as a
    # subprotocol is not repeated.
    await websocket.accept(PROTOCOL if PROTOCOL in websocket.scope["subprotocols"] else None)
    try:
        session = sessions.get(session_id)
    except (SessionNotFoundError, KeyRefusedError) as err:
        await _close(websocket, MailboxClosed(CLOSE_DELETED, str(err)))
        return
    except UnavailableError as err:
        await _close(websocket, MailboxClosed(CLOSE_GOING_AWAY, str(err)))
        return
    unreadable = _why_unreadable(version, session)
    if unreadable is not None:
        await _close(websocket, MailboxClosed(_CLOSE_VERSION, unreadable))
        return
    # A client that is too slow, or has gone, gets no close code: the connection ends with this function.
    with session.viewer() as mailbox, contextlib.suppress(WebSocketDisconnect, TimeoutError):
        end = await _serve(websocket, session, mailbox, int(version), limits=limits)
        if end is not None:
            await _close(websocket, end)


async def _close(websocket: WebSocket, end: MailboxClosed) -> None:
    async with asyncio.timeout(_LAST_WORDS_SECONDS):
        # The protocol has room for 123 bytes.
        await websocket.close(end.code, end.reason.encode()[:123].decode(errors="ignore"))


def _why_unreadable(version: str, session: Session) -> str | None:
    """Return why a viewer cannot get the frames in a version; None if it can."""
    if version not in map(str, VERSIONS):
        return f"version must be {', '.join(map(str, VERSIONS[:-1]))} or {VERSIONS[-1]}"
    if version == "1" and session.scene.is_open:
        return "particles come and go here, which version 1 lacks: connect with ?version=2"
    if version != "3" and session.scene.rigid:
        return f"rigid bodies are here, which version {version} lacks: connect with ?version=3"
    return None


async def _serve(
    websocket: WebSocket,
    session: Session,
    mailbox: Mailbox,
    version: int,
    *,
    limits: Settings,
) -> MailboxClosed | None:
    """Send and receive at once; return the close code of the stream, None where the client left."""
    sending = asyncio.create_task(_send(websocket, session, mailbox, version, limits.send_seconds))
    receiving = asyncio.create_task(_receive(websocket, session, mailbox, limits))
    ending = asyncio.create_task(mailbox.closed())
    barring = asyncio.create_task(_bar(session, mailbox))
    tasks = (sending, receiving, ending, barring)
    try:
        await asyncio.wait((sending, receiving, ending), return_when=asyncio.FIRST_COMPLETED)
        if receiving.done():
            return receiving.result()
        await asyncio.wait([sending], timeout=_LAST_WORDS_SECONDS)
        if sending.done():
            sending.result()
        return await mailbox.closed()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _bar(session: Session, mailbox: Mailbox) -> None:
    """Close the mailbox of a viewer whose key or link is not valid any more."""
    caller = CALLER.get()
    if caller is EVERYBODY:
        return
    while True:
        await asyncio.sleep(_BAR_SECONDS)
        try:
            caller.check_link(session.links)
        except KeyRefusedError as err:
            mailbox.close(_CLOSE_KEY, str(err))
        if not caller.is_valid():
            mailbox.close(_CLOSE_KEY, "the key or link of this stream is not valid any more")


async def _send(
    websocket: WebSocket, session: Session, mailbox: Mailbox, version: int, seconds: float
) -> None:
    """Send a greeting, then the messages of the mailbox, until it is closed.

    Raises
    ------
    TimeoutError
        The client has taken longer than `seconds` for a message.
    """
    message: Message | str = _hello(session, version)
    with contextlib.suppress(MailboxClosed):
        while True:
            if isinstance(message, Signal):
                message = session.audience.status(lambda: _status(session))
            elif isinstance(message, Exception):
                message = _problem(message)
            async with asyncio.timeout(seconds):
                if isinstance(message, FrameMessage):
                    await websocket.send_bytes(message.of(version))
                else:
                    await websocket.send_text(message)
            message = await mailbox.take()


async def _receive(
    websocket: WebSocket, session: Session, mailbox: Mailbox, limits: Settings
) -> MailboxClosed | None:
    """Execute commands until the client leaves; `StreamProtocol` meters them."""
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return None
        session.touch()
        try:
            text = message.get("text")
            if text is None:
                raise FieldError("message", "must be text with a JSON command, got binary data")
            command = COMMAND.validate_python(read_json(text, "message"))
            CALLER.get().require("steer")
            session.ends_at = None
            await _execute(command, session, mailbox, limits)
        except ValidationError as err:
            mailbox.put_problem(_refusal(err))
        except ServiceError as err:
            mailbox.put_problem(err)
        except SimulationError:
            # The session has posted this problem to all its viewers.
            continue


async def _execute(command: Command, session: Session, mailbox: Mailbox, limits: Settings) -> None:
    match command:
        case Play():
            session.play()
        case Pause():
            session.pause()
        case Step(frames=frames):
            if frames > limits.max_advance_frames:
                raise FieldError("frames", f"must be in [1, {limits.max_advance_frames}], got {frames}")
            session.pause()
            await session.advance(frames)
        case Reset():
            await session.reset()
        case Speed(value=value):
            session.set_speed(value)
        case PushFluid() | PullBody():
            check_hand(command, session.scene)
            session.end_lead("a hand acted on the server")
            session.push(command.force(), by=mailbox)
        case EndPush():
            session.end_lead("a hand let go on the server")
            session.push(None, by=mailbox)
        case _:
            await _lead(command, session, mailbox)


async def _lead(command: StartLead | Follow | EndLead, session: Session, mailbox: Mailbox) -> None:
    match command:
        case StartLead():
            await session.lead(mailbox)
        case Follow():
            await session.follow(command.upto, _led(command, session.scene), mailbox)
        case EndLead():
            await session.unlead(mailbox, command.digest, pause=command.pause)


def _led(command: Follow, scene: Scene) -> list[HandInput]:
    """Return the inputs of a leading tab."""
    found = []
    for place, one in enumerate(command.inputs):
        for name in ("push", "pull"):
            hand = getattr(one, name)
            if hand is not None:
                check_hand(hand, scene, f"inputs[{place}].{name}.")
        found.append(one.input())
    return found


def _refusal(err: ValidationError) -> FieldError:
    """Return the error of a command that cannot be read."""
    problem = err.errors(include_url=False)[0]
    # The first part of the location is the type of the command, which is not a field.
    field = field_path(problem["loc"][1:]) or "message"
    return FieldError(field, problem["msg"])


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle as viewers draw it: a surface of many triangles coarser than it is."""
    if not isinstance(obstacle, MeshObstacle):
        return obstacle.model_dump(mode="json", exclude_none=True)
    rest = obstacle.model_dump(mode="json", exclude_none=True, exclude={"vertices", "triangles"})
    vertices, triangles = _surface(obstacle)
    return rest | {"vertices": vertices, "triangles": triangles}


@lru_cache(maxsize=8)
def _surface(mesh: MeshObstacle) -> tuple[list[list[float]], list[list[int]]]:
    vertices, triangles = mesh.coarser(_MOST_TRIANGLES)
    return vertices.round(_DIGITS).tolist(), triangles.tolist()


def _hello(session: Session, version: int) -> str:
    scene = session.scene.model_dump(mode="json", exclude_none=True, include=_SHOWN)
    scene["obstacles"] = [_obstacle(one) for one in session.scene.obstacles]
    types = session.simulation.types
    encoded = None if types is None else base64.b64encode(types.tobytes()).decode()
    return _text(
        "hello",
        version=version,
        session=_session(session),
        scene=scene,
        spacing=session.simulation.spacing,
        types=encoded,
        rigid=session.simulation.solids,
    )


def _status(session: Session) -> str:
    history, forces = HistoryBody.of(session), session.simulation.forces()
    hand = session.simulation.shown_hand
    return _text(
        "status",
        session=_session(session),
        history=None if history is None else history.model_dump(mode="json"),
        forces=None if forces is None else forces.model_dump(mode="json"),
        hand=None if hand is None else hand.model_dump(mode="json", include=_SHOWN_OF_HANDS),
        **vars(session.simulation.timing()),
    )


def _problem(err: Exception) -> str:
    row = row_of(err)
    detail = shortened(str(err), MAX_DETAIL)
    return _text("problem", problem=urn_of(row), title=row.title, detail=detail, status=row.status)


def _text(kind: str, **content: Any) -> str:
    return json.dumps({"type": kind} | content, separators=(",", ":"))


def _session(session: Session) -> dict[str, Any]:
    return SessionBody.of(session).model_dump(mode="json")
