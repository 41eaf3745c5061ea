"""`copolicy-dataset split`: parts close to the requested proportions, without overlap."""

import numpy as np
import pytest
from edited_data import columns, digests, info, load

from copolicy.convert.cli import main as convert
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.cli import main
from copolicy.dataset.edit.groups import By, group_episodes
from copolicy.dataset.edit.parts import assign_groups, parse_parts
from copolicy.dataset.edit.split import split
from copolicy.dataset.exceptions import InvalidValueError, RunError


def rows(pairs, source="human", **others):
    """Episodes of the pairs `A/B`: players A and B."""
    result = []
    for number, pair in enumerate(pairs):
        first, _, second = pair.partition("/")
        row = {"pair_id": pair, "player_0_id": first, "player_1_id": second, "source": source, "map_id": "training-01"}
        result.append({**row, **{name: values[number] for name, values in others.items()}})
    return result


def dealt(episodes, parts, by: By = "pairs", seed=0, same_consent=False):
    motions = list(range(len(episodes)))
    return assign_groups(episodes, group_episodes(episodes, motions, by, same_consent), parse_parts(parts), by, seed)


def test_a_player_with_two_partners_joins_their_pairs():
    episodes = rows(["a/b", "b/c", "d/e", "c/f", "g/h"])
    assert group_episodes(episodes, range(5), "pairs") == [[0, 1, 3], [2], [4]]
    # Whoever sat where.
    assert group_episodes(rows(["a/b", "c/a"]), range(2), "pairs") == [[0, 1]]


def test_a_consent_id_joins_pairs_where_it_means_one_person():
    episodes = rows(["a/b", "c/d", "e/f"], consent_id=["C-1,C-2", "C-2", "C-3"])
    assert group_episodes(episodes, range(3), "pairs") == [[0], [1], [2]]
    assert group_episodes(episodes, range(3), "pairs", same_consent=True) == [[0, 1], [2]]


def test_scripted_agents_are_joined_by_their_pair_alone():
    episodes = rows(["s/t", "s/u", "s/t"], source="simulated")
    assert group_episodes(episodes, range(3), "pairs") == [[0, 2], [1]]


def test_people_without_a_name_stay_together():
    episodes = [{"source": "human"}, {"source": "human", "pair_id": ""}, *rows(["a/b"])]
    assert group_episodes(episodes, range(3), "pairs") == [[0, 1], [2]]


def test_copies_always_stay_together():
    episodes = rows(["a/b", "c/d", "e/f"], source_sha256=["x", "y", "x"])
    assert group_episodes(episodes, [1, 2, 3], "episodes") == [[0, 2], [1]]
    assert group_episodes(rows(["a/b", "c/d", "e/f"]), [1, 2, 1], "maps") == [[0, 1, 2]]
    assert group_episodes(rows(["a/b", "c/d", "e/f"]), [1, 2, 1], "episodes") == [[0, 2], [1]]


def test_a_map_stays_with_its_orientations():
    episodes = rows(["a/b"] * 4, map_id=["training-01", "training-02", "training-01-90deg", "training-01-displaced"])
    assert group_episodes(episodes, range(4), "maps") == [[0, 2, 3], [1]]


@pytest.mark.parametrize("seed", range(5))
def test_proportions_are_reached_as_far_as_groups_allow(seed):
    draw = np.random.default_rng(seed)
    names = [f"{n}a/{n}b" for n in range(40) for _ in range(int(draw.integers(5, 15)))]
    parts = dealt(rows(names), ["train=0.7", "valid=0.1", "test=0.2"], seed=seed)
    total = len(names)
    for name, share in (("train", 0.7), ("valid", 0.1), ("test", 0.2)):
        assert abs(len(parts[name]) / total - share) < 0.01
    owners = {}
    for name, places in parts.items():
        for place in places:
            assert owners.setdefault(names[place], name) == name
    assert sorted(place for places in parts.values() for place in places) == list(range(total))


def test_single_episodes_are_spread_over_pairs_maps_and_results():
    episodes = rows(
        [f"{n % 4}a/{n % 4}b" for n in range(200)],
        success=[n % 5 != 0 for n in range(200)],
        map_set=["training" if n % 2 else "unseen" for n in range(200)],
    )
    parts = dealt(episodes, ["train=0.8", "valid=0.2"], "episodes")
    assert len(parts["valid"]) == 40
    inside = [episodes[place] for place in parts["valid"]]
    assert sum(row["success"] for row in inside) == 32
    assert sum(row["map_set"] == "unseen" for row in inside) == 20
    assert sorted(sum(row["pair_id"] == f"{n}a/{n}b" for row in inside) for n in range(4)) == [10] * 4


def test_the_seed_determines_the_split():
    episodes = rows([f"{n}a/{n}b" for n in range(30)])
    parts = [dealt(episodes, ["train=0.5", "test=0.5"], seed=seed)["test"] for seed in (1, 1, 2)]
    assert parts[0] == parts[1] != parts[2]


def test_no_part_is_empty():
    episodes = rows(["a/b"] * 98 + ["c/d", "e/f"])
    parts = dealt(episodes, ["train=0.98", "valid=0.01", "test=0.01"])
    assert all(parts.values())
    with pytest.raises(RunError, match="expected at least one of the groups of people for each part, found 2 for 3"):
        dealt(rows(["a/b", "c/d"]), ["train=0.8", "valid=0.1", "test=0.1"])


