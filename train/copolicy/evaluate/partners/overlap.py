"""Checks that no robot learned from the pairs that a partner learned from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from copolicy.collect.agents.checkpoint_folder import checkpoint_folder
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.train.training_data import TrainingPairs, training_pairs

UNKNOWN = "the checkpoint does not record its pairs"


def check_overlap(robots: Mapping[str, Path | str], proxies: Mapping[str, Path | str], allow: bool) -> dict[str, Any]:
    """Compares the pairs that robots and proxies learned from; the `overlap` entry of a result.

    Args:
        robots: checkpoints by name.
        proxies: checkpoints by name.
        allow: record shared pairs instead of refusing them.

    Returns:
        `shared` pairs by robot and proxy, `unknown` checkpoints, `same_names` of pairs in different data sets of
        people, and whether overlap was allowed; empty without proxies.

    Raises:
        InvalidValueError: a robot and a proxy share a pair, and `allow` is not set.
    """
    if not proxies:
        return {}
    pairs = {name: training_pairs(checkpoint_folder(path)) for name, path in (*robots.items(), *proxies.items())}
    shared: dict[str, dict[str, list[str]]] = {}
    same_names: dict[str, dict[str, list[str]]] = {}
    for robot in robots:
        for proxy in proxies:
            first, second = pairs[robot], pairs[proxy]
            if first is None or second is None:
                continue
            both = first.shared_with(second)
            if both:
                shared.setdefault(robot, {})[proxy] = both
            elif names := sorted(first.pairs & second.pairs):
                same_names.setdefault(robot, {})[proxy] = names
    if shared and not allow:
        robot, by_proxy = next(iter(shared.items()))
        proxy, names = next(iter(by_proxy.items()))
        expected = f"a robot and a proxy ({robot} and {proxy}) that share no pair, or --allow-overlap"
        raise InvalidValueError("--partners", expected, ", ".join(names))
    unknown = {name: UNKNOWN for name, of in pairs.items() if of is None}
    return {
        "allowed": allow,
        **({"shared": shared} if shared else {}),
        **({"unknown": unknown} if unknown else {}),
        **({"same_names": same_names} if same_names else {}),
        "pairs": {name: _described(of) for name, of in pairs.items() if of is not None},
    }


def _described(pairs: TrainingPairs) -> dict[str, Any]:
    return {"repo_id": pairs.repo_id, "content_hash": pairs.content_hash, "pairs": sorted(pairs.pairs)}
