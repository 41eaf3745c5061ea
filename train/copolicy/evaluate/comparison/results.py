"""Results of `copolicy-eval`, read and held against each other: only the same protocol can be compared."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.files.json_file import read_json
from copolicy.dataset.policies.documents import ComparedDocument
from copolicy.dataset.task import TABLE

from .paired import Key, Values, episode_key, episode_values

_WHAT = "a result of copolicy-eval coplan or partner"
# Where the noise of the plans comes from and what computes them is no part of the protocol.
_FREE_SETTINGS = ("seed", "device")
_COLUMNS = ("map_index", "map_id", "start_theta", "obstacles", "repeat", "success", "time_s", "interaction_mean")
_OF_THE_TABLE = ("start_theta", "obstacles")  # a result that names no task is of it


@dataclass(frozen=True)
class Result:
    """One checkpoint's episodes.

    Attributes:
        settings: of the study, without what is free to differ.
        weights: digest of the checkpoint's weights; empty where a scripted robot acted.
        rows: one an episode, as in the file.
        values: metrics of each episode.
        not_measured: why a measure is null, by its name in the summary.
    """

    path: Path
    study: str
    label: str
    settings: dict[str, Any]
    weights: str
    rows: tuple[dict[str, Any], ...]
    values: dict[Key, Values]
    not_measured: dict[str, str]

    @classmethod
    def read(cls, path: Path) -> "Result":
        """
        Raises:
            FileFormatError: no such file, no result of a study with episodes, or one that repeats an episode.
        """
        content = read_json(path, ComparedDocument, _WHAT)
        try:
            study, label, rows = str(content["study"]), str(content["label"]), tuple(content["episodes"])
            settings = {key: one for key, one in content["settings"].items() if key not in _FREE_SETTINGS}
            weights = str(content["policy"].get("weights_sha256", ""))
            needed = [name for name in _COLUMNS if "task" not in settings or name not in _OF_THE_TABLE]
            missing = [name for row in rows[:1] for name in needed if name not in row]
            values = {} if missing else episode_values(rows)
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise FileFormatError(path, _WHAT, f"none: {type(error).__name__} {error}") from None
        if missing:
            raise FileFormatError(path, _WHAT, f"episodes without {', '.join(missing)}")
        if not rows or len(values) < len(rows):
            raise FileFormatError(path, "at least one episode, and each once", f"{len(rows)}, {len(values)} distinct")
        return cls(path, study, label, settings, weights, rows, values, content.get("not_measured") or {})

    @property
    def measures_interaction(self) -> bool:
        """Whether its task has an interaction measure."""
        return all("interaction_mean" in values for values in self.values.values())

    @property
    def success(self) -> float:
        """Share of successes."""
        return sum(values["success"] for values in self.values.values()) / len(self.values)


@dataclass(frozen=True)
class Method:
    """One method: the results of one or more trainings of it that differ in their seed alone."""

    name: str
    runs: tuple[Result, ...]


def read_methods(files: Mapping[str, Sequence[Path]]) -> list[Method]:
    """Reads the results of each method and makes sure that they are comparable.

    Raises:
        FileFormatError: a file is no result, belongs to another protocol or other episodes than the first, or
            repeats a training of its method.
    """
    methods = [Method(name, tuple(Result.read(path) for path in paths)) for name, paths in files.items()]
    first = methods[0].runs[0]
    for method in methods:
        seen: dict[str, Path] = {}
        for run in method.runs:
            _require_same_protocol(first, run)
            if run.weights and run.weights in seen:
                raise FileFormatError(
                    run.path, f"another training than {seen[run.weights]}", f"the same weights {run.weights[:12]}"
                )
            seen[run.weights] = run.path
    return methods


def _require_same_protocol(first: Result, run: Result) -> None:
    if run.study != first.study:
        raise FileFormatError(run.path, f"the study {first.study!r} as in {first.path}", repr(run.study))
    for name in ("task", *sorted(first.settings.keys() | run.settings.keys())):
        usual = TABLE if name == "task" else None
        expected, found = first.settings.get(name, usual), run.settings.get(name, usual)
        if name == "map_set":
            _require_same_maps(first, run)
        elif expected != found:
            if isinstance(expected, dict) and isinstance(found, dict):  # of partners: say which, not all their habits
                differing = [k for k in {**expected, **found} if expected.get(k) != found.get(k)]
                expected, found = f"the same {name}", f"others: {', '.join(differing)}"
            raise FileFormatError(run.path, f"{name} {expected} as in {first.path}", str(found))
    if run.values.keys() != first.values.keys():
        odd = next(iter(run.values.keys() ^ first.values.keys()))
        raise FileFormatError(run.path, f"the episodes of {first.path}", f"others, such as {odd}")


def _require_same_maps(first: Result, run: Result) -> None:
    """Two files of maps may have one name; a result of an earlier version does not say what was in its."""
    one, other = first.settings.get("map_set"), run.settings.get("map_set")
    if one and other and one != other:
        name, version, digest = (one[key] for key in ("name", "version", "digest"))
        raise FileFormatError(
            run.path,
            f"the maps {name}, version {version}, digest {digest} as in {first.path}",
            f"{other['name']} of other content, version {other['version']}, digest {other['digest']}",
        )


def subset(run: Result, column: str, value: Any) -> dict[Key, Values]:
    """The episodes whose row has a value in a column."""
    keys = {episode_key(row) for row in run.rows if row.get(column) == value}
    return {key: values for key, values in run.values.items() if key in keys}
