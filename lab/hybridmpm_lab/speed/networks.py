"""Time of the networks' steps on the CPU or a GPU by torch, beside the solver on the same machine.

Weights do not change the time, so networks of each size are timed untrained. Positions begin and end a step
in the CPU's memory, where the solver, the search for neighbours and the user's program are.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch

from hybridmpm import MpmSolver, scenarios
from hybridmpm._core import radius_graph
from hybridmpm.errors import ConfigError
from hybridmpm.physics.manifest import default_model
from hybridmpm.physics.spec import HISTORY, RADIUS_SPACINGS, NetworkSpec, Normalization
from hybridmpm.planner.candidates import loaded
from hybridmpm.scene.particle_types import KINEMATIC
from hybridmpm.training.devices import usable
from hybridmpm.training.physics.network.edges import EdgeList
from hybridmpm.training.physics.network.simulator import LearnedSimulator
from hybridmpm_lab.harness.command import Measurement, measured, scenarios_setting, setting
from hybridmpm_lab.harness.provenance import gpu_model
from hybridmpm_lab.harness.rows import Progress, Row
from hybridmpm_lab.harness.timing import QUIET, Calibration, TimedCall, seconds_by_turns

WAYS = ("eager", "captured", "compiled")
"""How torch runs a network: kernel by kernel; as one graph of CUDA; compiled by Inductor and such a graph."""
_RATIOS = ((1.0, 1), (1 / 1.75, 2))
"""r_p and r_t of the paper's networks."""
_RUN_UP = 120  # frames before the measurement: most bodies have hit the floor by then
_FRAMES = 8  # of one timing of the solver


@dataclass(frozen=True, kw_only=True)
class NetworksSettings:
    """Scenes in mid-splash, and the settings of the measurement."""

    scenario: tuple[str, ...] = scenarios_setting(("water_2d", "sand_2d", "water_3d", "sand_3d"))
    device: str = setting("auto", "Device of the networks: cpu, cuda, or the best, auto.", str)
    way: tuple[str, ...] = setting(("eager",), "How torch runs them; all but eager need cuda.", WAYS)
    threads: tuple[int, ...] = setting((1, 2), "Number of threads of the solver.", low=1, high=1024)
    repeats: int = setting(25, "Number of timings of each.", low=1, high=1000)

    @property
    def steps(self) -> int:
        """Number of rows."""
        return len(self.scenario) * ((len(_RATIOS) + 1) * len(self.way) + 2 * len(self.threads))


def measure(settings: NetworksSettings, on_progress: Progress) -> Iterator[Row]:
    """Time the networks and the solver in each scene by turns; yield a row for each.

    The solver runs with all particles at the ground truth's substeps, and in the coarse mode at 1/16. Times
    are of a frame; a network's step takes r_t of them. `search` is the part of the search for neighbours with
    the copy of its edges, `network` that of the network with inputs and edges in place.

    Raises
    ------
    ConfigError
        The device cannot be used, or has no graphs.
    """
    device = usable(settings.device)
    name = gpu_model() if device.type == "cuda" else "cpu"
    calibration = Calibration(max(settings.threads))
    for scenario in settings.scenario:
        before = calibration.slowdown()
        networks = [
            _Network(spec, scenario, device, way) for way in settings.way for spec in _specs(scenario)
        ]
        solvers = [
            (label, threads, _in_splash(scenario, threads, **how))
            for label, how in (
                ("all particles", {"substeps": "reference"}),
                ("coarse 1/16", {"coarse": "1/16"}),
            )
            for threads in settings.threads
        ]
        calls = [TimedCall(call=call) for network in networks for call in network.calls]
        calls += [
            TimedCall(
                prepare=partial(solver.restore, solver.snapshot()), call=partial(solver.advance, _FRAMES)
            )
            for _, _, solver in solvers
        ]
        times = seconds_by_turns(calls, settings.repeats)
        quartiles = [1e3 * float(np.percentile(mine, 25)) for mine in times]
        slowdown = round(max(before, calibration.slowdown()), 2)
        common = {"slowdown": slowdown, "loaded": slowdown >= QUIET}
        for network in networks:
            step, search, alone = (quartiles.pop(0) / network.spec.r_t for _ in network.calls)
            yield {
                "scenario": scenario,
                "method": f"network {network.spec.latent} x {network.spec.layers}",
                "r_p": round(network.spec.r_p, 4),
                "r_t": network.spec.r_t,
                "device": name,
                "way": network.way,
                "particles": network.count,
                "edges": network.edges,
                "ms_per_frame": round(step, 4),
                "search": round(search, 4),
                "network": round(alone, 4),
            } | common
            on_progress(1)
        for (label, threads, solver), took in zip(solvers, quartiles, strict=True):
            yield {
                "scenario": scenario,
                "method": f"MPM, {label}",
                "device": "cpu",
                "threads": threads,
                "particles": len(solver.coarse_positions),
                "ms_per_frame": round(took / _FRAMES, 4),
            } | common
            on_progress(1)


