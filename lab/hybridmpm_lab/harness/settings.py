"""Settings of a measurement, whose fields are the options of its command."""

import dataclasses
from collections.abc import Callable
from typing import Any

import click

from hybridmpm import scenarios
from hybridmpm_lab.harness.provenance import Provenance, provenance


def setting(
    default: Any, text: str, kind: Any = None, low: float | None = None, high: float | None = None
) -> Any:
    """Return the field of a settings class that is an option of a command, too.

    Parameters
    ----------
    default
        A tuple for an option that may be given several times.
    text : str
        Help of the option.
    kind : click type or sequence of str, optional
        Type of a value, or its choices; None for whole numbers between `low` and `high`.
    """
    if kind is None and low is not None:
        kind = click.IntRange(int(low), None if high is None else int(high))
    elif isinstance(kind, (list, tuple)):
        kind = click.Choice(kind)
    return dataclasses.field(default=default, metadata={"text": text, "kind": kind})


def scenarios_setting(default: tuple[str, ...] = scenarios.NAMES) -> Any:
    """Return the field of the scenarios of the scenes."""
    return setting(default, "Scenario of the scenes.", scenarios.NAMES)


def settings_options(settings: type[Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that gives a command the options of a settings class, as the argument `settings`.

    A field `scenario: tuple[str, ...]` becomes the option `--scenario`, which may be given several times.
    """
    fields = [one for one in dataclasses.fields(settings) if "text" in one.metadata]

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        def called(**values: Any) -> Any:
            given = {one.name: values.pop(one.name) for one in fields}
            return command(settings=settings(**given), **values)

        called.__doc__, called.__name__ = command.__doc__, command.__name__
        called.__click_params__ = getattr(command, "__click_params__", [])  # type: ignore[attr-defined]
        result: Callable[..., Any] = called
        for one in reversed(fields):
            several = isinstance(one.default, tuple)
            result = click.option(
                _option(one.name),
                one.name,
                type=one.metadata["kind"],
                is_flag=isinstance(one.default, bool),
                multiple=several,
                default=one.default,
                show_default=one.default not in ((), None),
                help=one.metadata["text"] + (" May be given several times." if several else ""),
            )(result)
        return result

    return decorate


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def origin_of(command: str, settings: Any) -> Provenance:
    """Return the origin of a measurement by a command with its options that are not the default."""
    words = ["python -m hybridmpm_lab", command]
    for one in dataclasses.fields(settings):
        value = getattr(settings, one.name)
        if "text" in one.metadata and value != one.default:
            several = value if isinstance(one.default, tuple) else (value,)
            words += [
                _option(one.name) if given is True else f"{_option(one.name)} {given}" for given in several
            ]
    return provenance(" ".join(words))