def test_named_pairs_go_to_the_part_that_names_them():
    episodes = rows(["a/b", "b/c", "d/e", "f/g"])
    assert dealt(episodes, ["test=a/b", "train=rest"]) == {"test": [0, 1], "train": [2, 3]}
    assert dealt(episodes, ["test=d", "train=0.5", "valid=0.5"])["test"] == [2]
    maps = rows(["a/b"] * 3, map_id=["training-01", "training-02", "training-01-90deg"])
    assert dealt(maps, ["test=training-01", "train=rest"], "maps") == {"test": [0, 2], "train": [1]}


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        (["test=a/b", "train=b/c"], "share a person"),
        (["test=nobody", "train=rest"], "found 'nobody', which no episode has"),
        (["test=a/b", "train=d/e"], "found 1 without one; add NAME=rest"),
        (["test=a/b", "train=a/b"], "each name in one part"),
    ],
)
def test_names_that_cannot_be_separated_are_refused(parts, line):
    with pytest.raises((RunError, InvalidValueError), match=line):
        dealt(rows(["a/b", "b/c", "d/e", "f/g"]), parts)


@pytest.mark.parametrize(
    "texts",
    [
        ["train=0.8"], ["train=0.8", "test=0.3"], ["train=0.5", "train=0.5"], ["train=1.2", "test=-0.2"],
        ["train", "test=0.5"], ["tr/ain=0.5", "test=0.5"], ["train=rest", "test=rest"], ["train=rest", "test=0.2"],
        ["..=0.5", "test=0.5"], ["train=nan", "test=0.5"], ["train=inf", "test=0.5"], ["train=0", "test=1"],
    ],
)  # fmt: skip
def test_invalid_parts_are_refused(texts):
    with pytest.raises(InvalidValueError, match="--parts: expected "):
        parse_parts(texts)


def test_folders_share_no_person(people_set, tmp_path, capsys):
    out = tmp_path / "parts"
    assert main(["split", str(people_set), "--out", str(out), "--parts", "train=0.75", "test=0.25"]) == 0
    shown = capsys.readouterr().out
    assert "reached" in shown
    assert sorted(path.name for path in out.iterdir()) == ["test", "train"]
    pairs = [{row["pair_id"] for row in columns(out / name)} for name in ("train", "test")]
    assert not pairs[0] & pairs[1]
    assert (len(pairs[0]), len(pairs[1])) == (3, 1)
    before = {uuid: entry.digest for uuid, entry in digests(people_set).items()}
    after = {uuid: entry.digest for name in ("train", "test") for uuid, entry in digests(out / name).items()}
    assert after == before
    result = check_dataset(out / "train", against=out / "test")
    assert not [finding for finding in result.findings if finding.rule.startswith("leakage")]
    assert load(out / "test").num_episodes == 2


def test_one_data_set_whose_splits_the_checks_and_robomimic_read(people_set, tmp_path, capsys):
    out = tmp_path / "one"
    summary = split(people_set, out, parse_parts(["train=0.75", "valid=0.25"]), as_splits=True)
    assert info(out)["splits"] == {"train": "0:6", "valid": "6:8"}
    assert summary["in_several_parts"].keys() <= {"maps", "consents"}
    found = {finding.rule for finding in check_dataset(out).findings}
    assert not found & {"leakage", "leakage_people", "splits"}
    h5py = pytest.importorskip("h5py")
    assert convert(["export", str(out), "--format", "robomimic", "--out", str(tmp_path / "a.hdf5")]) == 0
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert [name.decode() for name in file["mask/valid"]] == ["demo_6", "demo_7"]
        assert len(file["mask/train"]) == 6
    assert convert(["export", str(out), "--format", "robomimic", "--out", str(tmp_path / "b"), "--valid", "0.5"]) == 2
    assert "a data set without splits" in capsys.readouterr().err


def test_robomimics_valid_key_shares_no_person_with_train(people_set, tmp_path):
    h5py = pytest.importorskip("h5py")
    flags = ["--format", "robomimic", "--out", str(tmp_path / "a.hdf5"), "--valid", "0.25", "--seed", "1"]
    assert convert(["export", str(people_set), *flags]) == 0
    with h5py.File(tmp_path / "a.hdf5") as file:
        names = {key: [name.decode() for name in file[f"mask/{key}"]] for key in ("train", "valid")}
        pairs = {key: {file[f"data/{name}"].attrs["pair_id"] for name in names[key]} for key in names}
    assert (len(names["train"]), len(names["valid"])) == (6, 2)
    assert not pairs["train"] & pairs["valid"]


@pytest.mark.parametrize(
    ("flags", "line"),
    [
        (["--format", "zarr", "--valid", "0.2"], "--valid: expected --format robomimic"),
        (["--format", "robomimic", "--valid", "1.5"], "--valid: expected a proportion between 0 and 1"),
        (["--format", "robomimic", "--valid-by", "maps"], "--valid-by: expected --format robomimic and --valid"),
        (["--format", "robomimic", "--valid", "0.2", "--seed", "-1"], "--seed: expected at least 0"),
    ],
)
def test_wrong_flags_of_the_export(people_set, tmp_path, capsys, flags, line):
    assert convert(["export", str(people_set), "--out", str(tmp_path / "out"), *flags]) == 2
    assert line in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_too_few_people_leave_nothing(people_set, tmp_path, capsys):
    parts = [f"p{number}=0.2" for number in range(5)]
    assert main(["split", str(people_set), "--out", str(tmp_path / "parts"), "--parts", *parts]) == 1
    assert "groups of people for each part, found 4 for 5 parts" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
