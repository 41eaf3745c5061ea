"""Results of the table's evaluations: those that exist, and new ones for the runs that have none."""

import argparse
import json
import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from copolicy.dataset.clock import stride
from copolicy.dataset.command_line.commands import progress_bar
from copolicy.dataset.exceptions import FileFormatError, InvalidValueError
from copolicy.dataset.scenarios import ScenarioSet

from ..coplan.rollouts import coplan
from ..coplan.study import coplan_settings, write_coplan_result
from ..file_names import file_name
from ..study_flags import Protocol, study_policy
from .result_files import CHECKPOINTS, json_files, read_result
from .training_runs import TrainedMethod, TrainingRun

RESULTS = "coplanning"
"""Folder of the table's results in the folder of a run."""

# What may differ between results of one protocol: none changes the distribution of the actions.
_FREE = ("device", "told_otherwise", "unseen")
_POLICY_PLACES = ("checkpoint", "learned", "planned_with", "backend", "planner")


class Evaluation(NamedTuple):
    """A result of one run on one map set, and its file."""

    path: Path
    result: dict[str, Any]


class Evaluator:
    """Finds or makes the results of all runs.

    Attributes:
        left_out: one line for each file that is not used, with the reason.
        evaluated: number of evaluations that this call made.
    """

    def __init__(self, arguments: argparse.Namespace, protocol: Protocol, map_sets: Sequence[ScenarioSet], out: Path):
        self._arguments, self._protocol, self._map_sets, self._out = arguments, protocol, map_sets, out
        self.left_out: list[str] = []
        self.evaluated = 0

    def results(self, methods: Sequence[TrainedMethod]) -> list[list[dict[str, Evaluation]]]:
        """The results of each run of each method, by label of the map set.

        Raises:
            FileFormatError: a policy cannot be loaded or does not act in this task.
            InvalidValueError: the rate of a policy does not divide that of the task.
        """
        found = [self._existing(method) for method in methods]
        episodes = sum(len(chosen.scenarios[: self._arguments.limit]) for chosen in self._map_sets)
        total = episodes * self._arguments.repeats * sum(len(method.runs) for method in methods)
        results = []
        with progress_bar(total, "episodes") as bar:
            for method, existing in zip(methods, found, strict=True):
                results.append([self._of_run(method, run, existing, bar) for run in method.runs])
        return results

    def _existing(self, method: TrainedMethod) -> dict[str, list[Evaluation]]:
        """Results of co-planning below and beside the runs of a method, by the weights of its runs."""
        weights: dict[str, list[Evaluation]] = {run.weights: [] for run in method.runs}
        for path in self._files(method):
            result = read_result(path)
            if result is None:
                continue
            digest = result["policy"].get("weights_sha256")
            if digest in weights:
                weights[digest].append(Evaluation(path, result))
            elif method.source in path.parents or self._out in path.parents:
                self._leave_out(path, f"its weights {str(digest)[:12]} are of no run in {method.source}")
        return weights

    def _files(self, method: TrainedMethod) -> list[Path]:
        folders = [method.source, self._out / "results" / file_name(method.name)]
        files = {path.resolve(): path for folder in folders if folder.is_dir() for path in json_files(folder)}
        if any(run.folder == method.source for run in method.runs):  # beside the run
            files |= {path.resolve(): path for path in method.source.resolve().parent.glob("*.json")}
        return sorted(files.values())

    def _of_run(
        self, method: TrainedMethod, run: TrainingRun, existing: Mapping[str, list[Evaluation]], bar: Any
    ) -> dict[str, Evaluation]:
        try:
            stride(run.conditions.fps, self._protocol.task.spec.record_hz)
        except InvalidValueError as error:
            raise FileFormatError(run.folder, "a policy of a rate that the task has", str(error)) from None
        arguments = argparse.Namespace(**vars(self._arguments))
        # `study_policy` then takes this number, or all actions of a shorter chunk.
        arguments.n_action_steps, arguments.default_n_action_steps = None, self._arguments.n_action_steps
        policy = study_policy(run.checkpoint, arguments)
        protocol = replace(self._protocol, fps=run.conditions.fps)
        chosen_results = {}
        for chosen in self._map_sets:
            settings = coplan_settings(arguments, protocol, chosen)
            scenarios = chosen.scenarios[: arguments.limit]
            evaluation = self._matching(existing[run.weights], settings, policy.describe())
            if evaluation is None:
                path = self._new_file(method, run, settings)
                # One call of the same size, so that loading and compiling are not in the times of the study.
                coplan(policy, scenarios, replace(protocol.settings, step_limit=1), repeats=arguments.repeats)
                policy.inference_seconds, policy.batch_sizes = [], []
                result = write_coplan_result(policy, protocol, scenarios, settings, path, bar)
                evaluation = Evaluation(path, json.loads(json.dumps(result)))
                self.evaluated += 1
            else:
                bar.update(len(scenarios) * arguments.repeats)
            chosen_results[chosen.label] = evaluation
        return chosen_results

    def _matching(
        self, existing: Sequence[Evaluation], settings: Mapping[str, Any], policy: Mapping[str, Any]
    ) -> Evaluation | None:
        """The first result with these settings; results of the same maps with other settings are left out."""
        match = None
        for evaluation in existing:
            found = evaluation.result
            if found["settings"].get("maps") != settings["maps"]:
                continue
            differences = [
                *_differences(settings, found["settings"], _FREE),
                *_differences(policy, found["policy"], _POLICY_PLACES, both=True),
            ]
            if differences:
                self._leave_out(evaluation.path, f"other settings: {', '.join(differences)}")
            elif match is not None:
                self._leave_out(evaluation.path, f"a second result beside {match.path}")
            else:
                match = evaluation
        return match

    def _new_file(self, method: TrainedMethod, run: TrainingRun, settings: Mapping[str, Any]) -> Path:
        """A new file in the folder of the run; for an exported policy, which is published as it is, below `--out`."""
        if (run.folder / CHECKPOINTS).is_dir():
            folder, stem = run.folder / RESULTS, ""
        else:
            folder, stem = self._out / "results" / file_name(method.name), f"{run.weights[:8]}_"
        stem += file_name(settings["maps"])
        paths = (folder / f"{stem}{number}.json" for number in ("", *(f"_{k}" for k in range(2, 10_000))))
        return next(path for path in paths if not os.path.lexists(path))

    def _leave_out(self, path: Path, reason: str) -> None:
        line = f"{path}: left out, {reason}"
        logging.warning("warning: %s", line)
        self.left_out.append(line)


def _differences(
    expected: Mapping[str, Any], found: Mapping[str, Any], free: Sequence[str], both: bool = False
) -> list[str]:
    """Entries that differ, as `name FOUND, here EXPECTED`; with `both`, only those that both have."""
    expected = json.loads(json.dumps(expected))
    names = [name for name in {**expected, **found} if name not in free]
    return [
        f"{name} {found.get(name)}, here {expected.get(name)}"
        for name in names
        if expected.get(name) != found.get(name) and not (both and not (name in expected and name in found))
    ]
