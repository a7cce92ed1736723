"""Chromium without a window, for tests of pages; they are skipped where it is missing."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

ADVICE = "needs Chromium, its driver (Debian: chromium-driver) and the extra 'browser'"
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--window-size=1500,1000",
)  # fmt: skip


def skip_without_browser() -> None:
    """Skip the tests of a file, before it computes anything."""
    pytest.importorskip("selenium.webdriver", reason=ADVICE)
    if not all(map(shutil.which, ("chromium", "chromedriver"))):
        pytest.skip(ADVICE, allow_module_level=True)


@contextmanager
def opened(page: Path, folder: Path) -> Iterator[Any]:
    """A browser that shows a page; what it downloads goes into a folder."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for option in (*OPTIONS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(option)
    options.add_experimental_option("prefs", {"download.default_directory": str(folder)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        browser.get(page.as_uri())
        until(lambda: browser.execute_script("return document.body.dataset.state") == "ready")
        yield browser
        errors = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert errors == []
    finally:
        browser.quit()


def until(true: Any, seconds: float = 60.0) -> None:
    """Wait for something."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "in vain"
        time.sleep(0.05)
