"""A client of the service: sessions, sketches and live frames from Python, with and without asyncio.

`Client` waits for each answer, the methods of `AsyncClient` are coroutines; both have the same methods. They
need httpx and websockets: `pip install 'hybridmpm[client]'`. docs/reference/http-api.md describes the calls.
"""

from hybridmpm.client.answers import Particles, Trajectory
from hybridmpm.client.asynchronous import AsyncClient, AsyncJob, AsyncSession, AsyncStream
from hybridmpm.client.errors import ServiceError, StreamClosedError, UnreachableError
from hybridmpm.client.synchronous import Client, Job, Session, Stream
from hybridmpm.stream_frames import Frame

__all__ = [
    "AsyncClient",
    "AsyncJob",
    "AsyncSession",
    "AsyncStream",
    "Client",
    "Frame",
    "Job",
    "Particles",
    "ServiceError",
    "Session",
    "Stream",
    "StreamClosedError",
    "Trajectory",
    "UnreachableError",
]
