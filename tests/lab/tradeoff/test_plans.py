"""The errors that plans assume, taken from the rows of the trade-off."""

from hybridmpm.planner import store
from hybridmpm.planner.calibration import MEASURES, Calibration
from hybridmpm_lab.compare.plan_errors import calibration_of


def test_a_calibration_of_rows() -> None:
    fields = dict.fromkeys(MEASURES.values(), 0.5) | {f"{field}_se": 0.1 for field in MEASURES.values()}
    head = {"scenario": "water_2d", "scenes": 3, "commit": "abc"}
    rows = [
        head | fields | {"method": "mpm", "label": "1/8"},
        head | fields | {"method": "jitter", "label": None, "error_se": None},
        head | fields | {"method": "mpm", "label": "truth"},
        head | fields | {"method": "hybrid", "label": "fluids_2d r_c 0.8"},
        head | fields | {"method": "coarse", "label": "1/8", "error": None},
    ]
    made = calibration_of(rows, store.shipped().times)
    # Plans take neither the truth itself, nor what nobody would choose, nor what failed.
    assert [one.name for one in made.errors] == ["mpm 1/8", "jitter"]
    assert made.errors[0].means["grid_rmse"] == 0.5
    assert "grid_rmse" not in made.errors[1].standard_errors
    assert Calibration.model_validate_json(made.model_dump_json()) == made
