"""What the operator may choose, from the environment and from flags."""

import ipaddress
import os
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from hybridmpm.errors import ConfigError

PREFIX = "HYBRIDMPM_"


def _split(value: object) -> object:
    """Let an environment variable list its items with commas."""
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value


_Names = Annotated[tuple[str, ...], BeforeValidator(_split)]


class Settings(BaseModel):
    """Addresses and limits of one service process; limits, because memory and cores do not grow."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(default=8000, ge=0, le=65535, description="0 takes a free one.")
    max_sessions: int = Field(default=16, ge=1, le=1000, description="Sessions at once.")
    max_particles: int = Field(default=50_000, ge=1, le=2_000_000, description="Particles of one session.")
    max_grid_nodes: int = Field(default=1 << 22, ge=64, le=1 << 27, description="Grid nodes of one session.")
    max_advance_frames: int = Field(default=2000, ge=1, le=100_000, description="Frames of one call.")
    max_sketch_frames: int = Field(default=400, ge=1, le=4000, description="Frames that a sketch may steer.")
    max_upload_bytes: int = Field(default=1 << 20, ge=1024, le=1 << 20, description="Compressed sketch.")
    max_body_bytes: int = Field(default=1 << 21, ge=4096, le=1 << 26, description="Any request body.")
    idle_seconds: float = Field(
        default=600,
        ge=1,
        le=604_800,
        description="A session that nobody watches or asks for ends after this.",
    )
    threads: int = Field(default=1, ge=1, le=256, description="Solver threads of one session.")
    models: str = Field(
        default="",
        description="Folder of models with their manifest.json. Empty: the models of the library.",
    )
    cors_origins: _Names = Field(
        default=(),
        description="Origins of other front ends that may use this service, e.g. https://a.example.",
    )
    allowed_hosts: _Names = Field(
        default=(),
        description="Host names that requests may carry. Empty: the loopback names when bound to loopback "
        "(so that no web site can reach the service through a name it controls), else any.",
    )
    log_level: Literal["critical", "error", "warning", "info", "debug"] = "warning"

    @classmethod
    def load(cls, environment: Mapping[str, str] = os.environ, **flags: Any) -> Self:
        """Read `HYBRIDMPM_PORT` and the like; a flag that is not None wins.

        Raises
        ------
        ConfigError
            Naming the variable or flag and the allowed range.
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
        """Whether only this machine can connect."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def hosts(self) -> tuple[str, ...] | None:
        """Host names that requests may carry; None for any."""
        if self.allowed_hosts:
            return self.allowed_hosts
        return (
            tuple(dict.fromkeys(("localhost", "127.0.0.1", "::1", self.host))) if self.is_loopback else None
        )
