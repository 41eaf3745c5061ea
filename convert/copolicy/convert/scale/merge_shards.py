"""Merges all shards to one data set, and computes what depends on all episodes: findings and statistics."""

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.checks.checking import check_data, judges_data_set
from copolicy.dataset.checks.finding import SEVERITIES, Finding
from copolicy.dataset.checks.read_lerobot import read_lerobot
from copolicy.dataset.edit.subset.stored_set import stored_record, write_record
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.files.meta_files import (
    CARD_FILE,
    EPISODES_FOLDER,
    INFO_FILE,
    STATISTICS_FILE,
    STATS_FILE,
    TASKS_FILE,
)
from copolicy.dataset.files.staging import new_folder, replace_json, require_new, write_lerobot_json
from copolicy.dataset.lerobot_folder.info import read_info, task_name, task_of
from copolicy.dataset.lerobot_folder.references import chunk_files
from copolicy.dataset.lerobot_folder.tables import read_parquet
from copolicy.dataset.publication.minimal_card import write_minimal_card

from ..lerobot.joined_sets import join_data_sets
from ..lerobot.mixtures import Mixtures
from ..lerobot.prepare import RepeatedEpisodeError, SkipReport
from ..lerobot.shifted_tables import read_episode_columns, write_with_schema
from ..lerobot.writer import WrittenDataset
from .shard_plan import DATA_SET, ShardPlan, ShardRecord

FINDINGS_FILE = "findings.json"


def merge_shards(plan: ShardPlan) -> dict[str, Any]:
    """Writes the merged data set at `plan.root`, which appears complete in one rename.

    Returns:
        Summary of the written and skipped episodes and the findings.

    Raises:
        RunError: a shard is not finished, no episode remains, or one occurs twice.
        OutputExistsError: `plan.root` exists.
    """
    require_new(plan.root)
    records = [record for rank in range(len(plan)) if (record := plan.record(rank)) is not None]
    if len(records) != len(plan):
        raise RunError(f"{plan.folder}: expected {len(plan)} finished shards, found {len(records)}")
    _require_unique(records)
    roots = [plan.shard(rank) / DATA_SET for rank, record in enumerate(records) if record["episodes"]]
    if not roots:
        raise RunError(f"{plan.root}: expected at least one episode to write, found none")
    skipped = SkipReport()
    for record in records:
        skipped.damaged += record["left_out"]["damaged"]
        skipped.discarded += record["left_out"]["discarded"]
        skipped.messages += record["left_out"]["messages"]
    with new_folder(plan.root, "merging") as partial:
        info = aggregate(roots, plan.repo_id, partial, plan.folder / "cache")
        notes = _write_record(plan, partial, roots, skipped)
        findings = all_findings(partial, records)
        if plan.statistics:
            _write_statistics(partial)
        rows = read_episode_columns(partial)
        write_minimal_card(partial / CARD_FILE, {row["license"] for row in rows}, task_name(read_info(partial)))
    replace_json(plan.folder / FINDINGS_FILE, [finding.to_dict() for finding in findings], indent=1)
    conversion = plan.conversion
    written = WrittenDataset(
        plan.root, plan.repo_id, conversion.fps, conversion.downsampling, info["total_episodes"], info["total_frames"],
        sum(row["success"] for row in rows), Mixtures.from_rows(rows, task_of(info)),
    )  # fmt: skip
    counts = Counter(finding.severity for finding in findings)
    return {
        **written.summary(),
        "damaged_left_out": skipped.messages,
        "discarded_left_out": skipped.discarded,
        "unfinished_recordings": list(plan.unfinished),
        "not_verified": [f"episode {uuid}: {note}" for uuid, texts in notes.items() for note in texts],
        "shards": len(plan),
        "found": {severity: counts[severity] for severity in SEVERITIES},
        "findings": [str(finding) for finding in findings],
    }


def _require_unique(records: list[ShardRecord]) -> None:
    origins: dict[str, str] = {}
    for rank, record in enumerate(records):
        # A shard of an earlier version does not name its files.
        files = record.get("origins") or [f"a file of shard {rank}"] * len(record["episodes"])
        for uuid, origin in zip(record["episodes"], files, strict=True):
            if uuid in origins:
                raise RepeatedEpisodeError(uuid, origins[uuid], origin)
            origins[uuid] = origin


def _write_record(plan: ShardPlan, root: Path, roots: list[Path], skipped: SkipReport) -> dict[str, list[str]]:
    """Writes the conversion record of the data set; returns the notes by episode."""
    notes: dict[str, list[str]] = {}
    for part in roots:
        notes |= stored_record(part).get("notes", {})
    document = {
        "converter": "copolicy-convert mcap",
        "version": version("lerobot_policy_copolicy"),
        "files": len(plan.files),
        "left_out": skipped.record(),
        "task": task_of(read_info(root)).spec.to_dict(),
        "fps": plan.conversion.fps,
        "hold": plan.conversion.downsampling,
        "notes": notes,
    }
    write_record(root, document)
    return notes


def _write_statistics(root: Path) -> None:
    from copolicy.dataset.statistics.compute import compute_statistics
    from copolicy.dataset.statistics.reading import read_trajectories

    data, left_out = read_trajectories(root)
    replace_json(root / STATISTICS_FILE, compute_statistics(data, left_out=left_out), allow_nan=False)


def aggregate(roots: Sequence[Path], repo_id: str, target: Path, cache: Path) -> dict[str, Any]:
    """Joins data sets with the same features, in their order, with one data (and video) file per part.

    Packing thousands of parts into one file would make LeRobot rewrite it thousands of times. The column types and the
    encoder facts of video features, which LeRobot loses, are restored.

    Args:
        target: a new folder.
        cache: a temporary folder, removed at the end.

    Returns:
        `meta/info.json` of the result.

    Raises:
        FileFormatError: a part is incomplete. LeRobot would search for it on the Hub.
    """
    for root in roots:
        for name in (INFO_FILE, STATS_FILE, TASKS_FILE, EPISODES_FOLDER, "data"):
            if not (root / name).exists():
                raise FileFormatError(root, f"a complete data set with {name}", "none; delete the shard's folder")
    join_data_sets(roots, repo_id, target, cache, concatenate_data=False)
    info = read_info(target)
    info["features"] = read_info(roots[0])["features"]
    write_lerobot_json(target / INFO_FILE, info)
    example = next(iter(chunk_files(roots[0] / EPISODES_FOLDER).values()))
    for path in chunk_files(target / EPISODES_FOLDER).values():
        write_with_schema(read_parquet(path), example, path)
    return info


def all_findings(root: Path, records: Sequence[ShardRecord]) -> list[Finding]:
    """Collects the shards' findings in their recordings and the findings of the data set rules, worst first.

    Args:
        root: the merged data set; findings name episodes by their index in it.
        records: records of all shards, in order.
    """
    findings: list[Finding] = []
    totals: Counter[Finding] = Counter()
    start = 0
    for record in records:
        for fields in record["findings"]:
            finding = Finding(**fields)
            if finding.episode:
                findings.append(Finding(**{**fields, "episode": str(start + int(finding.episode))}))
            elif isinstance(finding.figure, int):  # a number of episodes
                totals[Finding(**{**fields, "figure": None})] += finding.figure
            else:
                findings.append(finding)
        start += len(record["episodes"])
    for finding, total in totals.items():
        findings.append(Finding("", finding.rule, total, finding.limit, finding.severity, finding.message))
    findings += check_data(read_lerobot(root), judges_data_set).findings
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
