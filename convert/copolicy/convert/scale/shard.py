"""One shard: its recordings read, checked and converted to a data set of its own."""

import shutil
from dataclasses import asdict
from importlib.metadata import version

from copolicy.dataset.checks.checking import check_data, judges_one_recording
from copolicy.dataset.checks.read_recordings import data_of_recordings, unverified_findings
from copolicy.dataset.episode import Episode
from copolicy.dataset.files.staging import new_folder, replace_json, replace_text
from copolicy.dataset.recording.reader import read_episode

from ..lerobot.prepare import DamagedEpisodeError, LeftOut, NotPrepared, PreparedEpisode, admit, prepare_from
from .plan import DATA_SET, RECORD_FILE, ShardPlan


def convert_shard(plan: ShardPlan, rank: int) -> int:
    """Makes a shard, unless it is there; what a killed process left of it goes first.

    Every recording is read once: its check sums are verified, it is held against the rules for single recordings
    at their rate, and its frames are written. The shard appears complete, in one renaming, or not at all.

    Returns:
        Number of its episodes.

    Raises:
        DamagedEpisodeError: recordings are damaged and may not be left out; `plan.damage_list` has a line for each.
    """
    target = plan.shard(rank)
    for left in target.parent.glob(f".{target.name}.*.partial"):
        shutil.rmtree(left)
    record = plan.record(rank)
    if record is not None:
        return len(record["episodes"])
    digest = plan.digest(rank)  # before the files are read: one that changes meanwhile is read again
    episodes: list[Episode] = []
    results = [_read(plan, path, episodes) for path in plan.files_of(rank)]
    _stop_at_damage(plan, rank, results)
    left_out = LeftOut()
    prepared = list(admit(results, plan.skip_damaged, left_out))
    with new_folder(target) as partial:
        partial.mkdir()
        if prepared:
            from ..lerobot.writer import write_dataset  # seconds, and a shard may hold nothing to write

            conversion = plan.conversion
            about = {"version": version("lerobot_policy_copolicy")}
            write_dataset(prepared, partial / DATA_SET, plan.repo_id, conversion.fps, conversion.hold, lambda: about)
        document = {
            "digest": digest,
            "episodes": [episode.meta.episode_uuid for episode in prepared],
            "origins": [episode.origin for episode in prepared],
            "left_out": asdict(left_out),
            **_findings(plan, prepared, episodes),
        }
        replace_json(partial / RECORD_FILE, document, indent=1)
    return len(prepared)


def _read(plan: ShardPlan, path, episodes: list[Episode]) -> PreparedEpisode | NotPrepared:
    """Prepares a recording, and keeps the episode itself if it goes into the data set."""
    read: list[Episode] = []

    def read_once() -> Episode:
        read.append(read_episode(path))
        return read[0]

    result = prepare_from(path.name, read_once, plan.conversion, str(path))
    if isinstance(result, PreparedEpisode):
        episodes += read
    return result


def _stop_at_damage(plan: ShardPlan, rank: int, results: list[PreparedEpisode | NotPrepared]) -> None:
    damaged = [result.message for result in results if isinstance(result, NotPrepared) and result.reason == "damaged"]
    path = plan.damage_list(rank)
    path.unlink(missing_ok=True)
    if damaged and not plan.skip_damaged:
        replace_text(path, "".join(f"{message}\n" for message in damaged))
        raise DamagedEpisodeError(damaged[0])


def _findings(plan: ShardPlan, prepared: list[PreparedEpisode], episodes: list[Episode]) -> dict:
    """Findings of the recordings at their rate, named by their place among the shard's episodes."""
    if not episodes:
        return {"applied": [], "findings": []}
    labels = [str(place) for place in range(len(prepared))]
    result = check_data(data_of_recordings(plan.root, labels, episodes), judges_one_recording)
    findings = list(result.findings)
    for label, episode in zip(labels, episodes, strict=True):
        findings += unverified_findings(label, episode)
    return {"applied": list(result.applied), "findings": [finding.to_dict() for finding in findings]}
