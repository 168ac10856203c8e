"""The browser of measurements."""

import os
import shutil

from playwright.sync_api import Browser, Playwright

from hybridmpm import ConfigError


def launched(playwright: Playwright) -> Browser:
    """Return Chromium, or raise a `ConfigError` that says how to get it."""
    chromium = os.environ.get("HYBRIDMPM_CHROMIUM") or shutil.which("chromium")
    if chromium is None:
        raise ConfigError("no Chromium found: install Debian's package chromium or set HYBRIDMPM_CHROMIUM")
    flags = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    return playwright.chromium.launch(executable_path=chromium, args=flags)
