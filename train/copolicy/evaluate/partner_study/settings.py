"""The settings of a study with partners, for its result."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import get_task

from ..partners.names import SCRIPTED
from ..partners.partner import StudyPartner
from .configurations import all_starts


def partner_settings(
    chosen: ScenarioSet, starts: int, partners: Sequence[StudyPartner], partner_seed: int, repeats: int
) -> dict[str, Any]:
    """The part of the `settings` entry of a result that only studies with partners have.

    Args:
        chosen: set of the starts.
        starts: their number.
    """
    task = get_task(chosen.task)
    profiles = simulated_players(task).partners if task.agents is not None else {}
    return {
        "maps": chosen.label,
        "map_set": chosen.describe(),
        "configurations": starts,
        "map_count": starts,
        "complete_set": starts == len({scenario.digest for scenario in all_starts(chosen)}),
        "orientations": task.orientations > 1,
        "partners": {partner.name: _described(partner, profiles) for partner in partners},
        "partner_seed": partner_seed,
        "repeats": repeats,
    }


def _described(partner: StudyPartner, profiles: Mapping[str, Any]) -> Mapping[str, Any]:
    described = dict(partner.describe())
    plain = described.get("kind") == SCRIPTED and partner.name in profiles
    return asdict(profiles[partner.name]) if plain else described
