"""The results in a model card: one table a study, each with its label."""

from collections.abc import Iterable, Sequence
from typing import Any

from .markdown import number, table


def results(evaluations: Sequence[dict[str, Any]]) -> str:
    """The section, from results of `copolicy-eval` of one policy."""
    if not evaluations:
        return "## Results\n\nNot evaluated: no `eval.json` was given."
    studies = {study: [one for one in evaluations if one["study"] == study] for study in _studies(evaluations)}
    parts = ["## Results"]
    for study, some in studies.items():
        labels = sorted({evaluation["label"] for evaluation in some})
        parts += [f"**{label[0].upper()}{label[1:]}.**" for label in labels]
        parts += [_partners(one) for one in some] if study == "partner" else [_plain(some)]
    parts.append(
        "s.e.: binomial standard error over episodes of this one training; it says nothing about other training "
        "seeds. Interval: Wilson. Times to completion count successes only. Interaction force: mean size, in "
        "units of a player's full force. A call plans for all tables that are still being carried at once."
    )
    return "\n\n".join(parts)


def _studies(evaluations: Sequence[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(str(evaluation["study"]) for evaluation in evaluations))


def _plain(evaluations: Sequence[dict[str, Any]]) -> str:
    header = (
        "study", "maps", "sampler", "success, % ± s.e.", "95 % interval, %", "episodes", "evaluation seed",
        "time to completion, s", "interaction force", "planning, ms a call (median)",
    )  # fmt: skip
    return table(header, [_plain_row(evaluation) for evaluation in evaluations])


def _plain_row(evaluation: dict[str, Any]) -> tuple[object, ...]:
    settings, summary = evaluation["settings"], evaluation["summary"]
    planning = number((summary.get("planning_ms_per_call") or {}).get("p50"))
    return (
        evaluation["study"],
        _maps(settings) + _turned(settings),
        _sampler(evaluation["policy"]),
        *_success(summary["success"]),
        settings.get("seed", "not stated"),
        number((summary.get("time_to_completion_s") or {}).get("mean")),
        number((summary.get("interaction_force") or {}).get("mean")),
        f"{planning} on {settings.get('device', 'a device not stated')}",
    )


def _partners(evaluation: dict[str, Any]) -> str:
    """One study with partners: this robot and those beside it, on the same starts with the same partners."""
    settings = evaluation["settings"]
    robots = [(evaluation.get("name", "this policy"), evaluation["summary"])]
    robots += [(one["name"], one["summary"]) for one in evaluation.get("baselines") or ()]
    kinds = list(evaluation["summary"].get("by_partner") or ())
    header = (
        "robot", "success, % ± s.e.", "95 % interval, %", "episodes", "time to completion, s", "interaction force",
        "robot's share of the work", *(f"{kind}, %" for kind in kinds),
    )  # fmt: skip
    rows = []
    for name, summary in robots:
        by_kind = summary.get("by_partner") or {}
        rows.append(
            (
                name,
                *_success(summary["success"]),
                number((summary.get("time_to_completion_s") or {}).get("mean")),
                number((summary.get("interaction_force") or {}).get("mean")),
                number(summary.get("robot_share")),
                *(_percent((by_kind.get(kind) or {}).get("success")) for kind in kinds),
            )
        )
    about = (
        f"With simulated partners on {settings.get('configurations', settings.get('map_count'))} starts of the "
        f"{_maps(settings)} maps, {settings.get('actions_per_plan', 'a number not stated of')} action(s) a plan, "
        f"{_sampler(evaluation['policy'])}, evaluation seed {settings.get('seed', 'not stated')}. The last columns are "
        "the success with each kind of partner."
    )
    return f"{about}\n\n{table(header, rows)}"


def _success(success: dict[str, Any]) -> Iterable[object]:
    low, high = success["wilson_95"]
    mean, error = 100 * success["mean"], 100 * success["standard_error"]
    return f"{mean:.1f} ± {error:.1f}", f"{100 * low:.1f} to {100 * high:.1f}", success["episodes"]


def _percent(success: dict[str, Any] | None) -> str:
    return "-" if success is None else f"{100 * success['mean']:.1f}"


def _maps(settings: dict[str, Any]) -> str:
    """Name of the set, and version and digest of one from a file."""
    maps = settings.get("map_set") or {}
    return settings["maps"] + (f" (version {maps['version']}, {maps['digest']})" if maps.get("from") == "file" else "")


def _turned(settings: dict[str, Any]) -> str:
    part = "" if settings.get("complete_set", True) else f", first {settings['map_count']}"
    return part + (", four start orientations" if settings.get("orientations") else "")


def _sampler(policy: dict[str, Any]) -> str:
    if not policy.get("sampler"):
        return "sampler not stated"
    noise = policy.get("initial_noise_scale")
    scale = "" if noise in (None, 1, 1.0) else f", noise x {noise:g}"
    return f"{policy['sampler']}, {policy.get('num_inference_steps', '?')} steps{scale}"
