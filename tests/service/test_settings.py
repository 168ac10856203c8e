"""Settings come from the environment and flags, and name what is wrong with them."""

from pathlib import Path

import pytest

from hybridmpm import ConfigError
from hybridmpm_service import Settings


def test_flags_win_over_the_environment_and_this_over_defaults() -> None:
    environment = {"HYBRIDMPM_PORT": "9000", "HYBRIDMPM_MAX_SESSIONS": "3", "PORT": "1"}
    settings = Settings.load(environment, port=9001, host=None)
    assert (settings.port, settings.max_sessions, settings.host) == (9001, 3, "127.0.0.1")


def test_lists_are_separated_by_commas() -> None:
    settings = Settings.load({"HYBRIDMPM_CORS_ORIGINS": "https://a.example, https://b.example"})
    assert settings.cors_origins == ("https://a.example", "https://b.example")


@pytest.mark.parametrize(
    ("environment", "flags", "message"),
    [
        ({"HYBRIDMPM_PORT": "70000"}, {}, "HYBRIDMPM_PORT.*less than or equal to 65535.*70000"),
        ({"HYBRIDMPM_MAX_SESSIONS": "many"}, {}, "HYBRIDMPM_MAX_SESSIONS"),
        ({}, {"port": -1}, "--port.*greater than or equal to 0"),
        ({}, {"idle_seconds": float("nan")}, "--idle-seconds"),
        ({}, {"colour": "red"}, "--colour"),
    ],
)
def test_bad_settings_are_refused_by_name_and_range(
    environment: dict[str, str], flags: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        Settings.load(environment, **flags)


@pytest.mark.parametrize(
    ("host", "loopback"),
    [("127.0.0.1", True), ("localhost", True), ("::1", True), ("0.0.0.0", False), ("example.org", False)],  # noqa: S104
)
def test_only_loopback_restricts_host_names_by_itself(*, host: str, loopback: bool) -> None:
    assert Settings(host=host).is_loopback is loopback
    assert (Settings(host=host).hosts is not None) is loopback
    assert Settings(host=host, allowed_hosts=("a.example",)).hosts == ("a.example",)


def test_the_document_tells_every_setting_with_its_default() -> None:
    text = (Path(__file__).parents[2] / "docs" / "reference" / "http-api.md").read_text(encoding="utf-8")
    section = text.partition("## Settings")[2]
    rows = [line for line in section.splitlines() if line.startswith("|")]
    for name, field in Settings.model_fields.items():
        (row,) = [line for line in rows if f"`{name}`" in line]
        if isinstance(field.default, int) and not name.endswith("_bytes"):
            assert str(field.default) in row
