"""The errors of all entrants on one scene, and of the bounds beside them."""

import warnings
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from hybridmpm import metrics, scenarios
from hybridmpm.coarse import CoarseSimulator
from hybridmpm.errors import SimulationError
from hybridmpm.hybrid import HybridSimulator
from hybridmpm.physics.simulator import NeuralPhysics
from hybridmpm.planner.candidates import Candidate
from hybridmpm.recording import Recording, record
from hybridmpm.scene import Scene
from hybridmpm_lab.compare.accuracy.conventions import EVERY, LADDER
from hybridmpm_lab.compare.accuracy.rollouts import Truth, excerpt, frozen
from hybridmpm_lab.compare.tradeoff.entrants import entrants
from hybridmpm_lab.compare.tradeoff.measures import after, errors
from hybridmpm_lab.compare.tradeoff.peers import can_simulate, peer_states
from hybridmpm_lab.compare.tradeoff.settings import TradeoffSettings, warm_up
from hybridmpm_lab.harness.provenance import Provenance
from hybridmpm_lab.harness.rows import Progress, Row, significant
from hybridmpm_lab.harness.store import RowStore

PART = "errors"
"""First field of the keys of these rows; scenario, seed and name follow."""
JITTER, STILL, MERGED, PEER = "jitter", "still", "merged", "peer"

Named = list[tuple[str, Row]]


def names(scenario: str, settings: TradeoffSettings) -> list[str]:
    """Return the names of the rows of a scene: entrants, bounds and peers."""
    bounds = [JITTER, STILL, *(f"{MERGED} {label}" for label, r_p in LADDER.items() if r_p < 1)]
    plain = can_simulate(scenarios.get(scenario, settings.seeds[0]))
    peers = [f"{PEER} {one}" for one in settings.peers if plain]
    return [*entrants(scenario, settings.patterns), *bounds, *peers]


def measure_errors(
    settings: TradeoffSettings, runs: RowStore, origin: Provenance, on_progress: Progress, jobs: int = 1
) -> None:
    """Run what is missing, scene by scene, and add its rows; `on_progress` counts scenes.

    Parameters
    ----------
    settings : TradeoffSettings
    runs : RowStore
        Rows so far, by ("errors", scenario, seed, name); the new ones are added as each scene is done.
    origin : Provenance
    on_progress : callable
    jobs : int
        Processes that each take one scene at a time; errors do not depend on them.
    """
    missing: list[tuple[str, int, list[str]]] = []
    for scenario in settings.scenarios:
        wanted = names(scenario, settings)
        for seed in settings.seeds:
            mine = [name for name in wanted if (PART, scenario, seed, name) not in runs]
            if mine:
                missing.append((scenario, seed, mine))
            else:
                on_progress(1)
    for scenario, seed, rows in _all_scenes(missing, settings, jobs):
        for name, row in rows:
            runs.add((PART, scenario, seed, name), origin.stamped(row))
        on_progress(1)


def _all_scenes(
    missing: Sequence[tuple[str, int, list[str]]], settings: TradeoffSettings, jobs: int
) -> Iterator[tuple[str, int, Named]]:
    if jobs == 1:
        for scenario, seed, wanted in missing:
            yield scenario, seed, scene_errors(scenario, seed, wanted, settings)
        return
    # A fresh interpreter each: threads of onnxruntime do not survive a fork.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    with pool:
        waiting = {
            pool.submit(scene_errors, scenario, seed, wanted, settings): (scenario, seed)
            for scenario, seed, wanted in missing
        }
        try:
            for one in as_completed(waiting):
                yield *waiting[one], one.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def scene_errors(scenario: str, seed: int, wanted: Iterable[str], settings: TradeoffSettings) -> Named:
    """Return the rows of one scene: errors counted over `span` frames.

    They count from the first impact on, or from the end of the longest warm-up of the scenario's networks
    where that is later, so that all methods answer for the same frames.
    """
    truth = Truth.of(scenarios.get(scenario, seed), latest_warm_up=warm_up(scenario), span=settings.span)
    start = truth.start(warm_up(scenario))
    true = excerpt(truth.states, start, settings.span)
    found = []
    for name in wanted:
        kind, _, label = name.partition(" ")
        if kind in (JITTER, STILL, MERGED):
            row = _compared(_bound(kind, label, truth, start, settings.span), true)
        elif kind == PEER:
            row = _compared(peer_states(label, truth.states, start, settings.span), true)
        else:
            row = _run(entrants(scenario)[name], truth.states.scene, start, true, settings)
        found.append((name, {"impact": truth.impact, "start": start} | row))
    return found


def _bound(kind: str, label: str, truth: Truth, start: int, span: int) -> Recording | None:
    if kind == MERGED:
        return metrics.merged_states(excerpt(truth.states, start, span), LADDER[label])
    run = frozen(truth.states, 0) if kind == STILL else truth.with_other_jitter()
    return None if run is None else excerpt(run, start, span)


def _run(entrant: Candidate, scene: Scene, start: int, true: Recording, settings: TradeoffSettings) -> Row:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            simulator = entrant.make(scene, settings.threads)
            simulator.advance(start)
            before = _by_network(simulator)
            run: Recording | None = after(record(simulator, settings.span, every=EVERY), start)
        except SimulationError:
            return {"failed": True, "warned": bool(told)}
    share = 1 - (_by_network(simulator) - before) / settings.span
    return _compared(run, true) | {
        "warned": bool(told),
        "particles": len(simulator.coarse_positions),
        "mpm_share": significant(share),
    }


def _by_network(simulator: CoarseSimulator) -> int:
    """Return the number of frames so far that MPM did not simulate."""
    if isinstance(simulator, HybridSimulator):
        counts = simulator.step_counts
        return counts.network + counts.free_fall + counts.rest
    if isinstance(simulator, NeuralPhysics):
        return sum(max(0, simulator.frame - decision.frame) for decision in simulator.log)
    return 0


def _compared(run: Recording | None, true: Recording) -> Row:
    if run is None:
        return {"failed": True}
    return {"failed": False} | {name: significant(value, 6) for name, value in errors(run, true).items()}
