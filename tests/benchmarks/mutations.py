"""Damages every field of a small data set, one at a time, and drives every command that reads data sets over it.

    uv run python tests/benchmarks/mutations.py --every 1

prints, for each command, how many damages ended in a traceback, how many passed although something that the command
uses was wrong, and how many were right: refused in one line, found, or harmless. `--every N` takes each N-th damage.
`unlike check` counts those that passed where `check` finds an error: right only where the command does not use what
was damaged, which `--verbose` lets a reader judge.
"""

import argparse
import contextlib
import io
import shutil
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

from damaged_sets import Damage, copy_of, damages, harmless, look_before_training, unused_in_training

Run = Callable[[list[str]], int]
_PRINTED = ("traceback", "passed wrongly", "several lines", "unlike check")


def commands(root: Path, scratch: Path, sound: Path, before: bool) -> Iterator[tuple[str, Run, list[str]]]:
    """Name, entry point and arguments of every command that reads a data set."""
    from copolicy.cards.cli import main as cards
    from copolicy.convert.cli import main as convert
    from copolicy.dataset.cli import main as dataset

    yield "check", dataset, ["check", str(root), "--no-save"]
    yield "stats", dataset, ["stats", str(root), "--out", str(scratch / "stats.json")]
    yield "exclude", dataset, ["exclude", str(root), "--list"]
    yield "diff", dataset, ["diff", str(root), str(sound)]
    yield "release", dataset, ["release", str(root), "--bump", "major", "--notes", "n"]
    yield "card", cards, ["dataset", str(root), "--repo-id", "local/x", "--overwrite"]
    yield "report", cards, ["report", str(root), "--out", str(scratch / "report.html")]
    yield "zarr", convert, ["export", str(root), "--out", str(scratch / "b.zarr"), "--format", "zarr"]
    yield "robomimic", convert, ["export", str(root), "--out", str(scratch / "r.hdf5"), "--format", "robomimic"]
    yield "minari", convert, ["export", str(root), "--out", str(scratch / "m-v0"), "--format", "minari"]
    yield "merge", convert, ["merge", str(root), str(sound), "--out", str(scratch / "merged"), "--repo-id", "l/m"]
    yield "train", train, [str(root)]
    if not before:
        part = str(scratch / "part")
        yield "select", dataset, ["select", str(root), "--out", part, "--episode-ids", "1"]
        yield "split", dataset, ["split", str(root), "--out", part, "--parts", "a=0.5", "b=rest", "--by", "episodes"]
        yield "amend", dataset, ["amend", str(root), "--set", "session_id=S9"]
        yield "restore", dataset, ["amend", str(root), "--restore-from", str(sound)]
        yield "withdraw", dataset, ["withdraw", "C1", str(root)]


def train(arguments: list[str]) -> int:
    """What `copolicy-train` looks at before the first step."""
    from copolicy.dataset.exceptions import CopolicyError

    try:
        look_before_training(Path(arguments[0]))
    except CopolicyError as error:
        print(error, file=sys.stderr)
        return error.exit_status
    return 0


def outcome(run: Run, arguments: list[str]) -> tuple[str, str]:
    """`traceback`, `refused`, or `passed`, and what was printed on stderr."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(printed):
        try:
            status = run(arguments)
        except SystemExit as error:
            status = int(error.code or 0)
        except Exception:
            return "traceback", traceback.format_exc()
    return ("refused" if status else "passed"), printed.getvalue()


def wrongly(name: str, damage: Damage) -> bool:
    """Whether a command that passes used what was damaged: `check` must find all that a data set needs, training all
    that it reads."""
    if harmless(damage):
        return False
    return name == "check" or (name == "train" and not unused_in_training(damage))


def small_set(folder: Path) -> Path:
    """A data set of three episodes with everything that the commands leave in it, but a release."""
    from checked_data import make_data_set, make_recordings

    from copolicy.dataset.cli import main as dataset

    root = make_data_set(make_recordings(folder / "recordings", episodes=3), folder / "sound")
    with contextlib.redirect_stdout(io.StringIO()):
        dataset(["check", str(root)])
        dataset(["stats", str(root)])
    return root


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--only", nargs="+")
    parser.add_argument("--match", default="", help="only damages whose line holds this text")
    parser.add_argument("--before", action="store_true", help="without the commands that 0.1.0 did not have")
    parser.add_argument("--verbose", action="store_true", help="print each wrong outcome")
    arguments = parser.parse_args()
    counts: dict[str, Counter[str]] = {}
    with tempfile.TemporaryDirectory() as scratch_name:
        scratch = Path(scratch_name)
        sound = small_set(scratch)
        copy_of(sound, scratch / "other")
        chosen = [one for one in damages(sound) if arguments.match in str(one)][arguments.start :: arguments.every]
        print(f"{len(chosen)} damages", flush=True)
        for damage in chosen:
            refused_by_check = False
            for name, run, flags in list(
                commands(scratch / "damaged", scratch / "out", scratch / "other", arguments.before)
            ):
                if arguments.only and name not in arguments.only:
                    continue
                shutil.rmtree(scratch / "out", ignore_errors=True)
                (scratch / "out").mkdir()
                root = copy_of(sound, scratch / "damaged")
                damage.apply(root)
                result, printed = outcome(run, flags)
                if result == "passed" and wrongly(name, damage):
                    result = "passed wrongly"
                elif result == "refused" and len(printed.strip().splitlines()) > 1:
                    result = "several lines"
                refused_by_check |= name == "check" and result == "refused"
                if result == "passed" and refused_by_check:
                    result = "unlike check"
                counts.setdefault(name, Counter())[result] += 1
                if arguments.verbose and result in _PRINTED:
                    last = (printed.strip().splitlines() or [""])[-1]
                    where = [line.strip() for line in printed.splitlines() if "copolicy" in line and "File" in line]
                    print(f"{result}: {name}: {damage}: {last[:200]} {where[-1:]}", flush=True)
    for name, results in counts.items():
        wrong = {kind: results[kind] for kind in _PRINTED}
        print(f"{name:<14} {wrong}  right {results['passed'] + results['refused']}")
    total = Counter()
    for results in counts.values():
        total += results
    print(dict(total))


if __name__ == "__main__":
    main()
