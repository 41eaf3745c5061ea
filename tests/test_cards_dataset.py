import json
import shutil
from pathlib import Path

import pyarrow.parquet as parquet
import pytest
import yaml
from huggingface_hub import DatasetCard
from report_page import route_document

from copolicy.cards.cli import main
from copolicy.cards.dataset_card import render_dataset_card
from copolicy.cards.facts import DatasetFacts
from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert
from copolicy.dataset.checks.limits import RULES_VERSION
from copolicy.dataset.cli import main as dataset_command
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.files.meta_files import WITHDRAWALS_FILE
from copolicy.dataset.publication.minimal_card import is_minimal_card
from copolicy.dataset.versions.withdrawals import withdrawals_text


@pytest.fixture(scope="module")
def converted(tmp_path_factory, upstream) -> Path:
    """The original program's raw example episodes as a LeRobot data set."""
    root = tmp_path_factory.mktemp("cards") / "table"
    raw = str(upstream / "examples_scripted" / "raw")
    assert convert(["upstream", raw, "--out", str(root), "--repo-id", "local/table", "--license", "cc-by-4.0"]) == 0
    return root


@pytest.fixture
def dataset(converted, tmp_path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(converted, tmp_path / "table"))


def _set_column(root: Path, column: str, values: list) -> None:
    (path,) = (root / "meta" / "episodes").glob("*/*.parquet")
    table = parquet.read_table(path)
    index = table.schema.get_field_index(column)
    parquet.write_table(table.set_column(index, column, [values]), path)


def test_a_card_states_what_the_metadata_holds(dataset):
    assert main(["dataset", str(dataset), "--repo-id", "lab/table"]) == 0
    card = DatasetCard.load(dataset / "README.md")
    metadata = yaml.safe_load(card.content.split("---")[1])
    assert metadata["license"] == "cc-by-4.0"
    assert metadata["task_categories"] == ["robotics"]
    assert metadata["size_categories"] == ["n<1K"]
    assert metadata["configs"] == [
        {"config_name": "default", "data_files": "data/*/*.parquet"},
        {"config_name": "episodes", "data_files": "meta/episodes/*/*.parquet"},
    ]
    assert {"LeRobot", "upstream"} <= set(metadata["tags"])
    info = json.loads((dataset / "meta" / "info.json").read_text(encoding="utf-8"))
    text = card.text
    assert f"| episodes | {info['total_episodes']} |" in text
    assert f"| frames | {info['total_frames']:,} |" in text
    assert "| reached the goal | 5 of 6 (83.3 %) |" in text
    assert "| collision_obstacle | 1 of 6 (16.7 %) |" in text
    assert "Those files do not state who or what played." in text
    assert "No person took part" not in text
    assert 'LeRobotDataset("lab/table")' in text
    assert "| `observation.human_action` | float32 | 2 | human_fx, human_fy |" in text


