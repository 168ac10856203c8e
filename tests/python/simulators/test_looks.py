"""How simulators and scenes look: in a terminal, in a notebook, and to whoever writes to their arrays."""

import base64
import io
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageShow
from tests.python.notebooks.runner import Shell, as_ipython

from hybridmpm import (
    Ball,
    BallObstacle,
    BallSink,
    BoxObstacle,
    ConfigError,
    ExportError,
    HalfSpaceObstacle,
    HybridSimulator,
    MpmBatch,
    MpmSolver,
    NeuralPhysics,
    Polygon,
    RectangularEmitter,
    Scene,
    SegmentObstacle,
    Simulator,
    control,
    data,
    recording,
    scenarios,
)

WATER = scenarios.water_2d(7)


def test_a_repr_says_what_it_is_and_how_far() -> None:
    solver = MpmSolver(WATER)
    solver.advance(2)
    count = solver.particle_count
    assert repr(solver) == f"MpmSolver(water_2d seed 7, {count} particles, frame 2)"
    level = MpmSolver(WATER, coarse="1/16")
    assert repr(level) == f"MpmSolver(water_2d seed 7, coarse level '1/16', {count} particles, frame 0)"
    few = MpmSolver(WATER, r_p=0.25)
    assert repr(few) == f"MpmSolver(water_2d seed 7, r_p = 0.25, {few.particle_count} particles, frame 0)"
    neural = NeuralPhysics(WATER, "fluids_2d")
    assert repr(neural) == f"NeuralPhysics(water_2d seed 7, model fluids_2d, {count} particles, frame 0)"
    hybrid = HybridSimulator(WATER, "zero")
    assert "HybridSimulator(water_2d seed 7, model zero, MPM simulates, " in repr(hybrid)
    hybrid.advance(20)
    assert "model zero, the network simulates, " in repr(hybrid)
    assert repr(MpmBatch([WATER, WATER])) == f"MpmBatch(2 scenes, {2 * count} particles)"


def test_scenes_and_states_that_were_kept_say_what_they_are() -> None:
    assert repr(WATER) == str(WATER) == f"Scene(water_2d seed 7, 2D, water, bodies: {len(WATER.bodies)})"
    run = recording.record(MpmSolver(WATER), 4, every=2)
    count = run.positions.shape[1]
    assert repr(run) == f"Recording(water_2d seed 7, {count} particles, 3 states from frame 0 to 4)"
    trajectory = data.Trajectory(positions=run.positions, types=run.types.astype(np.int64), scene=WATER)
    assert repr(trajectory) == f"Trajectory(water_2d seed 7, {count} particles, 3 states)"


def test_what_follows_a_sketch_says_how_far_it_is(falling_block: Scene) -> None:
    arrow = control.Arrow(points=np.array([[0.3, 0.3], [0.4, 0.4]]))
    following = control.follow(MpmSolver(falling_block), arrow, frames=40)
    assert repr(following.guidance).startswith("Guidance(arrow, learned: ")
    next(following)
    assert repr(following).endswith("frame 1), arrow, 1 of 40 frames)")
    following.cancel()
    text = repr(following.run())
    assert text.startswith("ControlledTrajectory(256 particles, 1 frames from frame 0, cancelled: centre of")


def _pictures(html: str) -> list[tuple[int, int]]:
    """Return the sizes of the pictures within HTML."""
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return [Image.open(io.BytesIO(base64.b64decode(text))).size for text in found]


def test_a_notebook_shows_a_picture(make: Callable[[], Simulator]) -> None:
    simulator = make()
    html = simulator._repr_html_()
    assert _pictures(html) == [(480, 480)]
    assert "falling block, " in html
    run = recording.record(simulator, 6, every=2)
    ((width, height),) = _pictures(run._repr_html_())
    assert (width, height) == (4 * 240 + 3 * 6, 240)


def test_a_notebook_shows_a_scene_as_a_drawing() -> None:
    scene = Scene(
        name="<all> of it",
        dim=2,
        bodies=(
            Ball(material="sand", center=(0.3, 0.75), radius=0.1),
            Polygon(material="elastic", vertices=((0.6, 0.6), (0.8, 0.6), (0.7, 0.8))),
        ),
        obstacles=(
            SegmentObstacle(start=(0.15, 0.6), end=(0.5, 0.4), thickness=0.02),
            BallObstacle(center=(0.5, 0.2), radius=0.05),
            BoxObstacle(lower=(0.7, 0.1), upper=(0.8, 0.2)),
            HalfSpaceObstacle(point=(0.1, 0.15), normal=(0.0, 1.0)),
        ),
        emitters=(RectangularEmitter(material="water", lower=(0.1, 0.5), upper=(0.1, 0.7), velocity=(2, 0)),),
        sinks=(BallSink(center=(0.85, 0.15), radius=0.04),),
    )
    html = scene._repr_html_()
    assert "&lt;all&gt; of it" in html
    assert html.count("<circle ") == 3
    assert html.count("<polygon ") == html.count("<line ") == 1
    assert html.count("<rect ") == 4  # the room, the box, the half-space, the emitter
    assert scenarios.water_3d(1)._repr_html_().count("<rect ") >= 2


