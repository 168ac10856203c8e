"""What an operator watches, as metrics of Prometheus: requests, frames, sessions, work, jobs."""

from collections import Counter as Count
from collections.abc import Iterator

import prometheus_client as prometheus
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from hybridmpm_service.jobs import JobTable
from hybridmpm_service.sessions.manager import SessionManager

MEDIA_TYPE = prometheus.CONTENT_TYPE_LATEST
_REQUEST_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
_LATE_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.02, 0.04, 0.08, 0.1)
"""Bounds of the times of requests, and of frames behind their time, of which 0.1 s are made up for."""


class Metrics:
    """The metrics of one application; nothing is shared between applications.

    Parameters
    ----------
    sessions : SessionManager
    jobs : JobTable

    Attributes
    ----------
    requests : Counter of method, route, status
    seconds : Histogram of route
        Time from a request's head to the end of its answer [s].
    refusals : Counter of kind
        Answers that are problems, by the last part of their type.
    """

    def __init__(self, sessions: SessionManager, jobs: JobTable) -> None:
        self._registry = registry = prometheus.CollectorRegistry()
        self.requests = prometheus.Counter(
            "hybridmpm_requests",
            "Requests answered.",
            ["method", "route", "status"],
            registry=registry,
        )
        self.seconds = prometheus.Histogram(
            "hybridmpm_request_seconds",
            "Time of requests, with their answers [s].",
            ["route"],
            buckets=_REQUEST_SECONDS,
            registry=registry,
        )
        self.refusals = prometheus.Counter(
            "hybridmpm_refusals", "Answers that are problems.", ["kind"], registry=registry
        )
        frames = prometheus.Counter("hybridmpm_frames", "Frames that players computed.", registry=registry)
        late = prometheus.Histogram(
            "hybridmpm_frame_late_seconds",
            "Time by which a player began its due frames too late [s].",
            buckets=_LATE_SECONDS,
            registry=registry,
        )

        def on_turn(computed: int, behind: float) -> None:
            frames.inc(computed)
            late.observe(behind)

        sessions.machine.on_turn = on_turn
        registry.register(_Present(sessions, jobs))
        prometheus.ProcessCollector(registry=registry)

    def text(self) -> bytes:
        """Return all metrics in the text format of Prometheus."""
        return prometheus.generate_latest(self._registry)


class _Present(Collector):
    """The state at the time of a request, which nothing has to keep up to date."""

    def __init__(self, sessions: SessionManager, jobs: JobTable) -> None:
        self._sessions, self._jobs = sessions, jobs

    def collect(self) -> Iterator[Metric]:
        """Return the gauges."""
        manager, sessions, machine = self._sessions, self._sessions.all(), self._sessions.machine
        playing = sum(session.playing for session in sessions)
        yield _by("sessions", "Sessions.", "state", {"playing": playing, "paused": len(sessions) - playing})
        kept = {"memory": 0, "disk": 0, "failing": 0} | Count(session.kept for session in sessions)
        yield _by("sessions_kept", "Sessions by where they are kept.", "where", kept)
        yield _one("viewers", "Streams that are open.", sum(len(session.audience) for session in sessions))
        yield _one("load_cores", "Load of the sessions that play [cores].", machine.load)
        yield _one("limit_cores", "Largest load of the sessions that play [cores].", machine.cores)
        yield _by("work", "Expensive work.", "state", manager.turns.counts())
        phases = {"running": 0, "done": 0, "failed": 0} | Count(job.phase for job in self._jobs.all())
        yield _by("jobs", "Jobs.", "phase", phases)
        ready = (manager.why_full() or manager.turns.why_stuck()) is None
        yield _one("ready", "1 if a session can be created and work goes on, else 0.", float(ready))


def _one(name: str, text: str, value: float) -> Metric:
    return GaugeMetricFamily(f"hybridmpm_{name}", text, value=value)


def _by(name: str, text: str, label: str, values: dict[str, int]) -> Metric:
    family = GaugeMetricFamily(f"hybridmpm_{name}", text, labels=[label])
    for key, value in values.items():
        family.add_metric([key], value)
    return family
