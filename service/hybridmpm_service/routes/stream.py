"""Route of a session's live stream: frames and status go out, commands for the player come in."""

import asyncio
import base64
import contextlib
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from hybridmpm import SimulationError
from hybridmpm.control import Push, push
from hybridmpm_service.errors import FieldError, ServiceError, SessionNotFoundError
from hybridmpm_service.http.answers import SessionBody
from hybridmpm_service.http.learned_answers import HistoryBody
from hybridmpm_service.http.problems import field_path, row_of, urn_of
from hybridmpm_service.http.requests import (
    COMMAND,
    Command,
    EndPush,
    Pause,
    Play,
    PushFluid,
    Reset,
    Speed,
    Step,
)
from hybridmpm_service.routes.dependencies import Limits, SessionId, Sessions
from hybridmpm_service.sessions.mailbox import Mailbox, MailboxClosed, Signal
from hybridmpm_service.sessions.session import CLOSE_DELETED, Session
from hybridmpm_service.settings import Settings

router = APIRouter()

_LAST_WORDS_SECONDS = 1.0
"""Longest time that a client may take to read the message on its way when its stream ends."""


@router.websocket("/v1/sessions/{session_id}/stream")
async def stream(websocket: WebSocket, session_id: SessionId, sessions: Sessions, limits: Limits) -> None:
    """Serve one viewer until it leaves or the session ends."""
    # Accepted first, because a refused handshake cannot carry a close code.
    await websocket.accept()
    try:
        session = sessions.get(session_id)
    except SessionNotFoundError as err:
        await websocket.close(CLOSE_DELETED, str(err))
        return
    with session.viewer() as mailbox, contextlib.suppress(WebSocketDisconnect):
        end = await _serve(websocket, session, mailbox, limits)
        if end is not None:
            await websocket.close(end.code, end.reason)


async def _serve(
    websocket: WebSocket, session: Session, mailbox: Mailbox, limits: Settings
) -> MailboxClosed | None:
    """Send and receive at once; return how the stream was closed, None where the client left."""
    sending = asyncio.create_task(_send(websocket, session, mailbox))
    receiving = asyncio.create_task(_receive(websocket, session, mailbox, limits))
    ending = asyncio.create_task(mailbox.closed())
    tasks = (sending, receiving, ending)
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if receiving.done():
            receiving.result()
            return None
        await asyncio.wait([sending], timeout=_LAST_WORDS_SECONDS)
        if sending.done():
            sending.result()
        return await mailbox.closed()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def _send(websocket: WebSocket, session: Session, mailbox: Mailbox) -> None:
    """Send a greeting, then the messages of the mailbox, until it is closed."""
    await websocket.send_json(_hello(session))
    with contextlib.suppress(MailboxClosed):
        while True:
            message = await mailbox.take()
            if isinstance(message, bytes):
                await websocket.send_bytes(message)
            elif isinstance(message, Signal):
                await websocket.send_json(_status(session))
            else:
                await websocket.send_json(_problem(message))


async def _receive(websocket: WebSocket, session: Session, mailbox: Mailbox, limits: Settings) -> None:
    """Obey commands until the client leaves."""
    while True:
        message = await websocket.receive()
        if message["type"] == "websocket.disconnect":
            return
        session.touch()
        try:
            text = message.get("text")
            if text is None:
                raise FieldError("message", "must be text with a JSON command, got binary data")
            await _obey(COMMAND.validate_json(text), session, mailbox, limits)
        except ValidationError as err:
            mailbox.put_problem(_refusal(err))
        except ServiceError as err:
            mailbox.put_problem(err)
        except SimulationError:
            # The session has put this problem into the mailboxes of all its viewers.
            continue


async def _obey(command: Command, session: Session, mailbox: Mailbox, limits: Settings) -> None:
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
        case PushFluid():
            session.push(_push(command, session.scene.dim), by=mailbox)
        case EndPush():
            session.push(None, by=mailbox)


def _push(command: PushFluid, dim: int) -> Push:
    for name in ("point", "velocity"):
        given = len(getattr(command, name))
        if given != dim:
            raise FieldError(name, f"must have {dim} numbers in this session, got {given}")
    return push(command.point, command.velocity, command.radius, cap=command.cap)


def _refusal(err: ValidationError) -> FieldError:
    """Return the refusal of a command that cannot be read."""
    problem = err.errors(include_url=False)[0]
    # The first part of the location is the type of the command, which is not a field.
    field = field_path(problem["loc"][1:]) or "message"
    return FieldError(field, problem["msg"])


def _hello(session: Session) -> dict[str, Any]:
    scene = session.scene.model_dump(
        mode="json", exclude_none=True, include={"dim", "frame_dt", "gravity", "walls", "obstacles"}
    )
    types = base64.b64encode(session.simulation.types.tobytes()).decode()
    return {"type": "hello", "session": _session(session), "scene": scene, "types": types}


def _status(session: Session) -> dict[str, Any]:
    history = HistoryBody.of(session)
    return {
        "type": "status",
        "session": _session(session),
        "history": None if history is None else history.model_dump(mode="json"),
        **vars(session.simulation.timing()),
    }


def _problem(err: Exception) -> dict[str, Any]:
    row = row_of(err)
    return {
        "type": "problem",
        "problem": urn_of(row),
        "title": row.title,
        "detail": str(err),
        "status": row.status,
    }


def _session(session: Session) -> dict[str, Any]:
    return SessionBody.of(session).model_dump(mode="json")
