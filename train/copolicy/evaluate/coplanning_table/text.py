"""The table as Markdown and as CSV."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

from ..markdown_table import markdown_table

_ERROR = "standard_error"


def markdown(table: Mapping[str, Any]) -> str:
    """The table, its details, the differences to the first method, the published numbers, and the definitions."""
    maps, rows = table["maps"], table["methods"]
    settings = table["settings"]
    text = [
        "# Co-planning with simulated pairs",
        f"{table['label']}. {table['note']} {settings['map_count_text']}, at most "
        f"{settings['step_limit']} steps; each method at the rate of its training data, and "
        f"{settings['n_action_steps']} actions of a chunk are executed, or all of a shorter one.",
        _success(rows, maps),
        "The best of several seeds is biased upward by the selection.",
        "## Episodes, times, sizes",
        _details(rows, maps, table.get("not_measured", {})),
    ]
    if table["differences"]:
        text += [f"## Differences to {rows[0]['method']}", _differences(table["differences"], maps)]
    if table["published"]:
        text += ["## Published numbers", f"{table['published_source']}.", _published(table["published"], maps)]
    notes = {**table["definitions"], **table.get("not_measured", {})}
    text += ["## Definitions", "\n".join(f"- {name}: {note}." for name, note in notes.items())]
    if table["left_out"]:
        text += ["## Left out", "\n".join(f"- {line}" for line in table["left_out"])]
    return "\n\n".join(text) + "\n"


def _success(rows: Sequence[Mapping[str, Any]], maps: Sequence[str]) -> str:
    heads = [f"{name}: best / mean ± standard error, %" for name in maps]
    published = [f"published, {name}: best / mean, %" for name in maps] if _has_published(rows) else []
    lines = []
    for row in rows:
        cells = [row["maps"][name] for name in maps]
        ours = [
            f"{100 * cell['best']:.1f} / {100 * cell['mean']:.1f} ± {100 * cell[_ERROR]:.1f}"
            + (" (binomial)" if row["seeds"] == 1 else "")
            for cell in cells
        ]
        theirs = [_published_percent(cell) for cell in cells] if published else []
        lines.append([row["method"], str(row["seeds"]), *ours, *theirs])
    return markdown_table(["method", "seeds", *heads, *published], lines)


def _details(rows: Sequence[Mapping[str, Any]], maps: Sequence[str], not_measured: Mapping[str, str]) -> str:
    measures: dict[str, tuple[str, int]] = {"time_s": ("time, s", 1), "interaction": ("interaction", 3)}
    measures = {name: measure for name, measure in measures.items() if name not in not_measured}
    heads = [
        "method", "policy, preset", "data", "episodes",
        *(f"{label}: {' / '.join(maps)}" for label, _ in measures.values()),
        "planning of all episodes, ms a call: p50 / mean", "published, one decision, ms", "parameters", "steps",
        "samples", "training, s",
    ]  # fmt: skip
    lines = []
    for row in rows:
        cells = [row["maps"][name] for name in maps]
        lines.append(
            [
                row["method"] + (f" ({row['unfinished']})" if row["unfinished"] else ""),
                ", ".join(filter(None, (row["policy"], row["preset"]))),
                f"{row['data'] or 'not stated'}, {row['fps']:g} Hz",
                " + ".join(str(cell["episodes"]) for cell in cells),
                *(
                    " / ".join(_mean(cell[measure], digits) for cell in cells)
                    for measure, (_, digits) in measures.items()
                ),
                f"{_number(_mean_of(cells, 'planning_ms_p50'), '.2f')} / "
                f"{_number(_mean_of(cells, 'planning_ms_mean'), '.2f')}",
                _number(row["published_planning_ms"], "g", ""),
                _number(row["parameters"], ",d"),
                _number(row["steps"], ",d"),
                _number(row["samples"], ",d"),
                _number(row["training_s"], ".0f"),
            ]
        )
    return markdown_table(heads, lines)


def _differences(differences: Sequence[Mapping[str, Any]], maps: Sequence[str]) -> str:
    heads = [f"{name}: points ± standard error (95 % interval)" for name in maps]
    tests = [f"{name}: between seeds, points" for name in maps]
    lines = []
    for difference in differences:
        cells = [difference["maps"][name] for name in maps]
        lines.append(
            [
                f"{difference['reference']} - {difference['method']}",
                *map(_points, cells),
                *(_welch(cell["between_seeds"]) for cell in cells),
            ]
        )
    return markdown_table(["difference", *heads, *tests], lines)


def _published(published: Sequence[Mapping[str, Any]], maps: Sequence[str]) -> str:
    names = [name for name in maps if any(name in row["maps"] for row in published)]
    heads = [f"{name}: {what}" for name in names for what in ("best", "mean")]
    lines = []
    for row in published:
        counts = [row["maps"].get(name, {}).get(what) for name in names for what in ("best", "mean")]
        cells = [f"{n[0]} of {n[1]} ({100 * n[0] / n[1]:.2f} %)" if n else "" for n in counts]
        lines.append([row["method"], *cells, _number(row["planning_ms"], "g", "")])
    return markdown_table(["method", *heads, "one decision, ms"], lines)


def csv_text(table: Mapping[str, Any]) -> str:
    """One line per method and map set; rates are fractions, times seconds."""
    file = io.StringIO()
    writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    differences = {difference["method"]: difference["maps"] for difference in table["differences"]}
    for row in table["methods"]:
        for maps, cell in row["maps"].items():
            best, mean = cell.get("published_best"), cell.get("published_mean")
            difference = differences.get(row["method"], {}).get(maps, {})
            values = {
                **row,
                **cell,
                "maps": maps,
                "label": "simulated pairs",
                "time_s": cell["time_s"]["mean"],
                "time_s_standard_error": cell["time_s"][_ERROR],
                "interaction": cell["interaction"]["mean"],
                "interaction_standard_error": cell["interaction"][_ERROR],
                "published_best_successes": best and best[0],
                "published_best_episodes": best and best[1],
                "published_successes": mean and mean[0],
                "published_episodes": mean and mean[1],
                "reference_minus_method": difference.get("mean"),
                "reference_minus_method_standard_error": difference.get(_ERROR),
            }
            writer.writerow({name: values.get(name) for name in _COLUMNS})
    return file.getvalue()


_COLUMNS = (
    "method", "maps", "label", "policy", "preset", "data", "fps", "actions_per_chunk", "seeds", "episodes",
    "successes", "best", "mean", "standard_error", "standard_error_of", "time_s", "time_s_standard_error",
    "interaction", "interaction_standard_error", "planning_ms_p50", "planning_ms_mean", "parameters", "steps",
    "batch_size", "samples", "training_s", "published", "published_best_successes", "published_best_episodes",
    "published_successes", "published_episodes", "published_planning_ms", "reference_minus_method",
    "reference_minus_method_standard_error",
)  # fmt: skip


def _has_published(rows: Sequence[Mapping[str, Any]]) -> bool:
    return any("published_mean" in cell for row in rows for cell in row["maps"].values())


def _published_percent(cell: Mapping[str, Any]) -> str:
    if "published_mean" not in cell:
        return ""
    best, mean = (
        100 * successes / episodes for successes, episodes in (cell["published_best"], cell["published_mean"])
    )
    return f"{best:.1f} / {mean:.1f}"


def _mean(value: Mapping[str, Any], digits: int) -> str:
    if value["mean"] is None:
        return "none"
    error = value[_ERROR]
    return f"{value['mean']:.{digits}f}" + ("" if error is None else f" ± {error:.{digits}f}")


def _mean_of(cells: Sequence[Mapping[str, Any]], name: str) -> float | None:
    values = [cell[name] for cell in cells if cell[name] is not None]
    return sum(values) / len(values) if values else None


def _number(value: Any, form: str, missing: str = "not stated") -> str:
    return missing if value is None else format(value, form)


def _points(difference: Mapping[str, Any]) -> str:
    text = f"{100 * difference['mean']:+.1f}"
    if difference["bootstrap_95"] is None:
        return text
    low, high = (100 * bound for bound in difference["bootstrap_95"])
    return f"{text} ± {100 * difference[_ERROR]:.1f} ({low:+.1f} to {high:+.1f})"


def _welch(test: Mapping[str, Any] | None) -> str:
    if test is None:
        return ""
    low, high = (100 * bound for bound in test["interval_95"])
    return f"{low:+.1f} to {high:+.1f}, p {test['p']:.3g}"
