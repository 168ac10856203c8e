"""Who simulated which frames, by a log of decisions."""

from hybridmpm.decisions import Decision, Span, frames_of_mpm, spans


def decided(frame: int, mode: str, reason: str) -> Decision:
    assert mode in ("mpm", "neural")
    return Decision(
        frame=frame, mode="mpm" if mode == "mpm" else "neural", value=None, reason=reason, noticed=frame
    )


START, IMPACT, CALM, UNDONE = (
    decided(20, "neural", "warm-up"),
    decided(60, "mpm", "impact"),
    decided(100, "neural", "calm"),
    decided(100, "mpm", "audit"),
)


def test_frames_belong_to_whoever_simulated_them_last() -> None:
    log = [START, IMPACT, CALM]
    assert spans(log, 120) == [
        Span(1, 20, "mpm", None),
        Span(21, 60, "neural", START),
        Span(61, 100, "mpm", IMPACT),
        Span(101, 120, "neural", CALM),
    ]
    assert frames_of_mpm(log, 120) == 60


def test_what_was_undone_is_left_out_and_later_decisions_do_not_count() -> None:
    log = [START, IMPACT, CALM, UNDONE]
    assert spans(log, 120)[-1] == Span(61, 120, "mpm", IMPACT)
    assert spans(log, 40) == [Span(1, 20, "mpm", None), Span(21, 40, "neural", START)]
    assert spans([], 0) == []
    assert spans([], 5) == [Span(1, 5, "mpm", None)]
