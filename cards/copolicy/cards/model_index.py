"""The results of a model for the Hub: the `model-index` of its card.

The Hub's library merges results of equal task type, data set type, config, split and revision, and keeps the name and
arguments of the first only. So no two results here have the same config and split.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from huggingface_hub import EvalResult

from copolicy.dataset.task import PairTask, get_task

_SETTINGS = (
    "map_count", "configurations", "orientations", "repeats", "actions_per_plan", "fps", "step_limit",
    "angular_acceleration_limit", "seed", "partner_seed",
)  # fmt: skip
_POLICY = ("sampler", "num_inference_steps", "initial_noise_scale")


def eval_results(evaluations: Sequence[Mapping[str, Any]], task: PairTask | None = None) -> list[EvalResult]:
    """Makes one result per evaluation, of this policy only, not of the baselines in a study.

    `dataset_config` is the study, with the differing arguments of results that would have the same config and split.

    Args:
        task: None is the table.
    """
    groups: dict[tuple, list[int]] = defaultdict(list)
    results = [_result(evaluation, task or get_task()) for evaluation in evaluations]
    for index, result in enumerate(results):
        groups[result.unique_identifier].append(index)
    for members in groups.values():
        for index, config in zip(members, _configs([results[index] for index in members]), strict=True):
            results[index] = replace(results[index], dataset_config=config)
    return results


def _result(evaluation: Mapping[str, Any], task: PairTask) -> EvalResult:
    settings, success = evaluation["settings"], evaluation["summary"]["success"]
    complete = settings.get("complete_set", True)
    count = settings.get("configurations", settings.get("map_count"))
    arguments = {key: settings[key] for key in _SETTINGS if settings.get(key) is not None}
    arguments |= {key: evaluation["policy"][key] for key in _POLICY if evaluation["policy"].get(key) is not None}
    if settings.get("partners"):
        arguments["partners"] = sorted(settings["partners"])
    maps, scenarios = settings.get("map_set") or {}, task.words.scenarios
    return EvalResult(
        task_type="robotics",
        task_name=f"{task.spec.title}, {evaluation['study']} (simulation)",
        dataset_type=f"copolicy-{scenarios}-{settings['maps'].replace('#', '-')}",
        dataset_name=f"{settings['maps']} {scenarios}{'' if complete else ', a part of them'}",
        dataset_config=f"{evaluation['study']}{'-four-orientations' if settings.get('orientations') else ''}",
        dataset_split="all" if complete else f"{count}-{'starts' if 'configurations' in settings else scenarios}",
        dataset_revision=f"{maps['version']}-{maps['digest']}" if maps.get("from") == "file" else None,
        dataset_args=arguments,
        metric_type="success_rate",
        metric_name=f"success rate over {success['episodes']} episodes",
        metric_value=round(success["mean"], 6),
        metric_args={"standard_error": round(success["standard_error"], 6), "episodes": success["episodes"]},
    )


def _configs(results: Sequence[EvalResult]) -> list[str]:
    """Unique configs for results with the same config: with the arguments that differ, else with a number."""
    names = [str(result.dataset_config) for result in results]
    if len(results) == 1:
        return names
    arguments = [result.dataset_args or {} for result in results]
    differing = [
        key
        for key in dict.fromkeys(key for entry in arguments for key in entry)
        if any(entry.get(key) != arguments[0].get(key) for entry in arguments)
    ]
    names = [
        "-".join((name, *(f"{key}-{_argument_text(entry[key])}" for key in differing if key in entry)))
        for name, entry in zip(names, arguments, strict=True)
    ]
    return [
        name if names.count(name) == 1 else f"{name}-run-{names[: index + 1].count(name)}"
        for index, name in enumerate(names)
    ]


def _argument_text(value: Any) -> str:
    return "-".join(str(item) for item in value) if isinstance(value, list) else str(value)
