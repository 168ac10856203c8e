"""`Scores`: errors of methods and of bounds on the scenes of one scenario, as fields of rows."""

from collections.abc import Mapping, Sequence

from hybridmpm import metrics
from hybridmpm.metrics import ErrorTable
from hybridmpm.recording import Recording
from hybridmpm_lab.compare.accuracy.conventions import AT
from hybridmpm_lab.compare.accuracy.methods import Method
from hybridmpm_lab.compare.accuracy.rollouts import MEASURES, Truth, errors, excerpt, frozen
from hybridmpm_lab.harness.rows import Row, significant


class Scores:
    """Errors of methods and of bounds on the scenes of a scenario, all counted after the same warm-up.

    Bounds are the floors and ceilings of an error: `merged`, the truth merged state by state; `still`, the
    initial state held; `frozen`, the state held in which the count begins; `jitter`, the truth with other
    jitter.

    Parameters
    ----------
    scenario : str
        Scenario of the scenes.
    methods : sequence of Method
        Methods in the order of the rows.
    warm_up, span : int
        Errors count over the `span` frames after the first impact, or after frame `warm_up` where that is
        later.
    threads : int
        Threads of the methods, as rows tell them.
    merged : mapping of str to float
        r_p of the merged truths by label.
    transport : bool
        Whether methods have Sinkhorn distances, too. Bounds and relaxed networks have none.
    """

    def __init__(
        self,
        scenario: str,
        methods: Sequence[Method],
        *,
        warm_up: int,
        span: int,
        threads: int,
        merged: Mapping[str, float],
        transport: bool = False,
    ) -> None:
        self._scenario, self._warm_up, self._span = scenario, warm_up, span
        self._threads, self._merged, self._transport = threads, merged, transport
        self._methods = {one.name: one for one in methods}
        self._table = ErrorTable()
        self._starts: dict[str, int] = {}
        self._failures = dict.fromkeys(self._methods, 0)

    @property
    def methods(self) -> list[Method]:
        """Methods in the order of the rows."""
        return list(self._methods.values())

    @property
    def names(self) -> list[str]:
        """Names of the methods, then of the bounds that have been entered."""
        return list(dict.fromkeys((*self._methods, *self._table.methods)))

    def enter(self, method: Method, run: Recording | None, truth: Truth) -> None:
        """Enter the errors of a method's rollout of a scene, or its failure where there is no rollout.

        Parameters
        ----------
        method : Method
        run : Recording or None
            Every frame of the rollout, as many as the truth has.
        truth : Truth
        """
        self._starts[truth.states.scene.name] = truth.start(self._warm_up)
        if run is None:
            self._failures[method.name] += 1
        else:
            self._compare(method.name, run, truth, transport=self._transport and method.kind != "relaxed")

    def enter_bounds(self, truth: Truth, jittered: Recording | None) -> None:
        """Enter the errors of the bounds on a scene; `jittered` is what `Truth.with_other_jitter` returns."""
        start, scene = truth.start(self._warm_up), truth.states.scene.name
        true = excerpt(truth.states, start, self._span)
        for label, r_p in self._merged.items():
            merged = metrics.merged_states(true, r_p)
            self._table.add(f"merged {label}", scene, errors(merged, true, transport=False))
        self._compare("still", frozen(truth.states, 0), truth)
        self._compare("frozen", frozen(truth.states, start), truth)
        if jittered is not None:
            self._compare("jitter", jittered, truth)

    def head(self, name: str) -> Row:
        """Return the fields that tell what a row is about; those of networks are None in a bound's row."""
        kind, _, label = name.partition(" ")
        method, starts = self._methods.get(name), self._starts.values()
        r_p = method.r_p if method else self._merged.get(label)
        return {
            "scenario": self._scenario,
            "method": kind,
            "label": label or None,
            "r_p": None if r_p is None else round(r_p, 4),
            "r_t": None if method is None else method.r_t,
            "r_c": None,
            "mpm_share": None if method is None else float(method.kind == "mpm"),
            "parameters": None if method is None else method.parameters,
            "scenes": len(starts),
            "failed": self._failures.get(name, 0),
            "threads": None if method is None else self._threads,
            "warm_up": self._warm_up,
            "start": round(sum(starts) / len(starts), 1) if starts else None,
        }

    def errors(self, name: str, zero: str | None = None) -> Row:
        """Return the fields of errors of a method or bound, None where it failed in a scene.

        Parameters
        ----------
        name : str
        zero : str, optional
            Name of the zero network that the method is compared with. `below_zero_40` is the part of that
            network's mean error that the method does without, `minus_zero_40` the mean difference of the two
            on the same scenes, `minus_zero_40_se` its standard error. All are None without a zero network.
        """
        has_failed = self._failures.get(name, 0) > 0
        entry = {} if has_failed else self._entries().get(name, {})
        measures = (field for measure in MEASURES for field in (measure, f"{measure}_se"))
        fields: Row = {field: significant(entry.get(field)) for field in measures}
        for frame in AT:
            measure, apart, share = f"error_{frame}", None, None
            if zero is not None and not has_failed and measure in self._table.measures:
                apart = self._table.difference(name, zero, measure)
                share = -apart.mean / self._table.estimate(zero, measure).mean
            fields[f"below_zero_{frame}"] = significant(share)
            fields[f"minus_zero_{frame}"] = significant(apart.mean if apart else None)
            fields[f"minus_zero_{frame}_se"] = significant(apart.standard_error if apart else None)
        return fields

    def _entries(self) -> dict[str, Row]:
        return {row["method"]: row for row in self._table.rows()}

    def _compare(self, name: str, run: Recording, truth: Truth, *, transport: bool = False) -> None:
        start, span = truth.start(self._warm_up), self._span
        found = errors(excerpt(run, start, span), excerpt(truth.states, start, span), transport=transport)
        self._table.add(name, truth.states.scene.name, found)
