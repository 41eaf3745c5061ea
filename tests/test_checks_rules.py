"""Each rule on sound data; the rules of schema and rows also on the same data with one thing wrong."""

from dataclasses import replace

import numpy as np
import pytest
from changed_tables import find, of, with_entry, with_frames

from copolicy.dataset.checks.checking import check_data, rules_of
from copolicy.dataset.checks.limits import limits_of
from copolicy.dataset.features import ACTION, HUMAN_ACTION, STATE
from copolicy.dataset.task import get_task

RULES = rules_of(get_task())


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
    for name, limit in limits_of(get_task()).items():
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
    assert small.proportion(marks).tolist() == [2 / 3, 1.0, 0.75]


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
        "error: schema: meta/episodes has no usable columns pair_id, seed (2; limit 0)",
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


def test_rules_without_their_columns_are_named_and_the_others_go_on(sound):
    assert check_data(sound).not_applied == {}
    for part in ("columns", "frames"):
        held = getattr(sound, part)
        for name in held:
            if name in ("episode_index", "length"):
                continue  # without them there is no table
            rest = {other: values for other, values in held.items() if other != name}
            result = check_data(replace(sound, **{part: rest}))
            needing = {rule.name for rule in RULES if name in getattr(rule, part)}
            assert set(result.not_applied) == needing, name
    bare = replace(sound, frames={}, framed=np.array([], int), starts=np.array([], int))
    result = check_data(bare)
    assert result.not_applied["jumps"] == f"needs {STATE}"
    assert "consent" in result.applied
    nobody = replace(bare, labels=(), columns={name: values[:0] for name, values in sound.columns.items()})
    assert {finding.severity for finding in check_data(nobody).findings} <= {"error", "info"}
