"""The datasheet of a data set after Gebru et al., "Datasheets for Datasets" (CACM 2021), from its metadata only.

Facts that the metadata lacks are given as "not stated".
"""

from collections.abc import Iterator

from copolicy.dataset.features import ACTION
from copolicy.dataset.files.json_file import read_optional_json
from copolicy.dataset.files.meta_files import RECORD_FILE
from copolicy.dataset.lerobot_folder.documents import ConversionRecord
from copolicy.dataset.versions.withdrawals import read_withdrawals

from .artefacts import newest_release
from .facts import DatasetFacts
from .formatting import count_text, counts_text


def datasheet(facts: DatasetFacts) -> Iterator[str]:
    """Yields the sections, in the order of the paper."""
    for heading, lines in (
        ("Motivation", _motivation(facts)),
        ("Composition", _composition(facts)),
        ("Collection: who played, and how it was recorded", _collection(facts)),
        ("Preprocessing", _preprocessing(facts)),
        ("Uses", _uses(facts)),
        ("Distribution and licence", _distribution(facts)),
        ("Maintenance", _maintenance(facts)),
        ("Consent and withdrawal", _consent(facts)),
    ):
        yield f"## {heading}\n\n" + "\n".join(f"- {line}" for line in lines)


def _motivation(facts: DatasetFacts) -> list[str]:
    return [
        f"Purpose: training and evaluating policies that {facts.words.purpose}.",
        "Creators and funding: not stated in the metadata.",
    ]


def _composition(facts: DatasetFacts) -> list[str]:
    discarded = sum(bool(episode["discarded"]) for episode in facts.episodes)
    lengths = sorted(episode["length"] for episode in facts.episodes)
    return [
        f"An instance is an episode: {facts.words.episode}, {lengths[0]} to {lengths[-1]} frames "
        f"(median {lengths[len(lengths) // 2]}).",
        f"Each has states, the joint action of both players, the {facts.words.scenario}, and the players' pseudonyms.",
        f"Splits: {', '.join(f'{name} {span}' for name, span in facts.info.get('splits', {}).items()) or 'none'}",
        f"Marked as discarded (stored, not used in training): {count_text(discarded, len(facts.episodes))}",
        f"Quality flags, including reasons of exclusions: {_flags(facts)}",
        "People are identified by pseudonyms only; the data hold no image, sound or name of a person.",
    ]


def _flags(facts: DatasetFacts) -> str:
    flagged = {flag: count for flag, count in facts.counts("quality_flags").items() if flag}
    return ", ".join(f"`{flag}` ({count})" for flag, count in flagged.items()) or "none set"


def _collection(facts: DatasetFacts) -> list[str]:
    lines = [
        f"{label}: {counts_text(facts.counts(column))}"
        for label, column in (
            ("Source", "source"),
            ("Sessions", "session_id"),
            ("Pairs (pseudonyms)", "pair_id"),
            ("Controller of the robot seat", "controller_0"),
            ("Controller of the human seat", "controller_1"),
            ("Software", "software_version"),
        )
    ]
    rates = _known_values(facts, "achieved_hz")
    if rates:
        lines.append(f"Achieved recording rate: {min(rates):.4g} to {max(rates):.4g} Hz")
    lines.append(f"Late ticks: {sum(episode['late_ticks'] for episode in facts.episodes)}")
    drift = _known_values(facts, "replay_drift_px")
    if drift:
        unit = facts.task.outline.unit if facts.task.outline else "(unit of the task)"
        lines.append(f"Distance between recorded and re-simulated position: at most {max(drift):.3g} {unit}")
    return lines


def _known_values(facts: DatasetFacts, column: str) -> list[float]:
    values = [episode[column] for episode in facts.episodes]
    return [value for value in values if value is not None and value == value]


def _preprocessing(facts: DatasetFacts) -> list[str]:
    action = facts.info["features"].get(ACTION, {})
    lines = [f"Frames at {facts.info['fps']:g} Hz, from a recording at {action.get('record_hz', 'not stated')} Hz"]
    if "hold" in action:
        lines.append(f"Downsampling: the {action['hold']} of the recorded actions until the next frame")
    record = read_optional_json(facts.root / RECORD_FILE, ConversionRecord, "the record of a conversion")
    if record is None:
        return [*lines, f"Conversion: not stated (no `{RECORD_FILE}`)"]
    lines.append(f"Converted by `{record.get('converter', 'not stated')}` {record.get('version', '')}".rstrip())
    left_out = record.get("left_out")
    if isinstance(left_out, dict):
        counts = ", ".join(f"{len(names)} {reason}" for reason, names in left_out.items() if isinstance(names, list))
        lines.append(f"Skipped at conversion: {counts or 'none'}")
    notes = record.get("notes") or {}
    lines.append(f"Episodes with a note on repaired or unverified data: {len(notes)} (`{RECORD_FILE}`)")
    sources = sum(bool(episode["source_sha256"]) for episode in facts.episodes)
    lines.append(f"Episodes with the hash of their source file: {count_text(sources, len(facts.episodes))}")
    return lines


def _uses(facts: DatasetFacts) -> list[str]:
    sources = facts.values("source")
    lines = [
        "Intended: imitation learning of co-policies, prediction of partner actions, statistics of shared decisions.",
        "Not intended: identifying people, or assessing a single player.",
    ]
    if "simulated" in sources:
        lines.append("Not intended: claims about people from simulated episodes.")
    if "upstream" in sources:
        lines.append("Caution: the imported files do not state who or what played.")
    return [*lines, f"{facts.words.limits}; the data do not show how a policy behaves on a real robot."]


def _distribution(facts: DatasetFacts) -> list[str]:
    licences = facts.counts("license")
    text = ", ".join(f"{name or 'not stated'} ({count} episodes)" for name, count in licences.items())
    return [f"Licence: {text}", f"Format: LeRobot {facts.info['codebase_version']}, parquet"]


def _maintenance(facts: DatasetFacts) -> list[str]:
    release = newest_release(facts.root)
    if release is None:
        return ["Not released: no version and no change log.", "Contact: not stated in the metadata."]
    lines = [f"Version {release.get('version')} of {release.get('date')}; changes are in `CHANGELOG.md`."]
    if "content_hash" in release:
        lines.append(f"Content hash, independent of the file layout: `{release['content_hash']}`")
    return [*lines, "Contact: not stated in the metadata."]


def _consent(facts: DatasetFacts) -> list[str]:
    people = [episode for episode in facts.episodes if episode["source"] == "human"]
    withdrawn = sum(entry["episodes"] for entry in read_withdrawals(facts.root))
    removed = [f"Withdrawn so far: {withdrawn} episodes, which are in no file of this version."] if withdrawn else []
    if not people:
        return ["No episode is marked as played by people, so no consent is stated.", *removed]
    consented = sum(bool(episode["consent_id"]) for episode in people)
    return [
        f"Consent: {count_text(consented, len(people))} episodes played by people state the identifier of a consent "
        "record, which the recording lab keeps",
        "Withdrawal: the recording lab deletes a person's episodes by consent id "
        "(`copolicy-dataset withdraw CONSENT_ID PATH... --yes`: recordings, data set, raw copies and the records of "
        "earlier releases) and publishes the next version; earlier downloads cannot be deleted.",
        *removed,
    ]
