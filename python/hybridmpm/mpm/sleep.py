"""`Sleep`: settings of sleeping regions."""

from typing import Annotated

from pydantic import Field

from hybridmpm.scene.fields import Range, Record


class Sleep(Record):
    """Settings of sleeping regions: a region sleeps once it and its surroundings were slow for long enough.

    Sleeping particles keep their positions and have no velocity. Lower speeds and more frames bring a
    simulation closer to one without sleep.
    """

    speed: Annotated[float, Range(0, 1e3, "m/s", open_low=True)] = Field(
        0.02, description="Speed [m/s] that every particle of the region has to stay below."
    )
    frames: Annotated[int, Range(1, 1_000_000)] = Field(
        20, description="Number of consecutive frames at the ends of which the region has to be that slow."
    )