def test_a_card_is_a_datasheet_with_figures(dataset):
    assert main(["dataset", str(dataset), "--repo-id", "lab/table"]) == 0
    text = (dataset / "README.md").read_text(encoding="utf-8")
    headings = [line[3:] for line in text.splitlines() if line.startswith("## ")]
    assert headings[5:] == [
        "Motivation", "Composition", "Collection: who played, and how it was recorded", "Preprocessing", "Uses",
        "Distribution and licence", "Maintenance", "Consent and withdrawal", "Citation",
    ]  # fmt: skip
    assert "No episode is marked as played by people, so no consent is stated." in text
    assert "- Converted by `copolicy-convert upstream` " in text
    assert "- Downsampling: the mean of the recorded actions until the next frame" in text
    assert "eprint  = {2305.12171}" in text
    for name in ("trajectories", "routes"):
        assert f"](figures/{name}.png)" in text
        assert (dataset / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert len(list((dataset / "figures").iterdir())) == 2


def test_the_datasheet_names_the_command_that_withdraws(dataset):
    _set_column(dataset, "source", ["human"] * len(DatasetFacts.read(dataset).episodes))
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "copolicy-dataset withdraw CONSENT_ID PATH... --yes" in text
    assert "Withdrawn so far" not in text
    entries = [{"date": "2026-03-01", "episodes": 2}, {"date": "2026-04-01", "episodes": 1}]
    (dataset / WITHDRAWALS_FILE).write_text(withdrawals_text(entries), encoding="utf-8")
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "Withdrawn so far: 3 episodes, which are in no file of this version." in text


def test_figures_can_be_left_out(dataset):
    assert main(["dataset", str(dataset), "--no-figures"]) == 0
    assert "](figures/" not in (dataset / "README.md").read_text(encoding="utf-8")
    assert not (dataset / "figures").exists()


def test_names_of_numbers_may_be_anything(dataset):
    path = dataset / "meta" / "info.json"
    info = json.loads(path.read_text(encoding="utf-8"))
    info["features"]["action"]["names"] = ["robot_x", None, 3, "human_y"]
    path.write_text(json.dumps(info), encoding="utf-8")
    assert main(["dataset", str(dataset), "--repo-id", "lab/table", "--no-figures", "--croissant"]) == 0
    assert "robot_x, None, 3, human_y" in (dataset / "README.md").read_text(encoding="utf-8")


def test_statistics_come_with_their_interval_and_their_null(dataset):
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "Not computed: `copolicy-dataset stats` was not run on this data set." in text
    stored = {
        "version": 1,
        "statistics": {
            "route_entropy": {
                "one obstacle": {
                    "value": 0.98765, "unit": "bits", "interval": [0.8, 1], "episodes": 6, "definition": "of | routes",
                    "null": {"mean": 0.1, "low": 0.0, "high": 0.25, "p": 0.01}, "details": {"value": 1, "unit": "no"},
                },
                "two": {"value": None, "unit": "bits", "interval": None, "episodes": 0, "note": "too few",
                        "definition": "of routes"},
            }
        },
    }  # fmt: skip
    (dataset / "meta" / "copolicy_stats.json").write_text(json.dumps(stored), encoding="utf-8")
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "| route entropy: one obstacle | 0.9877 | bits | 0.8 to 1 | 0.1 (0 to 0.25) | 6 |" in text
    assert "| route entropy: two | - | bits | - | - | 0 |" in text
    assert "- **route entropy: two**: of routes (too few)" in text
    (dataset / "meta" / "copolicy_stats.json").write_text("{", encoding="utf-8")
    with pytest.raises(
        FileFormatError, match=r"copolicy_stats.json: expected statistics of copolicy-dataset stats, found invalid JSON"
    ):
        render_dataset_card(DatasetFacts.read(dataset), "lab/table")


def test_findings_are_counted_and_dated(dataset):
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "## Checks\n\nNot checked: `copolicy-dataset check` was not run on this data set." in text
    assert dataset_command(["check", str(dataset)]) == 0
    stored = json.loads((dataset / "meta" / "copolicy_check.json").read_text(encoding="utf-8"))
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    counts = f"0 errors, {stored['counts']['warning']} warnings, {stored['counts']['info']} remarks."
    date = stored["date"][:10]
    assert f"Checked on {date} by version {RULES_VERSION} of the rules (`meta/copolicy_check.json`): {counts}" in text
    assert "| severity | rule | findings | first finding |" in text
    assert "**Stale.**" not in text
    _set_column(dataset, "discarded", [True] * 6)
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "## Checks\n\n**Stale.** The content of the data set changed since it was checked.\n\nChecked on" in text
    # What `check --json > meta/copolicy_check.json` kept before it named the content.
    entry = {"episode": "2", "rule": "idle_run", "figure": 5.25, "limit": 5, "severity": "warning", "message": "a|b"}
    old = {"rules": 37, "findings": [entry, {**entry, "episode": "", "figure": None}]}
    (dataset / "meta" / "copolicy_check.json").write_text(json.dumps(old), encoding="utf-8")
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "**Unknown.** They do not say which content was checked: the data may have changed since." in text
    assert "Checked (`meta/copolicy_check.json`): 0 errors, 2 warnings, 0 remarks." in text
    assert "| warning | idle run | 2 | episode 2: a\\|b (5.25; limit 5) |" in text


def test_routes_are_compared_with_human_routes(dataset):
    _set_column(dataset, "source", ["simulated"] * 6)
    document = route_document(["LL", "LR", "RR", "RL"] * 10, 6)
    (dataset / "meta" / "copolicy_stats.json").write_text(json.dumps(document), encoding="utf-8")
    assert main(["dataset", str(dataset), "--repo-id", "lab/table"]) == 0
    text = (dataset / "README.md").read_text(encoding="utf-8")
    assert (dataset / "figures" / "human_routes.png").read_bytes().startswith(b"\x89PNG")
    routes = document["statistics"]["routes"]
    distance = routes["human_distance_2_obstacles"]
    low, high = distance["interval"]
    caption = f"2 obstacles: {distance['value']:.3f} bits (95 % interval {low:.3f} to {high:.3f})."
    assert "*Routes of this data set (simulated pairs) and of human-human demonstrations" in text
    assert caption in text
    ((name, entry),) = routes["route_entropy"]["details"]["configurations"].items()
    assert "<details><summary>Routes of simulated pairs in each of 1 configurations</summary>" in text
    row = next(line for line in text.splitlines() if line.startswith(f"| {name} | 40 |"))
    bits = " to ".join(f"{bound:.4g}" for bound in entry["interval"])
    assert f"| {entry['entropy_bits']:.4g} | {bits} | {entry['effective_modes']:.4g} |" in row
    assert "by version 2.0.0 of the definitions" in text
    assert "**Stale.**" not in text.partition("## Multimodality")[2].partition("## Checks")[0]
    document["dataset"]["episodes"] = 7
    (dataset / "meta" / "copolicy_stats.json").write_text(json.dumps(document), encoding="utf-8")
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "**Stale.** They were computed when the data set had 7 episodes; it has 6 now." in text


def test_a_release_is_named(dataset):
    release = {"version": "1.2.0", "date": "2026-01-02", "content_hash": "abc"}
    (dataset / "meta" / "copolicy_release.json").write_text(json.dumps(release), encoding="utf-8")
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert 'LeRobotDataset("lab/table", revision="data-1.2.0")' in text
    assert "- Version 1.2.0 of 2026-01-02; changes are in `CHANGELOG.md`." in text


def test_simulated_episodes_are_called_that(dataset):
    _set_column(dataset, "source", ["simulated"] * 6)
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "**No person took part.**" in text
    assert "simulated" in yaml.safe_load(text.split("---")[1])["tags"]


def test_a_mixture_names_each_source(dataset):
    _set_column(dataset, "source", ["simulated"] * 2 + ["human"] * 4)
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "human (4), simulated (2)" in text
    assert "Consent: 0 of 4 (0.0 %) episodes played by people state the identifier of a consent record" in text


@pytest.mark.parametrize(
    ("licences", "expected"),
    [(["", *["mit"] * 5], "unknown"), (["cc0-1.0", *["mit"] * 5], "other"), (["MIT"] * 6, "mit")],
)
def test_the_licence_follows_from_the_episodes(dataset, licences, expected):
    _set_column(dataset, "license", licences)
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert yaml.safe_load(text.split("---")[1])["license"] == expected


def test_what_is_no_licence_identifier_is_refused(dataset):
    _set_column(dataset, "license", ["free for all"] * 6)
    with pytest.raises(InvalidValueError, match=r"license: expected a licence identifier of the Hub such as "):
        render_dataset_card(DatasetFacts.read(dataset), "lab/table")


def test_a_card_is_overwritten_on_request_only(dataset, capsys):
    (dataset / "README.md").write_text("written by hand", encoding="utf-8")
    assert main(["dataset", str(dataset)]) == 2
    assert "nothing was overwritten" in capsys.readouterr().err
    assert (dataset / "README.md").read_text(encoding="utf-8") == "written by hand"
    assert main(["dataset", str(dataset), "--overwrite"]) == 0
    assert (dataset / "README.md").read_text(encoding="utf-8").startswith("---\n")
    assert not list(dataset.glob("*.part"))


def test_a_folder_that_is_no_data_set_is_named(tmp_path, capsys):
    assert main(["dataset", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"copolicy-cards: {tmp_path}: expected a LeRobot v3 data set with meta/info.json, found an empty folder\n"
    )


def test_a_data_set_that_contradicts_itself_is_refused(dataset):
    path = dataset / "meta" / "info.json"
    path.write_text(
        path.read_text(encoding="utf-8").replace('"total_episodes": 6', '"total_episodes": 7'), encoding="utf-8"
    )
    with pytest.raises(FileFormatError, match=r"expected 7 episodes with .* found 6 episodes"):
        DatasetFacts.read(dataset)


def test_a_truncated_parquet_file_is_named(dataset):
    (path,) = (dataset / "meta" / "episodes").glob("*/*.parquet")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(FileFormatError, match=r"file-000.parquet: expected a complete Parquet file, found"):
        DatasetFacts.read(dataset)


def test_a_name_that_the_hub_would_refuse_is_refused(dataset, capsys):
    assert main(["dataset", str(dataset), "--repo-id", "table"]) == 2
    assert "--repo-id: expected USER/NAME" in capsys.readouterr().err
    assert is_minimal_card(dataset / "README.md")


def test_excluded_episodes_are_listed(dataset):
    assert "## Excluded episodes" not in render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert dataset_command(["exclude", str(dataset), "--episode-ids", "1", "3", "--reason", "stick unplugged"]) == 0
    text = render_dataset_card(DatasetFacts.read(dataset), "lab/table")
    assert "2 of 6 episodes are stored but marked as excluded" in text
    assert "| 3 | stick unplugged |" in text
    assert "lerobot-train --dataset.repo_id=lab/table --dataset.episodes='[0,2,4,5]'" in text
    assert "its trainer and loader use every episode unless a list is given" in text


def test_statistics_of_many_episodes_of_one_map_are_described(tmp_path, capsys):
    # Path modes and dips are then counted in the configuration, which few episodes leave out.
    lab, recordings, root = tmp_path / "one.yaml", tmp_path / "recordings", tmp_path / "set"
    assert collect(["maps", "make", "--count", "1", "--bounds", "obstacles=1", "--seed", "1", "--out", str(lab)]) == 0
    simulate = ["simulate", "--maps", str(lab), "--episodes", "10", "--seed", "1", "--out", str(recordings)]
    assert collect([*simulate, "--workers", "1"]) == 0
    assert convert(["mcap", str(recordings), "--out", str(root), "--repo-id", "lab/one", "--license", "cc0-1.0"]) == 0
    assert dataset_command(["stats", str(root)]) == 0
    stored = json.loads((root / "meta" / "copolicy_stats.json").read_text(encoding="utf-8"))["statistics"]
    estimates = [estimate for family in stored.values() for estimate in family.values()]
    all_details = [estimate.get("details", {}) for estimate in estimates]
    details = [entry for detail in all_details for entry in detail.get("configurations", {}).values()]
    assert any("counts" in entry for entry in details)
    assert any("counts" not in entry for entry in details)
    capsys.readouterr()
    assert main(["dataset", str(root), "--repo-id", "lab/one", "--overwrite"]) == 0, capsys.readouterr().err
    assert main(["report", str(root), "--out", str(tmp_path / "page.html")]) == 0, capsys.readouterr().err
    assert "H(route" in (root / "README.md").read_text(encoding="utf-8")
