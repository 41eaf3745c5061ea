"""The results section of a model card: one table per study, each with its label."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import compress
from typing import Any

from copolicy.dataset.task import PairTask
from copolicy.dataset.task_words import TaskWords

from .formatting import format_number, missing_part_note, table


def results(evaluations: Sequence[dict[str, Any]], task: PairTask) -> str:
    """Renders the section from `copolicy-eval` results of one policy."""
    if not evaluations:
        return "## Results\n\nNot evaluated: no `eval.json` was given."
    studies = {
        study: [evaluation for evaluation in evaluations if evaluation["study"] == study]
        for study in dict.fromkeys(str(evaluation["study"]) for evaluation in evaluations)
    }
    parts, words = ["## Results"], task.words
    measured = any(_mean_interaction(evaluation["summary"]) is not None for evaluation in evaluations)
    if not measured:
        words = replace(words, interaction="")
    for study, members in studies.items():
        labels = sorted({evaluation["label"] for evaluation in members})
        parts += [f"**{label[0].upper()}{label[1:]}.**" for label in labels]
        parts += [_partners(entry, words) for entry in members] if study == "partner" else [_plain(members, words)]
    measure = f"{words.interaction.capitalize()}: mean magnitude, in {words.interaction_unit}. " if measured else ""
    parts.append(
        "s.e.: binomial standard error over episodes of one trained model; it does not cover other training seeds. "
        "Interval: Wilson. Times to completion are of successes only. "
        f"{measure}A call predicts action chunks for all {words.running} at once."
    )
    if not measured:
        parts.append(missing_part_note(task, "interaction measure"))
    return "\n\n".join(parts)


def _plain(evaluations: Sequence[dict[str, Any]], words: TaskWords) -> str:
    header = (
        "study", words.scenarios, "sampler", "success, % ± s.e.", "95 % interval, %", "episodes", "evaluation seed",
        "time to completion, s", words.interaction, "inference, ms per call (median)",
    )  # fmt: skip
    return _table_of_headed_columns(header, [_plain_row(evaluation) for evaluation in evaluations])


def _plain_row(evaluation: dict[str, Any]) -> tuple[object, ...]:
    settings, summary = evaluation["settings"], evaluation["summary"]
    inference = format_number((summary.get("planning_ms_per_call") or {}).get("p50"))
    return (
        evaluation["study"],
        _maps(settings) + _subset_and_orientations(settings),
        _sampler(evaluation["policy"]),
        *_success(summary["success"]),
        settings.get("seed", "not stated"),
        format_number((summary.get("time_to_completion_s") or {}).get("mean")),
        format_number(_mean_interaction(summary)),
        f"{inference} on {settings.get('device', 'a device not stated')}",
    )


def _partners(evaluation: dict[str, Any], words: TaskWords) -> str:
    """One partner study: this policy and the baselines, with the same starts and partners."""
    settings = evaluation["settings"]
    robots = [(evaluation.get("name", "this policy"), evaluation["summary"])]
    robots += [(baseline["name"], baseline["summary"]) for baseline in evaluation.get("baselines") or ()]
    partners = list(evaluation["summary"].get("by_partner") or ())
    header = (
        "robot", "success, % ± s.e.", "95 % interval, %", "episodes", "time to completion, s", words.interaction,
        "robot's proportion of the work", *(f"{partner}, %" for partner in partners),
    )  # fmt: skip
    rows = []
    for name, summary in robots:
        by_partner = summary.get("by_partner") or {}
        rows.append(
            (
                name,
                *_success(summary["success"]),
                format_number((summary.get("time_to_completion_s") or {}).get("mean")),
                format_number(_mean_interaction(summary)),
                format_number(summary.get("robot_share")),
                *(_percent((by_partner.get(partner) or {}).get("success")) for partner in partners),
            )
        )
    about = (
        f"With simulated partners on {settings.get('configurations', settings.get('map_count'))} starts of the "
        f"{_maps(settings)} {words.scenarios}, {settings.get('actions_per_plan', 'a number not stated of')} action(s) "
        f"per chunk, {_sampler(evaluation['policy'])}, evaluation seed {settings.get('seed', 'not stated')}. The last "
        "columns are the success with each kind of partner."
    )
    return f"{about}\n\n{_table_of_headed_columns(header, rows)}"


def _table_of_headed_columns(header: Sequence[object], rows: Sequence[Sequence[object]]) -> str:
    """A table without the columns that have no heading."""
    return table(compress(header, header), [compress(row, header) for row in rows])


def _mean_interaction(summary: dict[str, Any]) -> float | None:
    return (summary.get("interaction_force") or {}).get("mean")


def _success(success: dict[str, Any]) -> Iterable[object]:
    low, high = success["wilson_95"]
    mean, error = 100 * success["mean"], 100 * success["standard_error"]
    return f"{mean:.1f} ± {error:.1f}", f"{100 * low:.1f} to {100 * high:.1f}", success["episodes"]


def _percent(success: dict[str, Any] | None) -> str:
    return "-" if success is None else f"{100 * success['mean']:.1f}"


def _maps(settings: dict[str, Any]) -> str:
    """Name of the scenario set, with version and digest if it is from a file."""
    maps = settings.get("map_set") or {}
    return settings["maps"] + (f" (version {maps['version']}, {maps['digest']})" if maps.get("from") == "file" else "")


def _subset_and_orientations(settings: dict[str, Any]) -> str:
    part = "" if settings.get("complete_set", True) else f", first {settings['map_count']}"
    return part + (", four start orientations" if settings.get("orientations") else "")


def _sampler(policy: dict[str, Any]) -> str:
    if not policy.get("sampler"):
        return "sampler not stated"
    noise = policy.get("initial_noise_scale")
    scale = "" if noise in (None, 1, 1.0) else f", noise x {noise:g}"
    return f"{policy['sampler']}, {policy.get('num_inference_steps', '?')} steps{scale}"
