"""A check tells of a scene, before any frame, what a run of it would show."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from hybridmpm import (
    CoarseWarning,
    ConfigError,
    MpmSolver,
    NeuralPhysics,
    Scene,
    SoftMaterialWarning,
    scenarios,
)
from hybridmpm.checking import Finding, check, findings
from hybridmpm.cli import cli

BLOCK = {"shape": "box", "material": "water", "lower": [0.2, 0.2], "upper": [0.4, 0.4]}

SMALL = BLOCK | {"lower": [0.5, 0.2], "upper": [0.6, 0.3]}
IN_FULL_BOX = {"shape": "box", "material": "sand", "lower": [0.1, 0.1], "upper": [0.3, 0.3]}
SLIVER = {"shape": "polygon", "material": "water", "vertices": [[0.2, 0.2], [0.21, 0.19], [0.4, 0.4]]}
SPOUT = {
    "shape": "rectangle",
    "material": "water",
    "lower": [0.5, 0.5],
    "upper": [0.5, 0.7],
    "velocity": [1, 0],
}


def scene(*bodies: dict[str, Any], **fields: Any) -> Scene:
    return Scene.parse({"dim": 2, "resolution": 64, "bodies": list(bodies or (BLOCK,))} | fields)


def only(found: tuple[Finding, ...]) -> Finding:
    assert len(found) == 1, found
    return found[0]


def test_a_scene_without_faults_gets_its_figures_and_nothing_else() -> None:
    found = check(scene())
    assert found.findings == ()
    assert found.ok
    assert found.stable is True
    solver = MpmSolver(scene())
    solver.advance(1)
    assert solver.last_frame is not None
    assert (found.particles, found.substeps) == (solver.particle_count, solver.last_frame.substeps)
    assert found.bound == "sound"
    assert found.milliseconds is not None
    assert 0.001 < found.milliseconds < 1000
    assert 50e6 < found.memory < 200e6
    assert "no findings" in str(found)


@pytest.mark.parametrize(
    ("changed", "severity", "field", "words"),
    [
        (
            {"obstacles": [{"shape": "box", "lower": [0.5, 0.1], "upper": [0.6, 0.103]}]},
            "warning", "obstacles[0]", ["0.003 m thick", "0.00781 m"],
        ),
        (
            {"bodies": [BLOCK | {"upper": [0.4, 0.21]}]},
            "warning", "bodies[0]", ["0.01 m thin", "0.0156 m"],
        ),
        (
            {"obstacles": [{"shape": "box", "lower": [0.1, 0.5], "upper": [0.85, 0.6]}]},
            "warning", "obstacles[0]", ["gap of 0.05 m", "x is 3.2 cells", "59%", "0.068 m wide", "or set"],
        ),
        (
            {"bodies": [SLIVER]},
            "warning", "bodies[0]", ["thin, less than one cell"],
        ),
        (
            {"bodies": [BLOCK, BLOCK | {"lower": [0.3, 0.2], "upper": [0.5, 0.4]}]},
            "warning", "bodies[1]", ["50% of its volume in bodies[0]"],
        ),
        (
            {"obstacles": [{"shape": "box", "lower": [0.3, 0.1], "upper": [0.6, 0.5]}]},
            "warning", "bodies[0]", ["50% of its volume in obstacles[0]"],
        ),
        (
            {"bodies": [BLOCK | {"material": {"kind": "water", "bulk_modulus": 1000}}]},
            "warning", "bodies[0]", ["49%", "4.9 times as stiff"],
        ),
        (
            {"bodies": [BLOCK | {"material": {"kind": "sand", "density": 2}}, SMALL]},
            "warning", "bodies[0]", ["2 kg/m^3 beside 1000 kg/m^3"],
        ),
        (
            {"bodies": [IN_FULL_BOX], "walls": {"lower": [0.1, 0.1], "upper": [0.3, 0.3]}},
            "warning", "bodies[0]", ["fills its box, between walls 13 cells", "at least 32", "twentieth"],
        ),
        (
            {"bodies": [IN_FULL_BOX | {"upper": [0.2, 0.5]}],
             "walls": {"lower": [0.1, 0.1], "upper": [0.2, 0.9]}},
            "warning", "bodies[0]", ["sand between walls 6.4 cells apart", "at least 7 cells"],
        ),
        (
            {"bodies": [BLOCK | {"material": {"kind": "water", "bulk_modulus": 1e9}}]},
            "note", "bodies[0]", ["substeps a frame"],
        ),
        (
            {"bodies": [BLOCK | {"material": {"kind": "liquid", "viscosity": 2000}}]},
            "warning", "bodies[0]", ["as an elastic solid", "give it 18 times the bulk_modulus"],
        ),
        (
            {"bodies": [BLOCK | {"material": {"kind": "liquid", "viscosity": 1e9}}]},
            "warning", "bodies[0]", ["as an elastic solid", "lower it to 4.7e+02 Pa s, or bear with it"],
        ),
        (
            {"emitters": [SPOUT], "frames": 800},
            "note", "emitters", ["from 655 to up to 7311", "11 times as long"],
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else None,
)  # fmt: skip
def test_each_finding_names_place_figures_and_remedy(
    changed: dict[str, Any], severity: str, field: str, words: list[str]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = check(scene(**changed))
    mine = [one for one in found.findings if (one.severity, one.field) == (severity, field)]
    one = next(one for one in mine if words[0] in one.problem)
    assert all(word in f"{one.problem}; {one.advice}" for word in words), one
    assert one.advice
    assert str(one) in str(found)
    assert found.ok


def test_narrow_sand_without_gravity_gains_nothing_and_is_no_finding() -> None:
    walls = {"lower": [0.1, 0.1], "upper": [0.3, 0.3]}

    def is_found(**changed: Any) -> bool:
        found = findings(scene(bodies=[IN_FULL_BOX], walls=walls, **changed))
        return any("its pressure grows" in one.problem for one in found)

    assert is_found()
    assert is_found(gravity=[7, -7])
    assert not is_found(gravity=[0, 0])


def test_the_gravest_comes_first() -> None:
    stiff = BLOCK | {"material": {"kind": "water", "bulk_modulus": 1e9}}
    thin = {"shape": "box", "lower": [0.5, 0.1], "upper": [0.6, 0.103]}
    found = check(scene(stiff, obstacles=[thin]))
    assert [one.severity for one in found.findings] == ["warning", "note"]


def test_substeps_above_the_limit_are_an_error_whoever_refuses_them() -> None:
    made = scene()
    unstable = MpmSolver(made, substeps=1, allow_unstable=True)
    found = check(made, unstable)
    assert found.stable is False
    one = only(found.findings)
    assert one.severity == "error"
    assert "1 substeps a frame are too few" in one.problem
    assert unstable.frame == 0
    fixed = MpmSolver(made, substeps=20)
    assert check(made, fixed).stable is True


def test_what_cannot_be_filled_is_a_finding_and_no_error() -> None:
    twice = check(scene(BLOCK, BLOCK))
    assert not twice.ok
    assert twice.substeps is None
    assert any("room for no particle" in one.problem for one in twice.findings)


def test_the_simulator_asked_about_stays_as_it_is() -> None:
    made = scenarios.water_2d(7)
    network = NeuralPhysics(made, "fluids_2d")
    before = network.snapshot()
    found = check(made, network)
    assert network.snapshot() == before
    assert found.stable is None
    assert found.milliseconds is not None


def test_a_solver_of_another_scene_is_refused() -> None:
    with pytest.raises(ConfigError, match="another scene"):
        check(scene(), MpmSolver(scenarios.water_2d(0)))
    with pytest.raises(ConfigError, match="write MpmSolver"):
        check(scene(), scene())  # type: ignore[arg-type]


def test_a_long_frame_is_tried_in_part() -> None:
    stiff = scene(BLOCK | {"material": {"kind": "water", "bulk_modulus": 1e12}})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = check(stiff)
    assert found.substeps is not None
    assert found.substeps > 5000
    assert found.milliseconds is not None
    assert found.milliseconds > 20


def test_a_scene_that_fills_is_timed_as_in_the_middle_of_its_run() -> None:
    spout = scene(emitters=[SPOUT], frames=400)
    short = scene(emitters=[SPOUT | {"stop": 0.01}], frames=400)
    filled, started = check(spout).milliseconds, check(short).milliseconds
    assert filled is not None
    assert started is not None
    # By frame 200 the first has five times the particles of the second.
    assert filled > 1.5 * started


def test_what_no_grid_bears_is_an_error_of_the_scene_alone() -> None:
    hard = scene(BLOCK | {"material": {"kind": "water", "bulk_modulus": 1e12, "density": 1}})
    found = [one for one in findings(hard) if one.severity == "error"]
    assert "substeps a frame, and at most 20000 are taken" in only(tuple(found)).problem
    assert check(hard).stable is False


def test_overlaps_are_found_among_many_bodies() -> None:
    bars = [BLOCK | {"lower": [0.12, 0.11 + k / 400], "upper": [0.88, 0.113 + k / 400]} for k in range(300)]
    told = [one for one in findings(scene(*bars)) if "of its volume in bodies" in one.problem]
    assert {one.field for one in told} == {f"bodies[{k}]" for k in range(1, 300)}


def test_soft_material_is_warned_of() -> None:
    with pytest.warns(SoftMaterialWarning, match=r"bodies\[0\]: water is so soft .* max_compression"):
        MpmSolver(scene(BLOCK | {"material": {"kind": "water", "bulk_modulus": 1000}}))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        MpmSolver(scene(BLOCK | {"material": {"kind": "water", "max_compression": 0.2}}))


def test_the_command_prints_lines_or_json(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text(scene(obstacles=[{"shape": "box", "lower": [0.5, 0.1], "upper": [0.6, 0.103]}]).to_json())
    result = CliRunner().invoke(cli, ["check", str(file)])
    assert result.exit_code == 0, result.output
    assert "warning: obstacles[0]: is 0.003 m thick" in result.output
    answer = json.loads(CliRunner().invoke(cli, ["check", str(file), "--json"]).stdout)
    assert answer["ok"] is True
    assert answer["findings"][0]["field"] == "obstacles[0]"
    assert CliRunner().invoke(cli, ["check", str(file), "--coarse", "1/16"]).exit_code == 0


def test_the_command_lists_all_faults_of_a_scene_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "scene.json"
    file.write_text('{"dim": 2, "resolution": 4, "frame_dt": 7, "bodies": []}')
    result = CliRunner().invoke(cli, ["check", str(file)])
    assert result.exit_code == 1
    assert "2 faults" in result.output
    assert "resolution: must be in [8, 4096]" in result.output
    answer = json.loads(CliRunner().invoke(cli, ["check", str(file), "--json"]).stdout)
    assert [one["field"] for one in answer["findings"]] == ["resolution", "frame_dt"]
    missing = CliRunner().invoke(cli, ["check", "nothing"])
    assert missing.exit_code == 2
    assert "neither a file nor a scenario" in missing.output


def test_a_simulator_stands_for_its_scene_and_brings_what_its_level_does_not_suit() -> None:
    made = scene(obstacles=[{"shape": "box", "lower": [0.5, 0.1], "upper": [0.6, 0.14]}])
    with pytest.warns(CoarseWarning) as warned:
        coarse = MpmSolver(made, coarse="1/64")
    found = check(coarse)
    told = {one.problem for one in found.findings}
    assert {str(one.message) for one in warned} <= told
    assert found.findings == check(made, coarse).findings
    with pytest.raises(ConfigError, match="a simulator is required"):
        check("water_2d")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("material", "problem"),
    [
        ("oil", "flows along walls like one of about 2 Pa s on this grid"),
        ("honey", None),
        ({"kind": "liquid", "viscosity": 2e3}, "its viscosity is so high that it rebounds"),
        (
            {"kind": "liquid", "viscosity": 8e3, "flow_index": 0.5},
            "its viscosity is so high that it rebounds",
        ),
        (
            {"kind": "liquid", "viscosity": 200, "flow_index": 1.8},
            "its viscosity is so high that it rebounds",
        ),
        ({"kind": "liquid", "viscosity": 1e3, "flow_index": 0.5}, None),
        ({"kind": "liquid", "viscosity": 1e3, "bulk_modulus": 2e6}, None),
        ({"kind": "liquid", "viscosity": 10, "yield_stress": 8e3}, "its yield stress is so high"),
    ],
)
def test_liquids_are_found_where_the_grid_does_not_show_their_law(material: Any, problem: str | None) -> None:
    found = findings(scene(BLOCK | {"material": material}))
    if problem is None:
        assert found == ()
    else:
        assert problem in only(found).problem
        assert only(found).field == "bodies[0]"
