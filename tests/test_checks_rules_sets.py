"""The rules of maps, and those that compare episodes with each other, on data with one thing wrong."""

from dataclasses import replace

import numpy as np
import pytest
from changed_tables import all_frames, find, of, with_column, with_entry, with_frames

from copolicy.dataset.checks.episode_data import EpisodeData
from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.tasks.table.maps import MAP_SETS, identify, map_set
from copolicy.tasks.table.rules.maps import map_by_name


def test_maps_by_name():
    for name in MAP_SETS:
        for config in map_set(name, orientations=True):
            assert map_by_name(identify(config)[0]) is not None
    config = map_set("training", orientations=True)[4 * 17 + 1]
    assert identify(config)[0] == "training-17-90deg"
    assert map_by_name("training-17-90deg") == config
    assert map_by_name("training-17-90deg-displaced") == config
    for name in ("training-84", "training-17-45deg", "nowhere-01", "", "custom-1a2b3c4d"):
        assert map_by_name(name) is None


def test_wrong_maps(sound):
    name = str(sound.columns["map_id"][0])
    other = "training-00" if name != "training-00" else "training-83"
    found = find(with_entry(sound, "map_id", 0, other), "map_rows")
    assert [(f.episode, f.severity, f.message) for f in found] == [
        ("0", "error", f"start, goal or obstacles in the rows are not those of {other}")
    ]
    unknown = with_entry(with_entry(sound, "map_id", 1, "training-99"), "map_set", 2, "unseen")
    assert [(f.episode, f.message) for f in find(unknown, "map_names")] == [
        ("1", "map_id is not the name of a known map"),
        ("2", "map_set is not the set of map_id"),
    ]
    flagged = with_entry(sound, "quality_flags", 3, "map_mismatch,map_recovered")
    assert of(find(flagged, "map_names")) == [("3", "warning")]

    def moved(rows):
        rows[all_frames(sound, 4), 0] += 30.0
        rows[sound.ends[5], 3] += 1.0

    table = with_frames(sound, ENVIRONMENT_STATE, moved)
    assert of(find(table, "map_start")) == [("4", "error")]
    assert of(find(table, "map_constant")) == [("5", "error")]


@pytest.mark.parametrize("form", ["sound", "recorded"])
def test_a_goal_elsewhere_is_seen_in_the_geometry(request, form):
    table = request.getfixturevalue(form)
    reached = np.flatnonzero(table.columns["success"])[0]

    def elsewhere(rows):
        rows[all_frames(table, reached), 3:5] = (200.0, 300.0)

    found = find(with_frames(table, ENVIRONMENT_STATE, elsewhere), "goal_contact")
    assert of(found) == [(table.labels[reached], "error")]
    assert float(str(found[0].figure)) > 300

    def on_the_way(rows):
        middle = (table.starts[reached] + table.ends[reached]) // 2
        rows[all_frames(table, reached), 5:7] = table.frames[STATE][middle, :2]

    found = find(with_frames(table, ENVIRONMENT_STATE, on_the_way), "obstacle_contact")
    assert of(found) == [(table.labels[reached], "error")]


def test_failures_that_the_geometry_contradicts(sound):
    place = int(np.flatnonzero(sound.columns["success"])[0])
    failed = with_entry(sound, "success", place, False)

    def at_the_end(rows):
        rows[all_frames(sound, place), 3:5] = sound.frames[STATE][sound.ends[place], :2]

    assert of(find(with_frames(failed, ENVIRONMENT_STATE, at_the_end), "goal_contact")) == [(str(place), "error")]
    for reason, rule in (("collision_wall", "wall_contact"), ("collision_obstacle", "obstacle_contact")):
        table = with_entry(failed, "termination_reason", place, reason)

        def far(rows):
            rows[all_frames(sound, place), 5:] = 0
            rows[all_frames(sound, place), 5:7] = (60.0, 60.0)

        assert of(find(with_frames(table, ENVIRONMENT_STATE, far), rule)) == [(str(place), "error")]


def test_duplicates_by_name_and_by_bits(sound):
    table = with_entry(sound, "episode_uuid", 4, sound.columns["episode_uuid"][1])
    assert [str(finding) for finding in find(table, "duplicate_names")] == [
        "error: duplicate: episode 4: same episode_uuid as episode 1 (2; limit 1)"
    ]
    same = np.arange(sound.starts[0], sound.ends[0] + 1)
    rows = np.concatenate((np.arange(sound.frame_count), same))
    copied = replace(
        sound,
        labels=(*sound.labels, "6"),
        frames={name: values[rows] for name, values in sound.frames.items()},
        framed=np.arange(7),
        starts=np.append(sound.starts, sound.frame_count),
    )
    message = "states and actions bit-identical to episode 0"
    assert [(f.episode, f.message) for f in find(copied, "duplicate_motion")] == [("6", message)]


def episodes_of(sound: EpisodeData, maps: list[str], pairs: list[str]) -> EpisodeData:
    columns = {"map_id": np.array(maps), "map_set": np.array(["training"] * len(maps)), "pair_id": np.array(pairs)}
    return replace(sound, labels=tuple(map(str, range(len(maps)))), columns=columns)


