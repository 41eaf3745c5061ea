"""`copolicy-eval figures` on files: data sets, results, cross-plays, and a second task."""

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from test_figures import carry

from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask, get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.coplan.rollouts import EpisodeResult
from copolicy.evaluate.figures.faults import SENTENCES
from copolicy.evaluate.trajectories import Trajectory, trajectories_beside, write_trajectories
from copolicy.evaluate.trajectory_sources import read_sources

NAMES = ("visitation", "force-map", "force-path", "success-by-map")


def store(path: Path, episodes: list[tuple[str, Trajectory]], task: PairTask | None = None) -> Path:
    """A trajectories file of the episodes of robots."""
    task = task or get_task()
    results = [
        (
            robot,
            EpisodeResult(
                index, episode.scenario, 0, episode.columns["success"], "goal", 0, None, None,
                task=task, end=len(episode.actions), states=episode.every_state, actions=episode.actions,
            ),
        )
        for index, (robot, episode) in enumerate(episodes)
    ]  # fmt: skip
    write_trajectories(path, task, "constructed episodes, no person took part", results)
    return path


@pytest.fixture(scope="module")
def study(tmp_path_factory) -> Path:
    """A result with the trajectories of two robots beside it."""
    result = tmp_path_factory.mktemp("study") / "result.json"
    result.write_text("{}", encoding="utf-8")
    episodes = [("A", carry(force=0.5)), ("A", carry(force=0.3)), ("B", carry(force=0.1))]
    store(trajectories_beside(result), episodes)
    return result


