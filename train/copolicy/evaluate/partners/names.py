"""Names of partners on the command line, without loading anything.

    [NAME=]proxy:CHECKPOINT[,delay=S][,noise=X][,commit=S]   a policy at the human's seat
    [NAME=][scripted:]KIND[,delay=S][,noise=X]               a scripted kind of the task, such as stubborn
    [NAME=]human-like[,delay=S][,noise=X]                    a scripted player with people's delay and force noise
    [NAME=]replay:FOLDER[,noise=X]                           recorded human actions, without feedback
    population:FOLDER#choosing                               a half of a population (`partners make`), or #reporting

`delay` is a reaction time in s (for a scripted kind in addition to its own), `noise` the standard deviation of the
force noise as a proportion of the force, `commit` the time in s for which a proxy executes a chunk before it looks
again.
"""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError, UnknownNameError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.task import PairTask

from .population import CHOOSING, DOCUMENT, REPORTING, PopulationDocument

_LABEL = "human-in-the-loop protocol with SIMULATED partners: "
_PARTNERS = "scripted players sit at the human seat, no person took part"

PROXY, SCRIPTED, HUMAN_LIKE, REPLAY = "proxy", "scripted", "human-like", "replay"
POPULATION = "population"

PARTNERS_HELP = (
    "partners: kinds of scripted player (scripted:KIND or KIND), proxy:CKPT (a policy at the human's seat), "
    "human-like, replay:FOLDER (recorded human actions), population:FOLDER#choosing or #reporting; each "
    "may have a name and options, as in "
    "slow-proxy=proxy:CKPT,delay=0.2,noise=0.3,commit=0.8"
)

_OPTIONS = {
    PROXY: ("delay", "noise", "commit"),
    SCRIPTED: ("delay", "noise"),
    HUMAN_LIKE: ("delay", "noise"),
    REPLAY: ("noise",),
}
_LARGEST = {"delay": 2.0, "noise": 5.0, "commit": 60.0}


@dataclass(frozen=True)
class PartnerName:
    """A partner as named on the command line.

    Attributes:
        name: name in results.
        kind: `proxy`, `scripted`, `human-like` or `replay`.
        detail: checkpoint, kind of scripted player, or folder; empty for `human-like`.
        options: `delay` (s), `noise` (proportion), `commit` (s), as far as they are given.
    """

    name: str
    kind: str
    detail: str = ""
    options: dict[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The name's parts in results."""
        return {"kind": self.kind, **({"of": self.detail} if self.kind == SCRIPTED else {}), **self.options}


def parse_partners(texts: Iterable[str], task: PairTask) -> list[PartnerName]:
    """Parses the values of `--partners`; the same text twice counts once.

    Raises:
        UnknownNameError: no such kind of scripted player.
        InvalidValueError: another form, an option that the kind does not have, or two partners of one name.
        FileFormatError: a population that is not complete.
        CopolicyError: the task has no scripted or human-like players, and one is asked for.
    """
    texts = [text for given in texts for text in _members(given)]
    partners = [_parse(text, task) for text in dict.fromkeys(texts)]
    names = [partner.name for partner in partners]
    if not partners:
        raise InvalidValueError("--partners", "at least one partner", "none")
    if len(set(names)) < len(names):
        raise InvalidValueError("--partners", "partners of different names (NAME=... gives one)", names)
    return partners


def _parse(text: str, task: PairTask) -> PartnerName:
    name, rest = _named(text)
    rest, options = _options(rest)
    kind, colon, detail = rest.partition(":")
    if not colon and rest != HUMAN_LIKE:
        kind, detail = SCRIPTED, rest
    if kind not in _OPTIONS or (kind == HUMAN_LIKE) == bool(detail):
        expected = "proxy:CHECKPOINT, scripted:KIND, human-like or replay:FOLDER"
        raise InvalidValueError("--partners", expected, text)
    if kind == SCRIPTED and detail not in simulated_players(task).partners:
        raise UnknownNameError("kind of partner", detail, simulated_players(task).partners)
    if kind == HUMAN_LIKE and simulated_players(task).make_human_like is None:
        raise InvalidValueError("--partners", "a partner that the task has", task.missing("human-like player"))
    for option in options:
        if option not in _OPTIONS[kind]:
            expected = f"options of a {kind} partner ({', '.join(_OPTIONS[kind])})"
            raise InvalidValueError(f"--partners {text}", expected, option)
    return PartnerName(name or _default_name(kind, detail, options), kind, detail, options)


def _members(text: str) -> list[str]:
    """The names of a half of a population; another name is itself."""
    if not text.startswith(f"{POPULATION}:"):
        return [text]
    folder, sign, half = text.removeprefix(f"{POPULATION}:").rpartition("#")
    if not sign or half not in (CHOOSING, REPORTING):
        expected = f"{POPULATION}:FOLDER#{CHOOSING} or {POPULATION}:FOLDER#{REPORTING}"
        raise InvalidValueError("--partners", expected, text)
    path = Path(folder) / DOCUMENT
    document = read_json(path, PopulationDocument, "the record of a population (copolicy-eval partners make)")
    proxies = [name for name, recipe in document["proxies"].items() if recipe["half"] == half]
    if missing := [name for name in proxies if not (Path(folder) / name).is_dir()]:
        raise FileFormatError(folder, f"the proxies of the half {half}", f"none named {', '.join(missing)}")
    others = [name for name, of in document["others"].items() if of == half]
    return [*(f"{name}={PROXY}:{Path(folder) / name}" for name in proxies), *others]


def _named(text: str) -> tuple[str, str]:
    """Splits `NAME=PARTNER`; an `=` after a colon, comma or slash belongs to the partner."""
    match = re.match(r"([^=:,/\\]+)=(.+)", text)
    return (match[1], match[2]) if match else ("", text)


def _options(text: str) -> tuple[str, dict[str, float]]:
    options: dict[str, float] = {}
    while match := re.fullmatch(r"(.*),([a-z_]+)=([^,=/]*)", text):
        text, name, value = match[1], match[2], match[3]
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if name in _LARGEST and not 0 <= number <= _LARGEST[name]:  # also nan
            raise InvalidValueError(f"--partners {name}", f"a number from 0 to {_LARGEST[name]:g}", value)
        options = {name: number, **options}
    return text, options


def _default_name(kind: str, detail: str, options: dict[str, float]) -> str:
    base = detail if kind == SCRIPTED else HUMAN_LIKE if kind == HUMAN_LIKE else f"{kind}:{Path(detail).name}"
    return base + "".join(f",{name}={value:g}" for name, value in options.items())


def partners_label(partners: Sequence[PartnerName], task: PairTask) -> str:
    """Says who sat at the human's seat."""
    if all(partner.kind == SCRIPTED and not partner.options for partner in partners):
        return _LABEL + task.studies.definitions.get("partners", _PARTNERS)
    texts = {
        PROXY: "policies",
        SCRIPTED: "scripted players",
        HUMAN_LIKE: "scripted players with people's delay",
        REPLAY: "recorded human actions without feedback",
    }
    kinds = [text for kind, text in texts.items() if any(partner.kind == kind for partner in partners)]
    return f"{_LABEL}{', '.join(kinds)} sit at the human seat, no person took part in the study"
