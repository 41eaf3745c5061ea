"""Each rule on sound data, and on the same data with one thing wrong."""

from dataclasses import replace

import numpy as np
import pytest
from checked_data import make_data_set, make_recordings

from copolicy.dataset.checks.checking import RULES, check_table, read_table
from copolicy.dataset.checks.episode_table import EpisodeTable
from copolicy.dataset.checks.finding import Finding
from copolicy.dataset.checks.limits import LIMITS
from copolicy.dataset.checks.maps import named_map
from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.task import MAP_SETS, identify, map_set

BY_NAME = {rule.name: rule for rule in RULES}


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return make_recordings(tmp_path_factory.mktemp("checks") / "recordings")


@pytest.fixture(scope="module")
def recorded(recordings) -> EpisodeTable:
    return read_table(recordings)


@pytest.fixture(scope="module")
def sound(recordings) -> EpisodeTable:
    return read_table(make_data_set(recordings, recordings.parent / "set"))


def find(table: EpisodeTable, rule: str) -> list[Finding]:
    return list(BY_NAME[rule].find(table))


def of(findings: list[Finding]) -> list[tuple[str, str]]:
    return [(finding.episode, finding.severity) for finding in findings]


def with_frames(table: EpisodeTable, name: str, change) -> EpisodeTable:
    values = table.frames[name].copy()
    change(values)
    return replace(table, frames={**table.frames, name: values})


def with_column(table: EpisodeTable, name: str, values) -> EpisodeTable:
    return replace(table, columns={**table.columns, name: np.array(values)})


def with_entry(table: EpisodeTable, name: str, place: int, value) -> EpisodeTable:
    return with_column(table, name, [*table.columns[name][:place], value, *table.columns[name][place + 1 :]])


def all_frames(table: EpisodeTable, episode: int) -> slice:
    return slice(table.starts[episode], table.ends[episode] + 1)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_sound_data_have_no_error_and_no_warning(sound, recorded, rule):
    for table in (sound, recorded):
        if table.kind in rule.kinds:
            found = [finding for finding in rule.find(table) if finding.severity != "info"]
            if rule.name == "license" and table.kind == "recordings":
                assert [finding.figure for finding in found] == [6]  # a recording's licence comes at conversion
            else:
                assert found == []


def test_every_limit_has_a_unit_and_a_reason():
    for name, limit in LIMITS.items():
        assert limit.unit, name
        assert len(limit.reason) > 20, name
    assert len({rule.name for rule in RULES}) == len(RULES)


