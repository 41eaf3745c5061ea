"""Reads results of `copolicy-eval` and checks that they have the same protocol, so that they can be compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.policies.documents import ComparedDocument
from copolicy.dataset.task import TABLE

from .paired import EpisodeKey, Metrics, episode_key, episode_values

_EXPECTED = "a result of copolicy-eval coplan or partner"
# Settings that may differ between compared results.
_FREE_SETTINGS = ("seed", "device")
_COLUMNS = ("map_index", "map_id", "start_theta", "obstacles", "repeat", "success", "time_s", "interaction_mean")
_TABLE_COLUMNS = ("start_theta", "obstacles")  # required of results without `task`, which are of the table


@dataclass(frozen=True)
class StudyResult:
    """Result file of one checkpoint.

    Attributes:
        settings: settings of the study, without those that may differ between compared results.
        weights: sha256 of the checkpoint's weights; empty for a scripted robot.
        rows: rows of the file, one per episode.
        values: metrics of each episode.
        not_measured: the reason for each measure that is null, by its name in the summary.
    """

    path: Path
    study: str
    label: str
    settings: dict[str, Any]
    weights: str
    rows: tuple[dict[str, Any], ...]
    values: dict[EpisodeKey, Metrics]
    not_measured: dict[str, str]

    @classmethod
    def read(cls, path: Path) -> "StudyResult":
        """
        Raises:
            FileFormatError: the file does not exist, is no result with episodes, or repeats an episode.
        """
        content = read_json(path, ComparedDocument, _EXPECTED)
        try:
            study, label, rows = str(content["study"]), str(content["label"]), tuple(content["episodes"])
            settings = {name: value for name, value in content["settings"].items() if name not in _FREE_SETTINGS}
            weights = str(content["policy"].get("weights_sha256", ""))
            required = [name for name in _COLUMNS if "task" not in settings or name not in _TABLE_COLUMNS]
            missing = [name for row in rows[:1] for name in required if name not in row]
            values = {} if missing else episode_values(rows)
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise FileFormatError(path, _EXPECTED, f"none: {type(error).__name__} {error}") from None
        if missing:
            raise FileFormatError(path, _EXPECTED, f"episodes without {', '.join(missing)}")
        if not rows or len(values) < len(rows):
            raise FileFormatError(path, "at least one episode, and each once", f"{len(rows)}, {len(values)} distinct")
        return cls(path, study, label, settings, weights, rows, values, content.get("not_measured") or {})

    @property
    def measures_interaction(self) -> bool:
        """Whether the task has an interaction measure."""
        return all("interaction_mean" in values for values in self.values.values())

    @property
    def success(self) -> float:
        """Success rate."""
        return sum(values["success"] for values in self.values.values()) / len(self.values)


@dataclass(frozen=True)
class Method:
    """One method: results of one or more training runs that differ only in their seed."""

    name: str
    runs: tuple[StudyResult, ...]


def read_methods(files: Mapping[str, Sequence[Path]]) -> list[Method]:
    """Reads the results of each method and checks that all of them can be compared.

    Raises:
        FileFormatError: a file is no result, has another protocol or other episodes than the first, or has the
            weights of another file of its method.
    """
    methods = [Method(name, tuple(StudyResult.read(path) for path in paths)) for name, paths in files.items()]
    first = methods[0].runs[0]
    for method in methods:
        paths: dict[str, Path] = {}
        for run in method.runs:
            _require_same_protocol(first, run)
            if run.weights and run.weights in paths:
                raise FileFormatError(
                    run.path, f"another training than {paths[run.weights]}", f"the same weights {run.weights[:12]}"
                )
            paths[run.weights] = run.path
    return methods


def _require_same_protocol(first: StudyResult, run: StudyResult) -> None:
    if run.study != first.study:
        raise FileFormatError(run.path, f"the study {first.study!r} as in {first.path}", repr(run.study))
    for name in ("task", *sorted(first.settings.keys() | run.settings.keys())):
        default = TABLE if name == "task" else None
        expected, actual = first.settings.get(name, default), run.settings.get(name, default)
        if name == "map_set":
            _require_same_scenarios(first, run)
        elif expected != actual:
            if isinstance(expected, dict) and isinstance(actual, dict):  # name the partners, not their whole profiles
                differing = [k for k in {**expected, **actual} if expected.get(k) != actual.get(k)]
                expected, actual = f"the same {name}", f"others: {', '.join(differing)}"
            raise FileFormatError(run.path, f"{name} {expected} as in {first.path}", str(actual))
    if run.values.keys() != first.values.keys():
        difference = next(iter(run.values.keys() ^ first.values.keys()))
        raise FileFormatError(run.path, f"the episodes of {first.path}", f"others, such as {difference}")


def _require_same_scenarios(first: StudyResult, run: StudyResult) -> None:
    """Compares version and digest of the scenario files; results of earlier versions do not record them."""
    expected, actual = first.settings.get("map_set"), run.settings.get("map_set")
    if expected and actual and expected != actual:
        name, version, digest = (expected[key] for key in ("name", "version", "digest"))
        raise FileFormatError(
            run.path,
            f"the maps {name}, version {version}, digest {digest} as in {first.path}",
            f"{actual['name']} of other content, version {actual['version']}, digest {actual['digest']}",
        )


def subset(run: StudyResult, column: str, value: Any) -> dict[EpisodeKey, Metrics]:
    """The episodes whose row has the given value in a column."""
    keys = {episode_key(row) for row in run.rows if row.get(column) == value}
    return {key: values for key, values in run.values.items() if key in keys}
