"""Which map was played in the original program's files, and the exclusion of an episode whose map is unknown."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from upstream_files import (
    CONFIG,
    EPISODES,
    OPTIONS,
    play,
    processed,
    random_forces,
    raw,
    write_processed,
    write_raw,
    zarr_places,
)

from copolicy.convert.cli import main
from copolicy.convert.upstream.played_map import check_by_path, check_by_rewards
from copolicy.convert.upstream.processed import read_processed
from copolicy.convert.upstream.raw import read_raw
from copolicy.convert.upstream.zarr_episodes import ZarrStore
from copolicy.dataset.checks.checking import check_dataset
from copolicy.dataset.lerobot_folder.exclusions import excluded_episodes, include
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.reward import reward


def test_a_processed_file_with_another_map_is_noticed_and_set_right(examples):
    episode = processed(examples, 1)
    assert episode.meta.quality_flags == "map_mismatch,map_recovered"
    assert not episode.meta.discarded
    assert episode.meta.map_id == raw(examples, 1).meta.map_id
    assert episode.notes[1] == (
        "stored map is not the one played: its start is 120 px from the path's; goal (960.0, 420.0) and obstacles "
        "((720.0, 420.0),) recovered from the rewards; there may have been further obstacles far from the path"
    )
    assert [processed(examples, number).meta.quality_flags for number in EPISODES[1:]] == [""] * 5


def test_a_zarr_episode_with_another_map_is_noticed(examples):
    episode = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places(examples)[1], OPTIONS)
    played = raw(examples, 1).map_config
    assert episode.meta.quality_flags == "map_mismatch,goal_recovered,excluded: map_mismatch"
    assert episode.meta.discarded
    assert (episode.map_config.start, episode.map_config.goal) == (played.start, played.goal)
    assert episode.map_config.obstacles != played.obstacles
    assert episode.notes[1].endswith("its obstacles may be wrong")


def test_rewards_that_no_known_map_gives_are_noted(tmp_path):
    states, actions = play(random_forces(60))
    pose = np.hstack((states[1:, :2], np.cos(states[1:, 2:3]), np.sin(states[1:, 2:3])))
    write_processed(tmp_path / "p" / "p.npz", pose, actions, np.tile([*CONFIG.start, *CONFIG.goal, 1, 1, 1], (60, 1)))
    episode = read_processed(tmp_path / "p" / "p.npz", OPTIONS)
    assert episode.meta.quality_flags == "map_mismatch,excluded: map_mismatch"
    assert "no known map gives the rewards, goal and obstacles unchanged" in episode.notes[1]
    assert episode.map_config == CONFIG


def test_rewards_tell_a_wrong_goal_where_the_start_is_right():
    states, _ = play(np.tile((0.3, 0.1, 0.3, 0.1), (300, 1)))
    rewards = np.array([reward(x, y, CONFIG) for x, y in states[1:, :2]])
    assert check_by_rewards(CONFIG, states[0], states[1:, :2], rewards).flags == ()
    stored = replace(CONFIG, goal=(960.0, 180.0), obstacles=((600.0, 300.0),))
    finding = check_by_rewards(stored, states[0], states[1:, :2], rewards)
    assert finding.flags == ("map_mismatch", "map_recovered")
    assert "its rewards are up to" in finding.notes[0]
    assert finding.config.goal == CONFIG.goal
    assert set(finding.config.obstacles) <= set(CONFIG.obstacles)


def test_a_path_tells_a_wrong_map_where_the_start_is_right(examples):
    episode = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places(examples)[3], OPTIONS)
    played, last = episode.map_config, episode.actions[-1]

    def check(stored: MapConfig):
        return check_by_path(stored, episode.states, episode.final_state, last, Physics())

    assert check(played).flags == ()
    elsewhere = check(replace(played, goal=(960.0, 420.0)))
    assert elsewhere.flags == ("map_mismatch", "goal_recovered")
    assert elsewhere.config == played
    assert "the path ends without contact with it; goal (960.0, 180.0) recovered" in elsewhere.notes[0]
    # A table that ends between two goals touches both.
    between = ZarrStore(examples / "table_10Hz.zarr").read(zarr_places(examples)[4], OPTIONS)
    stored = replace(between.map_config, goal=(960.0, 420.0))
    finding = check_by_path(stored, between.states, between.final_state, between.actions[-1], Physics())
    assert finding.flags == ("map_mismatch",)
    assert finding.notes[0].endswith("its goal and obstacles may be wrong")
    x, y = (round(float(value)) for value in episode.states[100, :2])
    crossed = check(replace(played, obstacles=((x, y),)))
    assert crossed.flags == ("map_mismatch",)
    assert "the path runs through its goal or obstacles in" in crossed.notes[0]


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"goal": (960.0, 180.0)}, "its goal is (960.0, 180.0)"),
        ({"obstacles": ((720.0, 420.0),)}, "its obstacles are ((720.0, 420.0),)"),
        ({"start": (240.0, 240.0, 3.14)}, "its start is 120 px from the path's"),
    ],
)
def test_raw_rows_win_over_a_map_file(tmp_path, changes, says):
    states, actions = play(random_forces(40))
    stored = MapConfig(**{"start": CONFIG.start, "goal": CONFIG.goal, "obstacles": CONFIG.obstacles, **changes})
    episode = read_raw(write_raw(tmp_path, states, actions, map_config=stored), OPTIONS)
    assert episode.meta.quality_flags == "map_mismatch,map_recovered"
    assert not episode.meta.discarded
    assert says in episode.notes[1]
    assert episode.map_config == CONFIG
    assert np.abs(episode.states[:, :2] - states[:-1, :2]).max() < 1e-9


def test_map_files_are_matched_by_their_whole_name(tmp_path):
    states, actions = play(random_forces(20))
    write_raw(tmp_path, states, actions, name="ep_11", map_config=MAP_SETS["training"][50])
    episode = read_raw(write_raw(tmp_path, states, actions, name="ep_1"), OPTIONS)
    assert episode.notes[1:] == ("no map file of this name: start computed by inverting the first step",)
    assert episode.map_config == CONFIG


def map_findings(root: Path) -> list[tuple[str, str, str]]:
    findings = check_dataset(root).findings
    return [(finding.episode, finding.severity, finding.message) for finding in findings if finding.rule == "map_name"]


def test_an_episode_with_a_wrong_map_is_kept_and_excluded(examples, tmp_path, capsys):
    root = tmp_path / "set"
    store = str(examples / "table_10Hz.zarr")
    assert main(["upstream", store, "--out", str(root), "--repo-id", "me/table", "--json"]) == 0
    capsys.readouterr()
    index = zarr_places(examples)[1]
    assert [(entry.episode, entry.reason) for entry in excluded_episodes(root)] == [(index, "map_mismatch")]
    message = (
        "the importer found another map in the file than was played (map_mismatch): the one in the rows may be wrong"
    )
    assert map_findings(root) == [(str(index), "warning", f"{message}; excluded from training")]
    include(root, [str(index)])
    assert map_findings(root) == [(str(index), "warning", message)]


def test_an_episode_whose_map_was_recovered_is_used(examples, tmp_path, capsys):
    root = tmp_path / "set"
    files = str(examples / "processed_npz")
    assert main(["upstream", files, "--out", str(root), "--repo-id", "me/table", "--json"]) == 0
    assert excluded_episodes(root) == []
    ((episode, severity, message),) = map_findings(root)
    assert (episode, severity) == ("0", "warning")
    assert message.endswith("(map_mismatch): it was recovered")
