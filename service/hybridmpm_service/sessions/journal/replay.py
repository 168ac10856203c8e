"""Computing a session again from its inputs."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from hybridmpm.control import Guidance, Push, prepare
from hybridmpm.simulator import Simulator
from hybridmpm_service.sessions.journal.inputs import Input, PushInput, SketchInput


class Replayed(Protocol):
    """What a replay asks of a simulation."""

    hand: Push | None

    @property
    def frame(self) -> int:
        """Number of frames since the start."""

    def advance(self, frames: int) -> int:
        """Compute frames."""

    def copy(self) -> Simulator:
        """Return a copy of the simulator."""

    def steer(self, guidance: Guidance, number: int, settings: Mapping[str, Any]) -> object:
        """Let a guidance steer."""

    def release(self) -> None:
        """Let no sketch steer any more."""


def replay(
    simulation: Replayed,
    inputs: Sequence[Input],
    until: int,
    guidances: Mapping[int, Guidance] | None = None,
    check: Callable[[], object] = lambda: None,
) -> None:
    """Advance a simulation to a frame, while inputs act as they did.

    Parameters
    ----------
    simulation : Replayed
        At the frame of the first input or before.
    inputs : sequence of Input
        In the order in which they acted.
    until : int
        Frame to stop at; inputs that act from it on are given, too.
    guidances : mapping, optional
        Guidances of sketches by the place of the sketch among the inputs. Other sketches are planned again,
        in the state in which they were.

    check : callable, optional
        Called again and again; what it raises ends the replay.

    Raises
    ------
    SimulationError, SketchError
        A frame or a plan failed.
    """
    plans = dict(guidances or {})
    drawn = {
        place: one.drawn_frame
        for place, one in enumerate(inputs)
        if isinstance(one, SketchInput) and place not in plans
    }
    stops = sorted({one.frame for one in inputs} | set(drawn.values()) | {until})
    waiting = list(enumerate(inputs))
    for stop in (stop for stop in stops if stop >= simulation.frame):
        check()
        simulation.advance(stop - simulation.frame)
        for place in [place for place, frame in drawn.items() if frame == stop]:
            sketch = inputs[place]
            assert isinstance(sketch, SketchInput)  # noqa: S101 - of such alone `drawn` is made
            plans[place] = prepare(simulation.copy(), sketch.sketch, on_frame=check, **sketch.settings)
        while waiting and waiting[0][1].frame == stop:
            place, one = waiting.pop(0)
            _act(simulation, one, plans.get(place))


def _act(simulation: Replayed, one: Input, guidance: Guidance | None) -> None:
    if isinstance(one, PushInput):
        simulation.hand = one.push
    elif guidance is not None and isinstance(one, SketchInput):
        simulation.steer(guidance, one.number, one.settings)
    else:
        simulation.release()
