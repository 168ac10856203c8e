"""What an operator sees: metrics, a line in the log for each request, identifiers, the dashboard."""

import asyncio
import json
import logging
import logging.config
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send
from tests.service.conftest import WAIT_SECONDS, Service

from hybridmpm_service import Settings, create_app
from hybridmpm_service.http.observed import ObservedMiddleware, log_config

DASHBOARD = Path(__file__).parents[3] / "service" / "deploy" / "grafana.json"


def read(service: Service) -> dict[str, float]:
    """Return all samples of /metrics."""
    answer = service.http.get("/metrics")
    assert answer.status_code == 200
    lines = [line for line in answer.text.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


def test_requests_are_counted_by_route_and_refusals_by_kind(start: Callable[..., Service]) -> None:
    service = start()
    path = service.create()
    for name in ("a", "b"):
        service.http.get(f"/v1/sessions/{name}")
    service.http.get("/main.js")
    service.http.request("BREW", "/livez")
    found = read(service)
    session = "/v1/sessions/{session_id}"
    assert found[f'hybridmpm_requests_total{{method="GET",route="{session}",status="404"}}'] == 2
    assert found['hybridmpm_requests_total{method="POST",route="/v1/sessions",status="201"}'] == 1
    assert found['hybridmpm_requests_total{method="GET",route="page",status="200"}'] == 1
    assert any('method="other"' in name for name in found)
    assert found['hybridmpm_refusals_total{kind="session-not-found"}'] == 2
    assert found[f'hybridmpm_request_seconds_count{{route="{session}"}}'] == 2
    assert not any(path in name for name in found), "each session would have metrics of its own"


def test_gauges_follow_sessions_streams_and_frames(start: Callable[..., Service]) -> None:
    service = start()
    path = service.create()
    service.create()
    assert read(service)['hybridmpm_sessions{state="paused"}'] == 2
    with service.stream(path) as stream:
        stream.send(type="play")
        while (found := read(service))["hybridmpm_frames_total"] < 5:
            stream.frame()
        assert found["hybridmpm_viewers"] == 1
        assert found['hybridmpm_sessions{state="playing"}'] == 1
        assert found["hybridmpm_load_cores"] > 0
        assert found["hybridmpm_frame_late_seconds_count"] > 0
    streams = 'hybridmpm_requests_total{method="STREAM",route="stream",status="101"}'
    deadline = time.monotonic() + WAIT_SECONDS
    # A stream counts when the server has seen its end.
    while streams not in (found := read(service)):
        assert time.monotonic() < deadline
    assert found[streams] == 1
    assert found["hybridmpm_ready"] == 1
    assert found["hybridmpm_limit_cores"] == 64
    assert found['hybridmpm_sessions_kept{where="memory"}'] == 2


def test_the_dashboard_asks_for_metrics_that_exist(service: Service) -> None:
    service.http.get("/v1/sessions/none")
    names = {name.partition("{")[0] for name in read(service)}
    panels = json.loads(DASHBOARD.read_text("utf-8"))["panels"]
    asked = {
        name
        for panel in panels
        for target in panel["targets"]
        for name in re.findall(r"\b(?:hybridmpm|process)_\w+", target["expr"])
    }
    assert asked - names == set()
    ours = {re.sub(r"_(bucket|sum|count|created)$", "", name) for name in names if "hybridmpm" in name}
    shown = {re.sub(r"_bucket$", "", name) for name in asked}
    assert {name for name in ours if not name.endswith("_created")} - shown == {
        "hybridmpm_frames",
        "hybridmpm_requests",
        "hybridmpm_refusals",
    } & ours


@pytest.mark.parametrize("given", ["abc-1.2_Z", "x" * 64])
def test_an_identifier_is_taken_over(service: Service, given: str) -> None:
    answer = service.http.get("/livez", headers={"X-Request-ID": given})
    assert answer.headers["x-request-id"] == given


@pytest.mark.parametrize("given", ["", "x" * 65, "a b", "a\tb", "é".encode().decode("latin-1")])
def test_what_is_no_identifier_is_replaced(service: Service, given: str) -> None:
    sent = {"X-Request-ID": given.encode("latin-1")}
    found = {service.http.get("/v1/sessions/none", headers=sent).headers["x-request-id"] for _ in range(2)}
    assert len(found) == 2
    assert all(re.fullmatch(r"[0-9a-f]{32}", one) for one in found)


def test_a_line_of_the_log_is_an_object(capsys: pytest.CaptureFixture[str]) -> None:
    loggers = [logging.getLogger(name) for name in ("hybridmpm_service", "uvicorn", "asyncio")]
    before = [(one.level, one.handlers[:]) for one in loggers]
    try:
        logging.config.dictConfig(log_config("info", "json"))
        logging.getLogger("hybridmpm_service.access").info("GET\n/x %d", 200, extra={"status": 200})
        (line,) = capsys.readouterr().err.splitlines()
        found = json.loads(line)
    finally:
        for one, (level, handlers) in zip(loggers, before, strict=True):
            one.setLevel(level)
            one.handlers[:] = handlers
    assert found["message"] == "GET\n/x 200"
    assert found["status"] == 200
    assert found["level"] == "INFO"
    assert found["request"] == "-"
    assert found["time"]


def test_each_request_has_a_line_with_its_identifier(
    start: Callable[..., Service], caplog: pytest.LogCaptureFixture
) -> None:
    service = start(log_level="info")
    with caplog.at_level(logging.INFO, "hybridmpm_service.access"):
        service.http.get("/v1/sessions/no%0Ane", headers={"X-Request-ID": "mine"})
        # The line is written after the answer.
        service.stop()
    (record,) = [one for one in caplog.records if one.name == "hybridmpm_service.access"]
    about: dict[str, Any] = vars(record)
    assert (about["method"], about["path"], about["status"]) == ("GET", "/v1/sessions/no%0Ane", 404)
    assert about["client"] == "127.0.0.1"
    assert about["bytes"] > 0
    assert about["request"] == "mine"


def test_metrics_are_for_this_machine_unless_a_setting_says_otherwise(start: Callable[..., Service]) -> None:
    away = {"X-Forwarded-For": "203.0.113.5"}
    service = start()
    assert service.http.get("/metrics", headers=away).status_code == 403
    assert service.http.head("/metrics").status_code == 200
    assert start(metrics="all").http.get("/metrics", headers=away).status_code == 200
    assert start(metrics="off").http.get("/metrics").status_code == 404


def test_a_request_counts_before_its_answer_has_left() -> None:
    counted: list[float] = []
    metrics = create_app(Settings()).state.metrics

    async def app(_scope: Scope, _receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"x"})

    async def send(message: Message) -> None:
        if message["type"] == "http.response.body":
            counted.append(metrics.requests.labels("GET", "page", 200)._value.get())

    async def receive() -> Message:
        return {"type": "http.request"}

    scope = {"type": "http", "method": "GET", "path": "/x", "headers": [], "client": ("127.0.0.1", 1)}
    asyncio.run(ObservedMiddleware(app, metrics, ())(scope, receive, send))
    assert counted == [1.0]
    assert metrics.requests.labels("GET", "page", 200)._value.get() == 1.0
