import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from copolicy.collect.play.settings import PlayerSpec, PlaySettings
from copolicy.collect.recording.recorder import EpisodeRecorder
from copolicy.collect.recording.wall_clock import WallClockAnchor
from copolicy.collect.session import BalancedSchedule, CollectionLock, EpisodeCounts, SessionFolder
from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import CopolicyError, InvalidValueError, RunError
from copolicy.tasks.table.maps import MAP_SETS, identify
from copolicy.tasks.table.world import TableWorld

FIXED = {"maps": "training", "seed": 0}
_MAP_SETS = "holdout, paper36, paper36-orders, training, unseen, varied"
_AN_ID = "letters, digits, '.', '_' or '-' (an id, no name of a person)"


def _record(folder, pair="P01", seating=0, map_index=0, discarded=False, flags="", reason="goal"):
    """A recording of one step in a session's folder."""
    config = MAP_SETS["training"][map_index]
    a, b = f"{pair}-a", f"{pair}-b"
    meta = EpisodeMeta(
        episode_uuid="u",
        session_id=folder.session_id,
        pair_id=pair,
        player_0_id=b if seating else a,
        player_1_id=a if seating else b,
        map_id=identify(config)[0],
    )
    world, path = TableWorld(config), folder.next_path()
    with EpisodeRecorder(path, config, meta, WallClockAnchor.simulated(0)) as recorder:
        world.step((0, 0, 0, 0))
        recorder.step((0, 0, 0, 0), world.recorded, 0.0)
        recorder.finish(reason == "goal", reason, discarded=discarded, quality_flags=flags)
    return path


def test_a_session_continues_until_it_is_complete(tmp_path):
    first = SessionFolder(tmp_path, "P01", FIXED, 2)
    assert (first.path.name, first.continued) == ("P01-01", False)
    _record(first)
    continued = SessionFolder(tmp_path, "P01", FIXED, 2)
    assert (continued.path, continued.session_id, continued.continued) == (first.path, first.session_id, True)
    assert continued.next_path().name == "episode_001.mcap"
    _record(continued)
    assert SessionFolder(tmp_path, "P01", FIXED, 2).path.name == "P01-02"


def test_another_pair_has_sessions_of_its_own_but_shares_the_counts(tmp_path):
    first = SessionFolder(tmp_path, "P01", FIXED, 2)
    _record(first, seating=1)
    partner_session = SessionFolder(tmp_path, "P02", FIXED, 2)
    assert partner_session.path.name == "P02-01"
    assert partner_session.counts.kept == Counter({("training-00", 1): 1})
    assert partner_session.counts.kept_in_session.total() == 0


@pytest.mark.parametrize(
    ("changes", "kept", "attempted"),
    [
        ({}, 1, 1),
        ({"discarded": True}, 0, 1),
        ({"discarded": True, "flags": "practice"}, 0, 0),
        ({"reason": "collision_wall"}, 1, 1),
        ({"reason": "crash_recovered"}, 0, 1),
    ],
)
def test_what_counts_is_what_was_played_to_its_end_and_kept(tmp_path, changes, kept, attempted):
    folder = SessionFolder(tmp_path, "P01", FIXED, 2)
    _record(folder, **changes)
    counts = SessionFolder(tmp_path, "P01", FIXED, 2).counts
    assert (counts.kept_in_session.total(), counts.attempted.total()) == (kept, attempted)


def test_an_undone_keep_is_no_recording_any_more(tmp_path):
    folder = SessionFolder(tmp_path, "P01", FIXED, 3)
    _record(folder)
    last = _record(folder, map_index=1)
    _record(folder, discarded=True)
    folder = SessionFolder(tmp_path, "P01", FIXED, 3)
    undone = folder.undo_last_keep()
    assert undone is not None
    assert undone.path == last
    assert not last.exists()
    assert last.with_name("episode_001.mcap.undone").stat().st_size > 0
    assert folder.counts.kept_in_session == Counter({("training-00", 0): 1, ("training-01", 0): 0})
    assert folder.next_path().name == "episode_003.mcap"
    assert SessionFolder(tmp_path, "P01", FIXED, 3).counts.kept_in_session.total() == 1
    assert folder.undo_last_keep() is not None
    assert folder.undo_last_keep() is None


def test_a_session_with_other_settings_is_not_mixed_in(tmp_path):
    folder = SessionFolder(tmp_path, "P01", FIXED, 2)
    with pytest.raises(InvalidValueError) as error:
        SessionFolder(tmp_path, "P01", {"maps": "unseen", "seed": 0}, 2)
    assert str(error.value) == (
        f"{folder.path}: expected the settings that it began with, {FIXED}, or --new-session, "
        "found {'maps': 'unseen', 'seed': 0}"
    )
    assert SessionFolder(tmp_path, "P01", {"maps": "unseen", "seed": 0}, 2, new_session=True).path.name == "P01-02"


