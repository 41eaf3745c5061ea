"""`copolicy-dataset check` on files: whole, broken, released, on the Hub."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from checked_data import EPISODES, FRAMES, contents, make_data_set, make_recordings, set_columns, set_frames

from copolicy.dataset.cli import main
from copolicy.dataset.versions.release import release


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return make_recordings(tmp_path_factory.mktemp("command") / "recordings", 4)


@pytest.fixture(scope="module")
def converted(recorded):
    return make_data_set(recorded, recorded.parent / "set")


@pytest.fixture
def recordings(recorded, tmp_path):
    return shutil.copytree(recorded, tmp_path / "recordings")


@pytest.fixture
def root(converted, tmp_path):
    return shutil.copytree(converted, tmp_path / "set")


@pytest.fixture
def check(capsys):
    """Runs the command; gives its exit status and its findings as text."""

    def run(*arguments) -> tuple[int, list[str]]:
        status = main(["check", *map(str, arguments), "--json"])
        summary = json.loads(capsys.readouterr().out)
        lines = [f"{f['severity']} {f['rule']} [{f['episode']}] {f['message']}" for f in summary["findings"]]
        assert summary["passed"] == (status == 0)
        for severity, count in summary["counts"].items():
            assert count == sum(line.startswith(severity) for line in lines)
        return status, lines

    return run


def serious(lines: list[str]) -> list[str]:
    return [line for line in lines if not line.startswith("info")]


def test_sound_data_pass_and_are_left_alone(recordings, root, check):
    before = contents(recordings), contents(root)
    status, lines = check(root, "--strict", "--no-save")
    assert (status, serious(lines)) == (0, [])
    status, lines = check(recordings)
    message = "of 4 episodes state no licence; nobody may use them"
    assert (status, serious(lines)) == (0, [f"warning license [] {message}"])
    assert check(recordings, "--strict")[0] == 1
    assert (contents(recordings), contents(root)) == before


def test_findings_as_text(root, capsys):
    set_columns(root, source=["human"] * 4, consent_id=["c-1", "c-2", "", "c-4"])
    assert main(["check", str(root)]) == 1
    lines = capsys.readouterr().out.splitlines()
    what = "people were recorded, but there is no record of their consent"
    assert lines[0] == f"error: consent: episode 2: {what} (nothing; limit a consent_id)"
    assert lines[1].startswith("warning: achieved_hz: ")
    assert "  error    1" in lines
    assert lines[-1] == "passed       False"


def test_findings_as_json_name_episode_rule_figure_and_limit(root, capsys):
    set_frames(root, "action", lambda actions: np.where(np.arange(len(actions))[:, None] == 3, 1.5, actions))
    assert main(["check", str(root), "--json"]) == 1
    summary = json.loads(capsys.readouterr().out)
    entry = next(finding for finding in summary["findings"] if finding["rule"] == "action_range")
    assert (entry["episode"], entry["figure"], entry["severity"]) == ("0", 1.5, "error")
    assert entry["limit"] == pytest.approx(1.0, abs=1e-5)
    assert (summary["kind"], summary["episodes"], summary["not_applied"]) == ("lerobot", 4, {})


def test_damaged_and_unfinished_recordings(recordings, check):
    broken = recordings / "episode_000001.mcap"
    data = bytearray(broken.read_bytes())
    data[len(data) // 2] ^= 4
    broken.write_bytes(bytes(data))
    (recordings / "episode_000003.mcap").rename(recordings / "episode_000003.mcap.part")
    status, lines = check(recordings)
    assert status == 1
    assert lines[0].startswith("error check_sum [episode_000001.mcap] expected an intact")
    recover = "an unfinished recording; copolicy-collect recover makes it readable"
    assert f"warning unfinished [episode_000003.mcap.part] {recover}" in lines


def test_only_damaged_recordings_are_findings_too(recordings, check):
    for path in recordings.glob("*.mcap"):
        path.write_bytes(path.read_bytes()[:1000])
    status, lines = check(recordings)
    assert status == 1
    assert [line.split()[1] for line in lines] == ["check_sum"] * 4


def test_a_broken_table_of_frames(root, check):
    path = root / FRAMES
    path.write_bytes(path.read_bytes()[:-10])
    status, lines = check(root)
    assert status == 1
    assert lines[0].startswith(f"error check_sum [] {FRAMES.as_posix()} cannot be read: ")
    assert "error check_sum [] no Parquet file in data can be read" in lines
    assert "error rows [] total_frames of meta/info.json differs from the files" in lines


def test_rows_that_are_missing(root, check):
    import pyarrow.parquet as pq

    table = pq.ParquetFile(root / FRAMES).read()
    pq.write_table(table.slice(0, table.num_rows - 5), root / FRAMES)
    status, lines = check(root)
    assert status == 1
    assert serious(lines) == [
        "error rows [3] wrong number of frames",
        "error rows [] total_frames of meta/info.json differs from the files",
    ]


def test_a_broken_table_of_episodes_is_no_data_set(root, capsys):
    (root / EPISODES).write_bytes(b"nothing")
    assert main(["check", str(root)]) == 2
    expected = "expected a table with episode_index and length, found none that can be read\n"
    assert capsys.readouterr().err == f"copolicy-dataset: {root / 'meta' / 'episodes'}: {expected}"


def test_a_released_file_that_changed(root, check):
    release(root, "minor", "the first")
    assert check(root)[0] == 0
    (root / "README.md").write_text("not released", encoding="utf-8")
    stats = root / "meta" / "stats.json"
    stats.write_text(stats.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    status, lines = check(root)
    assert status == 1
    assert [line.split(";")[0] for line in serious(lines)] == [
        "error check_sum [] README.md has other content",
        "error check_sum [] meta/stats.json has other content",
    ]
    (root / "meta" / "manifest.json").write_text("[]", encoding="utf-8")
    assert serious(check(root)[1])[0].startswith("error check_sum [] meta/manifest.json: expected a manifest")


def test_two_data_sets_that_share_an_episode(root, recordings, tmp_path, check):
    for name in ("episode_000000.mcap", "episode_000001.mcap", "episode_000003.mcap"):
        (recordings / name).unlink()
    test = make_data_set(recordings, tmp_path / "test", "--license", "cc0-1.0")
    status, lines = check(root, "--against", test)
    assert status == 1
    assert serious(lines) == [
        f"error leakage [2 of set] same {what} as episode 0 of test"
        for what in ("episode_uuid", "source_sha256", "states and actions")
    ]
    assert any(line.startswith("info leakage_people [] the same pair_id in set and test") for line in lines)


def test_the_call_is_wrong(tmp_path, capsys):
    def error(*arguments: str) -> str:
        assert main(["check", *arguments]) == 2
        return capsys.readouterr().err.removeprefix("copolicy-dataset: ").rstrip()

    nowhere, empty = tmp_path / "nowhere", tmp_path / "empty"
    empty.mkdir()
    assert (
        error(str(nowhere))
        == f"{nowhere}: expected a folder, or USER/NAME of a data set on the Hub, found no such file or folder"
    )
    found = "expected recordings (*.mcap) or a LeRobot data set (meta/info.json), found an empty folder"
    assert error(str(empty)) == f"{empty}: {found}"
    assert error() == "PATH: expected a folder, or USER/NAME of a data set on the Hub, found None"
    expected = f"--revision: expected a data set on the Hub, {empty} is a folder, found 'v3.0'"
    assert error(str(empty), "--revision", "v3.0") == expected


def test_a_name_of_the_hub_is_looked_up_there(tmp_path, monkeypatch, capsys):
    # Tests may not reach the network: the Hub's client says so, for this name.
    monkeypatch.chdir(tmp_path)
    assert main(["check", "lab/no-such-table", "--revision", "data-1.0.0"]) == 1
    error = "lab/no-such-table: querying the Hub: the Hub's client is offline (HF_HUB_OFFLINE is set)"
    assert capsys.readouterr().err == f"copolicy-dataset: {error}\n"


def test_every_limit_is_printed(capsys):
    assert main(["check", "--rules"]) == 0
    out = capsys.readouterr().out
    assert "late_ticks.warning" in out
    assert "every tenth action was applied to a state that people did not see yet" in out


def test_help_waits_for_no_heavy_package():
    code = (
        "import sys; from copolicy.dataset.checks.command import add_check_command; "
        "print([name for name in ('scipy', 'pyarrow', 'huggingface_hub', 'torch') if name in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
