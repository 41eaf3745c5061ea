"""Findings and statistics on the page: shown, missing, or about other data than these."""

import json
import shutil
from pathlib import Path

import pytest
from playwright.sync_api import expect
from report_page import route_document

from copolicy.cards.cli import main
from copolicy.dataset.checks.limits import RULES_VERSION
from copolicy.dataset.cli import main as dataset_command
from copolicy.dataset.files.meta_files import CHECK_FILE, STATISTICS_FILE

EPISODES = 5


def test_findings_and_statistics_are_shown(visit, report):
    page = visit.open(report)
    expect(page.locator("#finding-list")).to_contain_text("37 rules were applied: 1 error, 1 warning, 0 info.")
    expect(page.locator("#finding-list")).to_contain_text("Whole data set: too few <b> (1; limit 5)")
    expect(page.locator("#finding-list")).to_contain_text("These findings may be stale. They do not say which content")
    page.get_by_text("idle · 1").click()
    page.get_by_role("button", name="Episode 3", exact=True).click()
    expect(page.locator("#player-title")).to_have_text("Episode 3")
    page.keyboard.press("Escape")
    rows = page.locator("#statistic-list tbody tr")
    expect(rows.nth(0)).to_contain_text("route entropy")
    expect(rows.nth(0)).to_contain_text("0.8 to 1")
    expect(rows.nth(0)).to_contain_text("0.1 (0 to 0.2), p = 0.01")
    expect(rows.nth(1)).to_contain_text("one split only")


def test_commands_that_were_not_run_are_stated(visit, report_set, tmp_path, capsys):
    root = Path(
        shutil.copytree(report_set, tmp_path / "table", ignore=shutil.ignore_patterns("copolicy_*.json", "*.html"))
    )
    assert main(["report", str(root), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["findings"] == "copolicy-dataset check was not run"
    assert summary["statistics"] == "copolicy-dataset stats was not run"
    page = visit.open(root / "report.html")
    expect(page.locator("#finding-list")).to_contain_text("There are no stored findings of copolicy-dataset check")
    for selector in ("#statistic-list", "#route-statistics"):
        expect(page.locator(selector)).to_contain_text("copolicy-dataset stats was not run on this data set")


def test_routes_are_shown_with_human_routes(visit, report_set, tmp_path):
    root = Path(shutil.copytree(report_set, tmp_path / "table"))
    document = route_document(["LL", "LR", "RR", "RL"] * 10, EPISODES)
    (root / STATISTICS_FILE).write_text(json.dumps(document), encoding="utf-8")
    assert main(["report", str(root), "--overwrite"]) == 0
    routes = document["statistics"]["routes"]
    page = visit.open(root / "report.html", width=375)
    section = page.locator("#route-mix")
    expect(section).to_contain_text("The episodes were played by simulated pairs.")
    expect(section).not_to_contain_text("stale")
    figures = section.locator("figure")
    assert figures.count() == 3
    expect(figures.nth(0)).to_contain_text("1 obstacle: fewer than 5 episodes with 1 obstacle(s) and a route")
    distance = routes["human_distance_2_obstacles"]
    low, high = distance["interval"]
    expect(figures.nth(1)).to_contain_text(f"2 obstacles: {distance['value']:.3f} bits ({low:.3f} to {high:.3f})")
    expect(figures.nth(1)).to_contain_text("40 episodes of simulated pairs, 171 human demonstrations.")
    label = figures.nth(1).locator("svg").get_attribute("aria-label")
    assert label is not None
    human = distance["details"]["human"]["counts"]
    human_label = "RL" if distance["details"]["reading"] == "as labelled" else "LR"
    assert f"RL 10 in this data set, {human[human_label]} of people" in label

    ((name, entry),) = routes["route_entropy"]["details"]["configurations"].items()
    cells = section.locator("#configuration-table tbody tr").first.locator("th, td").all_inner_texts()
    assert cells[:2] == [name, "40"]
    assert "LL 10 · LR 10 · RL 10 · RR 10" in cells[2]
    assert cells[3].strip() == f"{entry['entropy_bits']:.3g}"
    assert [float(text) for text in cells[4].split(" to ")] == pytest.approx(entry["interval"], rel=0.01)
    assert float(cells[5]) == pytest.approx(entry["effective_modes"], rel=0.01)
    assert [float(text) for text in cells[6].split(" to ")] == pytest.approx(
        entry["effective_modes_interval"], rel=0.01
    )

    # A narrow screen holds it all, and the keyboard reaches the definitions and the rows.
    assert page.evaluate("document.documentElement.scrollWidth") == 375
    opened = section.locator("details[open]")
    assert opened.count() == 0
    section.locator("summary").nth(1).focus()
    page.keyboard.press("Enter")
    expect(opened).to_contain_text("H(route | configuration): the entropy of the route classes")
    page.keyboard.press("Tab")
    expect(section.get_by_role("region", name="Entropy of the routes in each configuration")).to_be_focused()


def test_statistics_of_other_episodes_are_called_stale(visit, report_set, tmp_path):
    root = Path(shutil.copytree(report_set, tmp_path / "table"))
    (root / STATISTICS_FILE).write_text(json.dumps(route_document(["RL"] * 6, EPISODES - 1)), encoding="utf-8")
    assert main(["report", str(root), "--overwrite"]) == 0
    page = visit.open(root / "report.html")
    note = f"These statistics are stale. They were computed when the data set had {EPISODES - 1} episodes; it has"
    for selector in ("#route-statistics", "#statistic-list"):
        expect(page.locator(selector)).to_contain_text(note)


def test_findings_about_another_content_are_called_stale(visit, report_set, tmp_path, capsys):
    root = Path(shutil.copytree(report_set, tmp_path / "table", ignore=shutil.ignore_patterns("copolicy_*.json")))
    assert dataset_command(["check", str(root), "--json"]) == 0
    date = json.loads((root / CHECK_FILE).read_text(encoding="utf-8"))["date"][:10]
    capsys.readouterr()
    assert main(["report", str(root), "--json", "--overwrite"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == "shown"
    page = visit.open(root / "report.html")
    expect(page.locator("#finding-list")).to_contain_text(f"Checked on {date} by version {RULES_VERSION} of the rules.")
    expect(page.locator("#finding-list")).not_to_contain_text("stale")
    assert dataset_command(["exclude", str(root), "--episode-ids", "0", "--reason", "a test"]) == 0
    capsys.readouterr()
    assert main(["report", str(root), "--json", "--overwrite"]) == 0
    reason = "The content of the data set changed since it was checked."
    assert json.loads(capsys.readouterr().out)["findings"] == f"shown as stale: {reason}"
    page.reload()
    expect(page.locator("#finding-list")).to_contain_text(f"These findings are stale. {reason}")
