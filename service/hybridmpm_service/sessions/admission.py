"""Which scenes this service takes, and how many sessions may play at once.

A scene is bounded before it is built: its frames have to fit into the memory, and into bearable time.
Sessions that play are bounded by what their frames are measured to cost. A paused session costs nothing but
memory.
"""

from typing import Protocol

from hybridmpm import Scene, SceneError
from hybridmpm.checking import Finding, findings
from hybridmpm.mpm import frame_cost
from hybridmpm_service.errors import MachineFullError
from hybridmpm_service.sessions.solvers import SolverChoice
from hybridmpm_service.settings import Settings

_SECONDS_PER_PARTICLE_SUBSTEP = 25e-9
"""Estimate for a particle in a substep; on one core MPM takes 15 (2D water) to 43 ns (3D sand)."""


class Load(Protocol):
    """What counts of the player of a session."""

    @property
    def load(self) -> float:
        """Load on the machine [cores]; 0 while nothing is played."""


class Machine:
    """The machine's time, which the sessions that play share.

    The load of a session is the time that its frames take in a second at its speed, at most all of its
    threads. Calls that compute frames without the player are not counted: they end by themselves.

    Parameters
    ----------
    cores : float > 0
        Largest sum of the loads [cores].
    threads : int >= 1
        Threads of each session.
    """

    def __init__(self, cores: float, threads: int) -> None:
        self._cores, self._threads = cores, threads
        self._players: set[Load] = set()

    def join(self, player: Load) -> None:
        """Count the load of a session from now on."""
        self._players.add(player)

    def leave(self, player: Load) -> None:
        """Count the load of a session no more."""
        self._players.discard(player)

    def load_of(self, frame_seconds: float, frame_dt: float, speed: float) -> float:
        """Return the load of a session that plays [cores].

        Parameters
        ----------
        frame_seconds : float
            Time that a frame takes [s].
        frame_dt : float
            Simulated time of a frame [s].
        speed : float
            Simulated seconds per second.
        """
        return self._threads * min(1.0, frame_seconds * speed / frame_dt)

    def full(self) -> MachineFullError | None:
        """Return why nobody else may play now; None if a session may that costs little enough."""
        load = sum(player.load for player in list(self._players))
        if load < self._cores:
            return None
        return MachineFullError(
            f"sessions that play take {load:.2f} of {self._cores:g} cores: pause or delete a session, lower "
            "a speed, or try again later"
        )

    def check(self, more: float, who: str, player: Load | None = None) -> None:
        """Find room for a load beside those of the other sessions. Who would play alone always has room.

        Parameters
        ----------
        more : float
            The load [cores].
        who : str
            What would put it on the machine, for the message.
        player : Load, optional
            The player that asks, whose own load does not count.

        Raises
        ------
        MachineFullError
            There is too little room; the message has the load, the limit and what to do.
        """
        # Copied at once, since sessions may join and leave while a thread asks.
        others = sum(other.load for other in list(self._players) if other is not player)
        if others > 0.0 and others + more > self._cores:
            raise MachineFullError(
                f"sessions that play take {others:.2f} of {self._cores:g} cores, and {who} would take about "
                f"{more:.2f}: pause or delete a session, lower a speed, choose a smaller scene, or try again "
                "later"
            )


def estimated_frame_seconds(scene: Scene) -> float:
    """Return about how long a frame of a scene takes [s], before any has been measured."""
    cost = frame_cost(scene)
    return cost.particles * cost.substeps * _SECONDS_PER_PARTICLE_SUBSTEP


def within_limits(scene: Scene, settings: Settings) -> Scene:
    """Return the scene with the particle limit of this service.

    Raises
    ------
    SceneError
        The scene is beyond a limit; the message has the figure, the limit and what to do.
    """
    most = settings.max_grid_nodes
    nodes = (scene.resolution + 1) ** scene.dim
    if nodes > most:
        allowed = int(most ** (1 / scene.dim)) - 1
        text = f"must be at most {allowed} in {scene.dim}D on this server, got {scene.resolution}"
        raise SceneError.of([("resolution", text)])
    limit = min(scene.max_particles, settings.max_particles)
    cost = frame_cost(scene)
    # Emitters fill a scene up to the limit. More particles at the start are refused when they are made.
    particles = limit if scene.emitters else min(cost.particles, limit)
    if particles * cost.substeps > settings.max_frame_cost:
        text = (
            f"make a frame of about {particles} particles x {cost.substeps} substeps = "
            f"{particles * cost.substeps}, and this server takes up to {settings.max_frame_cost} (setting "
            "max_frame_cost): shorten frame_dt, lower the resolution, or take softer or smaller bodies"
        )
        raise SceneError.of([("bodies", text)])
    return scene.model_copy(update={"max_particles": limit})


def unrefused(scene: Scene, choice: SolverChoice) -> tuple[Finding, ...]:
    """Return what a check says of a scene without trying a frame.

    Raises
    ------
    SceneError
        There are errors among it: the scene would not run. The message says what to change.
    """
    found = findings(scene)
    errors = [one for one in found if one.severity == "error"]
    if errors and choice.solver == "mpm" and choice.coarse is None:
        raise SceneError.of([(one.field, f"{one.problem}; {one.advice}") for one in errors])
    # Fewer particles take a coarser grid and longer steps, of which the scene alone tells nothing.
    return tuple(one for one in found if one not in errors)
