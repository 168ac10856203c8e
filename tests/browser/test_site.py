"""The gallery as a folder of pages that play by themselves."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser
from tests.browser.conftest import PATIENCE_MS

import hybridmpm_service
from hybridmpm import ConfigError, ExportError
from hybridmpm_service.site import entries, write_site

NAMES = ["wave-maker", "dam-in-space", "water-2-oval"]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "new" / "site"
    assert write_site(folder, NAMES) == [folder / "index.html", *(folder / f"{name}.html" for name in NAMES)]
    return folder


@pytest.mark.parametrize("width", [1100, 390])
def test_a_site_on_a_disk_has_pages_that_play(browser: Browser, site: Path, width: int) -> None:
    context = browser.new_context(viewport={"width": width, "height": 740}, reduced_motion="reduce")
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    errors: list[str] = []
    page.on("console", lambda line: errors.append(line.text) if line.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((site / "index.html").as_uri())
    assert page.locator("li h3").all_inner_texts() == ["Wave maker", "Dam in space", "Water into an oval"]
    assert page.evaluate("[...document.images].every((one) => one.naturalWidth > 100)")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.get_by_role("link", name="Wave maker").click()
    page.wait_for_function("() => document.body.dataset.ready === 'true'")
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.click("#step")
    page.wait_for_function("() => document.body.dataset.frame === '1'")
    assert "Try: Push against" in page.locator("#lesson").inner_text()
    assert page.locator("figure b").all_inner_texts() == ["water level", "paddle"]
    page.get_by_role("link", name="All scenes").click()
    page.get_by_role("link", name="Water into an oval").click()
    page.wait_for_function("() => document.body.dataset.ready === 'true'")
    page.evaluate("async () => await advance(61)")
    page.wait_for_function("() => document.body.dataset.frame === '61'")
    context.close()
    assert errors == []


def test_pages_of_a_site_are_small_and_load_nothing_from_elsewhere(site: Path) -> None:
    for file in site.glob("*.html"):
        # The module for 3D, in two builds, takes 1.3 million bytes of it.
        assert file.stat().st_size < 2_000_000
        assert "http" not in re.sub(r"<script.*?</script>", "", file.read_text("utf-8"), flags=re.DOTALL)


def test_each_scene_of_the_gallery_is_an_entry() -> None:
    folder = Path(hybridmpm_service.__file__).parent / "page" / "gallery"
    listed = json.loads((folder / "entries.json").read_text(encoding="utf-8"))
    files = {file.stem for file in folder.glob("*.json")} - {"entries"}
    assert set(listed["scenes"]) | set(listed["lessons"]) == files
    assert {file.stem for file in folder.glob("*.png")} == files | set(listed["demos"])
    assert all(one.title and one.about.endswith(".") and one.to_try.endswith(".") for one in entries())


def test_a_site_says_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"the gallery has no 'jely'; it has .*jelly"):
        write_site(tmp_path, ["jely"])
    (tmp_path / "file").touch()
    with pytest.raises(ExportError, match="cannot write"):
        write_site(tmp_path / "file" / "site", ["jelly"])
    command = [sys.executable, "-m", "hybridmpm_service.site", str(tmp_path), "jely"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("the gallery has no 'jely'")
