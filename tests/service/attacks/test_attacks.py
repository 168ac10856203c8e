"""Attacks on a server of its own, beside a bystander whose work has to be done.

What it waits for depends on the machine, and is printed beside its waits in a calm time: `pytest -rP`.
"""

import pytest

from hybridmpm import SimulationError
from hybridmpm_lab.service.attacks import ATTACKS, Attack, attacked


@pytest.mark.long
@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_costs_itself_alone(name: str) -> None:
    for measure, value, calm, unit, aim in attacked(ATTACKS[name], 10.0):
        before = "" if calm is None else f", {calm:.4g} in the calm before"
        print(f"{measure}: {value:.4g} {unit}{before}, aim {aim:g}")  # noqa: T201
        if measure == "memory" and value is not None:
            assert value < aim


def test_an_attack_that_is_not_refused_is_reported() -> None:
    attack = Attack(None, (413,), lambda to: to.crowd(1, b"GET /livez HTTP/1.0\r\n\r\n"))
    with pytest.raises(SimulationError, match=r"answers an attack with \{200: "):
        attacked(attack, 0.1)
