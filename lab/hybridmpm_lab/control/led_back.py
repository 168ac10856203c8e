"""Prints how near networks lead a fluid to where it was: tables of docs/results/control-studies.md.

`python -m hybridmpm_lab.control.led_back FILE --network NAME.onnx` takes 50 reversed cases in 3D of each
scenario and kind of sketch, from the validation seed 1000600 on, or those that `--seeds FIRST COUNT`
names. Seeds whose fluid hardly moves are left out. FILE collects a JSON line for each run, so a network that
is judged later does not repeat the runs of the other methods, and an interrupted call goes on.
"""

import argparse
import hashlib
import json
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from hybridmpm.control import (
    ControlNet,
    Following,
    Learned,
    Method,
    ReversedCase,
    prepare,
    reversed_from_seed,
)
from hybridmpm.errors import SketchError
from hybridmpm_lab.control.methods import Backcast

RIVALS = ("constant", "analytic", "backcast")
KINDS = ("oval", "arrow")
SEEDS = 1_000_600, 50
CAP, NEAREST = 15.0, 0.05
"""Cap [g], and how far the centre of mass comes at least [m]."""
KEYS = ("scenario", "kind", "seed", "method")
Row = dict[str, Any]


def case_of(name: str, kind: Any, seed: int) -> ReversedCase | None:
    """Return the reversed case of a seed, None where the fluid hardly moves."""
    try:
        case = reversed_from_seed(name, seed, start="live", kind=kind)
    except SketchError:
        return None
    way = (case.truth[-1] - case.truth[0]).mean(axis=0)
    return case if np.linalg.norm(way) >= NEAREST else None


def judged(case: ReversedCase, method: str | Method) -> Row:
    """Return the final grid RMSE of a method, the time of its plan and first force, and what took over."""
    simulator = case.simulator()
    began = time.process_time()
    guidance = prepare(simulator, case.sketch, method=method, frames=case.frames, cap=CAP, gentle=False)
    guidance(simulator)
    spent = time.process_time() - began
    result = Following(simulator, guidance).run()
    found = {"error": case.error(result.positions[-1]), "first_ms": 1e3 * spent}
    return found | {"used": guidance.method, "reason": guidance.reason}


def measured(file: Path, names: Sequence[str], seeds: tuple[int, int], methods: dict[str, Any]) -> list[Row]:
    """Return the rows of all methods on all cases, those that the file lacks computed and added to it."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    there = {tuple(row[key] for key in KEYS): row for row in rows}
    found: list[Row] = []
    for name, kind in product(names, KINDS):
        seed, left = seeds
        while left:
            keys = [(name, kind, seed, method) for method in methods]
            lacking = [key for key in keys if key not in there]
            case = case_of(name, kind, seed) if lacking else None
            for key in lacking:
                figures = {"error": None} if case is None else judged(case, methods[key[3]])
                there[key] = dict(zip(KEYS, key, strict=True)) | figures
                with file.open("a") as log:
                    log.write(json.dumps(there[key]) + "\n")
            of_seed = [there[key] for key in keys]
            moves = of_seed[0]["error"] is not None
            found += of_seed if moves else []
            left -= moves
            seed += 1
    return found


def table(rows: Sequence[Row], label: str) -> list[str]:
    """Return the rows of the table: means, and the network's over the better of analytic and backcast."""
    columns = ["", *RIVALS, "network", "over the better", "than the better of a seed", "better in"]
    columns += ["over constant", "handed over", "first frame"]
    lines = [f"| {' | '.join(columns)} |", "|---" * len(columns) + "|"]
    for name, kind in dict.fromkeys((row["scenario"], row["kind"]) for row in rows):
        mine = [row for row in rows if (row["scenario"], row["kind"]) == (name, kind)]
        of = {
            method: np.array([row["error"] for row in mine if row["method"] == method])
            for method in (*RIVALS, label)
        }
        own = [row for row in mine if row["method"] == label]
        best = np.minimum(of["analytic"], of["backcast"])
        away = of[label] - best
        means = {method: error.mean() for method, error in of.items()}
        ratio = means[label] / min(means["analytic"], means["backcast"])
        over = np.mean([row["used"] == "analytic" for row in own])
        cells = [f"{name}, {kind}s ({len(best)})", *(f"{means[method]:.3f}" for method in RIVALS)]
        cells += [f"{means[label]:.3f}", f"{ratio:.3f}"]
        cells += [f"{away.mean():+.3f} ± {away.std(ddof=1) / len(away) ** 0.5:.3f}"]
        cells += [f"{100 * (away < 0).mean():.0f} %", f"{means[label] / means['constant']:.3f}"]
        cells += [f"{100 * over:.0f} %", f"{np.median([row['first_ms'] for row in own]):.0f} ms"]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--method", choices=("learned", "controlnet"), default="learned")
    parser.add_argument("--network", type=Path, help="the library's own if absent")
    parser.add_argument("--scenario", nargs="+", default=["water_3d", "sand_3d"])
    parser.add_argument("--seeds", nargs=2, type=int, default=SEEDS, metavar=("FIRST", "COUNT"))
    asked = parser.parse_args()
    digest = hashlib.sha256(asked.network.read_bytes()).hexdigest()[:8] if asked.network else "of the library"
    network = None if asked.network is None else str(asked.network)
    entrant = Learned(network) if asked.method == "learned" else ControlNet(network)
    rivals = {"constant": "constant", "analytic": "analytic", "backcast": Backcast()}
    entrants: dict[str, Any] = rivals | {f"{asked.method} {digest}": entrant}
    found = measured(asked.file, asked.scenario, tuple(asked.seeds), entrants)
    print("\n".join(table(found, f"{asked.method} {digest}")))  # noqa: T201 - that is what it is for
