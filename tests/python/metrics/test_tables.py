"""Means, standard errors and paired differences by hand."""

import pytest

from hybridmpm import ConfigError, metrics


def filled() -> metrics.ErrorTable:
    table = metrics.ErrorTable()
    for seed, (good, bad) in enumerate([(1.0, 2.0), (3.0, 5.0), (5.0, 8.0)]):
        table.add("good", f"scene {seed}", {"error": good, "other": 10 * good})
        table.add("bad", f"scene {seed}", {"error": bad})
    table.add("bad", "scene 9", {"error": 9.0})
    return table


def test_mean_and_standard_error() -> None:
    # 1, 3, 5: standard deviation 2, over sqrt(3)
    estimate = filled().estimate("good", "error")
    assert (estimate.mean, estimate.count) == (3.0, 3)
    assert estimate.standard_error == pytest.approx(2 / 3**0.5)
    assert str(estimate) == "3 ± 1.2"


def test_one_sample_has_no_standard_error() -> None:
    assert metrics.Estimate.of([4.0]).standard_error is None
    assert str(metrics.Estimate.of([4.0])) == "4"


def test_differences_are_paired_by_scene() -> None:
    # 1, 2, 3 in the scenes shared: the standard error is 1 / sqrt(3), smaller than that of either alone.
    difference = filled().difference("bad", "good", "error")
    assert (difference.mean, difference.count) == (2.0, 3)
    assert difference.standard_error == pytest.approx(1 / 3**0.5)


def test_rows_are_flat() -> None:
    good, bad = filled().rows(reference="good")
    assert good["method"] == "good"
    assert (good["error"], good["error_n"], good["error_difference"]) == (3.0, 3, None)
    assert good["other"] == 30.0
    assert (bad["error"], bad["error_n"], bad["error_difference"]) == (6.0, 4, 2.0)
    assert bad["error_difference_se"] == pytest.approx(1 / 3**0.5)
    assert "error_difference" not in filled().rows()[0]


def test_text() -> None:
    lines = filled().text().splitlines()
    assert [line.split("  ")[0].strip() or line.split()[0] for line in lines] == ["method", "good", "bad"]
    assert lines[1].split() == ["good", "3", "±", "1.2", "30", "±", "12"]
    assert lines[2].split()[-1] == "-"
    assert len({len(line) for line in lines}) == 1


def test_refusals() -> None:
    table = filled()
    with pytest.raises(ConfigError, match="already"):
        table.add("good", "scene 0", {"error": 1.0})
    with pytest.raises(ConfigError, match="must be finite"):
        table.add("good", "scene 7", {"error": float("nan")})
    with pytest.raises(ConfigError, match="no other of bad"):
        table.estimate("bad", "other")
    table.add("third", "elsewhere", {"error": 1.0})
    with pytest.raises(ConfigError, match="share no scene"):
        table.difference("third", "good", "error")
    with pytest.raises(ConfigError, match="one or more finite numbers"):
        metrics.Estimate.of([])