def test_a_recording_that_cannot_be_read_is_told_and_not_counted(tmp_path, caplog):
    folder = SessionFolder(tmp_path, "P01", FIXED, 2)
    (folder.path / "episode_000.mcap").write_bytes(b"no recording")
    again = SessionFolder(tmp_path, "P01", FIXED, 2)
    assert again.counts.attempted.total() == 0
    assert "not counted" in caplog.text
    assert again.next_path().name == "episode_001.mcap"


def test_two_tools_do_not_mix(tmp_path):
    lock = CollectionLock(tmp_path)
    command = [sys.executable, "-m", "copolicy.collect.cli", "play", "--pair", "P01", "--out", str(tmp_path)]
    done = subprocess.run(
        [*command, "--players", "scripted", "scripted", "--headless"], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        f"copolicy-collect: {tmp_path}: expected a folder that no other tool collects into, found one running"
    )
    assert [path.name for path in tmp_path.iterdir()] == [".copolicy.lock"]
    lock.close()
    CollectionLock(tmp_path).close()


def test_the_lock_is_held_in_this_process_too(tmp_path):
    lock = CollectionLock(tmp_path)
    with pytest.raises(RunError, match="found one running"):
        CollectionLock(tmp_path)
    lock.close()


def _play(balance, counts, episodes):
    """Keeps every episode of a schedule."""
    played = []
    for _ in range(episodes):
        config, seating = balance.next(counts)
        key = (identify(config)[0], seating)
        for counter in (counts.kept, counts.attempted, counts.kept_in_session):
            counter[key] += 1
        played.append((config, seating))
    return played


def test_every_configuration_gets_its_share_across_pairs():
    maps = MAP_SETS["training"]
    kept = Counter()
    for pair in range(7):
        counts = EpisodeCounts(kept)
        _play(BalancedSchedule(maps, 24, 0, f"P{pair}", swap=True), counts, 24)
        kept = counts.kept
    # 7 x 24 episodes are one for each of the 84 maps in both seatings.
    assert set(kept.values()) == {1}
    assert len(kept) == 2 * len(maps)


def test_a_short_session_is_even_over_starts_goals_and_seats():
    played = _play(BalancedSchedule(MAP_SETS["training"], 12, 3, "P01", swap=True), EpisodeCounts(), 12)
    assert Counter(config.start for config, _ in played).most_common()[0][1] <= 4
    assert set(Counter(config.goal for config, _ in played).values()) == {4}
    seats = [seating for _, seating in played]
    assert seats in ([0] * 6 + [1] * 6, [1] * 6 + [0] * 6)


def test_the_schedule_depends_on_seed_and_pair_and_on_nothing_else():
    def schedule(seed, pair):
        return _play(BalancedSchedule(MAP_SETS["training"], 10, seed, pair, swap=True), EpisodeCounts(), 10)

    assert schedule(0, "P01") == schedule(0, "P01")
    assert schedule(0, "P01") != schedule(1, "P01")
    assert schedule(0, "P01") != schedule(0, "P02")


def test_a_discarded_configuration_comes_back_after_the_others():
    balance, counts = BalancedSchedule(MAP_SETS["training"][:3], 6, 0, "P01", swap=False), EpisodeCounts()
    discarded, _ = balance.next(counts)
    counts.attempted[identify(discarded)[0], 0] += 1
    (second, _), (third, _), (fourth, _) = _play(balance, counts, 3)
    assert discarded not in (second, third)
    assert fourth == discarded


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"pair": "Ann & Bob"}, f"pair: expected {_AN_ID}, found 'Ann & Bob'"),
        ({"consents": ("", "a b")}, f"consent-1: expected {_AN_ID}, found 'a b'"),
        ({"episodes": 0}, "episodes: expected at least 1, found 0"),
        ({"maps": "mine"}, f"unknown map set 'mine'; available: {_MAP_SETS}"),
        ({"window": (10, 10)}, "window: expected WxH of at least 320x320, found '10x10'"),
    ],
)
def test_settings_that_cannot_be(changes, message):
    values = {"pair": "P01", "out": Path("x")} | changes
    with pytest.raises(CopolicyError) as error:
        PlaySettings(**values)
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("robot", "unknown player 'robot'; available: joystick, keyboard, policy, replay, scripted"),
        (
            "scripted:S99",
            "unknown simulated pair 'S99'; available: " + ", ".join(f"S{number:02d}" for number in range(1, 14)),
        ),
        ("policy", "player: expected policy:CKPT, found 'policy'"),
        ("joystick:1", "player: expected joystick, found 'joystick:1'"),
    ],
)
def test_pilots_that_cannot_be(text, message):
    with pytest.raises(CopolicyError) as error:
        PlayerSpec.parse(text)
    assert str(error.value) == message


def test_a_pilot_has_a_kind_and_a_detail():
    assert PlayerSpec.parse("scripted") == PlayerSpec("scripted", "S01")
    assert PlayerSpec.parse("policy:C:/a:b") == PlayerSpec("policy", "C:/a:b")


def test_the_header_names_no_path(tmp_path):
    folder = SessionFolder(tmp_path, "P01", FIXED, 2)
    header = json.loads((folder.path / "session.json").read_text(encoding="utf-8"))
    assert header == {"session_id": folder.session_id, "pair_id": "P01", "settings": FIXED}
