"""How tests are dealt out to processes, and networks that need no training for whatever serves networks."""

import dataclasses
import hashlib
import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from xdist.scheduler import LoadScopeScheduling

from hybridmpm import SOLVER_VERSION
from hybridmpm._support.machine import usable_cores

if TYPE_CHECKING:
    from hybridmpm.physics import NetworkSpec

FALLING = "falling"
"""Free fall between walls: what a network answers that predicts no acceleration but the known one."""
BROKEN = "broken"
"""A network that answers NaN."""

TOGETHER = {
    "one browser": ("tests/browser/",),
    "signals, players and streams": ("tests/service/", "tests/python/cli/test_cli.py", "tests/python/data/"),
    "exported networks": (
        "tests/python/physics/",
        "tests/python/training/",
        "tests/python/cli/test_train_command.py",
    ),
}
"""Tests that run in one process, one after the other: they share what is expensive, or they wait for time."""
LONGEST = (*TOGETHER.values(), ("tests/lab/test_validation.py",))
"""Tests that are dealt out first, so that no process is left with one of them when the others are done."""
MAX_PROCESSES = 8
"""More would wait for the longest of `TOGETHER`, and each takes up to 1 GB."""

# Processes share the cores; tests that need more threads ask for them.
os.environ.setdefault("OMP_NUM_THREADS", "1")
# POT imports torch where it is installed, and needs it nowhere here: two seconds for each process.
os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")


def pytest_xdist_auto_num_workers() -> int:
    """Return how many processes `pytest -n auto` starts: none where there is one core.

    Otherwise one more than cores, because the process that drives the browser waits for most of its time.
    """
    cores = usable_cores()
    return min(cores + 1, MAX_PROCESSES) if cores > 1 else 0


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the groups of `LONGEST` first, in their order; the others keep theirs."""

    def rank(item: pytest.Item) -> int:
        ranks = (rank for rank, places in enumerate(LONGEST) if item.nodeid.startswith(places))
        return next(ranks, len(LONGEST))

    items.sort(key=rank)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what needs a module that is missing.

    Looking for a module takes no time. Importing it where tests are collected would take seconds in every
    process, though few of them run a test that needs it.
    """
    for mark in item.iter_markers("needs"):
        module, extra = mark.args
        if importlib.util.find_spec(module) is None:
            pytest.skip(f"needs {module}: pip install 'hybridmpm[{extra}]'")


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """Return what deals out whole files, in order of collection."""
    return _ByFile(config, log)


class _ByFile(LoadScopeScheduling):
    """Keeps a file in one process, so that what its tests share is made once, and `TOGETHER` likewise."""

    def _split_scope(self, nodeid: str) -> str:
        groups = (name for name, places in TOGETHER.items() if nodeid.startswith(places))
        return next(groups, nodeid.partition("::")[0])


@pytest.fixture(scope="session")
def model_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of models for water_2d, with r_p = 1/4 and r_t = 4: `FALLING` and `BROKEN`."""
    from hybridmpm._support.networks import NetworkFolder
    from hybridmpm.physics import NetworkSpec
    from hybridmpm.physics.manifest import Entry

    spec = NetworkSpec(
        scenarios=("water_2d",), latent=1, layers=1, hidden_layers=1, radius=0.03, r_p=1 / 4, r_t=4
    )
    folder = tmp_path_factory.mktemp("models")
    (folder / "manifest.json").write_text("{}", encoding="utf-8")
    for name, factor in ((FALLING, 1.0), (BROKEN, float("nan"))):
        data = _model(spec, factor)
        (folder / f"{name}.onnx").write_bytes(data)
        entry = Entry(
            file=f"{name}.onnx",
            sha256=hashlib.sha256(data).hexdigest(),
            scenarios=spec.scenarios,
            r_p=spec.r_p,
            r_t=spec.r_t,
            latent=spec.latent,
            layers=spec.layers,
            radius=spec.radius,
            parameters=0,
            solver_versions=(SOLVER_VERSION,),
        )
        NetworkFolder(folder).write_entry(name, dataclasses.asdict(entry))
    return folder


def _model(spec: "NetworkSpec", factor: float) -> bytes:
    """Return an ONNX file with the inputs and outputs of a network: free fall times a factor.

    Its accelerations have so small a deviation that rounding is a disturbance, and it is run in every step.
    Written out rather than exported, because torch takes many seconds for the same.
    """
    import onnx

    from hybridmpm._support.networks import OPSET
    from hybridmpm.physics import Normalization
    from hybridmpm.physics.model_info import ModelInfo

    text = f"""
        <ir_version: 10, opset_import: ["" : {OPSET}]>
        fall (float[6, n, d] history, int64[n] types, float[n, d] acceleration, float[2, d] walls,
              int32[e] senders, int32[e] receivers, int32[n, k] arrivals, bool[n, k] mask,
              float[n] share)
            => (float[n, d] positions)
        <int64 now = {{5}}, int64 before = {{4}},
         int64 low = {{0}}, int64 high = {{1}},
         float square = {{{spec.step_dt**2:.9g}}}, float two = {{2}}, float factor = {{{factor}}}>
        {{
            x = Gather(history, now)
            y = Gather(history, before)
            fallen = Mul(acceleration, square)
            twice = Mul(two, x)
            kept = Sub(twice, y)
            free = Add(kept, fallen)
            lower = Gather(walls, low)
            upper = Gather(walls, high)
            above = Max(free, lower)
            inside = Min(above, upper)
            positions = Mul(inside, factor)
        }}
    """
    model = onnx.parser.parse_model(text)
    ones, tiny = (1.0,) * spec.dim, (1e-9,) * spec.dim
    scales = Normalization(
        velocity_mean=ones, velocity_std=ones, acceleration_mean=ones, acceleration_std=tiny, noise_std=0.0
    )
    info = ModelInfo(spec=spec, scales=scales, parameters=0, training={})
    onnx.helper.set_model_props(model, info.to_properties())
    onnx.checker.check_model(model)
    data: bytes = model.SerializeToString()
    return data
