"""Reads and checks the recordings of one shard and converts them to a data set."""

import shutil
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from copolicy.dataset.checks.checking import check_data, judges_one_recording
from copolicy.dataset.checks.read_recordings import data_of_recordings, unverified_findings
from copolicy.dataset.episode import Episode
from copolicy.dataset.files.staging import new_folder, replace_json, replace_text
from copolicy.dataset.recording.reader import read_episode

from ..lerobot.prepare import DamagedEpisodeError, PreparedEpisode, SkippedEpisode, SkipReport, admit, read_and_prepare
from .shard_plan import DATA_SET, RECORD_FILE, ShardPlan


def convert_shard(plan: ShardPlan, rank: int) -> int:
    """Converts a shard unless it is finished; first removes partial output of a killed process.

    Every recording is read once: its check sums are verified, the rules for single recordings are checked at its
    recording rate, and its frames are written. The shard appears complete, in one rename, or not at all.

    Returns:
        Number of episodes in the shard.

    Raises:
        DamagedEpisodeError: recordings are damaged and `skip_damaged` is off; `plan.damage_list` has a line for each.
    """
    target = plan.shard(rank)
    for partial_folder in target.parent.glob(f".{target.name}.*.partial"):
        shutil.rmtree(partial_folder)
    record = plan.record(rank)
    if record is not None:
        return len(record["episodes"])
    digest = plan.digest(rank)  # before reading: a file that changes meanwhile makes the next call convert again
    episodes: list[Episode] = []
    results = [_read(plan, path, episodes) for path in plan.files_of(rank)]
    _stop_at_damage(plan, rank, results)
    skipped = SkipReport()
    prepared = list(admit(results, plan.skip_damaged, skipped))
    with new_folder(target) as partial:
        partial.mkdir()
        if prepared:
            from ..lerobot.writer import write_dataset  # takes seconds to import, and a shard may have no episode

            fps, downsampling = plan.conversion.fps, plan.conversion.downsampling
            versions = {"version": version("lerobot_policy_copolicy")}
            write_dataset(prepared, partial / DATA_SET, plan.repo_id, fps, downsampling, lambda: versions)
        document = {
            "digest": digest,
            "episodes": [episode.meta.episode_uuid for episode in prepared],
            "origins": [episode.origin for episode in prepared],
            "left_out": asdict(skipped),
            **_findings(plan, prepared, episodes),
        }
        replace_json(partial / RECORD_FILE, document, indent=1)
    return len(prepared)


def _read(plan: ShardPlan, path, episodes: list[Episode]) -> PreparedEpisode | SkippedEpisode:
    """Prepares a recording; appends its episode to `episodes` if it is written to the data set."""
    loaded: list[Episode] = []

    def read_once() -> Episode:
        loaded.append(read_episode(path))
        return loaded[0]

    result = read_and_prepare(path.name, read_once, plan.conversion, str(path))
    if isinstance(result, PreparedEpisode):
        episodes += loaded
    return result


def _stop_at_damage(plan: ShardPlan, rank: int, results: list[PreparedEpisode | SkippedEpisode]) -> None:
    skipped = [result for result in results if isinstance(result, SkippedEpisode)]
    damaged = [result.message for result in skipped if result.reason == "damaged"]
    path = plan.damage_list(rank)
    path.unlink(missing_ok=True)
    if damaged and not plan.skip_damaged:
        replace_text(path, "".join(f"{message}\n" for message in damaged))
        raise DamagedEpisodeError(damaged[0])


def _findings(plan: ShardPlan, prepared: list[PreparedEpisode], episodes: list[Episode]) -> dict[str, Any]:
    """Findings in the recordings at their recording rate, labelled with the episode's index in the shard."""
    if not episodes:
        return {"applied": [], "findings": []}
    labels = [str(index) for index in range(len(prepared))]
    result = check_data(data_of_recordings(plan.root, labels, episodes), judges_one_recording)
    findings = list(result.findings)
    for label, episode in zip(labels, episodes, strict=True):
        findings += unverified_findings(label, episode)
    return {"applied": list(result.applied), "findings": [finding.to_dict() for finding in findings]}
