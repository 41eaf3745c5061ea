"""Names of repositories are checked by the rules of the Hub's client before any work."""

import itertools
import random

import pytest
from huggingface_hub.errors import HFValidationError
from huggingface_hub.utils import validate_repo_id

from copolicy.cards.cli import main as cards
from copolicy.convert.cli import main as convert
from copolicy.dataset.cli import main as dataset
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.publication.repo_id import checked_repo_id, local_repo_id, repo_id_problem
from copolicy.train.cli import main as train

REFUSED = ["me/a..b", "me/x.git", "me/a--b", "me/täble", "me/" + "x" * 97, "me/.a", "me/a-", "me/a b", "a/b/c", "table"]


def _accepted_by_the_client(text: str) -> bool:
    try:
        validate_repo_id(text)
    except HFValidationError:
        return False
    return "/" in text  # a user is required here


def _names():
    """All short names of the characters in the rules, and many long and random ones."""
    for length in range(1, 4):
        yield from (f"u/{''.join(name)}" for name in itertools.product("aA0_.-", repeat=length))
        yield from (f"{''.join(name)}/n" for name in itertools.product("a_.-", repeat=length))
    generator = random.Random(0)
    alphabet = "abcXYZ0189___...---//é ü\n\t@:~+文٣"
    yield from ("".join(generator.choices(alphabet, k=generator.randrange(1, 12))) for _ in range(20_000))
    yield from (f"{'u' * left}/{'n' * right}" for left in (0, 1, 95, 96, 97) for right in (0, 1, 95, 96, 97))
    yield from (*REFUSED, "", "/", "a/", "/a", "a//b", "me/a.git.git", "me.git/a", "me/git", "me/.git", "me/a.GIT")


def test_the_rules_are_those_of_the_hubs_client():
    names = list(_names())
    differ = [name for name in names if (repo_id_problem(name) is None) != _accepted_by_the_client(name)]
    assert differ == []
    assert sum(repo_id_problem(name) is None for name in names) > 100


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("table", "one slash between user and name"),
        ("a/b/c", "one slash between user and name"),
        ("me/", "a user and a name"),
        ("me/a..b", "no '--' and no '..'"),
        ("me/a--b", "no '--' and no '..'"),
        ("me/x.git", "no '.git' at the end"),
        ("me/täble", "letters a to z, digits, '-', '_' and '.' only"),
        ("me/-a", "no '-' or '.' at the beginning or end of user and name"),
        ("m" * 97 + "/a", "at most 96 characters each"),
    ],
)
def test_the_violated_rule_is_named(text, reason):
    with pytest.raises(InvalidValueError) as error:
        checked_repo_id(text)
    assert str(error.value) == f"--repo-id: expected USER/NAME that the Hub accepts ({reason}), found {text!r}"


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (convert, ["mcap", "{here}", "--out", "{out}", "--repo-id"]),
        (convert, ["mcap", "{here}", "--out", "{out}", "--append", "--repo-id"]),
        (convert, ["mcap", "{here}", "--out", "{out}", "--shard-episodes", "2", "--repo-id"]),
        (convert, ["upstream", "{here}", "--out", "{out}", "--repo-id"]),
        (convert, ["merge", "{here}", "{here}", "--out", "{out}", "--repo-id"]),
        (cards, ["dataset", "{here}", "--repo-id"]),
        (cards, ["model", "{here}", "--repo-id"]),
        (dataset, ["publish", "{here}", "--repo-id"]),
        (dataset, ["pull", "--out", "{out}"]),
        (dataset, ["check", "--revision", "main"]),
    ],
)
def test_every_command_refuses_an_invalid_name_first(command, arguments, name, tmp_path, capsys):
    places = {"here": tmp_path / "there is nothing here", "out": tmp_path / "out"}
    assert command([*(part.format(**places) for part in arguments), name]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "expected USER/NAME that the Hub accepts (" in error
    assert error.endswith(f"found {name!r}\n")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("flag", ["dataset.repo_id", "policy.repo_id"])
@pytest.mark.parametrize("name", [name for name in REFUSED if name != "table"])
def test_training_refuses_an_invalid_name_before_importing_lerobot(flag, name, capsys):
    assert train([f"--{flag}={name}"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"copolicy-train: --{flag}: expected USER/NAME that the Hub accepts (")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("table", "local/table"), ("my data set", "local/my-data-set"), ("données", "local/donn-es"),
        ("a..b", "local/a.b"), ("x.git", "local/x"), ("-a--b-", "local/a-b"), ("文", "local/dataset"),
        ("n" * 120, "local/" + "n" * 96),
    ],
)  # fmt: skip
def test_a_local_name_follows_the_folder_as_far_as_the_rules_allow(tmp_path, folder, name):
    assert local_repo_id(tmp_path / folder) == name
    assert repo_id_problem(name) is None