def test_the_table_reads_the_same_from_both_forms(sound, recorded):
    assert sound.labels == ("0", "1", "2", "3", "4", "5")
    assert recorded.labels[0] == "episode_000000.mcap"
    for name in ("episode_uuid", "map_id", "duration_s", "success", "seed"):
        assert np.array_equal(sound.columns[name], recorded.columns[name]), name
    assert np.array_equal(sound.counts, -(-recorded.counts // 3))
    assert np.array_equal(sound.frames[STATE][sound.starts], recorded.frames[STATE][recorded.starts].astype(np.float32))


def test_longest_run_does_not_cross_episodes(sound):
    small = replace(
        sound, frames={"x": np.zeros(8)}, framed=np.array([0, 1, 2]), starts=np.array([0, 3, 4])
    )  # lengths 3, 1, 4
    marks = np.array([0, 1, 1, 1, 1, 1, 0, 1], bool)
    assert small.longest_run(marks).tolist() == [2, 1, 2]
    assert small.longest_run(~marks).tolist() == [1, 0, 1]
    assert small.share(marks).tolist() == [2 / 3, 1.0, 0.75]


def test_a_wrong_feature_table(sound):
    info = {**sound.info, "fps": 7, "codebase_version": "v2.1", "features": {**sound.info["features"]}}
    info["features"][ACTION] = {**info["features"][ACTION], "shape": [2], "names": ["x", "y"]}
    del info["features"]["next.reward"]
    table = replace(sound, info=info, fps=7.0, files={**sound.files, STATE: ("double", 7)})
    assert [str(finding) for finding in find(table, "format")] == [
        "error: schema: another version of LeRobot's format (v2.1; limit v3.x)",
        "error: schema: the rate is no divisor of 30 Hz (7; limit a divisor of 30)",
    ]
    assert [finding.message for finding in find(table, "features")] == [
        "feature action with another shape",
        "feature action with another names",
        "no feature next.reward in meta/info.json",
    ]
    double = with_frames(sound, STATE, lambda values: None)
    double.frames[STATE] = double.frames[STATE].astype(np.float64)
    assert [finding.figure for finding in find(double, "features")] == ["float64 x 7"]


def test_columns_and_what_stands_in_them(sound):
    columns = {name: values for name, values in sound.columns.items() if name not in ("pair_id", "seed")}
    table = with_entry(replace(sound, columns=columns), "source", 2, "guessed")
    messages = [str(finding) for finding in find(table, "columns")]
    assert messages == [
        "error: schema: meta/episodes has no columns pair_id, seed (2; limit 0)",
        "error: schema: episode 2: unknown source (guessed; limit one of the known)",
    ]


def test_outcomes_that_contradict_each_other(sound):
    reached = int(np.flatnonzero(sound.columns["success"])[0])
    flipped = with_entry(sound, "success", reached, False)
    assert of(find(flipped, "outcome")) == [(str(reached), "error")]
    assert of(find(flipped, "outcome_of_frames")) == [(str(reached), "error")]
    early = with_frames(sound, "next.done", lambda done: done.__setitem__(sound.starts[1], True))
    assert [(finding.episode, finding.figure) for finding in find(early, "outcome_of_frames")] == [("1", 1)]


def test_a_past_action_that_is_not_the_one_before(sound):
    shifted = with_frames(sound, HUMAN_ACTION, lambda past: past.__setitem__(slice(0, -1), past[1:].copy()))
    assert {finding.episode for finding in find(shifted, "alignment")} == set(sound.labels)


def test_rows_and_ranges(sound):
    missing = with_frames(sound, "frame_index", lambda index: index.__setitem__(sound.starts[2] + 5, 99))
    assert [(finding.episode, finding.figure) for finding in find(missing, "indices")] == [("2", 1)]
    moved = with_entry(sound, "dataset_to_index", 1, int(sound.columns["dataset_to_index"][1]) + 1)
    assert [finding.episode for finding in find(moved, "ranges")] == ["1", "2"]


@pytest.mark.parametrize(("share", "severity"), [(0.005, None), (0.05, "warning"), (0.5, "error")])
def test_late_ticks(sound, share, severity):
    late = int(share * 30 * sound.columns["duration_s"][3])
    found = find(with_entry(sound, "late_ticks", 3, late), "late_ticks")
    assert of(found) == ([] if severity is None else [("3", severity)])


@pytest.mark.parametrize(("rate", "severity"), [(29.9, None), (29.0, "warning"), (20.0, "error")])
def test_achieved_rate(sound, rate, severity):
    found = find(with_entry(sound, "achieved_hz", 0, rate), "achieved_hz")
    assert of(found) == ([] if severity is None else [("0", severity)])


def test_people_whose_rate_is_unknown(sound):
    people = with_column(sound, "source", ["human"] * 6)
    assert [(f.figure, f.severity) for f in find(people, "achieved_hz")] == [(6, "warning")]


def test_gaps_in_time(sound):
    later = with_frames(sound, "timestamp", lambda time: time.__setitem__(slice(sound.starts[4] + 9, sound.ends[4]), 7))
    assert of(find(later, "timestamps")) == [("4", "error")]
    longer = with_entry(sound, "duration_s", 5, float(sound.columns["duration_s"][5] + 0.5))
    assert of(find(longer, "duration")) == [("5", "error")]

    def cut(states):
        states[sound.starts[1] + 20 : sound.ends[1] + 1, 0] += 12.0

    found = find(with_frames(sound, STATE, cut), "jumps")
    assert of(found) == [("1", "error")]
    assert 60 < float(str(found[0].figure)) < 180  # 12 px in a tenth of a second, and the table's own motion


@pytest.mark.parametrize(("drift", "severity"), [(0.5, None), (3.0, "warning"), (50.0, "error"), (np.nan, "info")])
def test_drift(sound, drift, severity):
    found = find(with_entry(sound, "replay_drift_px", 2, drift), "drift")
    expected = [] if severity is None else [("" if severity == "info" else "2", severity)]
    assert of(found) == expected


def test_numbers_out_of_range(sound):
    def overdrive(actions):
        actions[sound.starts[0] + 3, 1] = -1.2

    found = find(with_frames(sound, ACTION, overdrive), "action_range")
    assert [(f.episode, round(float(str(f.figure)), 3)) for f in found] == [("0", 1.2)]

    def broken(states):
        states[sound.starts[1], 4] = np.nan
        states[sound.starts[2], 0] = 1250.0
        states[sound.starts[3], 2] *= 0.9

    table = with_frames(sound, STATE, broken)
    assert of(find(table, "finite")) == [("1", "error")]
    assert of(find(table, "state_range")) == [("2", "error"), ("3", "error")]


def test_idle_players(sound):
    def rest(actions):
        actions[all_frames(sound, 1), 2:] = 0.01
        actions[sound.starts[2] + 1 : sound.starts[2] + 56, :2] = 0.0

    table = with_frames(sound, ACTION, rest)
    found = find(table, "idle")
    assert ("1", "warning") in of(found)
    assert ("2", "idle_run", 5.5) in [(f.episode, f.rule, f.figure) for f in found if f.rule == "idle_run"]
    people = find(with_column(table, "source", ["human"] * 6), "idle")
    assert ("1", "error") in of(people)


def test_saturated_sticks_and_keys(sound):
    def full(actions):
        actions[all_frames(sound, 3), :2] = 1.0

    table = with_frames(sound, ACTION, full)
    assert of(find(table, "saturated")) == [("3", "warning")]
    assert of(find(with_column(table, "controller_0", ["keyboard: wasd"] * 6), "saturated")) == [("3", "info")]


def test_short_and_stuck_episodes(sound):
    assert of(find(with_entry(sound, "length", 4, 9), "short")) == [("4", "warning")]

    def rest(states):
        states[sound.starts[5] + 1 : sound.starts[5] + 56, 4:6] = 0.5
        states[all_frames(sound, 0), :2] = states[sound.starts[0], :2]

    found = find(with_frames(sound, STATE, rest), "stuck")
    assert [(f.episode, f.rule) for f in found if f.rule == "unmoved"] == [("0", "unmoved")]
    assert ("5", "stuck") in [(f.episode, f.rule) for f in found]


def test_duplicates_by_name_and_by_bits(sound):
    table = with_entry(sound, "episode_uuid", 4, sound.columns["episode_uuid"][1])
    assert [str(finding) for finding in find(table, "duplicate_names")] == [
        "error: duplicate: episode 4: the same episode_uuid as episode 1 (2; limit 1)"
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
    message = "the same states and actions, bit for bit, as episode 0"
    assert [(f.episode, f.message) for f in find(copied, "duplicate_motion")] == [("6", message)]


def test_maps_by_name():
    for name in MAP_SETS:
        for config in map_set(name, orientations=True):
            assert named_map(identify(config)[0]) is not None
    config = map_set("training", orientations=True)[4 * 17 + 1]
    assert identify(config)[0] == "training-17-90deg"
    assert named_map("training-17-90deg") == config
    assert named_map("training-17-90deg-displaced") == config
    for name in ("training-84", "training-17-45deg", "nowhere-01", "", "custom-1a2b3c4d"):
        assert named_map(name) is None


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


def episodes_of(sound: EpisodeTable, maps: list[str], pairs: list[str]) -> EpisodeTable:
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
    assert "of the 36 maps of training have no episode" in found[0].message
    assert found[0].figure == 2
    assert [f.severity for f in find(episodes_of(sound, names, ["a"] * 36), "balance")] == ["info"]


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
    assert [finding.message for finding in find(table, "leakage")] == ["split odd is no range"]
    shared = with_entry(with_column(table, "source", ["human"] * 6), "pair_id", 5, "p1")
    shared = with_entry(shared, "source_sha256", 5, shared.columns["source_sha256"][2])
    found = find(replace(shared, info={"splits": {"train": "0:4", "test": "4:6"}}), "leakage")
    assert [str(finding) for finding in found] == [
        "error: leakage: episode 2: same source_sha256 as episode 5 of test (1; limit 0)",
        "warning: leakage_people: the same pair_id in train and test: p1 (1; limit 0)",
    ]
    found = find(replace(table, info={"splits": {"train": "0:5", "test": "4:9"}}), "leakage")
    assert [finding.rule for finding in found[:2]] == ["splits", "splits"]


def test_rules_without_their_columns_are_named_and_the_others_go_on(sound):
    assert check_table(sound).not_applied == {}
    for part in ("columns", "frames"):
        held = getattr(sound, part)
        for name in held:
            if name in ("episode_index", "length"):
                continue  # without them there is no table
            rest = {other: values for other, values in held.items() if other != name}
            result = check_table(replace(sound, **{part: rest}))
            needing = {rule.name for rule in RULES if name in getattr(rule, part)}
            assert set(result.not_applied) == needing, name
    bare = replace(sound, frames={}, framed=np.array([], int), starts=np.array([], int))
    result = check_table(bare)
    assert result.not_applied["jumps"] == f"needs {STATE}"
    assert "consent" in result.applied
    nobody = replace(bare, labels=(), columns={name: values[:0] for name, values in sound.columns.items()})
    assert {finding.severity for finding in check_table(nobody).findings} <= {"error", "info"}
