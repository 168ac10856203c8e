"""Settings of the service, by environment variables or flags."""

import ipaddress
import os
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from hybridmpm.errors import ConfigError

PREFIX = "HYBRIDMPM_"


def _split(value: object) -> object:
    """Split the items of an environment variable at commas."""
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value


_Names = Annotated[tuple[str, ...], BeforeValidator(_split)]


class Settings(BaseModel):
    """Address, limits and access rules of one service process. Limits keep it within its memory and cores."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)

    host: str = "127.0.0.1"
    """Address to listen on."""
    port: int = Field(default=8000, ge=0, le=65535)
    """Port to listen on; 0 takes a free one."""
    max_sessions: int = Field(default=16, ge=1, le=1000)
    """Largest number of sessions at the same time."""
    max_load: float | None = Field(default=None, gt=0, le=1024)
    """Largest load of the sessions that play, in cores; if absent, all cores that the process may use."""
    max_connections: int = Field(default=1000, ge=1, le=100_000)
    """Largest number of connections at the same time."""
    max_particles: int = Field(default=50_000, ge=1, le=2_000_000)
    """Largest number of particles of a session."""
    max_grid_nodes: int = Field(default=1 << 22, ge=64, le=1 << 27)
    """Largest number of grid nodes of a session."""
    max_frame_cost: int = Field(default=20_000_000, ge=1000, le=10**12)
    """Largest cost of a frame of a session, in particles times substeps; 20 000 000 take about a second.
    Tests of particles and grid nodes against obstacles count as well."""
    max_building_cost: int = Field(default=100_000_000, ge=1000, le=10**12)
    """Largest cost of building a session, in tests of grid nodes and lattice sites against obstacles and
    bodies; 100 000 000 take about a second."""
    max_advance_frames: int = Field(default=2000, ge=1, le=100_000)
    """Largest number of frames that one call advances."""
    max_sketch_frames: int = Field(default=400, ge=1, le=4000)
    """Largest number of frames that a sketch steers."""
    max_replay_frames: int = Field(default=20_000, ge=1, le=1_000_000)
    """Largest number of frames of a log that is replayed."""
    max_dataset_frames: int = Field(default=20_000, ge=1, le=10**8)
    """Largest number of frames of a data set, those of all its trajectories together."""
    max_jobs: int = Field(default=16, ge=1, le=1024)
    """Largest number of jobs, those that have ended among them."""
    max_upload_bytes: int = Field(default=1 << 20, ge=1024, le=1 << 20)
    """Largest size of an uploaded PNG in bytes."""
    max_body_bytes: int = Field(default=1 << 24, ge=4096, le=1 << 26)
    """Largest size of a request body in bytes; a surface of 200 000 triangles takes 10 MB as STL."""
    idle_seconds: float = Field(default=600, ge=1, le=604_800)
    """Seconds after which a session ends that no client watches or calls."""
    send_seconds: float = Field(default=5, gt=0, le=600)
    """Seconds that a viewer may take for a message of its stream before it is dropped."""
    request_seconds: float = Field(default=20, gt=0, le=3600)
    """Seconds in which a client has to send a whole request, with its body."""
    max_messages_per_second: float = Field(default=200, gt=0, le=1e6)
    """Largest rate of a client's messages on a stream."""
    max_messages_at_once: int = Field(default=400, ge=1, le=10**6)
    """Largest burst of a client's messages on a stream."""
    threads: int = Field(default=1, ge=1, le=256)
    """Number of threads of each session's simulator; results do not depend on it."""
    keys: str = ""
    """File of keys, which `hybridmpm key` makes; every call then needs one. If empty, nobody needs a key, and
    only programs on this machine may be served."""
    open: bool = False
    """Whether others than programs on this machine may be served without keys."""
    proxies: _Names = ("127.0.0.1", "::1")
    """Addresses of proxies, separated by commas, whose X-Forwarded-For and X-Forwarded-Proto are believed."""
    state_folder: str = ""
    """Folder in which sessions are kept, so that they survive a stop or a crash of the service. If empty,
    they live in memory alone."""
    models: str = ""
    """Folder of models with their manifest.json. If empty, the library's models serve."""
    node: str = Field(default="", pattern="^([0-9a-f]{2})?$")
    """Name of this node of several, two hexadecimal digits with which the ids of its sessions and jobs
    begin, so that a proxy finds their owner. If empty, this is the only node."""
    peers: _Names = ()
    """The other nodes, separated by commas, e.g. 01=http://10.0.0.2:8000; lists contain theirs as well."""
    cors_origins: _Names = ()
    """Origins of other front ends that may use this service, separated by commas, e.g. https://a.example."""
    allowed_hosts: _Names = ()
    """Allowed host names of requests, separated by commas. If empty, a service on a loopback address
    allows the loopback names alone, so that no web site can reach it through a name of the site's own; any
    other service allows all names."""
    log_level: Literal["critical", "error", "warning", "info", "debug"] = "warning"
    """Least severe level that is logged: critical, error, warning, info or debug. With info, each request has
    a line."""
    log_format: Literal["text", "json"] = "text"
    """Format of the log: text, or json with an object on each line."""
    metrics: Literal["local", "all", "off"] = "local"
    """Who may read /metrics: local, which is programs on this machine; all; or off, which is nobody."""

    @classmethod
    def load(cls, environment: Mapping[str, str] = os.environ, **flags: Any) -> Self:
        """Read the settings from variables such as HYBRIDMPM_PORT; a flag that is not None wins.

        Raises
        ------
        ConfigError
            A value is not allowed. The message names the variable or flag and the allowed range.
        """
        given = {
            name: environment[PREFIX + name.upper()]
            for name in cls.model_fields
            if PREFIX + name.upper() in environment
        }
        chosen = {name: value for name, value in flags.items() if value is not None}
        try:
            return cls.model_validate(given | chosen)
        except ValidationError as err:
            problem = err.errors(include_url=False)[0]
            name = str(problem["loc"][0])
            source = f"--{name.replace('_', '-')}" if name in chosen else PREFIX + name.upper()
            raise ConfigError(f"{source}: {problem['msg']}, got {problem['input']!r}") from None

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can connect to the address."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def hosts(self) -> tuple[str, ...] | None:
        """Allowed host names of requests; None if all are allowed."""
        if self.allowed_hosts:
            return self.allowed_hosts
        return (
            tuple(dict.fromkeys(("localhost", "127.0.0.1", "::1", self.host))) if self.is_loopback else None
        )
