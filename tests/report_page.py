"""A data set of simulated pairs, its report, and a headless Chromium that shows it."""

import base64
import contextlib
import io
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from constructed_pairs import TWO, carried_set
from made_once import simulated
from playwright.sync_api import BrowserContext, Page, sync_playwright

from copolicy.cards.cli import main
from copolicy.convert.cli import main as convert
from copolicy.dataset.files.meta_files import CHECK_FILE, STATISTICS_FILE
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.route_entropy import route_statistics
from copolicy.tasks.table.statistics.route_statistics import route_statistics as routes_of_tables

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
REPORT = "report.html"
FINDINGS = {
    "rules": 37,
    "findings": [
        {"episode": "3", "rule": "idle", "figure": 0.5, "limit": 0.3, "severity": "warning", "message": "idle long"},
        {"episode": "", "rule": "balance", "figure": 1, "limit": 5, "severity": "error", "message": "too few <b>"},
    ],
}
"""Output of an earlier `copolicy-dataset check --json`, without a content hash."""

STATISTICS = {
    "version": 1,
    "statistics": {
        "routes": {
            "route_entropy": {
                "value": 0.93, "unit": "bits", "interval": [0.8, 1.0], "episodes": 30,
                "definition": "entropy of routes",
                "null": {"how": "shuffled", "mean": 0.1, "low": 0.0, "high": 0.2, "p": 0.01}, "details": {"L": 3},
            },
        },
        "distances": {
            "energy_distance": {"value": None, "unit": "1", "interval": None, "episodes": 0, "note": "one split only"},
        },
    },
}  # fmt: skip


def route_document(labels: list[str], episodes: int) -> dict[str, Any]:
    """Stored statistics of routes past two obstacles, as those of a data set with so many simulated episodes."""
    rng = np.random.default_rng(0)
    data = carried_set(labels, TWO, rng)
    bootstrap = Bootstrap(data.pairs, 200, rng)
    estimates = route_statistics(data, bootstrap, rng) | routes_of_tables(data, bootstrap, rng)
    return {
        "definition_version": "2.0.0",
        "dataset": {"episodes": episodes, "left_out": {}, "sources": {"simulated": episodes}},
        "human_reference": {"source": "Yang and Mavrogiannis, HRI 2025"},
        "statistics": {"routes": {name: estimate.as_dict() for name, estimate in estimates.items()}},
    }


def make_data_set(folder: Path, episodes: int) -> Path:
    """Episodes of simulated pairs at 10 Hz."""
    simulated(folder / "raw", episodes, 7)
    root = folder / "table"
    with contextlib.redirect_stdout(io.StringIO()):
        assert (
            convert(["mcap", str(folder / "raw"), "--out", str(root), "--repo-id", "local/table", "--license", "mit"])
            == 0
        )
    return root


def make_report(root: Path) -> Path:
    """The page of a data set, with findings and statistics."""
    (root / CHECK_FILE).write_text(json.dumps(FINDINGS), encoding="utf-8")
    (root / STATISTICS_FILE).write_text(json.dumps(STATISTICS), encoding="utf-8")
    assert main(["report", str(root), "--title", "Simulated <i>pairs</i>"]) == 0
    return root / REPORT


@contextlib.contextmanager
def chromium(profile: Path) -> Iterator[BrowserContext]:
    """A headless Chromium with its own profile."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    flags = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"]
    with sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            profile, executable_path=CHROMIUM, headless=True, args=flags
        )
        yield context
        context.close()


class Visit:
    """A page with all that it asked for and all that went wrong in it."""

    def __init__(self, browser: BrowserContext):
        self.page: Page = browser.new_page()
        self.requests: list[str] = []
        self.errors: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: self.errors.append(message.text) if message.type == "error" else None)

    def open(self, path: Path, width: int = 1320, fragment: str = "") -> Page:
        self.page.set_viewport_size({"width": width, "height": 900})
        self.page.goto(path.resolve().as_uri() + fragment)
        return self.page


@contextlib.contextmanager
def visiting(browser: BrowserContext) -> Iterator[Visit]:
    """A visit that may request files only and must see no error."""
    visit = Visit(browser)
    yield visit
    assert visit.errors == []
    assert all(url.startswith("file://") for url in visit.requests)
    visit.page.close()


def canvas_pixels(page: Page, selector: str) -> bytes:
    """The pixels of a canvas."""
    url = page.eval_on_selector(selector, "canvas => canvas.toDataURL()")
    return base64.b64decode(url.partition(",")[2])


def column(page: Page, index: int) -> list[str]:
    """The texts of a column of the table of episodes, from 1."""
    return page.locator(f"#episode-table tbody tr > :nth-child({index})").all_inner_texts()
