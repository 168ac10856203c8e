"""Samplers of few steps, held against distributions whose clean sample is known exactly."""

import numpy as np
import pytest

from hybridmpm.control.diffusion.samplers import SOLVERS, Solver, ddim_step, dpm_step, sampled
from hybridmpm.control.diffusion.schedule import cosine_schedule, few_times
from hybridmpm.errors import ConfigError

SPREAD = 0.3
NOISE = np.random.default_rng(0).standard_normal((50, 2), dtype=np.float32)


def of_a_normal_distribution(x_t: np.ndarray, time: int) -> np.ndarray:
    """Return the mean of x_0 given x_t, where x_0 is normal with the standard deviation SPREAD."""
    kept = cosine_schedule()[time]
    return np.asarray(np.sqrt(kept) * SPREAD**2 / (kept * SPREAD**2 + 1 - kept) * x_t)


def error_of(solver: Solver, steps: int) -> float:
    """Return the relative error of the deterministic flow, which only scales noise to the right spread."""
    found = sampled(of_a_normal_distribution, NOISE, steps=steps, solver=solver)
    return float(np.linalg.norm(found - SPREAD * NOISE) / np.linalg.norm(SPREAD * NOISE))


def test_the_schedule_goes_from_the_sample_to_noise() -> None:
    kept = cosine_schedule()
    assert kept.shape == (1001,)
    assert kept[0] == 1
    assert (np.diff(kept) < 0).all()
    assert kept[1000] < 1e-5
    # Eq. (17) at half of the time: cos^2(0.5 * (0.5 + s) / (1 + s) * pi) / cos^2(0.5 * s / (1 + s) * pi).
    expected = np.cos(0.508 / 1.008 * np.pi / 2) ** 2 / np.cos(0.008 / 1.008 * np.pi / 2) ** 2
    assert kept[500] == pytest.approx(expected, rel=1e-9)


def test_times_go_evenly_from_the_last_to_the_first() -> None:
    assert few_times(4).tolist() == [1000, 750, 500, 250, 0]
    assert few_times(1).tolist() == [1000, 0]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("steps", [1, 2, 7, 20])
def test_a_known_sample_is_found_in_any_number_of_steps(solver: Solver, steps: int) -> None:
    known = np.linspace(-1, 1, 100, dtype=np.float32).reshape(50, 2)
    found = sampled(lambda _x, _time: known, NOISE, steps=steps, solver=solver)
    assert found == pytest.approx(known, abs=1e-6)


def test_errors_fall_with_the_order_of_the_solver() -> None:
    first = [error_of("ddim", steps) for steps in (5, 10, 20)]
    second = [error_of("dpm", steps) for steps in (5, 10, 20)]
    assert first[0] / first[2] == pytest.approx(4, rel=0.35)
    assert second[0] / second[2] > 1.5 * first[0] / first[2]
    assert second[2] < 0.5 * first[2]


def test_one_step_is_the_answer_to_the_noise() -> None:
    expected = of_a_normal_distribution(NOISE, 1000)
    for solver in SOLVERS:
        assert sampled(of_a_normal_distribution, NOISE, steps=1, solver=solver) == pytest.approx(expected)


def test_the_second_order_step_begins_as_the_first_order_one() -> None:
    x_0 = of_a_normal_distribution(NOISE, 800)
    one = ddim_step(NOISE, x_0, alpha_bar=0.1, alpha_bar_prev=0.4)
    other = dpm_step(NOISE, x_0, None, alpha_bar=0.1, alpha_bar_prev=0.4, alpha_bar_before=None)
    assert np.array_equal(one, other)
    steady = dpm_step(NOISE, x_0, x_0, alpha_bar=0.1, alpha_bar_prev=0.4, alpha_bar_before=0.02)
    assert steady == pytest.approx(one, abs=1e-6)


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"steps must be .*\[1, 20\].*21"):
        sampled(of_a_normal_distribution, NOISE, steps=21)
    with pytest.raises(ConfigError, match="solver must be ddim or dpm, got 'euler'"):
        sampled(of_a_normal_distribution, NOISE, steps=4, solver="euler")  # type: ignore[arg-type]
