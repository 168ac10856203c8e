"""The documentation site: no page is too wide, the front leads on, the search finds, nothing is fetched."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect
from tests.browser.conftest import LiveService
from tests.python.package.test_documents import SERVICE, blocks

ROOT = Path(__file__).parents[2]
FOUND = {
    "pressure": "hybridmpm.probes.Pressure",
    "forces": "Forces on walls and obstacles",
    "snapshot": "Snapshots",
    "train": "Networks",
    "warning": "What went wrong",
}
"""Words, and what their search finds."""


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_site_is_built_without_a_warning_and_read_from_a_disk(browser: Browser, tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = ["make", "docs", f"DIST={tmp_path}", f"PYTHON={sys.executable}"]
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    site = tmp_path / "docs"
    context = browser.new_context(viewport={"width": 390, "height": 844})
    page = context.new_page()
    complaints: list[str] = []
    fetched: list[str] = []
    page.on("console", lambda line: complaints.append(line.text))
    page.on("request", lambda request: fetched.append(request.url))
    # The page of the root leads on at once.
    # Examples that call a service are offered for download.
    offered = set((site / "_downloads").rglob("*.html"))
    files = sorted(set(site.rglob("*.html")) - {site / "index.html"} - offered)
    assert len(files) > 50
    for file in files:
        page.goto(file.as_uri())
        page.wait_for_load_state()
        too_wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
        assert too_wide <= 0, f"{file.relative_to(site)} is {too_wide} pixels too wide"
    page.goto((site / "docs" / "sphinx" / "index.html").as_uri())
    expect(page.frame_locator("iframe").locator("body")).to_have_attribute("data-ready", "true")
    ways = page.locator("table").first.locator("tr").all()
    assert len([row for row in ways if row.locator("a").count()]) >= 20
    for word, title in FOUND.items():
        page.goto(f"{(site / 'search.html').as_uri()}?q={word}")
        expect(page.locator("#search-results li", has_text=title).first).to_be_attached()
    assert complaints == []
    assert [url for url in fetched if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.mark.long
def test_the_javascript_of_the_service_runs(browser: Browser) -> None:
    with LiveService() as service:
        for code in blocks(SERVICE, "javascript"):
            page = browser.new_page(bypass_csp=True)
            complaints: list[str] = []
            page.on("pageerror", lambda error, found=complaints: found.append(error.message))  # type: ignore[misc]
            page.goto(f"{service.url}/livez")
            with page.expect_console_message(lambda line: re.fullmatch(r"\d+ .*", line.text) is not None):
                page.add_script_tag(content=code.replace("127.0.0.1:8000", service.url[7:]), type="module")
            assert complaints == []
            page.close()
