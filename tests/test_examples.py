"""The examples run as they are, and draw what they say."""

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest
from checked_data import make_data_set, make_recordings
from PIL import Image

ROOT = Path(__file__).parent.parent
EXAMPLES = {path.stem: path for path in ROOT.glob("*/examples/*.py")}
DRAWN = {
    "explore_a_data_set": {"episode.png", "routes.png"},
    "watch_a_rollout": {"rollouts.png"},
    "evaluate_a_policy": {"coplanning.png"},
    "compare_two_policies": set(),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Where a user would be who has run the quickstart."""
    folder = tmp_path_factory.mktemp("examples")
    make_recordings(folder / "recordings", 4, seed=3)
    make_data_set(folder / "recordings", folder / "outputs" / "quickstart" / "dataset", "--no-drift")
    return folder


def test_every_example_is_tested():
    assert set(EXAMPLES) == set(DRAWN)


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_it_runs_and_draws(name, folder, monkeypatch, capsys):
    import matplotlib.pyplot as plt

    monkeypatch.chdir(folder)
    with mpl.rc_context({"backend": "agg"}):
        runpy.run_path(str(EXAMPLES[name]))
        plt.close("all")
    assert capsys.readouterr().out.strip()
    for picture in DRAWN[name]:
        with Image.open(folder / "outputs" / "examples" / picture) as image:
            assert len(image.convert("RGB").getcolors(1 << 20) or ()) > 20  # more than an empty page


@pytest.mark.parametrize("name", sorted(DRAWN))
def test_it_says_that_no_person_took_part(name):
    text = EXAMPLES[name].read_text(encoding="utf-8").replace("\n# ", " ")
    assert "no person t" in text.lower()
