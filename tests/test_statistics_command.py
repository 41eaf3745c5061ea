import contextlib
import io
import json

import numpy as np
import pyarrow.parquet as parquet
import pytest
from constructed_pairs import FREE, TWO, carried_set, row, still, trajectories, write_folder

from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main
from copolicy.dataset.command_line.commands import _lines
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.files.meta_files import STATISTICS_FILE
from copolicy.dataset.statistics.command import summary
from copolicy.dataset.statistics.reading import read_trajectories
from copolicy.tasks.table.routes import route_class

FAMILIES = [
    "routes", "paths", "actions", "visitation", "leadership", "forces", "activity", "smoothness", "distances", "pairs",
]  # fmt: skip


@pytest.fixture(scope="module")
def constructed():
    rng = np.random.default_rng(0)
    return carried_set(["LL", "LR", "RR", "RL"] * 10, TWO, rng)


@pytest.fixture
def folder(constructed, tmp_path):
    return write_folder(constructed, tmp_path / "table")


@pytest.fixture(scope="module")
def described(constructed, tmp_path_factory):
    """That data set with its statistics in it, and what the command printed."""
    folder = write_folder(constructed, tmp_path_factory.mktemp("described") / "table")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        assert main(["stats", str(folder)]) == 0
    return folder, printed.getvalue()


