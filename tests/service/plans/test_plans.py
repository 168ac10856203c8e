"""Plans over HTTP: the plans of the library, and sessions with their methods."""

from typing import Any

import pytest
from tests.service.conftest import SMALL_SCENE

from hybridmpm import plan, scenarios
from hybridmpm.client import Client


@pytest.fixture(autouse=True)
def _no_times_of_the_user(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDMPM_CALIBRATION", "none.json")


def test_a_plan_is_that_of_the_library_and_a_session_can_use_it(service: Any) -> None:
    with Client(str(service.http.base_url)) as client:
        found = client.plan("water_2d", 7, max_error=0.5)
        expected = plan(scenarios.water_2d(7), max_error=0.5)
        assert {name: found[name] for name in ("name", "error", "ms_per_frame", "reason")} == {
            "name": expected.name,
            "error": expected.error,
            "ms_per_frame": expected.ms_per_frame,
            "reason": expected.reason,
        }
        assert found["feasible"]
        answers = [client.plan("water_2d", 7, budget_ms=ms) for ms in (0.05, 0.1, 0.2, 0.5, 1.0, 5.0)]
        for one in (one for one in answers if one["session"] is not None):
            session = client.create("water_2d", 7, **one["session"])
            assert session.info["r_p"] == pytest.approx(one["r_p"])
            assert session.info["coarse"] is None or session.info["coarse"] in one["name"]
            session.delete()
        assert any(one["session"] and "coarse" in one["session"] for one in answers)
        # No session has a part of the particles alone.
        assert client.plan(scene=scenarios.water_2d(7), budget_ms=1e-6)["session"] is None


def test_a_plan_for_a_scene_of_ones_own_has_fields_of_a_session(service: Any) -> None:
    answer = service.http.post("/v1/plans", json={"scene": SMALL_SCENE, "budget_ms": 100})
    assert answer.json()["session"] == {"solver": "mpm"}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ({"scenario": "water_2d"}, "max_error"),
        ({"scenario": "water_2d", "max_error": 0.1, "budget_ms": 1.0}, "max_error"),
        ({"budget_ms": 1.0}, "scenario"),
        ({"scenario": "water_2d", "max_error": 0.1, "measure": "beauty"}, "grid_rmse"),
        ({"scenario": "water_9d", "budget_ms": 1.0}, "water_2d"),
        ({"scene": {"dim": 4}, "budget_ms": 1.0}, "dim"),
    ],
)
def test_an_invalid_demand_is_refused(service: Any, body: dict[str, Any], said: str) -> None:
    answer = service.http.post("/v1/plans", json=body)
    assert answer.status_code == 422
    assert said in answer.text