def test_balance_of_maps(sound):
    names = sorted({identify(config)[0] for config in MAP_SETS["paper36"]})
    even = names * 6
    assert find(episodes_of(sound, even, ["a"] * len(even)), "balance") == []
    skewed = [*names * 5, *[names[0]] * 30]
    found = find(episodes_of(sound, skewed, ["a"] * len(skewed)), "balance")
    assert [(f.rule, f.severity) for f in found] == [("balance", "warning")]
    assert found[0].message == "the maps of training have 5 to 35 episodes; p of a chi-square test"
    missing = names[:-2] * 8
    found = find(episodes_of(sound, missing, ["a"] * len(missing)), "balance")
    assert f"of the {len(names)} maps of training have no episode" in found[0].message
    assert found[0].figure == 2
    assert [f.severity for f in find(episodes_of(sound, names, ["a"] * len(names)), "balance")] == ["info"]


@pytest.mark.parametrize("recorded", ["training", "paper36", "paper36-orders", "varied"])
def test_every_set_is_balanced_by_its_own_shares(sound, recorded):
    """Maps of several sets carry the names of one; each is held against the set that was recorded."""
    named = [identify(config) for config in map_set(recorded)] * 10
    names, families = map(list, zip(*named, strict=True))
    episodes = episodes_of(sound, names, ["a"] * len(names))
    episodes.columns["map_set"] = np.array(families)
    assert find(episodes, "balance") == []


def test_balance_of_pairs(sound):
    maps = ["training-00", "training-01"] * 40
    mixed = ["a", "a", "b", "b"] * 20
    assert find(episodes_of(sound, maps, mixed), "balance_pairs") == []
    confounded = find(episodes_of(sound, maps, ["a", "b"] * 40), "balance_pairs")
    assert [f.message for f in confounded] == [
        "pairs did not carry on the same maps; p of a chi-square test of pair against map"
    ]
    lopsided = find(episodes_of(sound, maps, ["a"] * 70 + ["b"] * 10), "balance_pairs")
    assert (lopsided[0].figure, lopsided[0].limit) == (7.0, 3.0)


def test_consent_and_licence(sound):
    people = with_column(with_column(sound, "source", ["human"] * 6), "consent_id", ["c-1"] * 5 + [" "])
    assert of(find(people, "consent")) == [("5", "error")]
    unlicensed = with_column(sound, "license", ["CC-BY-4.0"] * 4 + ["", "CC0-1.0"])
    assert [(f.severity, f.figure) for f in find(unlicensed, "license")] == [("error", 1), ("warning", 2)]


def test_leakage_between_splits(sound):
    info = {**sound.info, "splits": {"train": "0:4", "test": "4:6", "odd": "all"}}
    apart = [f"p{place}" for place in range(6)]
    table = replace(sound, info=info)
    for column in ("pair_id", "player_0_id", "player_1_id"):
        table = with_column(table, column, apart)
    assert [finding.message for finding in find(table, "leakage")] == ["split odd is not a range"]
    shared = with_entry(with_column(table, "source", ["human"] * 6), "pair_id", 5, "p1")
    shared = with_entry(shared, "source_sha256", 5, shared.columns["source_sha256"][2])
    found = find(replace(shared, info={"splits": {"train": "0:4", "test": "4:6"}}), "leakage")
    assert [str(finding) for finding in found] == [
        "error: leakage: episode 2: same source_sha256 as episode 5 of test (1; limit 0)",
        "warning: leakage_people: the same pair_id in train and test: p1 (1; limit 0)",
    ]
    found = find(replace(table, info={"splits": {"train": "0:5", "test": "4:9"}}), "leakage")
    assert [finding.rule for finding in found[:2]] == ["splits", "splits"]


def test_two_files_of_maps_with_one_name(sound):
    """The same name and other content is one warning; a map of a file is not held against the sets of the package."""
    count = len(sound.labels)
    of_file = sound
    for column, values in (
        ("map_set", np.full(count, "lab")), ("map_set_version", np.full(count, "1")),
        ("map_set_digest", np.full(count, "a" * 16)),
        ("map_id", np.array([f"lab-{name}" for name in sound.columns["map_id"].tolist()])),
    ):  # fmt: skip
        of_file = with_column(of_file, column, values)
    for rule in ("map_files", "map_names", "map_rows", "obstacle_sizes"):
        assert find(of_file, rule) == []
    digests = np.array(["a" * 16, *["b" * 16] * (count - 1)])
    found = find(with_column(of_file, "map_set_digest", digests), "map_files")
    assert [f.message for f in found] == [
        f"episodes from several map files with the same name lab: {count - 1} of version 1, digest {'b' * 16}; 1 of "
        f"version 1, digest {'a' * 16}"
    ]
    elsewhere = with_entry(of_file, "map_id", 0, "other-01")
    assert [f.message for f in find(elsewhere, "map_names")] == ["map_set is not the file of map_id"]


def test_maps_of_a_file_are_as_frequent_as_their_weights(sound):
    count = 60
    table = replace(sound, labels=tuple(map(str, range(count))), columns={
        "map_set": np.full(count, "lab"), "map_id": np.array(["lab-a"] * 45 + ["lab-b"] * 15),
        "map_weight": np.array([3] * 45 + [1] * 15),
    })  # fmt: skip
    assert find(table, "balance") == []
    assert of(find(with_column(table, "map_weight", np.ones(count, int)), "balance")) == [("", "warning")]
