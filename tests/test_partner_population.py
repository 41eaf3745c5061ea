"""The population of partners: its recipe, and one proxy made from it."""

import json
from pathlib import Path

import pytest
from commands_here import commands_here

from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.simulate.recipes import RECIPES
from copolicy.dataset.exceptions import CopolicyError
from copolicy.dataset.task import get_task
from copolicy.evaluate.cli import main
from copolicy.evaluate.partners.names import parse_partners
from copolicy.evaluate.partners.population import CHOOSING, OTHERS, PROXIES, REPORTING, half_of
from copolicy.train.training_data import training_pairs

TABLE = get_task("table")


def test_its_pairs_are_disjoint_and_in_no_published_data_set():
    pairs = [recipe.pair for recipe in PROXIES.values()]
    assert len(pairs) >= 8
    assert len(set(pairs)) == len(pairs)
    players = simulated_players(TABLE)
    assert set(pairs) == set(players.pairs) - set(players.default_pairs)
    assert players.default_pairs == ("S01", "S02", "S03", "S04", "S05")  # of every recipe
    assert all("pairs" not in vars(recipe) for recipe in RECIPES.values())


def test_both_halves_have_proxies_of_different_sizes_and_lengths_and_scripted_kinds():
    halves = [half_of(half) for half in (CHOOSING, REPORTING)]
    assert all(len(proxies) == 4 and others for proxies, others in halves)
    assert set(OTHERS) == {*simulated_players(TABLE).partners, "human-like"}
    for proxies, _ in halves:
        recipes = [PROXIES[name] for name in proxies]
        assert len({recipe.episodes for recipe in recipes}) > 2
        assert len({recipe.steps for recipe in recipes}) > 2
        assert len({(recipe.width, recipe.n_layers) for recipe in recipes}) > 2


@pytest.fixture(scope="module")
def population(tmp_path_factory) -> Path:
    """One proxy, of few episodes and steps."""
    out = tmp_path_factory.mktemp("population") / "partners"
    call = ["partners", "make", "--out", str(out), "--only", "C1", "--limit-steps", "2", "--limit-episodes", "2"]
    with commands_here():
        assert main([*call, "--workers", "1"]) == 0
        assert main([*call, "--workers", "1"]) == 0  # already there
    return out


def test_a_proxy_is_made_from_its_recipe_and_records_its_pair(population):
    assert sorted(path.name for path in population.iterdir()) == ["C1", "partners.json"]
    document = json.loads((population / "partners.json").read_text(encoding="utf-8"))
    assert document["trial"] == {"limit_steps": 2, "limit_episodes": 2}
    assert document["proxies"]["R4"]["half"] == REPORTING
    found = training_pairs(population / "C1")
    assert found is not None
    assert (sorted(found.pairs), found.simulated) == (["S06"], True)
    assert found.content_hash is not None
    config = json.loads((population / "C1" / "config.json").read_text(encoding="utf-8"))
    assert (config["width"], config["n_layers"]) == (PROXIES["C1"].width, PROXIES["C1"].n_layers)


def test_a_half_is_named_as_partners(population, capsys):
    with pytest.raises(CopolicyError, match="expected the proxies of the half choosing, found none named C2, C3, C4"):
        parse_partners([f"population:{population}#choosing"], TABLE)
    with pytest.raises(CopolicyError, match="population:FOLDER#choosing or population:FOLDER#reporting"):
        parse_partners([f"population:{population}"], TABLE)
    for name in ("C2", "C3", "C4"):
        (population / name).mkdir()
    partners = parse_partners([f"population:{population}#choosing"], TABLE)
    assert [partner.name for partner in partners] == ["C1", "C2", "C3", "C4", "stubborn", "slow"]
    assert partners[0].detail == str(population / "C1")
    assert main(["partners", "make", "--out", str(population), "--only", "C9"]) == 2
    assert "unknown proxy 'C9'; available: C1, C2" in capsys.readouterr().err
