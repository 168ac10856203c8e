"""Limits on scenes, and on the load of the sessions that play.

A scene is limited before it is built, by the memory and the estimated time of its frames. Sessions that play
are limited by the measured time of their frames. A paused session costs nothing but memory.
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
    """A player with a load."""

    @property
    def load(self) -> float:
        """Load on the machine [cores]; 0 while nothing is played."""


class Machine:
    """The cores of the machine, shared by the sessions that play.

    The load of a session is the time of its frames in a second at its speed, at most all of its threads.
    Calls that compute frames without the player are not counted: they end by themselves.

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
            Time of a frame [s].
        frame_dt : float
            Simulated time of a frame [s].
        speed : float
            Simulated seconds per second.
        """
        return self._threads * min(1.0, frame_seconds * speed / frame_dt)

    def full(self) -> MachineFullError | None:
        """Return the refusal of any further load; None if a small one has room."""
        load = sum(player.load for player in list(self._players))
        if load < self._cores:
            return None
        return MachineFullError(
            f"sessions that play take {load:.2f} of {self._cores:g} cores: pause or delete a session, lower "
            "a speed, or try again later"
        )

    def check(self, more: float, who: str, player: Load | None = None) -> None:
        """Check that a load fits beside those of the other sessions. A single session always fits.

        Parameters
        ----------
        more : float
            The load [cores].
        who : str
            Source of the load, for the message.
        player : Load, optional
            Player whose present load does not count.

        Raises
        ------
        MachineFullError
            The load does not fit; the message has the load, the limit and a remedy.
        """
        # Copied at once, since sessions may join and leave meanwhile in other threads.
        others = sum(other.load for other in list(self._players) if other is not player)
        if others > 0.0 and others + more > self._cores:
            raise MachineFullError(
                f"sessions that play take {others:.2f} of {self._cores:g} cores, and {who} would take about "
                f"{more:.2f}: pause or delete a session, lower a speed, choose a smaller scene, or try again "
                "later"
            )


def estimated_frame_seconds(scene: Scene) -> float:
    """Return the estimated time of a scene's frame [s]."""
    cost = frame_cost(scene)
    return cost.particles * cost.substeps * _SECONDS_PER_PARTICLE_SUBSTEP


def within_limits(scene: Scene, settings: Settings) -> Scene:
    """Return the scene with the particle limit of this service.

    Raises
    ------
    SceneError
        The scene is beyond a limit; the message has the figure, the limit and a remedy.
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


def static_findings(scene: Scene, choice: SolverChoice) -> tuple[Finding, ...]:
    """Return the static findings of a scene's check, for which no frame is simulated.

    Raises
    ------
    SceneError
        There are errors among them: the scene would not run. The message has remedies.
    """
    found = findings(scene)
    errors = [one for one in found if one.severity == "error"]
    if errors and choice.solver == "mpm" and choice.coarse is None:
        raise SceneError.of([(one.field, f"{one.problem}; {one.advice}") for one in errors])
    # In coarse mode grid and time step differ from the scene's, so its static errors do not apply.
    return tuple(one for one in found if one not in errors)