def test_pictures_of_one_cell_take_the_place_of_each_other(falling_block: Scene) -> None:
    shell, solver, other = Shell(), MpmSolver(falling_block), MpmSolver(falling_block)
    with as_ipython(shell):
        solver.show(100)
        other.show(100)
        solver.advance(3)
        solver.show(200)
        assert [bundle["text/plain"] for bundle in shell.outputs] == [repr(solver), repr(other)]
        assert [_pictures(bundle["text/html"]) for bundle in shell.outputs] == [[(200, 200)], [(100, 100)]]
        shell.execution_count += 1
        solver.show(100)
    assert len(shell.outputs) == 3
    with pytest.raises(ConfigError, match=r"width must be in \[64, 4096\]"):
        solver.show(10)


def test_outside_of_notebooks_a_picture_is_shown_by_the_systems_viewer(
    falling_block: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[tuple[int, int]] = []

    def view(picture: Image.Image, **_: str) -> bool:
        seen.append(picture.size)
        return len(seen) == 1

    monkeypatch.setattr(ImageShow, "show", view)
    with as_ipython(Shell(kernel=False)):
        MpmSolver(falling_block).show(300)
        assert seen == [(300, 300)]
        with pytest.raises(ExportError, match="no program here to show pictures: use a notebook"):
            MpmSolver(falling_block).show()


SHOWN = ("positions", "velocities", "ids", "materials", "mass", "coarse_positions")


def _assert_read_only(owner: Any, names: tuple[str, ...]) -> None:
    for name in names:
        array = getattr(owner, name)
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


@pytest.mark.parametrize("frame", [0, 21, 23])
def test_what_would_be_lost_cannot_be_written(make: Callable[[], Simulator], frame: int) -> None:
    """At the start, and within steps of a network."""
    simulator = make()
    simulator.advance(frame)
    before = simulator.snapshot()
    _assert_read_only(simulator, SHOWN)
    assert simulator.snapshot() == before
    own = simulator.positions.copy()
    own[0] = 0


def test_carried_particles_and_those_of_the_core_cannot_be_written_either() -> None:
    solver = MpmSolver(WATER, coarse="1/16")
    solver.advance(3)
    _assert_read_only(solver, (*SHOWN, "material", "affine", "volume_ratio", "asleep"))
    core = solver._solver
    _assert_read_only(
        core, ("positions", "velocities", "ids", "material", "mass", "affine", "volume_ratio", "asleep")
    )
    _assert_read_only(solver._upsampler._native, ("ids", "material", "mass"))


def test_a_wrong_type_is_told_what_to_write_instead() -> None:
    wrong: list[tuple[Any, str]] = [
        ("water_2d", r"scene: must be a Scene, got the text 'water_2d': write scenarios\.water_2d\(\)"),
        ("Water2D", r"got the text 'Water2D': write scenarios\.water_2d\(\)"),
        ("lava", r"got the text 'lava': read a file by Scene\.load"),
        ("waves.yaml", r"got the path 'waves\.yaml': write Scene\.load\('waves\.yaml'\)"),
        (scenarios.water_2d, r"got the function water_2d: call it, scenarios\.water_2d\(\)"),
        ({"dim": 2}, r"got a dict: write Scene\.parse\(\.\.\.\)"),
        (MpmSolver(WATER), r"got MpmSolver\(.*\): write \.scene behind it"),
        (None, "got None"),
        (3, "got an object of type int"),
    ]
    makers: tuple[Callable[[Any], Simulator], ...] = (
        MpmSolver,
        lambda scene: NeuralPhysics(scene, "zero"),
        lambda scene: HybridSimulator(scene, "zero"),
    )
    for value, message in wrong:
        for make in makers:
            with pytest.raises(ConfigError, match=message):
                make(value)
    with pytest.raises(ConfigError, match=r"scenes must be a list of scenes, got a Scene: write \[scene\]"):
        MpmBatch(WATER)  # type: ignore[arg-type]
    with pytest.raises(
        ConfigError, match=r"a simulator is required.*; got a Scene: write MpmSolver\(scene\)"
    ):
        recording.record(WATER, 3)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r"a simulator is required, such as an MpmSolver; got a str"):
        control.prepare("water_2d", control.Arrow(points=np.array([[0.3, 0.3], [0.4, 0.4]])))  # type: ignore[arg-type]


def test_a_name_that_is_nearly_right_is_suggested() -> None:
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: scenarios.get("water2d"), r"; did you mean 'water_2d'\?$"),
        (lambda: scenarios.get("lava"), "got 'lava'$"),
        (lambda: NeuralPhysics(WATER, "fluid_2d"), r"; did you mean 'fluids_2d'\?$"),
        (lambda: MpmSolver(WATER, coarse="1/15"), r"; did you mean '1/16'\?$"),
        (lambda: HybridSimulator(WATER, "zero", guards=["cosin"]), r"; did you mean 'cosine'\?$"),
        (
            lambda: control.prepare(
                MpmSolver(WATER), control.Arrow(points=np.array([[0.3, 0.3], [0.4, 0.4]])), method="Analytc"
            ),
            r"; did you mean 'analytic'\?$",
        ),
    ]
    for provoke, message in wrong:
        with pytest.raises(ConfigError, match=message):
            provoke()
