import json
import shutil
from pathlib import Path

import pytest
from versioned_data_set import (
    EPISODES,
    FRAMES,
    change_json,
    cut_differently,
    keep_episodes,
    set_value,
    simulated_data_set,
)

from copolicy.dataset.cli import main
from copolicy.dataset.versions.diff_inputs import compare_statistics
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def converted(tmp_path_factory) -> Path:
    root = simulated_data_set(tmp_path_factory.mktemp("diff") / "table")
    release(root, "major", "The first.")
    return root


@pytest.fixture
def dataset(converted, tmp_path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(converted, tmp_path / "table"))


def uuids(converted: Path) -> list[str]:
    fields = json.loads((converted / "meta/copolicy_release.json").read_text(encoding="utf-8"))
    return [episode["episode_uuid"] for episode in fields["content"]["episodes"]]


def diff(capsys, a: object, b: object) -> tuple[int, dict]:
    status = main(["diff", str(a), str(b), "--json"])
    return status, json.loads(capsys.readouterr().out)


def test_equal_content_is_reported_as_same(converted, dataset, capsys):
    cut_differently(dataset)
    status, found = diff(capsys, converted, dataset)
    assert (status, found["same"]) == (0, True)
    assert found["content_hash"]["a"] == found["content_hash"]["b"]
    assert found["episodes_changed"] == {}


def test_every_kind_of_change_is_reported(converted, dataset, capsys):
    names = uuids(converted)
    set_value(dataset, FRAMES, "action[3]", 0, 0.123)
    set_value(dataset, EPISODES, "pair_id", 0, "pair-9")
    set_value(dataset, EPISODES, "seed", 3, 17)
    change_json(dataset, "meta/info.json", lambda info: info.update(fps=15))
    keep_episodes(dataset, [0, 1, 3])
    status, found = diff(capsys, converted, dataset)
    assert (status, found["same"]) == (1, False)
    assert found["schema"] == ["fps: 10.0 -> 15.0"]
    assert found["episodes_added"] == []
    assert found["episodes_removed"] == [names[2], names[4], names[5]]
    assert found["episodes_changed"] == {names[0]: ["action", "pair_id"], names[3]: ["seed"]}
    assert found["frames_changed"] == [names[0]]
    assert found["renumbered"] == [names[3]]
    status, found = diff(capsys, dataset, converted)
    assert (status, found["episodes_added"]) == (1, [names[2], names[4], names[5]])


def test_a_folder_is_compared_with_its_releases(dataset, capsys):
    assert diff(capsys, f"{dataset}@1.0.0", dataset)[0] == 0
    set_value(dataset, EPISODES, "pair_id", 0, "pair-9")
    assert diff(capsys, f"{dataset}@data-1.0.0", dataset)[0] == 1
    release(dataset, "patch", "Corrected.")
    status, found = diff(capsys, f"{dataset}@1.0.0", f"{dataset}@1.0.1")
    assert (status, list(found["episodes_changed"].values())) == (1, [["pair_id"]])


def test_the_text_names_each_change_and_its_bump(converted, dataset, capsys):
    set_value(dataset, EPISODES, "pair_id", 0, "pair-9")
    assert main(["diff", str(converted), str(dataset)]) == 1
    text = capsys.readouterr().out
    first = uuids(converted)[0]
    assert f"1 episode with other values of pair_id: {first} (patch)" in text
    assert "not compared: not stored for both data sets" in text


def test_stored_statistics_are_compared(converted, dataset, capsys):
    other = Path(shutil.copytree(dataset, dataset.parent / "other"))
    for root, bits in ((dataset, 0.99), (other, 1.71)):
        (root / "meta/copolicy_stats.json").write_text(
            json.dumps({"routes": {"bits": bits, "n": [1, 2]}, "x": None}), encoding="utf-8"
        )
    status, found = diff(capsys, dataset, other)
    assert (status, found["statistics"]) == (1, {"routes.bits": [0.99, 1.71]})
    assert main(["diff", str(dataset), str(other)]) == 1
    assert "routes.bits  0.99 -> 1.71" in capsys.readouterr().out
    assert diff(capsys, dataset, converted)[1]["statistics"] is None


def test_a_missing_value_differs():
    assert compare_statistics({"a": 1, "nan": float("nan")}, {"b": 2, "nan": float("nan")}) == {
        "a": (1, None),
        "b": (None, 2),
    }


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("{}@2.0.0", "unknown release of {} '2.0.0'; available: 1.0.0"),
        ("{}@newest", "data version: expected x.y.z or data-x.y.z, found 'newest'"),
        (
            "{}/nothing",
            "{}/nothing: expected a folder, FOLDER@data-x.y.z, or U/N[@REVISION] on the Hub, found none of them",
        ),
        ("lab/table", "lab/table: querying the Hub: the Hub's client is offline (HF_HUB_OFFLINE is set)"),
    ],
)  # fmt: skip
def test_an_error_has_status_2(converted, capsys, name, message):
    assert main(["diff", str(converted), name.format(converted)]) == 2
    assert capsys.readouterr().err == f"copolicy-dataset: {message.format(converted)}\n"
