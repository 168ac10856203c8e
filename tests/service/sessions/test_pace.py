"""The player keeps to media time, on a clock that the test turns."""

import pytest

from hybridmpm_service.sessions.pace import MAX_LAG_SECONDS, Pace


def _pace(speed: float = 1.0) -> Pace:
    pace = Pace(0.0025, speed)
    pace.start(100.0)
    return pace


@pytest.mark.parametrize(("speed", "frames"), [(1.0, 400), (0.25, 100), (0.01, 4)])
def test_a_second_of_looking_often_gives_the_frames_of_a_second(speed: float, frames: int) -> None:
    pace, computed = _pace(speed), 0
    for tick in range(1, 61):
        due = pace.due(100.0 + tick / 60)
        pace.count(due)
        computed += due
    assert computed == frames


def test_who_is_late_forgets_the_rest() -> None:
    pace = _pace()
    assert pace.due(160.0) == int(MAX_LAG_SECONDS * 400)
    pace.count(pace.due(160.0))
    assert pace.due(160.0) == 0


def test_even_a_very_slow_player_is_never_owed_less_than_a_frame() -> None:
    pace = Pace(10.0, 0.01)
    pace.start(0.0)
    assert pace.due(5000.0) == 1


def test_the_wait_ends_when_the_next_frame_is_due() -> None:
    pace = _pace(0.01)
    wait = pace.wait(100.0)
    assert wait == pytest.approx(0.25)
    assert pace.due(100.0 + wait - 1e-3) == 0
    assert pace.due(100.0 + wait) == 1


def test_a_new_speed_begins_without_a_jump() -> None:
    pace = _pace(0.25)
    pace.count(pace.due(100.05))
    pace.set_speed(1.0, 100.05)
    assert pace.due(100.05) == 0
    assert pace.due(100.06) == 4