def test_statistics_lie_in_the_data_set_and_are_the_same_the_next_time(described, capsys):
    folder, text = described
    first = (folder / STATISTICS_FILE).read_bytes()
    assert main(["stats", str(folder), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (folder / STATISTICS_FILE).read_bytes() == first
    assert not list((folder / "meta").glob(".*"))
    document = json.loads(first)
    assert printed == {"written": str(folder / STATISTICS_FILE), **document}
    assert document["definition_version"] == "2.0.0"
    assert document["settings"]["seed"] == 0
    assert document["dataset"]["source_labels"] == {"simulated": "scripted pairs, no person took part"}
    assert list(document["statistics"]) == FAMILIES
    assert "simulated (40): scripted pairs, no person took part" in text
    assert "route_entropy_pooled_2_obstacles  1.7" in text
    assert document["statistics"]["routes"]["route_entropy"]["value"] == pytest.approx(2.0, abs=0.01)
    assert document["statistics"]["paths"]["path_modes"]["value"] == 4


def test_every_statistic_has_unit_definition_interval_or_a_reason(described):
    document = json.loads((described[0] / STATISTICS_FILE).read_text(encoding="utf-8"))
    for family, estimates in document["statistics"].items():
        for name, entry in estimates.items():
            assert entry["unit"], name
            assert len(entry["definition"]) > 40, name
            if entry["value"] is None:
                assert entry["note"], f"{family} {name}"
            elif name != "route_class":  # a count
                low, high = entry["interval"]
                assert low <= entry["value"] <= high, name
                assert entry["resampled"], name


def test_another_seed_moves_the_draws_and_not_the_values(folder, described, tmp_path):
    path = tmp_path / "1.json"
    assert main(["stats", str(folder), "--seed", "1", "--out", str(path)]) == 0
    files = described[0] / STATISTICS_FILE, path
    one, other = (json.loads(file.read_text(encoding="utf-8"))["statistics"] for file in files)
    assert one["forces"]["conflict_fraction"]["value"] == other["forces"]["conflict_fraction"]["value"]
    assert one["forces"]["conflict_fraction"]["null"] != other["forces"]["conflict_fraction"]["null"]
    assert not (folder / STATISTICS_FILE).exists()


def test_a_target_that_is_a_folder_is_refused_before_the_work(folder, tmp_path, capsys):
    assert main(["stats", str(folder), "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"copolicy-dataset: {tmp_path}: expected a file to write, found a folder\n"


def test_discarded_episodes_and_other_sources_do_not_count(constructed, tmp_path):
    discarded = [index < 5 for index in range(40)]
    sources = ["human" if index >= 30 else "simulated" for index in range(40)]
    root = write_folder(constructed, tmp_path / "table", discarded=discarded, source=sources)
    data, left_out = read_trajectories(root, "human")
    assert len(data.rows) == 10
    assert left_out == {"discarded": 5, "other_source": 25}
    np.testing.assert_allclose(data.path(0), constructed.path(30), atol=1e-3)
    with pytest.raises(RunError, match="expected an episode to describe, found 40"):
        read_trajectories(root, "upstream")


def test_one_source_is_never_written_as_the_data_sets_statistics(folder, capsys):
    assert main(["stats", str(folder), "--source", "human"]) == 2
    assert "--out: expected a file" in capsys.readouterr().err


def test_damage_is_one_line(folder, tmp_path, capsys):
    assert main(["stats", str(tmp_path)]) == 2
    assert capsys.readouterr().err == (
        f"copolicy-dataset: {tmp_path}: expected a LeRobot v3 data set with meta/info.json, found none, "
        f"but a data set in {folder}\n"
    )
    (path,) = (folder / "data").glob("*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(table.slice(0, 100), path)
    with pytest.raises(FileFormatError, match=r"expected 4800 frames with index 0, 1, \.\.\., each once, found 100"):
        read_trajectories(folder)
    parquet.write_table(table.drop_columns(["action"]), path)
    with pytest.raises(FileFormatError, match="expected the columns of copolicy, found none named action"):
        read_trajectories(folder)
    path.write_bytes(b"PAR1")
    with pytest.raises(FileFormatError, match="expected a complete Parquet file"):
        read_trajectories(folder)


def test_frames_in_several_files_and_any_order_are_put_together(constructed, folder):
    (path,) = (folder / "data").glob("*/*.parquet")
    table = parquet.read_table(path)
    parquet.write_table(table.slice(2000), path)
    parquet.write_table(table.slice(0, 2000), path.with_name("file-001.parquet"))
    data, _ = read_trajectories(folder)
    np.testing.assert_allclose(data.states, constructed.states, atol=1e-3)


def test_files_of_the_original_program(tmp_path, upstream):
    root = tmp_path / "table"
    raw = str(upstream / "examples_scripted" / "raw")
    assert convert(["upstream", raw, "--out", str(root), "--repo-id", "local/t"]) == 0
    data, _ = read_trajectories(root)
    known = [(row.route_class, route_class(data.path(n), row.scenario)) for n, row in enumerate(data.rows)]
    assert all(column == word for (column, word), row in zip(known, data.rows, strict=True) if row.success)
    assert main(["stats", str(root)]) == 0
    document = json.loads((root / STATISTICS_FILE).read_text(encoding="utf-8"))
    assert document["dataset"]["sources"] == {"upstream": 6}
    assert document["statistics"]["paths"]["path_modes"]["note"].startswith("no configuration has 8 episodes")


def test_the_summary_is_one_line_a_value():
    entry = {
        "value": 0.5,
        "unit": "bits",
        "interval": [0.4, 0.6],
        "null": {"mean": 0.1, "low": 0, "high": 0.2, "p": 0.01},
    }
    document = {
        "definition_version": "1.0.0",
        "dataset": {"sources": {}, "left_out": {"discarded": 2}},
        "statistics": {"family": {"name": entry, "none": {"value": None, "note": "too few"}}},
        "human_reference": {"routes": {}},
    }
    lines = list(_lines(summary(document)))
    assert "  name  0.5 [0.4, 0.6] bits; null 0.1 [0, 0.2], p = 0.01" in lines
    assert "  none  - (too few)" in lines
    assert "  left_out  2 discarded" in lines


@pytest.mark.parametrize("episodes", [1, 2])
def test_hardly_any_data_is_described_without_made_up_numbers(episodes, tmp_path):
    data = trajectories([(still(3), None)] * episodes, [row(FREE, success=False, duration_s=0.3)] * episodes)
    root = write_folder(data, tmp_path / "table")
    assert main(["stats", str(root)]) == 0
    document = json.loads((root / STATISTICS_FILE).read_text(encoding="utf-8"))
    missing = {name for family in document["statistics"].values() for name, entry in family.items() if "note" in entry}
    assert {"route_entropy", "path_modes", "action_variance_ratio", "steering_dip", "leadership_share"} <= missing
    assert {"human_distance_3_obstacles", "energy_between_pairs", "route_between_pair_share", "sparc"} <= missing
