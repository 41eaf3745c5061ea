"""All shards to the one data set, with what can only be said of all episodes together."""

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from copolicy.dataset.checks.checking import check_table, of_data_sets
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
from ..lerobot.prepare import LeftOut, RepeatedEpisodeError
from ..lerobot.shifted_tables import episode_rows, write_like
from ..lerobot.writer import WrittenDataset
from .plan import DATA_SET, ShardPlan, ShardRecord

FINDINGS_FILE = "findings.json"


def merge_shards(plan: ShardPlan) -> dict[str, Any]:
    """Writes the data set at `plan.root`; it appears complete, in one renaming.

    Returns:
        Summary of what was written, left out and found.

    Raises:
        RunError: a shard is not finished, no episode is left, or one is there twice.
        OutputExistsError: there is something at `plan.root`.
    """
    require_new(plan.root)
    records = [record for rank in range(len(plan)) if (record := plan.record(rank)) is not None]
    if len(records) != len(plan):
        raise RunError(f"{plan.folder}: expected {len(plan)} finished shards, found {len(records)}")
    _require_once(records)
    roots = [plan.shard(rank) / DATA_SET for rank, record in enumerate(records) if record["episodes"]]
    if not roots:
        raise RunError(f"{plan.root}: expected at least one episode to write, found none")
    left_out = LeftOut()
    for record in records:
        left_out.damaged += record["left_out"]["damaged"]
        left_out.discarded += record["left_out"]["discarded"]
        left_out.messages += record["left_out"]["messages"]
    with new_folder(plan.root, "merging") as partial:
        info = aggregate(roots, plan.repo_id, partial, plan.folder / "cache")
        notes = _write_record(plan, partial, roots, left_out)
        findings = all_findings(partial, records)
        if plan.statistics:
            _write_statistics(partial)
        rows = episode_rows(partial)
        write_minimal_card(partial / CARD_FILE, {row["license"] for row in rows}, task_name(read_info(partial)))
    replace_json(plan.folder / FINDINGS_FILE, [finding.to_dict() for finding in findings], indent=1)
    conversion = plan.conversion
    written = WrittenDataset(
        plan.root, plan.repo_id, conversion.fps, conversion.hold, info["total_episodes"], info["total_frames"],
        sum(row["success"] for row in rows), Mixtures.of(rows, task_of(info)),
    )  # fmt: skip
    counts = Counter(finding.severity for finding in findings)
    return {
        **written.summary(),
        "damaged_left_out": left_out.messages,
        "discarded_left_out": left_out.discarded,
        "unfinished_recordings": list(plan.unfinished),
        "not_verified": [f"episode {uuid}: {note}" for uuid, texts in notes.items() for note in texts],
        "shards": len(plan),
        "found": {severity: counts[severity] for severity in SEVERITIES},
        "findings": [str(finding) for finding in findings],
    }


def _require_once(records: list[ShardRecord]) -> None:
    origins: dict[str, str] = {}
    for rank, record in enumerate(records):
        # A shard of an earlier version does not name its files.
        files = record.get("origins") or [f"a file of shard {rank}"] * len(record["episodes"])
        for uuid, origin in zip(record["episodes"], files, strict=True):
            if uuid in origins:
                raise RepeatedEpisodeError(uuid, origins[uuid], origin)
            origins[uuid] = origin


def _write_record(plan: ShardPlan, root: Path, roots: list[Path], left_out: LeftOut) -> dict[str, list[str]]:
    """Writes what is known of the conversion; returns the notes by episode."""
    notes: dict[str, list[str]] = {}
    for part in roots:
        notes |= stored_record(part).get("notes", {})
    document = {
        "converter": "copolicy-convert mcap",
        "version": version("lerobot_policy_copolicy"),
        "files": len(plan.files),
        "left_out": left_out.record(),
        "task": task_of(read_info(root)).spec.to_dict(),
        "fps": plan.conversion.fps,
        "hold": plan.conversion.hold,
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
    """One data set out of several with the same features, in their order.

    LeRobot joins them, one file of frames (and of video) a part: to pack thousands of parts into one file it would read
    and write that file thousands of times. What else it does to them is undone: columns change
    their type, video features lose what names their encoder.

    Args:
        target: a new folder.
        cache: a folder for its own use; it goes away at the end.

    Returns:
        `meta/info.json` of the result.

    Raises:
        FileFormatError: a part is not complete. LeRobot would look for it on the Hub.
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
        write_like(read_parquet(path), example, path)
    return info


def all_findings(root: Path, records: Sequence[ShardRecord]) -> list[Finding]:
    """What the shards found in their recordings, then what the other rules find in the data set; worst first.

    Args:
        root: the merged data set; episodes are named by their index in it.
        records: of all shards, in order.
    """
    findings: list[Finding] = []
    totals: Counter[Finding] = Counter()
    before = 0
    for record in records:
        for fields in record["findings"]:
            finding = Finding(**fields)
            if finding.episode:
                findings.append(Finding(**{**fields, "episode": str(before + int(finding.episode))}))
            elif isinstance(finding.figure, int):  # a number of episodes
                totals[Finding(**{**fields, "figure": None})] += finding.figure
            else:
                findings.append(finding)
        before += len(record["episodes"])
    for finding, total in totals.items():
        findings.append(Finding("", finding.rule, total, finding.limit, finding.severity, finding.message))
    findings += check_table(read_lerobot(root), of_data_sets).findings
    return sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity))
