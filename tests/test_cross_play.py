"""`copolicy-eval cross-play`: its cells and matrix, that a stopped run continues, that other settings are noticed."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from policy_runs import save_run
from untrained_policy import save_untrained_policy

from copolicy.collect.cli import main as collect
from copolicy.collect.rollout import EpisodeStart
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.files.lock import FolderLock
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.cross_play import cells
from copolicy.evaluate.cross_play.measures import MEASURES
from copolicy.evaluate.partner_study.study import run_with_partners
from copolicy.evaluate.partners.names import parse_partners
from copolicy.evaluate.partners.partner import make_partner
from copolicy.evaluate.study_flags import Protocol
from copolicy.evaluate.trajectories import read_trajectories, trajectories_beside
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import Physics
from copolicy.train.processor_files import processors_sha256

TABLE = get_task("table")
MAPS = MAP_SETS["training"]


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy, which plans rest."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint") / "still")


def run(checkpoint, out, *flags):
    limits = ("--configurations", "4", "--step-limit", "30", "--maps", "unseen")
    partners = () if "--partners" in flags else ("--partners", "stubborn")
    return main(["cross-play", "--robots", f"ours={checkpoint}", *partners, "--out", str(out), *limits, *flags])


def test_a_folder_with_training_seeds_is_a_method(tmp_path, capsys):
    for seed in (0, 1):
        save_run(tmp_path / "runs" / f"seed_{seed}" / "training", seed=seed)
    assert run(f"{tmp_path / 'runs'}", tmp_path / "out", "--no-floors") == 0
    result = json.loads((tmp_path / "out" / "matrix.json").read_text(encoding="utf-8"))
    assert list(result["robots"]) == ["ours-0", "ours-1"]
    weights = {robot["weights_sha256"] for robot in result["robots"].values()}
    assert len(weights) == 2
    method = result["methods"]["ours"]
    assert method["robots"] == ["ours-0", "ours-1"]
    assert (method["score"], method["differences"]) == (None, {})  # in 30 steps the own kind does not succeed
    forces = [result["cells"][robot]["stubborn"]["measures"]["interaction_force"]["mean"] for robot in method["robots"]]
    assert method["measures"]["interaction_force"] == {
        "mean": pytest.approx(np.mean(forces)),
        "standard_error": pytest.approx(abs(forces[0] - forces[1]) / 2),
        "n": 2,
    }
    assert "relative_force" not in result["not_measured"]
    assert "| ours | 2 | " in (tmp_path / "out" / "matrix.md").read_text(encoding="utf-8")
    shutil.copytree(tmp_path / "runs" / "seed_1", tmp_path / "runs" / "seed_2")
    capsys.readouterr()
    assert run(f"{tmp_path / 'runs'}", tmp_path / "out", "--no-floors") == 2
    assert "expected another training than" in capsys.readouterr().err


def test_methods_have_names_of_their_own(checkpoint, tmp_path, capsys):
    """Else the scores of one would be those of the other."""
    for seed in (0, 1):
        save_run(tmp_path / f"runs{seed}" / "training", seed=seed)
    runs = [str(tmp_path / f"runs{seed}") for seed in (0, 1)]
    call = ["--partners", "stubborn", "--maps", "unseen", "--out", str(tmp_path / "out")]
    assert main(["cross-play", "--robots", f"random={runs[0]}", *call]) == 2
    told = capsys.readouterr().err
    assert "expected robots and methods of different names" in told
    assert "found ['random-0', 'nothing', 'never-yields', 'random', 'random']" in told
    assert main(["cross-play", "--robots", f"A={runs[0]}", f"A={runs[1]}", *call]) == 2
    assert "expected methods of different names (NAME=DIR gives one), found 'A twice'" in capsys.readouterr().err


def test_each_partner_has_its_own_kind_at_the_robots_seat():
    for partner in [make_partner(name, TABLE) for name in parse_partners(["stubborn", "human-like"], TABLE)]:
        robot = cells.own_kind_robot(partner, 1)
        (episode,) = run_with_partners(robot, MAPS[:1], [partner], Physics(step_limit=2000))
        assert episode.success
        assert episode.robot_share is not None
        assert 0.3 < episode.robot_share < 0.7


def test_a_human_like_player_reacts_as_late_as_people():
    agent = make_partner(parse_partners(["human-like,noise=0"], TABLE)[0], TABLE).agent(0, 1)
    starts = [EpisodeStart(MAPS[0], seed, TABLE.make_world(MAPS[0]).observation) for seed in range(12)]
    agent.begin(1, starts)
    delays = {player.profile.delay_steps / 30 for player in agent.players}  # pyright: ignore[reportAttributeAccessIssue]
    assert delays <= {8 / 30, 9 / 30, 10 / 30}
    assert len(delays) > 1


def test_robots_without_a_policy_do_not_depend_on_the_rate_of_the_first_policy(checkpoint, tmp_path, monkeypatch):
    out, faster = tmp_path / "out", save_run(tmp_path / "run", fps=30.0)
    assert run(checkpoint, out) == 0
    ran = []
    original = cells.run_with_partners
    monkeypatch.setattr(
        cells,
        "run_with_partners",
        lambda robot, *rest, **more: ran.append((robot.name, more["fps"])) or original(robot, *rest, **more),
    )
    assert run(faster, out, "--overwrite") == 0
    assert ran == [("own-kind", 30), ("ours", 30), ("nothing", 30), ("never-yields", 30), ("random", 30)]
    ran.clear()
    limits = ("--configurations", "4", "--step-limit", "30", "--maps", "unseen", "--partners", "stubborn")
    robots = (f"slower={checkpoint}", f"ours={faster}")
    assert main(["cross-play", "--robots", *robots, "--out", str(out), *limits]) == 0
    assert ran == [("slower", 10)]


def test_the_matrix_continues_and_notices_other_settings(checkpoint, tmp_path, capsys, monkeypatch):
    out = tmp_path / "crossplay"
    flags = ("--partners", "stubborn", f"still=proxy:{checkpoint},delay=0.1,noise=0.2,commit=0.2", "--json")
    assert run(checkpoint, out, *flags) == 0
    capsys.readouterr()
    result = json.loads((out / "matrix.json").read_text(encoding="utf-8"))
    assert list(result["cells"]) == ["own-kind", "ours", "nothing", "never-yields", "random"]
    assert result["floors"] == ["nothing", "never-yields", "random"]
    assert set(result["cells"]["ours"]) == {"stubborn", "still"}
    assert result["partners"]["still"]["n_action_steps"] == 2
    assert result["overlap"]["unknown"] == dict.fromkeys(("ours", "still"), "the checkpoint does not record its pairs")
    cell = result["cells"]["nothing"]["stubborn"]
    assert cell["episodes"] == 4
    assert cell["measures"]["interaction_force"]["mean"] > 0.1
    assert cell["measures"]["smallest_distance"]["mean"] > 100
    # 30 steps reach no goal, so that no own kind gives a time.
    assert result["scores"] == {}
    assert set(result["no_own_kind"]) == {"stubborn", "still"}
    text = (out / "matrix.md").read_text(encoding="utf-8")
    assert "| robot | stubborn | still |" in text
    rows = list(csv.DictReader((out / "matrix.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 10
    assert rows[0]["is_own_kind"] == "true"
    assert set(MEASURES) == {name.removesuffix("_mean") for name in rows[0] if name.endswith("_mean")} - {"score"}
    assert (out / "matrix.png").read_bytes().startswith(b"\x89PNG")

    # One cell is lost, one robot is new: only their cells run.
    lost = next((out / "cells").glob("random--stubborn*"))
    before = lost.read_text(encoding="utf-8")
    lost.unlink()
    ran = []
    original = cells.run_with_partners
    monkeypatch.setattr(
        cells,
        "run_with_partners",
        lambda robot, *rest, **more: ran.append(robot.name) or original(robot, *rest, **more),
    )
    assert run(checkpoint, out, *flags) == 0
    assert ran == ["random"]
    again = json.loads(lost.read_text(encoding="utf-8"))
    assert again["episodes"] == json.loads(before)["episodes"]
    assert run(checkpoint, out, "--partners", "stubborn", "--robots", f"ours={checkpoint}", "scripted") == 0
    assert ran == ["random", "scripted"]

    # A cell of an earlier version has no adaptations: it is run again.
    again["episodes"] = [{name: row[name] for name in row if name != "adaptations"} for row in again["episodes"]]
    lost.write_text(json.dumps(again), encoding="utf-8")
    assert run(checkpoint, out, *flags) == 0
    assert ran == ["random", "scripted", "random"]
    capsys.readouterr()

    assert run(checkpoint, out, "--seed", "1") == 2
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert "expected seed 1 as in this run (another --out, or --overwrite), found 'seed 0'" in told
    assert run(checkpoint, out, "--seed", "1", "--overwrite") == 0


def test_cells_of_a_policy_with_other_processors_are_refused(checkpoint, tmp_path, capsys):
    """Equal weights with other processors are another policy, at either seat."""
    policy, out = tmp_path / "policy", tmp_path / "out"
    shutil.copytree(checkpoint, policy)
    flags = ("--no-floors", "--partners", f"still=proxy:{policy}")
    assert run(policy, out, *flags) == 0
    other = tmp_path / "other"
    shutil.copytree(policy, other)
    processor = other / "policy_preprocessor.json"
    processor.write_text(processor.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    capsys.readouterr()
    for robot, proxy, entry in ((policy, other, "partner.policy"), (other, policy, "robot")):
        assert run(robot, out, "--no-floors", "--partners", f"still=proxy:{proxy}") == 2
        found, expected = (processors_sha256(folder) for folder in (policy, other))
        assert found != expected
        line = capsys.readouterr().err.strip().splitlines()[-1]
        assert f': expected {entry}.processors_sha256 "{expected}" as in this run (another --out' in line
        assert line.endswith(f"found '{entry}.processors_sha256 \"{found}\"'")
    assert run(policy, out, *flags) == 0


def test_cells_of_other_recordings_are_refused(recordings, tmp_path, capsys):
    """Of as many recordings of the same names."""
    folders, out = [tmp_path / name / "three" for name in ("first", "second")], tmp_path / "out"
    shutil.copytree(recordings, folders[0])
    call = ["--episodes", "3", "--seed", "3", "--maps", "training", "--start-noise", "1", "--workers", "1"]
    assert collect(["simulate", *call, "--pairs", "S06", "--out", str(folders[1])]) == 0
    flags = ["--no-floors", "--configurations", "4", "--step-limit", "10", "--maps", "unseen", "--out", str(out)]

    def play(folder):
        return main(["cross-play", "--robots", "nothing", "--partners", f"r=replay:{folder}", *flags])

    assert play(folders[0]) == 0
    assert play(folders[0]) == 0
    capsys.readouterr()
    assert play(folders[1]) == 2
    assert ": expected recorded_sha256 " in capsys.readouterr().err.strip().splitlines()[-1]


def test_a_cell_that_is_run_again_has_its_own_trajectories_or_none(checkpoint, tmp_path):
    out = tmp_path / "out"

    def steps():
        (cell,) = (out / "cells").glob("ours--stubborn*.json")
        beside = trajectories_beside(cell)
        episodes = read_trajectories(beside).episodes if beside.exists() else None
        stored = [row["steps"] for row in json.loads(cell.read_text(encoding="utf-8"))["episodes"]]
        return stored, episodes and [len(episode.actions) for episode in episodes]

    assert run(checkpoint, out, "--no-floors", "--trajectories") == 0
    assert steps() == ([30] * 4, [30] * 4)
    assert run(checkpoint, out, "--no-floors", "--overwrite", "--step-limit", "20") == 0
    assert steps() == ([20] * 4, None)
    assert run(checkpoint, out, "--no-floors", "--trajectories", "--step-limit", "20") == 0
    assert steps() == ([20] * 4, [20] * 4)
    # A cell of an earlier version is run again for its adaptations; that takes no trajectories away.
    (cell,) = (out / "cells").glob("ours--stubborn*.json")
    stored = json.loads(cell.read_text(encoding="utf-8"))
    stored["episodes"] = [{name: row[name] for name in row if name != "adaptations"} for row in stored["episodes"]]
    cell.write_text(json.dumps(stored), encoding="utf-8")
    assert run(checkpoint, out, "--no-floors", "--step-limit", "20") == 0
    assert steps() == ([20] * 4, [20] * 4)
    assert "adaptations" in cell.read_text(encoding="utf-8")


def test_who_gave_way_is_counted_as_in_the_behaviours_of_the_trajectories(tmp_path, capsys):
    limits = ("--configurations", "8", "--maps", "unseen", "--no-floors", "--trajectories", "--json")
    call = ["cross-play", "--robots", "scripted", "never-yields", "--partners", "follower", *limits]
    assert main([*call, "--out", str(tmp_path / "out")]) == 0
    told = json.loads(capsys.readouterr().out)["partner_score"]
    result = json.loads((tmp_path / "out" / "matrix.json").read_text(encoding="utf-8"))
    assert main(["behaviours", f"all={tmp_path / 'out'}", "--out", str(tmp_path / "behaviours"), "--no-videos"]) == 0
    counted = json.loads((tmp_path / "behaviours" / "behaviours.json").read_text(encoding="utf-8"))["methods"]
    numbers = {name.removeprefix("all: "): method["adaptation"]["number"] for name, method in counted.items()}
    found = result["gave_way"]["robots"]
    assert {name: found[name]["adaptations"] if name in found else 0 for name in numbers} == numbers
    assert numbers["never-yields"] > 0
    assert found["never-yields"]["mean"] == 0
    # All on one of the two maps, which gives no error.
    assert f"gave way 0.0 % (adaptations: {numbers['never-yields']})" in told["never-yields"]
    text = (tmp_path / "out" / "matrix.md").read_text(encoding="utf-8")
    assert "**robot gave way, %**" in text
    assert "| robot | minus floor | score, points | / standard error | gave way, points | / standard error |" in text
    assert [line for line in text.splitlines() if line.startswith("| robot | 0 | 1.571 | 3.142 | 4.712 |")]
    scores = [each["robots"]["scripted"]["mean"] for each in result["by_factor"]["start_theta"].values()]
    assert np.mean(scores) == pytest.approx(result["scores"]["robots"]["scripted"]["mean"])


def test_a_replay_with_other_starts_has_no_part_in_the_scores_by_orientation(recordings, tmp_path):
    out, partners = tmp_path / "out", ("stubborn", f"r=replay:{recordings}")
    call = ["--robots", "scripted", "--partners", *partners, "--configurations", "4", "--maps", "unseen", "--no-floors"]
    assert main(["cross-play", *call, "--out", str(out)]) == 0
    text, document = ((out / f"matrix.{suffix}").read_text(encoding="utf-8") for suffix in ("md", "json"))
    assert "NaN" not in document
    result = json.loads(document)
    assert result["scores"]["robots"]["scripted"]["by_partner"].keys() == {"stubborn", "r"}
    assert list(result["by_factor"]["start_theta"]) == ["0", "1.571", "3.142", "4.712"]
    for value in result["by_factor"]["start_theta"].values():
        assert value["robots"]["scripted"]["by_partner"].keys() == {"stubborn"}
    assert "Partner score by start_theta, % (robots: bootstrap over maps; only with stubborn):" in text


def test_trajectories_alone_are_not_removed_unless_told(checkpoint, tmp_path, capsys):
    """Those of an earlier result must not stand beside another one."""
    beside = tmp_path / "result.trajectories.parquet"
    limits = ("--maps", "unseen", "--step-limit", "10", "--out", str(tmp_path / "result.json"))
    studies = {
        "coplan": ["coplan", "--policy", str(checkpoint), "--limit", "1"],
        "partner": ["partner", str(checkpoint), "--no-baseline", "--partners", "stubborn", "--configurations", "4"],
    }
    for call in studies.values():
        beside.write_bytes(b"of an earlier result")
        assert main([*call, *limits]) == 2
        assert f"{beside}: expected a path that does not exist yet, found one" in capsys.readouterr().err
        assert main([*call, *limits, "--overwrite"]) == 0
        assert not beside.exists()
        (tmp_path / "result.json").unlink()
        (tmp_path / "result.png").unlink()


def test_two_runs_do_not_share_a_folder(checkpoint, tmp_path, capsys):
    with FolderLock(tmp_path / ".lock", ""):
        assert run(checkpoint, tmp_path) == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.endswith(f"{tmp_path}: expected a folder in which no other cross-play runs, found one running")


@pytest.fixture(scope="module")
def recordings(tmp_path_factory) -> Path:
    """Three simulated episodes."""
    folder = tmp_path_factory.mktemp("recordings") / "three"
    call = ["--episodes", "3", "--seed", "2", "--maps", "training", "--start-noise", "1", "--workers", "1"]
    assert collect(["simulate", *call, "--pairs", "S06", "--out", str(folder)]) == 0
    return folder


def test_a_replay_with_its_own_kind_is_the_recording(recordings):
    (name,) = parse_partners([f"replay:{recordings}"], TABLE)
    protocol = Protocol(TABLE, 10, Physics(step_limit=2000))
    partner = make_partner(name, TABLE, protocol, starts=2)
    assert partner.recorded is not None
    assert partner.recorded.describe()["starts"] == 2
    robot = cells.own_kind_robot(partner, 2)
    episodes = run_with_partners(robot, (), [partner], Physics(step_limit=2000), repeats=2)
    assert [episode.success for episode in episodes] == [True] * 4
    assert [episode.steps for episode in episodes[::2]] == [len(actions) for actions in partner.recorded.actions]
    np.testing.assert_array_equal(episodes[0].actions, partner.recorded.actions[0])
    protocol = Protocol(TABLE, 10, Physics(step_limit=2000, angular_acceleration_limit=0.5))
    with pytest.raises(InvalidValueError, match="recordings under the study's world settings"):
        make_partner(name, TABLE, protocol, starts=2)


def test_a_replay_is_the_only_partner_of_a_partner_study(checkpoint, recordings, tmp_path, capsys):
    call = [
        "partner",
        str(checkpoint),
        "--configurations",
        "4",
        "--step-limit",
        "20",
        "--out",
        str(tmp_path / "p.json"),
    ]
    assert main([*call, "--partners", f"replay:{recordings}", "stubborn"]) == 2
    assert "expected a replay as the only partner" in capsys.readouterr().err.splitlines()[-1]
    assert main([*call, "--partners", f"replay:{recordings}", "--no-baseline"]) == 0
    result = json.loads((tmp_path / "p.json").read_text(encoding="utf-8"))
    assert result["settings"]["configurations"] == len(result["episodes"]) <= 3
    assert run(checkpoint, tmp_path / "x", "--partners", f"replay:{recordings}", "slow", "--no-floors") == 0


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--partners", "kind"], "unknown kind of partner 'kind'; available: erratic, follower, slow, stubborn"),
        (["--partners", "replay:nowhere"], "nowhere: expected a folder of recordings or a data set, found no such"),
        (
            ["--robots", "own-kind={0}"],
            "--robots: expected robots and methods of different names (NAME=CKPT gives one), other",
        ),
        (["--configurations", "3"], "--configurations: expected a multiple of 4 from 4 to 336, found 3"),
        (["--partners", "still=proxy:{0},commit=9"], "proxy still: commit: expected at most 1 s, a whole chunk, found"),
    ],
)
def test_a_wrong_call_is_one_line(checkpoint, tmp_path, capsys, flags, message):
    assert run(checkpoint, tmp_path / "out", *(flag.format(checkpoint) for flag in flags)) == 2
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert told.startswith(f"copolicy-eval: {message}")
    assert not (tmp_path / "out").exists()