def _specs(scenario: str) -> list[NetworkSpec]:
    """Return the paper's network at all particles and frames and at its ratios, and the one that ships."""
    ships = loaded(default_model(scenario), 1).spec
    papers = []
    for r_p, r_t in _RATIOS:
        spacing = ships.spacing * (ships.r_p / r_p) ** (1 / ships.dim)
        radius = RADIUS_SPACINGS[ships.dim] * spacing
        papers.append(NetworkSpec(scenarios=(scenario,), radius=radius, r_p=r_p, r_t=r_t))
    return [*papers, ships]


def _in_splash(scenario: str, threads: int, **how: Any) -> MpmSolver:
    solver = MpmSolver(scenarios.get(scenario, 7), threads=threads, **how)
    solver.advance(_RUN_UP)
    return solver


class _Network:
    """A network on a device, at positions in mid-splash."""

    def __init__(self, spec: NetworkSpec, scenario: str, device: torch.device, way: str) -> None:
        self.spec, self.way, self._device = spec, way, device
        zeros, ones = (0.0,) * spec.dim, (1e-3,) * spec.dim
        scales = Normalization(
            velocity_mean=zeros,
            velocity_std=ones,
            acceleration_mean=zeros,
            acceleration_std=ones,
            noise_std=0.0,
        )
        torch.manual_seed(0)
        self._simulator = LearnedSimulator(spec, scales).to(device).eval()
        solver = _in_splash(scenario, 1, r_p=spec.r_p, show_all=False)
        states = []
        for _ in range(HISTORY):
            states.append(solver.coarse_positions)
            solver.advance(spec.r_t)
        self._positions = torch.from_numpy(np.array(states))
        self.count = len(states[0])
        walls = [solver.scene.walls.lower, solver.scene.walls.upper]
        self._types = torch.from_numpy(solver.materials.astype(np.int64)).to(device)
        self._gravity = torch.tensor(solver.scene.gravity).expand(self.count, -1).to(device)
        self._walls = torch.tensor(walls, dtype=torch.float32).unsqueeze(1).to(device)
        self._inputs = [one.to(device) for one in (self._positions, *self._search())]
        self.edges = len(self._inputs[1])
        self._run = self._prepared(way)
        self.calls = [partial(self._timed, call) for call in (self._step, self._fill, self._run)]
        """A whole step; the search for neighbours with the copies to the device; the network alone."""

    def _search(self) -> tuple[torch.Tensor, ...]:
        x, kinds = self._positions[-1].numpy(), np.zeros(self.count, np.uint8)
        graph = radius_graph(x, self.spec.radius, kinds, kinematic=KINEMATIC)
        return tuple(torch.from_numpy(one.astype(np.int64)) for one in (graph.senders, graph.receivers))

    def _fill(self) -> None:
        for there, here in zip(self._inputs, (self._positions, *self._search()), strict=True):
            there.copy_(here)

    def _step(self) -> torch.Tensor:
        self._fill()
        return self._run().cpu()

    def _forward(self, history: torch.Tensor, senders: torch.Tensor, receivers: torch.Tensor) -> torch.Tensor:
        graph = EdgeList(senders, receivers, (self.count,))
        # As in training; sums and the integrator stay in float32.
        with torch.autocast(self._device.type, torch.bfloat16, enabled=self._device.type == "cuda"):
            answer = self._simulator.answer(history, self._types, self._walls, graph)
        inputs = (history, self._types, self._gravity, self._walls, graph)
        return self._simulator.integrate(*inputs, answer=answer.float())

    @torch.no_grad()
    def _prepared(self, way: str) -> Callable[[], torch.Tensor]:
        forward = torch.compile(self._forward) if way == "compiled" else self._forward
        if way == "eager":
            return partial(forward, *self._inputs)
        if self._device.type != "cuda":
            raise ConfigError(f"way {way} needs a GPU of CUDA; choose eager on {self._device.type}")
        aside = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        aside.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(aside):
            for _ in range(3):  # what is set up by a first call must not be captured
                forward(*self._inputs)
        torch.cuda.current_stream().wait_stream(aside)
        captured = torch.cuda.CUDAGraph()
        with torch.cuda.graph(captured):
            answer = forward(*self._inputs)

        def replay() -> torch.Tensor:
            captured.replay()
            return answer

        return replay

    @torch.no_grad()
    def _timed(self, call: Callable[[], object]) -> None:
        call()
        if self._device.type == "cuda":
            torch.cuda.synchronize()


networks = Measurement(
    name="networks",
    settings=NetworksSettings,
    measure=measured(measure),
    columns=(
        "scenario", "method", "r_p", "r_t", "device", "way", "threads", "particles", "edges", "ms_per_frame",
        "search", "network", "slowdown", "loaded",
    ),
    summary="""Time the networks' steps on the CPU or a GPU, and the solver on the same machine.

    The networks are the paper's, with all particles and frames and at its ratios, and the one that ships,
    all in torch. They and the solver take turns in mid-splash.
    """,
).command()  # fmt: skip