def test_a_data_set_and_a_study_make_every_figure(unsharded, study, tmp_path, capsys):
    out = tmp_path / "figures"
    call = ["figures", f"pairs={unsharded / 'whole'}", f"study={study}", "--out", str(out)]
    assert main([*call, "--as-published", "--min-episodes", "1", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    every = [*NAMES, *(f"{name}-as-published" for name in NAMES[:3])]
    assert told["figures"] == [str(out / f"{name}.{ending}") for name in every for ending in ("png", "svg")]
    assert sorted(path.name for path in out.iterdir()) == sorted(
        ["figures.json", *(f"{name}.{ending}" for name in every for ending in ("png", "svg"))]
    )
    for name in every:
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert ElementTree.parse(out / f"{name}.svg").getroot().tag.endswith("svg")

    document = json.loads((out / "figures.json").read_text(encoding="utf-8"))
    assert (document["task"], document["left_out"]) == ("table", {})
    assert document["scene"] == {"size": [1200, 600], "unit": "px", "y": "down"}
    sources = {entry["name"]: entry for entry in document["sources"]}
    assert list(sources) == ["pairs", "study: A", "study: B"]
    assert sources["pairs"]["label"] == "demonstrations, source: simulated"
    assert (sources["pairs"]["demonstrations"], sources["pairs"]["fps"]) == (True, [10])
    assert (sources["study: A"]["episodes"], sources["study: A"]["fps"]) == (2, [30])
    assert {shape["role"] for shape in sources["pairs"]["fixed"]} == {"obstacle", "goal"}
    figures = document["figures"]
    assert list(figures) == every
    for panel in figures["visitation"]["panels"].values():
        assert sum(cell["rate"] for cell in panel) == pytest.approx(100, abs=1e-3)
    cells = {(cell["row"], cell["column"]): cell for cell in figures["force-map"]["panels"]["study: A"]}
    assert cells[6, 5] == {"row": 6, "column": 5, "samples": 100, "episodes": 2, "above": [100, 0]}
    assert figures["force-map"]["interaction_unit"] == "units of a player's full force"
    assert figures["force-path"]["panels"]["study: A"]["episode"] == 1  # the lower median
    assert list(figures["force-path-as-published"]["faults"]) == [
        "unit_demonstrations", "mirrored_axis", "unsigned_demonstrations"
    ]  # fmt: skip
    assert "no result" in figures["visitation-as-published"]["definition"]


def test_the_same_call_gives_the_same_files(study, tmp_path):
    for name in ("a", "b"):
        out = str(tmp_path / name)
        assert main(["figures", f"S={study}#A", "--only", "visitation", "success-by-map", "--out", out]) == 0
    for name in ("visitation.png", "visitation.svg", "success-by-map.svg", "figures.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_the_document_says_which_map_was_chosen(study, tmp_path):
    name_of_map = f"custom-{carry().scenario.digest}"
    for name, flags in (("all", ()), ("one", ("--map", name_of_map))):
        call = ["figures", f"S={study}", "--only", "success-by-map", "--out", str(tmp_path / name)]
        assert main([*call, *flags]) == 0
    documents = [json.loads((tmp_path / name / "figures.json").read_text(encoding="utf-8")) for name in ("all", "one")]
    assert [document.get("map") for document in documents] == [None, name_of_map]
    figure = documents[1]["figures"]["success-by-map"]
    assert figure["unit"] == "proportion"
    assert figure["definition"].startswith("proportion of the episodes")


def test_a_figure_is_not_replaced_without_being_told(study, tmp_path, capsys):
    call = ["figures", f"S={study}", "--only", "visitation", "--out", str(tmp_path / "out")]
    assert main(call) == 0
    capsys.readouterr()
    assert main(call) == 2
    assert "visitation.png: expected a path that does not exist yet, found one" in capsys.readouterr().err
    assert main([*call, "--overwrite"]) == 0


def store_cell(folder: Path, name: str, episodes: list[tuple[str, Trajectory]], **settings) -> Path:
    """A cell of a cross-play: its result, of which only the settings are read, and its trajectories."""
    store(folder / f"cells/{name}.trajectories.parquet", episodes)
    result = folder / f"cells/{name}.json"
    result.write_text(json.dumps({"settings": settings}), encoding="utf-8")
    return result


def test_cells_of_a_cross_play_are_pooled_by_robot(tmp_path):
    store_cell(tmp_path, "A--x", [("A", carry()), ("A", carry())], seed=0, fps=10, robot={"type": "a"})
    store_cell(tmp_path, "A--y", [("A", carry())], seed=0, fps=10, robot={"type": "a"})
    store_cell(tmp_path, "B--x", [("B", carry())], seed=0, fps=30, robot={"type": "b"})
    _, sources = read_sources([f"play={tmp_path}"])
    assert {source.name: len(source.episodes) for source in sources} == {"play: A": 3, "play: B": 1}
    _, (source,) = read_sources([f"play={tmp_path}#B"])
    assert (source.name, len(source.episodes)) == ("play", 1)


def test_cells_of_two_cross_plays_are_not_pooled(tmp_path, capsys):
    call = ["figures", f"play={tmp_path}", "--out", str(tmp_path / "out")]
    store_cell(tmp_path, "A--x", [("A", carry())], seed=0, map_set={"name": "unseen", "version": 1})
    cell = store_cell(tmp_path, "A--y", [("A", carry())], seed=0, map_set={"name": "unseen", "version": 2})
    assert main(call) == 2
    expected = f"{cell}: expected map_set.version 1, as in A--x.trajectories.parquet, found 2"
    assert expected in capsys.readouterr().err
    cell.unlink()  # as after a process that was killed between the two files
    assert main(call) == 2
    expected = f"{cell}: expected the result of the trajectories beside it, found no such file"
    assert expected in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_name_of_the_present_folder_is_its_name(tmp_path, monkeypatch):
    (tmp_path / "play").mkdir()
    store_cell(tmp_path / "play", "A--x", [("A", carry())])
    monkeypatch.chdir(tmp_path / "play")
    assert [source.name for source in read_sources(["."])[1]] == ["play"]


def test_a_data_set_has_no_robots(unsharded):
    with pytest.raises(InvalidValueError, match="expected a data set without #ROBOT, found 'A'"):
        read_sources([f"pairs={unsharded / 'whole'}#A"])


def test_a_name_is_that_of_the_file_if_there_is_none(study):
    assert [source.name for source in read_sources([f"{study}#A"])[1]] == ["result"]
    assert [source.name for source in read_sources([f"{trajectories_beside(study)}#A"])[1]] == ["result"]


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["S={study}#C"], "expected a robot of the study (A, B), found 'C'"),
        (["S={study}#A", "S={study}#B"], "NAME=SOURCE: expected different names, found ['S', 'S']"),
        (["S={missing}.json"], "missing.trajectories.parquet: expected the trajectories of a study (--trajectories of "
         "copolicy-eval), found no such file"),
        (["S={missing}"], "missing: expected a data set, a result with trajectories (--trajectories), or the folder of "
         "a cross-play with them, found no such file"),
        (["S={folder}"], "expected a data set, a result with trajectories (--trajectories), or the folder of a "
         "cross-play with them, found none"),
        (["S={study}", "--map", "x"], "--map: expected the map_id of an episode"),
        (["S={study}#A", "--episode", "S=2"], "--episode: expected an episode of S (0 to 1, without excluded ones), "
         "found 'S=2'"),
        (["S={study}", "--as-published", "y-up"], "unknown fault 'y-up'; available: accumulated, "),
        (["S={study}", "--min-episodes", "0"], "--min-episodes: expected at least 1, found 0"),
    ],
)  # fmt: skip
def test_a_wrong_call_is_one_line_and_writes_nothing(study, tmp_path, capsys, flags, text):
    (tmp_path / "folder").mkdir()
    values = {"study": study, "missing": tmp_path / "missing", "folder": tmp_path / "folder"}
    arguments = [flag.format(**values) for flag in flags]
    assert main(["figures", *arguments, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert text in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_disk_error_leaves_no_figure(study, tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    drawn = Figure.savefig

    def full(figure, path, **options):
        if options["format"] == "svg":
            raise OSError(28, "No space left on device")
        drawn(figure, path, **options)

    monkeypatch.setattr(Figure, "savefig", full)
    assert main(["figures", f"S={study}", "--only", "visitation", "--out", str(tmp_path / "out")]) == 1
    assert list((tmp_path / "out").iterdir()) == []


def test_the_peg_has_the_figures_that_need_no_interaction(peg, tmp_path, capsys):
    scenario = peg.scenario_sets["right"][0]
    states = np.zeros((41, 2))
    states[:, 0] = -0.5 + 0.01 * np.arange(41)  # m: 20 cells of 2 m / 100, two frames each
    push = Trajectory(states[:-1], np.zeros((40, 2)), states[-1], 20, scenario, {"success": True})
    file = store(tmp_path / "peg.trajectories.parquet", [("R", push), ("R", replace(push))], peg)
    out = tmp_path / "out"
    assert main(["figures", f"peg={file}", "--as-published", "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    reason = "left out: the task 'peg' has no interaction measure"
    assert told["left_out"] == {
        "force-map": reason,
        "force-path": reason,
        "as-published": "left out: the task 'peg' has no published figures (`studies.figures`)",
    }
    document = json.loads((out / "figures.json").read_text(encoding="utf-8"))
    assert list(document["figures"]) == ["visitation", "success-by-map"]
    assert document["left_out"] == told["left_out"]
    visited = document["figures"]["visitation"]
    assert visited["grid"] == {"cell": 0.02, "rows": 20, "columns": 100}
    cells = visited["panels"]["peg"]
    assert {cell["row"] for cell in cells} == {10}  # the line is in the middle of 0.4 m
    assert sum(cell["rate"] for cell in cells) == pytest.approx(100)
    assert len(cells) in (20, 21)
    assert document["figures"]["success-by-map"]["maps"]["right-00"]["peg"]["episodes"] == 2
    assert sorted(path.name for path in out.iterdir()) == [
        "figures.json", "success-by-map.png", "success-by-map.svg", "visitation.png", "visitation.svg"
    ]  # fmt: skip

    assert main(["figures", f"peg={file}", "--only", "force-map", "--out", str(tmp_path / "none")]) == 2
    assert f"--only: expected a figure for which the task has the parts, found {{'force-map': \"{reason}\"}}" in (
        capsys.readouterr().err
    )
    assert not (tmp_path / "none").exists()


def test_a_task_without_an_outline_has_success_by_map_alone(peg, tmp_path, monkeypatch):
    push = Trajectory(
        np.zeros((4, 2)), np.zeros((4, 2)), np.zeros(2), 20, peg.scenario_sets["right"][0], {"success": False}
    )
    file = store(tmp_path / "peg.trajectories.parquet", [("R", push)], peg)
    monkeypatch.setattr(type(peg), "outline", None)
    out = tmp_path / "out"
    assert main(["figures", f"peg={file}", "--out", str(out)]) == 0
    document = json.loads((out / "figures.json").read_text(encoding="utf-8"))
    assert list(document["figures"]) == ["success-by-map"]
    assert document["left_out"] == dict.fromkeys(NAMES[:3], "left out: the task 'peg' has no outline")
    assert document["figures"]["success-by-map"]["maps"]["all"]["peg"]["mean"] == 0


def test_tasks_are_not_mixed(peg, study, tmp_path, capsys):
    push = Trajectory(
        np.zeros((4, 2)), np.zeros((4, 2)), np.zeros(2), 20, peg.scenario_sets["right"][0], {"success": True}
    )
    file = store(tmp_path / "peg.trajectories.parquet", [("R", push)], peg)
    assert main(["figures", f"S={study}", f"peg={file}", "--out", str(tmp_path / "out")]) == 2
    assert "expected a source of the task table as before it, found 'peg'" in capsys.readouterr().err


def test_the_help_names_every_fault(capsys):
    with pytest.raises(SystemExit):
        main(["figures", "--help"])
    told = capsys.readouterr().out
    assert all(name in told for name in SENTENCES)
