"""The transport distance against closed forms."""

import sys

import numpy as np
import pytest

from hybridmpm import ConfigError, metrics

pytestmark = pytest.mark.needs("ot", "metrics")


@pytest.mark.parametrize("dim", [2, 3])
def test_a_shift_is_as_long_as_it_is(dim: int) -> None:
    x = np.random.default_rng(2).uniform(0.2, 0.5, (1000, dim))
    shift = np.array([0.3, -0.1, 0.2])[:dim]
    mass = np.ones(1000)
    assert metrics.transport_distance(x + shift, mass, x, mass) == pytest.approx(
        np.linalg.norm(shift), rel=1e-6
    )
    assert metrics.transport_distance(x, mass, x, mass) == pytest.approx(0, abs=1e-9)


def test_the_cheaper_of_two_assignments_counts_whatever_the_order() -> None:
    one, two = np.array([[0.1, 0.5], [0.9, 0.5]]), np.array([[0.8, 0.5], [0.3, 0.5]])
    expected = np.sqrt((0.2**2 + 0.1**2) / 2)
    assert metrics.transport_distance(one, [1.0, 1.0], two, [2.0, 2.0]) == pytest.approx(expected)


def test_masses_are_split_where_they_must_be() -> None:
    # Three quarters of the mass stay, one quarter goes 0.4 m.
    one, two = np.array([[0.1, 0.5]]), np.array([[0.1, 0.5], [0.5, 0.5]])
    assert metrics.transport_distance(one, [4.0], two, [3.0, 1.0]) == pytest.approx(0.2)


def test_stretching_along_a_line_is_by_the_sorted_order() -> None:
    x = np.column_stack([np.linspace(0.3, 0.5, 900), np.full(900, 0.5)])
    wide = np.column_stack([np.linspace(0.2, 0.6, 900), np.full(900, 0.5)])
    expected = np.sqrt(np.mean((x - wide) ** 2 @ [1, 1]))
    assert metrics.transport_distance(x, np.ones(900), wide, np.ones(900)) == pytest.approx(
        expected, rel=0.01
    )


def test_what_cannot_be_compared_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    x, mass = np.full((4, 2), 0.5), np.ones(4)
    with pytest.raises(ConfigError, match=r"predicted must be one state \(N, D\), got shape \(1, 4, 2\)"):
        metrics.transport_distance(x[None], mass, x, mass)
    with pytest.raises(ConfigError, match="as many axes, got 2 and 3"):
        metrics.transport_distance(x, mass, np.full((4, 3), 0.5), mass)
    with pytest.raises(ConfigError, match=r"clusters must be in \[1, 2000\], got 0"):
        metrics.transport_distance(x, mass, x, mass, clusters=0)
    monkeypatch.setitem(sys.modules, "ot", None)
    with pytest.raises(ConfigError, match=r"needs POT: pip install 'hybridmpm\[metrics\]'"):
        metrics.transport_distance(x, mass, x, mass)
