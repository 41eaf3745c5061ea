"""Licences by the Hub's identifiers, checked where they are entered."""

import pytest

from copolicy.cards.cli import main as cards
from copolicy.collect.cli import main as collect
from copolicy.convert.cli import main as convert
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.publication.licences import LICENCES, checked_licence, licence_identifier
from copolicy.evaluate.cli import main as evaluate

SPELLINGS = {
    "CC-BY-4.0": "cc-by-4.0", "CC BY 4.0": "cc-by-4.0", "cc_by_4.0": "cc-by-4.0", "cc-by-4": "cc-by-4.0",
    "Creative Commons Attribution 4.0 International": "cc-by-4.0",
    "Creative Commons Attribution-NonCommercial-ShareAlike 4.0 International": "cc-by-nc-sa-4.0",
    "https://creativecommons.org/licenses/by-sa/4.0/deed.en": "cc-by-sa-4.0",
    "https://creativecommons.org/publicdomain/zero/1.0/": "cc0-1.0",
    "CC0": "cc0-1.0", "CC0 1.0 Universal": "cc0-1.0", "MIT License": "mit", "The MIT License": "mit",
    "Apache 2.0": "apache-2.0", "Apache License, Version 2.0": "apache-2.0", "GPLv3": "gpl-3.0",
    "GPL-3.0-only": "gpl-3.0", "LGPL 2.1": "lgpl-2.1", "BSD-3-Clause": "bsd-3-clause", "ODbL-1.0": "odbl",
    "PDDL-1.0": "pddl", "MPL 2.0": "mpl-2.0", " cc-by-4.0 ": "cc-by-4.0",
}  # fmt: skip
UNKNOWN = ["free for all", "proprietary", "cc-by-5.0", "CC-BY", "Public Domain", "cc-by-sa-2.0", "?"]


@pytest.mark.parametrize(("text", "identifier"), SPELLINGS.items())
def test_a_common_spelling_suggests_the_identifier(text, identifier):
    assert licence_identifier(text) == identifier
    with pytest.raises(InvalidValueError) as error:
        checked_licence(text)
    assert str(error.value) == f"--license: expected {identifier}, as the Hub spells it, found {text!r}"


def test_every_full_name_gives_its_identifier():
    for identifier, name in LICENCES.items():
        assert checked_licence(identifier) == identifier
        assert {licence_identifier(text) for text in (name, identifier.upper(), name.lower())} == {identifier}


@pytest.mark.parametrize("text", UNKNOWN)
def test_a_licence_that_is_not_on_the_list_is_refused(text):
    assert licence_identifier(text) is None
    with pytest.raises(InvalidValueError, match=r"--license: expected a licence identifier of the Hub such as .*other"):
        checked_licence(text)


def test_an_empty_licence_is_accepted():
    assert checked_licence("") == ""


@pytest.mark.parametrize("text", ["CC BY 4.0", "free for all"])
@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (collect, ["play", "--pair", "P01", "--out", "{out}"]),
        (convert, ["mcap", "{here}", "--out", "{out}", "--repo-id", "me/table"]),
        (convert, ["upstream", "{here}", "--out", "{out}", "--repo-id", "me/table"]),
        (evaluate, ["human", "run", "{plan}", "--participant", "P01", "--out", "{out}"]),
        (cards, ["model", "{here}"]),
    ],
)
def test_every_command_refuses_an_unknown_licence_before_writing(command, arguments, text, tmp_path, capsys):
    places = {"here": tmp_path / "nothing here", "out": tmp_path / "out", "plan": tmp_path / "plan.json"}
    assert command([*(part.format(**places) for part in arguments), "--license", text]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert ": --license: expected " in error
    assert error.endswith(f"found {text!r}\n")
    assert list(tmp_path.iterdir()) == []
