"""Pages that play by themselves: the bits of the native solver, and the controls."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page
from tests.browser.conftest import PATIENCE_MS
from tests.golden.digests import FRAMES, scenes

from hybridmpm import Box, BoxObstacle, ConfigError, Motion, MpmSolver, Scene, play, scenarios

MODULE = re.compile(r'(?<=id="module">)[^<]*')
"""The module that a page tries first, with instructions that not all browsers have."""
EXACT = re.compile(r'(?<=id="module-exact">)[^<]*')

Show = Callable[[str], Page]


@pytest.fixture
def show(browser: Browser, tmp_path: Path) -> Iterator[Show]:
    """Open a page from the disk, where nothing plays by itself; it must not complain."""
    context = browser.new_context(reduced_motion="reduce", viewport={"width": 900, "height": 700})
    errors: list[str] = []

    def note(line: ConsoleMessage) -> None:
        if line.type == "error":
            errors.append(line.text)

    def show_one(text: str) -> Page:
        file = tmp_path / "page.html"
        file.write_text(text, encoding="utf-8")
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", note)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(file.as_uri())
        page.wait_for_function("() => document.body.dataset.ready !== undefined")
        return page

    yield show_one
    context.close()
    assert errors == []


def advanced(page: Page, frames: int) -> str:
    """Return the digest after some more frames."""
    page.evaluate(f"async () => await ask('advance', {{ frames: {frames}, hand: null, wanted: 'speed' }})")
    digest: str = page.evaluate("async () => (await ask('digest')).digest")
    return digest


@pytest.mark.parametrize("kind", ["relaxed", "exact"])
@pytest.mark.parametrize("name", [*scenes()])
def test_a_page_computes_the_bits_of_the_native_solver(show: Show, name: str, kind: str) -> None:
    frames = FRAMES if kind == "relaxed" else 10
    solver = MpmSolver(scenes()[name], substeps="reference")
    text = play(solver).html
    page = show(text if kind == "relaxed" else MODULE.sub(EXACT.findall(text)[0], text))
    solver.advance(frames)
    assert advanced(page, frames) == solver.digest()


def test_a_page_goes_on_in_mid_splash_among_moving_obstacles(show: Show) -> None:
    paddle = BoxObstacle(
        lower=(0.45, 0.1),
        upper=(0.5, 0.4),
        motion=Motion(velocity=(0.4, 0.0), angular_velocity=2.0, center=(0.475, 0.25), period=1.3, phase=0.2),
    )
    bodies = (
        Box(material="water", lower=(0.3, 0.1), upper=(0.43, 0.25)),
        Box(material="elastic", lower=(0.55, 0.3), upper=(0.65, 0.4), velocity=(0.0, -2.0)),
        Box(material="sand", lower=(0.58, 0.1), upper=(0.7, 0.2)),
    )
    solver = MpmSolver(Scene(dim=2, bodies=bodies, obstacles=(paddle,)))
    solver.advance(50)
    page = show(play(solver).html)
    solver.advance(40)
    assert advanced(page, 40) == solver.digest()


def test_a_page_plays_steps_pushes_and_begins_again(show: Show) -> None:
    solver = MpmSolver(scenarios.water_2d(3))
    page = show(play(solver, name="Two <blocks>", text="# A title\n\nSome *words*.").html)
    assert page.title() == "Two <blocks>"
    assert page.locator("#lesson h2").inner_text() == "A title"
    assert page.locator("#lesson em").inner_text() == "words"
    page.click("#step")
    page.wait_for_function("() => document.body.dataset.frame === '1'")
    page.click("#show-digest")
    page.wait_for_function("() => document.getElementById('digest').value !== ''")
    solver.advance()
    assert page.locator("#digest").evaluate("output => output.value") == solver.digest()
    box = page.locator("#picture").bounding_box()
    assert box is not None
    page.click("#play")
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.8 * box["height"])
    page.mouse.down()
    for i in range(20):
        page.mouse.move(box["x"] + (0.3 + 0.02 * i) * box["width"], box["y"] + 0.8 * box["height"])
        page.wait_for_timeout(20)
    page.mouse.up()
    page.wait_for_function("() => Number(document.body.dataset.frame) > 20")
    page.click("#play")
    page.select_option("#colour", "pressure")
    page.click("#reset")
    page.wait_for_function("() => document.body.dataset.frame === '0'")
    page.click("#show-digest")
    page.wait_for_function("() => document.getElementById('digest').dataset.frame === '0'")
    solver.reset()
    assert page.locator("#digest").evaluate("output => output.value") == solver.digest()


def test_a_damaged_page_says_so(show: Show) -> None:
    text = play(scenarios.water_2d(3)).html
    other = play(scenarios.water_3d(3)).html
    page = show(MODULE.sub(MODULE.findall(other)[0], text))
    assert "it is of a scene in 2D, and this build plays those in 3D" in page.locator("#message").inner_text()


def test_a_text_is_markdown_that_cannot_run_or_load() -> None:
    text = (
        "A [link](index.html), `a < b`, {{module}}.\n\n- one\n- two\n\n<script>run()</script>\n\n"
        "[bad](javascript:run()) [worse](data:text/html,run) ![picture](http://example.com/a.png)"
    )
    page = play(scenarios.water_2d(3), text=text).html
    lesson = page[page.index('<article id="lesson"') : page.index("</article>")]
    assert '<a href="index.html">link</a>, <code>a &lt; b</code>, {{module}}.' in lesson
    assert "<li>one</li>" in lesson
    assert "&lt;script&gt;run()&lt;/script&gt;" in lesson
    assert re.findall("<(?:script|img|iframe)|href=.(?:javascript|data)", lesson) == []


@pytest.mark.parametrize("wrong", [scenarios.NAMES, None, "waves.yaml"])
def test_only_scenes_and_solvers_play(wrong: object) -> None:
    with pytest.raises(ConfigError, match="a page plays a Scene or an MpmSolver"):
        play(wrong)  # type: ignore[arg-type]


def test_files_have_a_suffix_and_a_size(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"must be an \.html file"):
        play(scenarios.water_2d(3), tmp_path / "waves.gif")
    with pytest.raises(ConfigError, match="make the solver without"):
        play(MpmSolver(scenarios.water_2d(3), coarse="1/16"))
    file = tmp_path / "waves.html"
    page = play(scenarios.water_2d(3), file)
    assert file.read_text(encoding="utf-8") == page.html
    assert file.stat().st_size < 1_200_000
    assert "http" not in re.sub(r"<script type=\"text/plain\".*?</script>", "", page.html, flags=re.DOTALL)
