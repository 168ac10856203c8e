"""The one table from exceptions to HTTP."""

import pytest

import hybridmpm.errors
from hybridmpm import ConfigError, NonFiniteError, SceneError, SimulationError, UnknownScenarioError
from hybridmpm_service import errors
from hybridmpm_service.http.problems import TABLE, field_path, row_of


def test_a_class_without_a_row_has_that_of_its_nearest_parent() -> None:
    assert row_of(NonFiniteError("x")) is TABLE[SimulationError]
    assert row_of(ConfigError("x")) is TABLE[SimulationError]
    assert row_of(UnknownScenarioError("x")) is TABLE[SceneError]


def test_an_unexpected_exception_is_a_500() -> None:
    assert row_of(KeyError("x")).status == 500


@pytest.mark.parametrize("name", hybridmpm.errors.__all__)
def test_no_error_of_the_library_is_a_500(name: str) -> None:
    assert row_of(getattr(hybridmpm.errors, name)("x")).status < 500


def test_no_error_of_the_service_is_a_500() -> None:
    kinds = [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and kind.__module__ == errors.__name__
    ]
    assert len(kinds) >= 9
    for kind in kinds:
        assert row_of(kind("x", "y") if kind is errors.FieldError else kind("x")).status != 500


def test_every_row_has_its_own_type() -> None:
    slugs = [row.slug for row in TABLE.values()]
    assert len(set(slugs)) == len(slugs)


def test_field_paths_read_like_code() -> None:
    assert field_path(("body", "strokes", 0, "points", 12, 1)) == "body.strokes[0].points[12][1]"
