"""Cards and the report on data and policies of a second task: its names and units, and no word of the table task."""

import hashlib
import json
import re
from pathlib import Path

import numpy as np
import pytest
from peg_data import convert_pegs, record_pegs
from playwright.sync_api import expect

from copolicy.cards.cli import main
from copolicy.cards.facts import DatasetFacts
from copolicy.cards.report.payload import build_payload
from copolicy.dataset.outline_figure import label_colours

OF_THE_TABLE = re.compile(r"\b(tables?|px|carr(y|ies|ying|ied)|maps?|routes?|obstacles?|goal|pilots?)\b", re.IGNORECASE)


@pytest.fixture
def peg_set(peg, tmp_path) -> Path:
    return convert_pegs(record_pegs(tmp_path / "recordings"), tmp_path / "set")


def card_of(root: Path) -> str:
    assert main(["dataset", str(root), "--repo-id", "lab/peg", "--croissant"]) == 0
    return (root / "README.md").read_text(encoding="utf-8")


def test_a_card_speaks_of_its_own_task(peg_set, capsys):
    card = card_of(peg_set)
    assert OF_THE_TABLE.findall(card) == []
    for text in (
        "Two players, one task (Push the peg to the mark together): states and the joint action of both",
        "State: position (m), velocity (m/s). Scenario: start (m), mark (m).",
        "| `action` | float32 | 2 | robot_push, human_push |",
        "| right | 3 | 4 | 4 of 4 (100.0 %) |",
        "Left out: the task 'peg' has no strategy labels.",
        "from a recording at 20 Hz",
    ):
        assert text in card
    assert [path.name for path in (peg_set / "figures").iterdir()] == ["trajectories.png"]
    metadata = json.loads((peg_set / "meta/croissant.json").read_text(encoding="utf-8"))
    assert metadata["description"] == "4 episodes of two players at the task 'peg'; source: simulated."
    assert "citeAs" not in metadata


def test_statistics_that_the_task_lacks_are_named_with_the_reason(peg_set, capsys):
    from copolicy.dataset.cli import main as dataset

    assert dataset(["stats", str(peg_set)]) == 0
    card = card_of(peg_set)
    assert "routes: route entropy" not in "".join(line for line in card.splitlines() if line.startswith("|"))
    assert ": left out: the task 'peg' has no strategy labels" in card
    assert "| leadership: leadership share |" in card


def test_a_task_without_an_outline_has_no_figures(peg, peg_set, monkeypatch, capsys):
    monkeypatch.setattr(type(peg), "outline", None)
    assert "Figures of paths: left out: the task 'peg' has no outline." in card_of(peg_set)
    assert not (peg_set / "figures").exists()
    payload = build_payload(DatasetFacts.read(peg_set), "peg")
    assert (payload["outline"], payload["scales"], payload["frames"]) == (None, {}, "")
    assert payload["left_out"]["outline"] == "Left out: the task 'peg' has no outline."


def test_the_page_draws_the_outline_and_leaves_out_missing_parts(peg_set, visit, tmp_path, capsys):
    out = tmp_path / "page.html"
    assert main(["report", str(peg_set), "--out", str(out)]) == 0
    page = visit.open(out)
    text = page.locator("body").inner_text()
    table_words = {match[0].lower() for match in OF_THE_TABLE.findall(text.replace("Heat maps", ""))}
    assert table_words <= {"obstacles", "obstacle"}  # panels are by sets of obstacles, whatever the task
    for part in ("strategy labels", "interaction measure", "tracked point"):
        assert f"Left out: the task 'peg' has no {part}." in text
    assert [head.inner_text() for head in page.locator("#pair-table th[scope=col]").all()] == [
        "Pair", "Source", "Episodes", "Success", "Duration, s",
    ]  # fmt: skip
    assert page.locator("#heat-cell").inner_text().split() == ["0.0333", "0.05", "0.1"]
    page.get_by_role("button", name="Open Episode 0").click()
    expect(page.locator("#player-readout")).to_contain_text(
        re.compile(r"robot seat [01]\.\d\d · human seat [01]\.\d\d$")
    )
    assert "interaction" not in page.locator("#player-readout").inner_text()


def test_a_page_without_an_outline_opens_no_player(peg, peg_set, visit, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(type(peg), "outline", None)
    out = tmp_path / "page.html"
    assert main(["report", str(peg_set), "--out", str(out)]) == 0
    page = visit.open(out)
    reason = "Left out: the task 'peg' has no outline."
    expect(page.locator("#trajectory-figures")).to_have_text(reason)
    expect(page.locator("#heat-figures")).to_have_text(reason)
    page.get_by_role("button", name="Open Episode 0").click()
    expect(page.locator("#player")).to_be_hidden()


def test_an_interaction_measure_of_any_size_survives_its_packing(peg, peg_set, monkeypatch):
    monkeypatch.setattr(type(peg), "interaction", lambda _, states, actions: 300.0 * actions[:, 0])
    payload = build_payload(DatasetFacts.read(peg_set), "peg")
    assert "interaction" not in payload["left_out"]
    assert payload["scales"]["interaction"] == pytest.approx(32_767 / 300, rel=1e-3)
    assert 0 < payload["episodes"][0]["force_mean"] <= 300


def test_labels_of_any_kind_have_colours():
    sides = label_colours(["LL", "LR", "RL", "RR", ""])
    assert len(set(sides.values())) == 5
    assert sides["LL"] == label_colours(["L"])["L"]
    assert len(set(label_colours(["fast", "slow", "Left", ""]).values())) == 4


def test_a_model_card_speaks_of_the_task_of_its_policy(peg, tmp_path, capsys):
    folder = tmp_path / "policy"
    folder.mkdir()
    (folder / "model.safetensors").write_bytes(b"weights")
    config = {"type": "copolicy", "task": "peg", "n_obs_steps": 3, "horizon": 12, "n_action_steps": 8}
    (folder / "config.json").write_text(json.dumps(config), encoding="utf-8")
    result = {
        "study": "coplan", "label": "co-planning in simulation",
        "policy": {"weights_sha256": hashlib.sha256(b"weights").hexdigest()},
        "settings": {"maps": "right", "map_count": 3, "seed": 0},
        "summary": {
            "success": {"mean": 1.0, "standard_error": 0.0, "wilson_95": [0.4, 1.0], "episodes": 3},
            "interaction_force": None,
        },
    }  # fmt: skip
    (tmp_path / "eval.json").write_text(json.dumps(result), encoding="utf-8")
    assert main(["model", str(folder), "--eval", str(tmp_path / "eval.json")]) == 0
    card = (folder / "README.md").read_text(encoding="utf-8")
    assert OF_THE_TABLE.findall(re.sub(r"```.*?```", "", card, flags=re.DOTALL)) == []  # but for flags of commands
    assert "acts together with a partner, in simulation: it predicts the next actions of both players" in card
    assert "Left out: the task 'peg' has no interaction measure." in card
    assert "pushing a peg, coplan (simulation)" in card
    assert "| study | scenarios | sampler |" in card


def test_paths_are_those_of_the_outline(peg, peg_set):
    payload = build_payload(DatasetFacts.read(peg_set), "peg")
    assert payload["scales"]["x"] == pytest.approx(12_000)
    assert payload["outline"]["size"] == (2.0, 0.4)
    marks = {peg.identify(line)[0]: line.mark for line in peg.scenario_sets["right"]}
    for row in payload["episodes"]:
        (goal,) = payload["scenes"][row["scene"]]["shapes"]
        assert goal["role"] == "goal"
        assert np.allclose(goal["corners"][0], (marks[row["map_id"]] + 0.98, 0.18))
