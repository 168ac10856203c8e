"""What a session was made from."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from hybridmpm import SOLVER_VERSION, Scene, __version__
from hybridmpm_service.sessions.solvers import ChosenSolver, SolverChoice


@dataclass(frozen=True, kw_only=True)
class Versions:
    """What computed a session. Others need not give the same bits."""

    hybridmpm: str
    """Version of the library."""
    solver: int
    """`hybridmpm.SOLVER_VERSION`."""
    model: str | None
    """SHA-256 of the network's file; None without a network."""


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Scene and simulator of a session."""

    scene: Scene
    scenario: str | None
    """Scenario that the scene was drawn from; None where a scene was given."""
    seed: int | None
    """Seed of the scenario; None where a scene was given."""
    choice: SolverChoice
    """The simulator; its network has a name."""
    versions: Versions

    @classmethod
    def of(cls, scene: Scene, chosen: ChosenSolver, scenario: str | None, seed: int | None) -> Self:
        """Return the origin of a session that begins now."""
        guard = chosen.safeguard
        choice = SolverChoice(
            solver=chosen.simulator.kind,
            coarse=chosen.coarse,
            model=chosen.model,
            r_c=None if guard is None else guard.r_c,
            safeguard=None if guard is None else guard.kind,
        )
        versions = Versions(hybridmpm=__version__, solver=SOLVER_VERSION, model=chosen.model_sha256)
        return cls(scene=scene, scenario=scenario, seed=seed, choice=choice, versions=versions)

    def record(self) -> dict[str, Any]:
        """Return the origin as plain data; `of_record` makes an equal one of it."""
        return {
            "versions": vars(self.versions),
            "scenario": self.scenario,
            "seed": self.seed,
            "scene": self.scene.model_dump(mode="json", exclude_none=True),
            **vars(self.choice),
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Return the origin of a record.

        Raises
        ------
        SceneError, FieldError
            The scene or the choice is refused.
        KeyError, TypeError
            It is no record.
        """
        return cls(
            scene=Scene.parse(record["scene"]),
            scenario=record["scenario"],
            seed=record["seed"],
            choice=SolverChoice(
                **{name: record[name] for name in ("solver", "coarse", "model", "r_c", "safeguard")}
            ),
            versions=Versions(**record["versions"]),
        )
