import base64
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest
from playwright.sync_api import Page, expect, sync_playwright

from copolicy.cards.artefacts import CHECK_FILE, STATISTICS_FILE
from copolicy.cards.cli import main
from copolicy.cards.facts import DatasetFacts
from copolicy.cards.frames import read_frames
from copolicy.cards.report.payload import FRAME_SCALES, build_payload
from copolicy.collect.simulate import simulate
from copolicy.convert.cli import main as convert
from copolicy.dataset.exceptions import FileFormatError

EPISODES = 30
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FINDINGS = {
    "rules": 37,
    "findings": [
        {"episode": "3", "rule": "idle", "figure": 0.5, "limit": 0.3, "severity": "warning", "message": "idle long"},
        {"episode": "", "rule": "balance", "figure": 1, "limit": 5, "severity": "error", "message": "too few <b>"},
    ],
}
STATISTICS = {
    "version": 1,
    "statistics": {
        "route_entropy": {
            "value": 0.93, "unit": "bits", "interval": [0.8, 1.0], "episodes": 30, "definition": "entropy of routes",
            "null": {"how": "shuffled", "mean": 0.1, "low": 0.0, "high": 0.2, "p": 0.01}, "details": {"L": 3},
        },
        "energy_distance": {"value": None, "unit": "1", "interval": None, "episodes": 0, "note": "one split only"},
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    """Episodes of simulated pairs."""
    folder = tmp_path_factory.mktemp("report")
    simulate(folder / "raw", EPISODES, 7, workers=1)
    root = folder / "table"
    assert convert(["mcap", str(folder / "raw"), "--root", str(root), "--repo-id", "local/table"]) == 0
    return root


@pytest.fixture(scope="module")
def report(dataset) -> Path:
    """The page of the data set, with findings and statistics."""
    (dataset / CHECK_FILE).write_text(json.dumps(FINDINGS))
    (dataset / STATISTICS_FILE).write_text(json.dumps(STATISTICS))
    assert main(["report", str(dataset), "--title", "Simulated <i>pairs</i>"]) == 0
    return dataset / "report.html"


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A headless Chromium with a profile of its own."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    flags = ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"]
    with sync_playwright() as playwright:
        context = playwright.chromium.launch_persistent_context(
            tmp_path_factory.mktemp("profile"), executable_path=CHROMIUM, headless=True, args=flags
        )
        yield context
        context.close()


class Visit:
    """A page with all that it asked for and all that went wrong in it."""

    def __init__(self, browser):
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


@pytest.fixture
def visit(browser):
    visit = Visit(browser)
    yield visit
    assert visit.errors == []
    assert all(url.startswith("file://") for url in visit.requests)
    visit.page.close()


def _picture(page: Page, selector: str) -> bytes:
    """The pixels of a canvas."""
    url = page.eval_on_selector(selector, "canvas => canvas.toDataURL()")
    return base64.b64decode(url.partition(",")[2])


def _column(page: Page, place: int) -> list[str]:
    return page.locator(f"#episode-table tbody tr > :nth-child({place})").all_inner_texts()


def test_the_top_says_that_pairs_are_simulated(visit, report):
    page = visit.open(report)
    assert page.title() == "Simulated <i>pairs</i>"
    assert page.locator("h1").inner_text() == "Simulated <i>pairs</i>"
    note = page.locator("#sources")
    expect(note).to_contain_text("simulated (all episodes): Simulated pairs: no person took part.")
    assert note.bounding_box()["y"] < page.locator("#overview").bounding_box()["y"]
    assert page.locator("#tiles").inner_text().startswith(f"Episodes\n{EPISODES}\n")


def test_filters_choose_episodes_for_the_whole_page(visit, report, dataset):
    page = visit.open(report)
    episodes = DatasetFacts.read(dataset).episodes
    pair = episodes[0]["pair_id"]
    chosen = [episode for episode in episodes if episode["pair_id"] == pair]
    assert 0 < len(chosen) < EPISODES
    page.get_by_role("combobox", name="Pair", exact=True).select_option(pair)
    expect(page.locator("#filter-count")).to_have_text(f"{len(chosen)} of {EPISODES} episodes")
    assert set(_column(page, 2)) == {pair}
    assert page.locator("#pair-table tbody tr").count() == 1
    assert page.locator("#tiles strong").first.inner_text() == str(len(chosen))
    page.get_by_role("searchbox", name="Find").fill(f"#{chosen[0]['episode_index']} {chosen[0]['map_id']}")
    assert _column(page, 1) == [str(chosen[0]["episode_index"])]
    page.get_by_role("searchbox", name="Find").fill("nothing has this name")
    expect(page.locator("#episode-count")).to_have_text("No episode fits what is chosen above.")
    page.get_by_role("button", name="Show all").click()
    expect(page.locator("#filter-count")).to_have_text(f"{EPISODES} of {EPISODES} episodes")


def test_the_table_sorts_and_turns_pages(visit, report, dataset):
    page = visit.open(report)
    heading = page.get_by_role("button", name="Duration, s")
    heading.click()
    durations = [float(text) for text in _column(page, 7)]
    assert durations == sorted(durations)
    assert page.locator("th[aria-sort=ascending]").inner_text().startswith("Duration, s")
    page.get_by_role("button", name="Duration, s").press("Enter")
    falling = [float(text) for text in _column(page, 7)]
    assert falling == sorted(falling, reverse=True)
    assert falling[0] == pytest.approx(max(e["duration_s"] for e in DatasetFacts.read(dataset).episodes), abs=0.05)
    first = set(_column(page, 1))
    page.get_by_role("button", name="Next page").click()
    assert first.isdisjoint(_column(page, 1))
    assert len(first) + page.locator("#episode-table tbody tr").count() == EPISODES


def test_an_episode_plays_by_keyboard_alone(visit, report, dataset):
    page = visit.open(report)
    open_first = page.get_by_role("button", name=re.compile(r"^Open Episode 0,"))
    open_first.focus()
    page.keyboard.press("Enter")
    player = page.get_by_role("dialog")
    expect(player).to_be_visible()
    expect(page.locator("#player-facts")).to_contain_text("simulated pair · pair ")
    frames = DatasetFacts.read(dataset).episodes[0]["length"]
    start = _picture(page, "#stage")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#player-readout")).to_contain_text(f"0.1 of {(frames - 1) / 10:.1f} s")
    page.keyboard.press("Shift+ArrowRight")
    expect(page.locator("#scrub")).to_have_value("11")
    page.keyboard.press("End")
    expect(page.locator("#scrub")).to_have_attribute(
        "aria-valuetext", f"{(frames - 1) / 10:.1f} of {(frames - 1) / 10:.1f} seconds"
    )
    assert _picture(page, "#stage") != start
    page.keyboard.press("Home")
    assert _picture(page, "#stage") == start
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Pause")
    expect(page.locator("#player-readout")).to_contain_text(re.compile(r"^0\.[2-9] of"))
    page.keyboard.press(" ")
    expect(page.locator("#play")).to_have_attribute("aria-label", "Play")
    page.keyboard.press("n")
    expect(page.locator("#player-title")).to_have_text("Episode 1")
    page.keyboard.press("Escape")
    expect(player).to_be_hidden()
    expect(open_first).to_be_focused()


def test_scrubbing_shows_the_recorded_forces(visit, report, dataset):
    page = visit.open(report, fragment="#episode=4")
    expect(page.locator("#player-title")).to_have_text("Episode 4")
    frames = next(frames for frames in read_frames(DatasetFacts.read(dataset)) if frames.index == 4)
    page.locator("#scrub").fill("25")
    robot, human = np.hypot(*frames.actions[25, :2]), np.hypot(*frames.actions[25, 2:])
    expect(page.locator("#player-readout")).to_contain_text(
        f"2.5 of {(len(frames.actions) - 1) / 10:.1f} s · robot seat ▲ {robot:.2f} · human seat ● {human:.2f} · "
        f"interaction {frames.interaction[25]:.2f}"
    )
    graph = page.locator("#graph").bounding_box()
    assert graph is not None
    page.mouse.click(graph["x"] + graph["width"] / 2, graph["y"] + graph["height"] / 2)
    middle = int(page.locator("#scrub").input_value())
    assert middle == pytest.approx((len(frames.actions) - 1) / 2, abs=1)


def test_a_line_of_a_trajectory_opens_its_episode(visit, report, dataset):
    page = visit.open(report)
    facts = DatasetFacts.read(dataset)
    target = next(iter(read_frames(facts)))
    page.get_by_role("searchbox", name="Find").fill(facts.episodes[0]["episode_uuid"])
    canvas = page.locator("#panels canvas").first
    box = canvas.bounding_box()
    assert box is not None
    x, y = target.states[len(target.states) // 2, :2] * box["width"] / 1200
    canvas.click(position={"x": float(x), "y": float(y)})
    expect(page.locator("#player-title")).to_have_text("Episode 0")


def test_findings_and_statistics_are_shown(visit, report):
    page = visit.open(report)
    expect(page.locator("#finding-list")).to_contain_text("37 rules were applied: 1 error, 1 warning, 0 info.")
    expect(page.locator("#finding-list")).to_contain_text("Whole data set: too few <b> (1; limit 5)")
    page.get_by_text("idle · 1").click()
    page.get_by_role("button", name="Episode 3", exact=True).click()
    expect(page.locator("#player-title")).to_have_text("Episode 3")
    page.keyboard.press("Escape")
    rows = page.locator("#statistic-list tbody tr")
    expect(rows.nth(0)).to_contain_text("route entropy")
    expect(rows.nth(0)).to_contain_text("0.8 to 1")
    expect(rows.nth(0)).to_contain_text("0.1 (0 to 0.2), p = 0.01")
    expect(rows.nth(1)).to_contain_text("one split only")


def test_it_fits_a_narrow_screen(visit, report, tmp_path):
    page = visit.open(report, width=360)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    picture = page.screenshot(path=tmp_path / "narrow.png", full_page=True)
    assert len(picture) > 20_000
    page.get_by_role("button", name=re.compile(r"^Open Episode 0,")).click()
    stage = page.locator("#stage").bounding_box()
    assert stage is not None
    assert stage["width"] <= 360
    for control in ("#play", "#scrub", "#player-close"):
        expect(page.locator(control)).to_be_in_viewport()


def test_dark_colours_are_a_choice(visit, report):
    page = visit.open(report)
    page.emulate_media(color_scheme="light")
    light, picture = page.evaluate("getComputedStyle(document.body).backgroundColor"), _picture(page, "#panels canvas")
    for name in ("light", "dark"):
        page.locator("#theme").click()
        expect(page.locator("#theme")).to_have_text(f"Colours: {name}")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != light
    assert _picture(page, "#panels canvas") != picture


def test_every_control_has_a_name(visit, report):
    page = visit.open(report)
    unnamed = page.evaluate(
        """[...document.querySelectorAll("button, input, select, canvas")]
            .filter((node) => !node.getAttribute("aria-label") && !node.labels?.length)
            .filter((node) => node.tagName !== "BUTTON" || !node.textContent.trim())
            .map((node) => node.outerHTML)"""
    )
    assert unnamed == []


def test_names_in_the_data_stay_text(visit, dataset, tmp_path):
    root = Path(shutil.copytree(dataset, tmp_path / "table"))
    (path,) = (root / "meta" / "episodes").glob("*/*.parquet")
    table = parquet.read_table(path)
    names = ["</script><script>document.title='taken'</script>{{style}}"] * EPISODES
    table = table.set_column(table.schema.get_field_index("pair_id"), "pair_id", [names])
    parquet.write_table(table, path)
    assert main(["report", str(root), "--out", str(tmp_path / "page.html"), "--title", "{{data}}"]) == 0
    page = visit.open(tmp_path / "page.html")
    assert page.title() == "{{data}}"
    assert _column(page, 2)[0] == names[0]


def test_what_was_not_run_is_said(visit, dataset, tmp_path, capsys):
    root = Path(
        shutil.copytree(dataset, tmp_path / "table", ignore=shutil.ignore_patterns("copolicy_*.json", "*.html"))
    )
    assert main(["report", str(root), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["findings"] == "copolicy-dataset check was not run"
    assert summary["statistics"] == "copolicy-dataset stats was not run"
    page = visit.open(root / "report.html")
    expect(page.locator("#finding-list")).to_contain_text("copolicy-dataset check was not run on this data set")
    expect(page.locator("#statistic-list")).to_contain_text("copolicy-dataset stats was not run on this data set")


def test_frames_survive_their_packing(dataset):
    facts = DatasetFacts.read(dataset)
    payload = build_payload(facts, "table")
    values = np.frombuffer(base64.b64decode(payload["frames"]), "<i2").reshape(-1, len(FRAME_SCALES))
    table = values / list(FRAME_SCALES.values())
    for row, frames in zip(payload["episodes"], read_frames(facts), strict=True):
        part = table[row["from"] : row["from"] + row["frames"]]
        np.testing.assert_allclose(part[:, :2], frames.states[:, :2], atol=0.0251)
        np.testing.assert_allclose(np.cos(part[:, 2]), frames.states[:, 2], atol=1e-4)
        np.testing.assert_allclose(np.sin(part[:, 2]), frames.states[:, 3], atol=1e-4)
        np.testing.assert_allclose(part[:, 3:7], frames.actions, atol=2e-5)
        np.testing.assert_allclose(part[:, 7], frames.interaction, atol=3e-5)


def test_a_page_of_376_episodes_is_under_10_mb(report, dataset):
    facts = DatasetFacts.read(dataset)
    per_episode = report.stat().st_size / len(facts.episodes)  # style and script are counted in, thirty times over
    assert facts.info["total_frames"] / len(facts.episodes) > 140
    assert 376 * per_episode < 10e6


def test_a_large_data_set_shows_fewer_frames_and_says_so(dataset):
    facts = DatasetFacts.read(dataset)
    limit = facts.info["total_frames"] * len(FRAME_SCALES) - 1  # a byte less than half of what all take
    payload = build_payload(facts, "table", frame_bytes=limit)
    assert payload["frame_step"] == 3
    assert len(base64.b64decode(payload["frames"])) <= limit
    assert [row["frames"] for row in payload["episodes"]] == [-(-e["length"] // 3) for e in facts.episodes]


def test_a_report_is_not_overwritten_unless_asked(dataset, tmp_path, capsys):
    out = tmp_path / "page.html"
    out.write_text("kept")
    assert main(["report", str(dataset), "--out", str(out)]) == 2
    assert out.read_text() == "kept"
    assert main(["report", str(dataset), "--out", str(out), "--overwrite"]) == 0
    assert out.read_text().startswith("<!doctype html>")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_findings_that_are_not_there_are_named(dataset, tmp_path, capsys):
    missing = tmp_path / "check.json"
    assert main(["report", str(dataset), "--out", str(tmp_path / "page.html"), "--findings", str(missing)]) == 2
    expected = f"{missing}: expected a file with the output of `copolicy-dataset check --json`, found none\n"
    assert capsys.readouterr().err == f"copolicy-cards: {expected}"
    missing.write_text("[]")
    assert main(["report", str(dataset), "--out", str(tmp_path / "page.html"), "--findings", str(missing)]) == 2
    assert capsys.readouterr().err == f"copolicy-cards: {missing}: expected a JSON object, found list\n"


def test_frames_that_contradict_the_metadata_are_refused(dataset, tmp_path):
    root = Path(shutil.copytree(dataset, tmp_path / "table"))
    (path,) = (root / "data").glob("*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(table.slice(0, len(table) - 5), path)
    facts = DatasetFacts.read(root)
    last = facts.episodes[-1]["length"]
    with pytest.raises(
        FileFormatError, match=f"expected episode 29 with {last} frames .* found episode 29 with {last - 5}"
    ):
        list(read_frames(facts))
    path.unlink()
    with pytest.raises(FileFormatError, match=r"data: expected the frames of episode 0, found none"):
        list(read_frames(facts))
