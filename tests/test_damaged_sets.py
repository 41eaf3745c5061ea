"""A sample of the damages of `benchmarks/mutations.py`, for every command that reads data sets."""

import contextlib
import io
import shutil

import pytest
from checked_data import make_data_set, make_recordings
from damaged_sets import copy_of, damages, harmless, look_before_training, unused_in_training

from copolicy.cards.cli import main as cards
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.exceptions import CopolicyError

EVERY = 211
"""One damage of so many is tried, of some eleven thousand; a prime, so that all kinds come up."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    root = make_data_set(make_recordings(folder / "recordings", episodes=3), folder / "table")
    with contextlib.redirect_stdout(io.StringIO()):
        assert dataset(["check", str(root)]) == 0
        assert dataset(["stats", str(root)]) == 0
    return root


def run(main, *arguments) -> tuple[int, str]:
    printed = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(printed):
        status = main([str(argument) for argument in arguments])
    return status, printed.getvalue().strip()


def test_damage_is_found_or_refused_in_one_line(sound, tmp_path):
    chosen = list(damages(sound))[::EVERY]
    assert len(chosen) > 40
    wrong = []
    for damage in chosen:
        root = copy_of(sound, tmp_path / "damaged")
        damage.apply(root)
        status, line = run(dataset, "check", root, "--no-save")
        if (status == 0 and not harmless(damage)) or len(line.splitlines()) > 1:
            wrong.append(f"check {status}: {damage}: {line}")
        commands = [
            (dataset, "exclude", root, "--list"),
            (dataset, "diff", root, sound),
            (convert, "export", root, "--format", "zarr", "--out", tmp_path / "out.zarr"),
            (cards, "dataset", root, "--repo-id", "lab/table", "--overwrite", "--no-figures"),
        ]
        for main, *arguments in commands:
            shutil.rmtree(tmp_path / "out.zarr", ignore_errors=True)
            status, line = run(main, *arguments)
            if len(line.splitlines()) > 1 or (status == 2 and not line):
                wrong.append(f"{arguments[0]} {status}: {damage}: {line}")
        try:
            look_before_training(root)
        except CopolicyError as error:
            if len(str(error).splitlines()) > 1:
                wrong.append(f"train: {damage}: {error}")
        else:
            if not harmless(damage) and not unused_in_training(damage):
                wrong.append(f"train passes: {damage}")
    assert not wrong
