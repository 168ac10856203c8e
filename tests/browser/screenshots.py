"""Draw docs/images/page-*.png from a running service: `python tests/browser/screenshots.py`.

`python tests/browser/screenshots.py gallery` draws the pictures of the gallery's lessons and scenes instead,
or those of the names that follow.
"""

import base64
import io
import sys
from collections.abc import Iterable
from pathlib import Path

from conftest import CHROMIUM_FLAGS, PATIENCE_MS, LiveService, Visit, find_chromium
from PIL import Image
from playwright.sync_api import Browser, ViewportSize, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / "docs" / "images"
PREVIEW = ROOT / "service" / "hybridmpm_service" / "page" / "share" / "preview.png"
MAX_BYTES = 400_000
GALLERY = PREVIEW.parents[1] / "gallery"
GALLERY_FRAMES = {
    "communicating-vessels": 170,
    "torricelli": 150,
    "archimedes": 90,
    "dam-break": 90,
    "hourglass": 400,
    "angle-of-repose": 1500,
    "waves-in-a-tank": 220,
    "u-tube": 130,
    "water-wheel": 560,
    "wave-maker": 420,
    "dam-and-gate": 170,
    "sand-and-water": 120,
    "jelly": 150,
    "rigid-bodies": 170,
    "crates": 130,
    "viscous-liquids": 240,
    "cascade": 700,
    "letters": 110,
    "dam-in-space": 127,
}
"""Frames that pictures of the gallery show."""
GALLERY_WIDTH = 256
MOST_AT_ONCE = 400
PREVIEW_PAGE = """
<body style="margin:0;width:1200px;height:630px;display:flex;background:#0a0f16;color:#e8eef6;
 font:500 34px/1.35 'DejaVu Sans',sans-serif">
<div style="flex:1;padding:150px 30px 0 70px"><h1 style="margin:0 0 24px;font-size:62px">hybridmpm</h1>
Particle fluids<br>that follow your sketch</div>
<img src="data:image/png;base64,{}" style="width:630px;height:630px;border-radius:16px">
"""


def _open(browser: Browser, service: LiveService, query: str, viewport: ViewportSize, scale: float) -> Visit:
    page = browser.new_page(viewport=viewport, device_scale_factor=scale)
    page.set_default_timeout(PATIENCE_MS)
    page.goto(f"{service.url}/?renderer=webgl2&{query}")
    visit = Visit(page)
    visit.wait_for("body.state === 'live' && Number(body.frame) > 0")
    visit.press_until("Space", "body.playing === 'false'")
    visit.press_until("r", "body.frame === '0'")
    return visit


def _go_to(visit: Visit, service: LiveService, frames: int) -> None:
    """Advance by a number of frames in two steps: the last frames tell the page how fast the fluid is."""
    for _ in range((frames - 4) // MOST_AT_ONCE):
        service.advance(visit.session, MOST_AT_ONCE)
    service.advance(visit.session, (frames - 4) % MOST_AT_ONCE)
    frame = service.advance(visit.session, 4)["frame"]
    visit.wait_for(f"body.frame === '{frame}'")
    visit.page.wait_for_timeout(1500)


def _draw_gallery(browser: Browser, service: LiveService, names: Iterable[str]) -> None:
    """Draw entries as the page shows them, so that all have one style."""
    for name in names:
        frames = GALLERY_FRAMES[name]
        query = f"theme=dark&simulate=server&gallery={name}"
        visit = _open(browser, service, query, {"width": 1100, "height": 700}, 1)
        _go_to(visit, service, frames)
        path = GALLERY / f"{name}.png"
        with Image.open(io.BytesIO(visit.page.locator("#view").screenshot())) as shot:
            picture = shot.convert("RGB")
            picture.thumbnail((GALLERY_WIDTH, 2 * GALLERY_WIDTH))
            picture.quantize(64, dither=Image.Dither.NONE).save(path, optimize=True)
        sys.stdout.write(f"{name}: {path.stat().st_size} bytes\n")
        visit.page.close()


def _save(visit: Visit, name: str) -> None:
    path = IMAGES / name
    visit.page.screenshot(path=path)
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise RuntimeError(f"{name} has {size} bytes, more than the {MAX_BYTES} that the repository takes")
    sys.stdout.write(f"{name}: {size} bytes\n")
    visit.page.close()


def _draw_preview(visit: Visit) -> None:
    """Draw what is shown beside a link to the page: the picture of a page, with the project's name."""
    picture = base64.b64encode(visit.page.locator("#view").screenshot()).decode()
    card = visit.page.context.browser.new_page(viewport={"width": 1200, "height": 630})
    card.set_content(PREVIEW_PAGE.format(picture))
    with Image.open(io.BytesIO(card.screenshot())) as shot:
        shot.convert("RGB").quantize(192, dither=Image.Dither.NONE).save(PREVIEW, optimize=True)
    sys.stdout.write(f"{PREVIEW.name}: {PREVIEW.stat().st_size} bytes\n")
    card.close()


def main() -> None:
    """Draw the pictures."""
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("no Chromium found: install Debian's package `chromium` or set HYBRIDMPM_CHROMIUM")
    IMAGES.mkdir(parents=True, exist_ok=True)
    with LiveService() as service, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=CHROMIUM_FLAGS)
        if sys.argv[1:2] == ["gallery"]:
            _draw_gallery(browser, service, sys.argv[2:] or GALLERY_FRAMES)
            return

        desktop = _open(browser, service, "scenario=water_2d&seed=0", {"width": 1440, "height": 900}, 1)
        _go_to(desktop, service, 150)
        desktop.press_until("a", "body.tool === 'arrow'")
        desktop.drag([(0.36, 0.42), (0.52, 0.72)])
        desktop.wait_for("body.control === 'following'")
        _go_to(desktop, service, 62)
        _draw_preview(desktop)
        _save(desktop, "page-desktop.png")

        hybrid = _open(
            browser, service, "scenario=sand_2d&seed=0&solver=hybrid", {"width": 1440, "height": 900}, 1
        )
        _go_to(hybrid, service, 160)
        _save(hybrid, "page-hybrid.png")

        phone = _open(browser, service, "scenario=water_sand_2d&seed=0", {"width": 390, "height": 844}, 2)
        _go_to(phone, service, 130)
        phone.press_until("o", "body.tool === 'oval'")
        phone.drag([(0.34, 0.42), (0.66, 0.68)])
        phone.wait_for("body.control === 'following'")
        _go_to(phone, service, 70)
        _save(phone, "page-phone.png")
        browser.close()


if __name__ == "__main__":
    main()
