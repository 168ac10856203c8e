"""What the checks judge, and what the command prints and writes."""

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from hybridmpm import DataError
from hybridmpm_lab import validation
from hybridmpm_lab.commands import cli
from hybridmpm_lab.validation import case, column_collapse, dam_break, page
from hybridmpm_lab.validation.case import Check

PAGE = Path(__file__).parents[2] / "docs" / "results" / "validation" / "README.md"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["validate", *map(str, arguments)], prog_name="hybridmpm")


@pytest.mark.parametrize(
    ("check", "verdict"),
    [
        (Check.at_most("error", -0.1, 0.1), "pass"),
        (Check.at_most("error", -0.11, 0.1), "FAIL"),
        (Check.at_most("error", float("nan"), 0.1), "FAIL"),
        (Check.between("band", 2.0, (1.0, 3.0)), "pass"),
        (Check.between("band", 0.9, (1.0, 3.0)), "FAIL"),
        (Check.between("control", 2.0, (1.0, 3.0), control=True), "FAIL"),
        (Check.between("control", 3.1, (1.0, 3.0), control=True), "pass"),
        (Check.between("control", float("nan"), (1.0, 3.0), control=True), "FAIL"),
        (Check.reported("figure", 7.0), "reported"),
    ],
)
def test_verdicts(check: Check, verdict: str) -> None:
    assert check.verdict == verdict


def test_data_are_in_order() -> None:
    fronts = (
        dam_break.FRONT,
        dam_break.FRONT_FIGURE,
        dam_break.FRONT_COMPUTED,
        dam_break.FRONT_KOSHIZUKA_OKA,
    )
    for table in (*fronts, dam_break.HEIGHT):
        assert (table[1:, 0] > table[:-1, 0]).all()
    assert (dam_break.HEIGHT[1:, 1] < dam_break.HEIGHT[:-1, 1]).all()


def test_fits_to_experiments_with_grains() -> None:
    assert column_collapse.runout("sand", 2.0) == pytest.approx(2.4)
    assert column_collapse.runout("beads", 2.0) == pytest.approx(3.6)
    assert column_collapse.height_band(2.0) == pytest.approx((0.83, 1.72), abs=0.01)
    # With alpha = sqrt(2/3) 2 sin(phi) / (3 - sin(phi)), 45 degrees are 45.4 in plane strain.
    assert column_collapse.angle_for_sand(45.4) == pytest.approx(45.0, abs=0.1)
    assert column_collapse.angle_for_sand(27.5) == pytest.approx(30.0, abs=0.1)
    assert column_collapse.plane_strain_angle(30.0) == pytest.approx(35.26, abs=0.01)


def test_the_page_has_the_same_bytes_on_every_run(tmp_path: Path) -> None:
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        shutil.copy(PAGE, tmp_path / folder)
        result = run("free_fall", "--out", tmp_path / folder)
        assert result.exit_code == 0, result.output
        assert result.stdout.count("pass") == 6
    written = sorted(file.name for file in (tmp_path / "one").iterdir())
    assert written == ["README.md", "free_fall.svg"]
    for name in written:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_figures_of_the_page_are_renewed() -> None:
    text = "2 of 2 judged figures pass.\n\n![Fall](fall.svg)\n\n| old |\n\n## Other\n\n| a | pass |\n"
    checks = Check.at_most("distance", 2.0, 1.0), Check.at_most("time", 0.5, 1.0)
    new = page.renewed(text, "fall", checks)
    assert new.startswith("2 of 3 judged figures pass.\n\n![Fall](fall.svg)\n\n| figure |")
    assert "| distance | 2 | 0 | <= 1 | FAIL |\n" in new
    assert new.endswith("| time | 0.5 | 0 | <= 1 | pass |\n\n## Other\n\n| a | pass |\n")
    with pytest.raises(DataError, match="no section with the chart absent"):
        page.renewed(text, "absent", checks)


def test_a_failed_figure_shows_and_gives_exit_status_1(monkeypatch: pytest.MonkeyPatch) -> None:
    result = case.Result((Check.at_most("distance", 2.0, 1.0),), ())
    monkeypatch.setitem(validation.CASES, "free_fall", lambda: result)
    called = run("free_fall")
    assert called.exit_code == 1
    assert "FAIL" in called.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("no_case",), "'no_case' is not one of 'dam_break'"),
        (("free_fall", "--out", "absent"), "Directory 'absent' does not exist"),
    ],
)
def test_wrong_arguments_give_one_line(arguments: tuple[str, ...], message: str) -> None:
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in result.stderr


def test_the_committed_page_covers_all_cases() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in validation.CASES:
        assert text.count(f"]({name}.svg)\n\n| figure | measured |") == 1
        assert (PAGE.parent / f"{name}.svg").exists()
