"""When regions of a scene may sleep."""

from typing import Annotated

from pydantic import Field

from hybridmpm.scene.fields import Range, Record


class Sleep(Record):
    """What counts as rest: a region sleeps once it and its surroundings were slow for long enough.

    Particles asleep keep their positions, with velocity zero. The slower and the longer, the closer to the
    motion without sleep.
    """

    speed: Annotated[float, Range(0, 1e3, "m/s", open_low=True)] = Field(
        0.02, description="Slower than this [m/s]"
    )
    frames: Annotated[int, Range(1, 1_000_000)] = Field(
        20, description="at the end of so many frames in a row."
    )
