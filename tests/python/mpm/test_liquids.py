"""Viscous liquids: names, bits and substeps. Validation of the laboratory compares them with closed forms."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from hybridmpm import Box, Liquid, MpmSolver, Scene, SceneError
from hybridmpm.scene import LIQUIDS, BoxObstacle, Walls


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.long)])
def test_threads_and_snapshots_give_the_same_bits(dim: int) -> None:
    thinning = Liquid(viscosity=4.0, yield_stress=20.0, flow_index=0.6)
    lower, upper = (0.2, 0.3, 0.3)[:dim], (0.45, 0.7, 0.6)[:dim]
    bodies = [
        Box(material=thinning, lower=lower, upper=upper, velocity=(2.0, -2.0, 1.0)[:dim]),
        Box(material="honey", lower=(0.6, 0.1, 0.3)[:dim], upper=(0.8, 0.3, 0.5)[:dim]),
    ]
    scene = Scene(dim=dim, resolution={2: 128, 3: 48}[dim], bodies=bodies)
    ends = []
    for threads in (1, 2, 4):
        solver = MpmSolver(scene, threads=threads)
        solver.advance(8)
        saved = solver.snapshot()
        solver.advance(4)
        ends.append(solver.snapshot())
        solver.restore(saved)
        solver.advance(4)
        assert solver.snapshot() == ends[0]
    assert ends[1:] == ends[:1] * 2


def test_liquids_have_names_in_scene_files() -> None:
    scene = Scene.from_yaml(
        "{dim: 2, bodies: [{shape: ball, material: honey, center: [.5, .5], radius: .1}, {shape: ball, "
        "material: {kind: liquid, viscosity: 3, flow_index: .5}, center: [.5, .2], radius: .05}]}"
    )
    honey, other = (body.material for body in scene.bodies)
    assert honey == LIQUIDS["honey"]
    assert other == Liquid(viscosity=3, flow_index=0.5)
    assert Scene.from_json(scene.to_json()) == scene
    assert MpmSolver(scene).materials.tolist().count(8) == len(scene.sample().x)
    for wrong, message in (
        ({"viscosity": 0}, r"viscosity.*must be in \(0, 1e\+09\] Pa s\^n, got 0"),
        ({"flow_index": 3}, r"flow_index.*must be in \[0.2, 2\], got 3"),
        ({"friction_angle": 30}, "friction_angle"),
    ):
        with pytest.raises((SceneError, ValidationError), match=message):
            Scene(
                dim=2,
                bodies=[
                    {
                        "shape": "ball",
                        "material": {"kind": "liquid", **wrong},
                        "center": (0.5, 0.5),
                        "radius": 0.1,
                    }
                ],
            )


@pytest.mark.parametrize("cells", [0.0, 0.35, 0.5, 0.8])
@pytest.mark.parametrize("sides", ["walls", "obstacles"])
def test_a_channel_flows_by_the_law_wherever_its_sides_lie_between_nodes(cells: float, sides: str) -> None:
    width, viscosity, weight = 0.2, 100.0, 2000.0
    lower = (20 + cells) / 64
    upper = lower + width
    held: dict[str, object] = {"walls": Walls(lower=(0, lower), upper=(1, upper), contact="sticky")}
    if sides == "obstacles":
        plates = [((0, lower - 0.1), (1, lower)), ((0, upper), (1, upper + 0.1))]
        held = {
            "walls": Walls(lower=(0, 0), upper=(1, 1)),
            "obstacles": [BoxObstacle(lower=a, upper=b, contact="sticky") for a, b in plates],
        }
    fluid = Box(material=Liquid(viscosity=viscosity), lower=(0.05, lower), upper=(0.85, upper))
    solver = MpmSolver(Scene(dim=2, resolution=64, gravity=(2, 0), bodies=[fluid], **held))
    solver.advance(60)
    x, v = solver.positions, solver.velocities
    middle = np.abs(x[:, 0] - np.median(x[:, 0])) < 0.1
    y = x[middle, 1] - lower
    law = weight * y * (width - y) / (2 * viscosity)
    assert v[middle, 0].sum() == pytest.approx(law.sum(), rel=0.03)
    assert np.abs(v[middle, 0] - law).max() < 0.05 * law.max()


def test_no_viscosity_needs_more_substeps_than_water() -> None:
    counts = set()
    for material in ("water", Liquid(viscosity=1e-3), Liquid(viscosity=1e8), Liquid(yield_stress=1e8)):
        solver = MpmSolver(
            Scene(dim=2, resolution=64, bodies=[Box(material=material, lower=(0.3, 0.1), upper=(0.5, 0.3))])
        )
        solver.advance(40)
        counts.add(solver.last_frame.substeps)
        assert math.isfinite(solver.diagnostics().kinetic_energy)
    assert len(counts) == 1
