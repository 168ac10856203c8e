"""The code behind each committed result, so that `hybridmpm bench --stale` knows what a result depends on."""

from hybridmpm.bench.staleness.results import Origin

_WEIGHTS = "python/hybridmpm/physics/weights/*.onnx"

BENCHES: dict[str, Origin] = {
    "mpm": Origin(
        modules=(
            "hybridmpm.bench.speed.mpm",
            "hybridmpm.bench.peers.worker",
            "hybridmpm.bench.peers.taichi_mpm",
            "hybridmpm.bench.peers.warp_mpm",
        )
    ),
    "scaling": Origin(modules=("hybridmpm.bench.speed.scaling",)),
    "batch": Origin(modules=("hybridmpm.bench.speed.batch",)),
    "neighbors": Origin(modules=("hybridmpm.bench.speed.neighbors", "hybridmpm.bench.peers.scipy_tree")),
    "sleeping": Origin(modules=("hybridmpm.bench.speed.sleeping",)),
    "downsampling": Origin(
        modules=("hybridmpm.bench.downsampling.ladders",),
        data=("python/hybridmpm/downsampling/rungs/rungs.json",),
    ),
    "models": Origin(modules=("hybridmpm.bench.accuracy.models",), data=(_WEIGHTS,)),
    "tradeoff": Origin(
        modules=(
            "hybridmpm.bench.tradeoff.errors",
            "hybridmpm.bench.tradeoff.times",
            "hybridmpm.bench.tradeoff.paper",
            "hybridmpm.bench.peers.worker",
            "hybridmpm.bench.peers.taichi_mpm",
        ),
        data=(_WEIGHTS, "python/hybridmpm/downsampling/rungs/rungs.json"),
    ),
    "crossing": Origin(
        modules=("hybridmpm.bench.crossing.measure",),
        data=(_WEIGHTS, "python/hybridmpm/downsampling/rungs/rungs.json"),
    ),
    "plans": Origin(
        modules=("hybridmpm.bench.calibrate.judge",),
        data=(_WEIGHTS, "python/hybridmpm/planner/calibration.json"),
    ),
    "sweep": Origin(modules=("hybridmpm.bench.sweep.runner", "hybridmpm.bench.sweep.results")),
    "stability": Origin(modules=("hybridmpm.bench.stability.stability",)),
    "stability-map": Origin(modules=("hybridmpm.bench.stability.map",), data=(_WEIGHTS,)),
    "safeguard": Origin(modules=("hybridmpm.bench.hybrid.safeguard",), data=(_WEIGHTS,)),
    "handoff": Origin(modules=("hybridmpm.bench.hybrid.handoff",)),
    "hybrid": Origin(modules=("hybridmpm.bench.hybrid.hybrid",), data=(_WEIGHTS,)),
    "shares": Origin(modules=("hybridmpm.bench.hybrid.scenes",), data=(_WEIGHTS,)),
    "thresholds": Origin(modules=("hybridmpm.bench.hybrid.scenes",), data=(_WEIGHTS,)),
    "spoilt": Origin(modules=("hybridmpm.bench.hybrid.scenes",), data=(_WEIGHTS,)),
    "reversal": Origin(modules=("hybridmpm.bench.reversal.reversal",)),
    "control": Origin(modules=("hybridmpm.bench.control.runner", "hybridmpm.bench.control.report.means")),
    "service": Origin(
        modules=("hybridmpm.bench.service.service",), programs=("service/hybridmpm_service/**/*.py",)
    ),
}
"""Modules and data by the name of the result in docs/results, which is that of its command; the map of
stability is made by `stability --map`, thresholds of the cosine and spoilt networks by `shares --method`."""
