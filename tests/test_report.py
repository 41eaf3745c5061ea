"""The page in a browser: overview, filters, table, screens and colours."""

import re
import shutil
from pathlib import Path

import pyarrow.parquet as parquet
import pytest
from playwright.sync_api import expect
from report_page import canvas_pixels, column

from copolicy.cards.cli import main
from copolicy.cards.facts import DatasetFacts

EPISODES = 30


def test_simulated_pairs_are_named_at_the_top(visit, report):
    page = visit.open(report)
    assert page.title() == "Simulated <i>pairs</i>"
    assert page.locator("h1").inner_text() == "Simulated <i>pairs</i>"
    note = page.locator("#sources")
    expect(note).to_contain_text("simulated (all episodes): Simulated pairs: no person took part.")
    assert note.bounding_box()["y"] < page.locator("#overview").bounding_box()["y"]
    assert page.locator("#tiles").inner_text().startswith(f"Episodes\n{EPISODES}\n")


def test_filters_choose_episodes_for_the_whole_page(visit, report, report_set):
    page = visit.open(report)
    episodes = DatasetFacts.read(report_set).episodes
    pair = episodes[0]["pair_id"]
    selected = [episode for episode in episodes if episode["pair_id"] == pair]
    assert 0 < len(selected) < EPISODES
    page.get_by_role("combobox", name="Pair", exact=True).select_option(pair)
    expect(page.locator("#filter-count")).to_have_text(f"{len(selected)} of {EPISODES} episodes")
    assert set(column(page, 2)) == {pair}
    assert page.locator("#pair-table tbody tr").count() == 1
    assert page.locator("#tiles strong").first.inner_text() == str(len(selected))
    page.get_by_role("searchbox", name="Find").fill(f"#{selected[0]['episode_index']} {selected[0]['map_id']}")
    assert column(page, 1) == [str(selected[0]["episode_index"])]
    page.get_by_role("searchbox", name="Find").fill("nothing has this name")
    expect(page.locator("#episode-count")).to_have_text("No episode matches the filters above.")
    page.get_by_role("button", name="Show all").click()
    expect(page.locator("#filter-count")).to_have_text(f"{EPISODES} of {EPISODES} episodes")


def test_the_table_sorts_and_turns_pages(visit, report, report_set):
    page = visit.open(report)
    heading = page.get_by_role("button", name="Duration, s")
    heading.click()
    durations = [float(text) for text in column(page, 7)]
    assert durations == sorted(durations)
    assert page.locator("th[aria-sort=ascending]").inner_text().startswith("Duration, s")
    page.get_by_role("button", name="Duration, s").press("Enter")
    falling = [float(text) for text in column(page, 7)]
    assert falling == sorted(falling, reverse=True)
    assert falling[0] == pytest.approx(max(e["duration_s"] for e in DatasetFacts.read(report_set).episodes), abs=0.05)
    first = set(column(page, 1))
    page.get_by_role("button", name="Next page").click()
    assert first.isdisjoint(column(page, 1))
    assert len(first) + page.locator("#episode-table tbody tr").count() == EPISODES


def test_it_fits_a_narrow_screen(visit, report, tmp_path):
    page = visit.open(report, width=360)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    screenshot = page.screenshot(path=tmp_path / "narrow.png", full_page=True)
    assert len(screenshot) > 20_000
    page.get_by_role("button", name=re.compile(r"^Open Episode 0,")).click()
    stage = page.locator("#stage").bounding_box()
    assert stage is not None
    assert stage["width"] <= 360
    for control in ("#play", "#scrub", "#player-close"):
        expect(page.locator(control)).to_be_in_viewport()


def test_dark_colours_are_a_choice(visit, report):
    page = visit.open(report)
    page.emulate_media(color_scheme="light")
    light, panel = (
        page.evaluate("getComputedStyle(document.body).backgroundColor"),
        canvas_pixels(page, "#panels canvas"),
    )
    for name in ("light", "dark"):
        page.locator("#theme").click()
        expect(page.locator("#theme")).to_have_text(f"Colours: {name}")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != light
    assert canvas_pixels(page, "#panels canvas") != panel


def test_every_control_has_a_name(visit, report):
    page = visit.open(report)
    unnamed = page.evaluate(
        """[...document.querySelectorAll("button, input, select, canvas")]
            .filter((node) => !node.getAttribute("aria-label") && !node.labels?.length)
            .filter((node) => node.tagName !== "BUTTON" || !node.textContent.trim())
            .map((node) => node.outerHTML)"""
    )
    assert unnamed == []


def test_names_in_the_data_stay_text(visit, report_set, tmp_path):
    root = Path(shutil.copytree(report_set, tmp_path / "table"))
    (path,) = (root / "meta" / "episodes").glob("*/*.parquet")
    table = parquet.read_table(path)
    names = ["</script><script>document.title='taken'</script>{{style}}"] * EPISODES
    table = table.set_column(table.schema.get_field_index("pair_id"), "pair_id", [names])
    parquet.write_table(table, path)
    assert main(["report", str(root), "--out", str(tmp_path / "page.html"), "--title", "{{data}}"]) == 0
    page = visit.open(tmp_path / "page.html")
    assert page.title() == "{{data}}"
    assert column(page, 2)[0] == names[0]
