"""Conversions in shards that end early: finished shards stay, and a second call converts the others."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
from sharded_calls import EPISODES, call, content, damage, times_of

from copolicy.convert.cli import main

COMMAND = [sys.executable, "-c", "from copolicy.convert.cli import main; raise SystemExit(main())"]


def test_a_finished_shard_is_not_converted_again(unsharded, tmp_path, capsys):
    recordings = Path(shutil.copytree(unsharded / "recordings", tmp_path / "recordings"))
    shards, broken = tmp_path / "shards", recordings / "episode_000002.mcap"
    sound = broken.read_bytes()
    damage(broken)
    damage(recordings / "episode_000003.mcap")
    flags = ("--shard-episodes", "2", "--shards", str(shards))
    assert main(call(recordings, tmp_path / "set", *flags)) == 1
    error = capsys.readouterr().err
    assert error.startswith(f"copolicy-convert: {broken}: expected an intact and complete MCAP file, found ")
    assert error.endswith(
        f" (and 1 more, in {shards / 'damaged'}); 2 of 3 shards are finished and kept in {shards}: repair or remove "
        "such files, or add --skip-damaged, and run again\n"
    )
    assert error.count("\n") == 1
    assert not (tmp_path / "set").exists()
    before = times_of(shards)
    assert set(before) == {"00000", "00002"}

    assert main(call(recordings, tmp_path / "without", *flags, "--skip-damaged", "--json")) == 0
    summary = json.loads(capsys.readouterr().out)
    assert (summary["episodes"], summary["finished_before"]) == (EPISODES - 2, 2)
    assert [message.split(":")[0] for message in summary["damaged_left_out"]] == [
        str(broken), str(recordings / "episode_000003.mcap"),
    ]  # fmt: skip
    left_out = json.loads((tmp_path / "without/meta/copolicy.json").read_text(encoding="utf-8"))["left_out"]
    assert left_out == {"damaged": ["episode_000002.mcap", "episode_000003.mcap"], "discarded": []}
    assert before.items() <= times_of(shards).items()

    broken.write_bytes(sound)
    shutil.copy(unsharded / "recordings/episode_000003.mcap", recordings)
    assert main(call(recordings, tmp_path / "set", *flags)) == 0
    assert before.items() <= times_of(shards).items()
    assert content(tmp_path / "set") == content(unsharded / "whole")


@contextmanager
def halted_at_work(
    arguments: list[str], begun: Callable[[], object]
) -> Iterator[tuple[subprocess.Popen, psutil.Process]]:
    """The command, and the process of its pool halted as soon as something has begun; neither outlives the block."""
    workers: list[psutil.Process] = []
    with subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command:
        try:
            while not (workers and begun()):
                assert command.poll() is None, f"it ended first: {command.communicate()}"
                if not workers:
                    children = psutil.Process(command.pid).children()
                    workers = [
                        child for child in children if any("spawn_main" in argument for argument in child.cmdline())
                    ]
                time.sleep(0.005)
            workers[0].suspend()
            yield command, workers[0]
        finally:
            command.kill()
            for worker in workers:
                with suppress(psutil.NoSuchProcess):
                    worker.kill()


def test_killed_processes_leave_nothing_half_and_a_rerun_finishes(unsharded, tmp_path, capsys):
    """The command killed while the last shard is made, then the process that makes it, then the same call once more."""
    recordings = Path(shutil.copytree(unsharded / "recordings", tmp_path / "recordings"))
    shards, root, last = tmp_path / "shards", tmp_path / "set", recordings / "episode_000005.mcap"
    arguments = call(recordings, root, "--shard-episodes", "2", "--shards", str(shards))
    sound = last.read_bytes()
    damage(last)
    assert main(arguments) == 1
    capsys.readouterr()
    last.write_bytes(sound)
    finished = times_of(shards)
    assert set(finished) == {"00000", "00001"}
    in_pool = [*arguments, "--workers", "2"]

    def begun() -> list[Path]:
        return list(shards.glob("shards/.*.partial"))

    with halted_at_work(in_pool, begun) as (command, worker):
        (orphaned,) = begun()
        command.kill()
        worker.resume()
        assert psutil.wait_procs([worker], timeout=60)[1] == []
        assert command.communicate(timeout=60)[0] == ""
    assert times_of(shards) == finished
    assert begun() == [orphaned]
    assert not root.exists()

    def half_written() -> bool:
        return any(path.parent != orphaned for path in shards.glob("shards/.*.partial/*"))

    with halted_at_work(in_pool, half_written) as (command, worker):
        worker.kill()
        out, error = command.communicate(timeout=60)
    assert (command.returncode, out) == (1, "")
    assert error == (
        f"copolicy-convert: {shards}: a process was killed, perhaps out of memory; 2 of 3 shards are finished and "
        f"kept in {shards}: run the command again\n"
    )
    assert times_of(shards) == finished
    assert half_written()
    assert not orphaned.exists()
    assert not root.exists()

    assert main(arguments) == 0
    assert capsys.readouterr().err == ""
    assert finished.items() < times_of(shards).items()
    assert not list(shards.glob("shards/.*"))
    assert content(root) == content(unsharded / "whole")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["recordings", "set", "shards"]


def test_files_of_a_killed_merge_are_removed(unsharded, tmp_path):
    leftover = tmp_path / ".set.merging"
    leftover.mkdir()
    (leftover / "half").write_text("", encoding="utf-8")
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shard-episodes", "4")) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_shards_of_another_call_are_refused(unsharded, tmp_path, capsys):
    shards = tmp_path / "shards"
    flags = ("--shards", str(shards), "--shard-episodes", "4")
    assert main(call(unsharded / "recordings", tmp_path / "set", *flags)) == 0
    before = times_of(shards)
    assert main(call(unsharded / "recordings", tmp_path / "other", *flags, "--fps", "30")) == 2
    folder = tmp_path / "photographs"
    folder.mkdir()
    (folder / "one.jpg").write_text("", encoding="utf-8")
    assert main(call(unsharded / "recordings", tmp_path / "other", "--shards", str(folder))) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"copolicy-convert: fps of the shards in {shards}: expected 30 (finish that call first, or give another "
        "--shards), found 10",
        f"copolicy-convert: {folder}: expected a new folder, or one with the shards of this call, found another",
    ]
    assert times_of(shards) == before
    assert list(folder.iterdir()) == [folder / "one.jpg"]


@pytest.fixture(scope="module")
def sharded(unsharded, tmp_path_factory) -> Path:
    """The shards of a conversion that has finished."""
    folder = tmp_path_factory.mktemp("sharded")
    flags = ("--shards", str(folder / "shards"), "--shard-episodes", "4")
    assert main(call(unsharded / "recordings", folder / "set", *flags)) == 0
    return folder / "shards"


@pytest.mark.parametrize("content", ["[]", "{}", "null", '{"digest": 1, "episodes": 3}', "{"])
def test_a_shard_with_an_invalid_record_is_converted_again(unsharded, sharded, tmp_path, capsys, content):
    flags = ("--shards", str(shutil.copytree(sharded, tmp_path / "shards")), "--shard-episodes", "4")
    record = next((tmp_path / "shards").rglob("shard.json"))
    times = times_of(tmp_path / "shards")
    record.write_text(content, encoding="utf-8")
    assert main(call(unsharded / "recordings", tmp_path / "again", *flags)) == 0
    assert json.loads(record.read_text(encoding="utf-8"))["episodes"]
    again = times_of(tmp_path / "shards")
    assert [name for name in times if times[name] != again[name]] == [record.parent.name]  # and no other


@pytest.mark.parametrize("content", ["[]", "3", "{"])
def test_options_of_another_form_are_refused(unsharded, tmp_path, capsys, content):
    shards = tmp_path / "shards"
    shards.mkdir()
    (shards / "options.json").write_text(content, encoding="utf-8")
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shards", str(shards))) == 2
    error = capsys.readouterr().err
    expected = f"{shards / 'options.json'}: expected the options of a conversion, found "
    assert error.startswith(f"copolicy-convert: {expected}")
    assert error.count("\n") == 1


def test_two_calls_do_not_work_in_one_folder(unsharded, tmp_path, capsys):
    shards = tmp_path / "shards"
    shards.mkdir()
    holder = (
        "import fcntl, sys, time; file = open(sys.argv[1], 'wb'); fcntl.flock(file, fcntl.LOCK_EX); print('held', "
        "flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", holder, str(shards / "lock")], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert main(call(unsharded / "recordings", tmp_path / "set", "--shards", str(shards))) == 1
        process.kill()
    expected = f"copolicy-convert: {shards}: expected shards that no other call works on, found one at work\n"
    assert capsys.readouterr().err == expected
    assert main(call(unsharded / "recordings", tmp_path / "set", "--shards", str(shards))) == 0
