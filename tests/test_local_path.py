"""A mistyped path is not looked up on the Hub."""

from pathlib import Path

import pytest

from copolicy.dataset.cli import main
from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.local_path import repo_id_from_url, require_repo_id
from copolicy.train.cli import main as train


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    (tmp_path / "outputs" / "dataset").mkdir(parents=True)
    (tmp_path / "données").mkdir()
    monkeypatch.chdir(tmp_path)
    # A request to the Hub fails.
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")
    return tmp_path


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (
            "outputs/datset",
            "did you mean outputs/dataset? (write hf://datasets/outputs/datset for the Hub)",
        ),
        (
            "output/dataset",
            "did you mean outputs/dataset? (write hf://datasets/output/dataset for the Hub)",
        ),
        ("outputs/other", "no such file or folder (write hf://datasets/outputs/other for the Hub)"),
        ("./outputs/datset", "did you mean outputs/dataset?"),
        ("outputs/datset/", "did you mean outputs/dataset?"),
        ("outputs/dataset/meta", "no such file or folder"),
        ("outptus", "did you mean outputs?"),
        ("donnees", "did you mean données?"),
        ("nothing", "no such file or folder"),
        ("../nothing/here", "no such file or folder"),
        ("~/nothing", "no such file or folder"),
        ("lab/a..b", "no such file or folder, and not a valid name on the Hub (no '--' and no '..')"),
        ("lab/täble", "and not a valid name on the Hub (letters a to z, digits, '-', '_' and '.' only)"),
    ],
)
def test_a_missing_path_is_reported_with_a_suggestion(here, text, found, capsys):
    for flags in ([text], ["outputs/dataset", "--against", text]):
        if "--against" in flags:
            (here / "outputs" / "dataset").mkdir(exist_ok=True)
        assert main(["check", *flags]) == 2
        error = capsys.readouterr().err
        assert error.startswith(f"copolicy-dataset: {text}: expected a folder, or USER/NAME of a data set on the Hub, ")
        assert error.endswith(f"{found}\n")
        assert error.count("\n") == 1


def test_a_suggestion_for_an_absolute_path(here, capsys):
    assert main(["check", str(here / "outputs" / "datset")]) == 2
    assert capsys.readouterr().err.endswith(f"did you mean {here / 'outputs' / 'dataset'}?\n")


def test_a_hub_name_is_returned(here):
    for text in ("lab/table", "lerobot/pusht", "a/b"):
        assert require_repo_id(text, "something") == text


@pytest.mark.parametrize(
    "text",
    [
        "hf://datasets/outputs/datset", "https://huggingface.co/datasets/outputs/datset",
        "https://huggingface.co/datasets/outputs/datset/", "hf://outputs/datset",
    ],
)  # fmt: skip
def test_a_hub_url_is_parsed(here, text):
    assert repo_id_from_url(text) == "outputs/datset"
    assert require_repo_id(text, "something") == "outputs/datset"


def test_an_invalid_name_in_a_hub_url_is_refused(here):
    with pytest.raises(FileFormatError, match=r"something that the Hub accepts \(no '--' and no '\.\.'\)"):
        require_repo_id("hf://datasets/lab/a..b", "something")


@pytest.mark.parametrize(
    ("flag", "text", "found"),
    [
        (
            "policy.path",
            "outputs/datset",
            "did you mean outputs/dataset? (from another folder it is looked up on the Hub)",
        ),
        ("policy.path", "outputs/x/last", "found no such file or folder"),
        ("config_path", "outputs/train_config.json", "found none"),
    ],
)
def test_training_does_not_query_the_hub_for_a_mistyped_path(here, flag, text, found, capsys):
    assert train([f"--{flag}={text}"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"copolicy-train: {text}: expected a file or folder for --{flag}, ")
    assert error.endswith(f"{found}\n")
