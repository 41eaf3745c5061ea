"""What determines the episodes of a task of a sweep, read from flags and files without torch."""

import argparse
import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from copolicy.dataset.scenarios import ScenarioSet
from copolicy.dataset.task import PairTask
from copolicy.train.processor_files import processors_sha256

from ..coplanning_table.training_runs import TrainingRun
from ..partner_study.configurations import study_configurations
from ..partners.names import PROXY, REPLAY, PartnerName
from ..study_flags import Protocol, policy_settings


@dataclass(frozen=True)
class StudyFlags:
    """Flags of the studies of a sweep.

    Attributes:
        n_action_steps: executed actions of a chunk in co-planning; 8, or all of a shorter chunk, if None.
        partner_n_action_steps: the same with partners.
        limit: number of maps of co-planning; all if None.
        configurations: number of starts with partners, see `study_configurations`.
        device: of the policies; its kind is one of the settings, its number not.
        threads: of a task; the last digits of a policy's sums depend on them.
        overrides: settings of the policy that flags override.
    """

    n_action_steps: int | None
    partner_n_action_steps: int
    orientations: bool
    limit: int | None
    configurations: int | None
    repeats: int
    seed: int
    partner_seed: int
    device: str
    threads: int
    overrides: Mapping[str, Any]

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> "StudyFlags":
        """From the flags of the command."""
        names = (
            "n_action_steps", "partner_n_action_steps", "orientations", "limit", "configurations", "repeats", "seed",
            "partner_seed", "device", "threads",
        )  # fmt: skip
        return cls(**{name: getattr(arguments, name) for name in names}, overrides=policy_settings(arguments))


def determined_by(
    run: TrainingRun, chosen: ScenarioSet, partner: PartnerName | None, protocol: Protocol, flags: StudyFlags
) -> dict[str, Any]:
    """The JSON that determines the episodes of a task; `protocol` has the rate of the run."""
    task = protocol.task
    starts = starts_of(task, chosen, partner, flags)
    described = {
        "study": "coplan" if partner is None else "partner",
        "weights_sha256": run.weights,
        "processors_sha256": processors_sha256(run.checkpoint),
        "policy": run.policy_settings,
        "overrides": dict(flags.overrides),
        "n_action_steps": flags.n_action_steps or "8, or all of a shorter chunk",
        "fps": protocol.fps,
        "task": task.spec.name,
        "world": asdict(protocol.settings),
        "maps": chosen.label,
        "starts": len(starts),
        "starts_sha256": _sha256("".join(scenario.digest for scenario in starts)),
        "repeats": flags.repeats,
        "seed": flags.seed,
        "threads": flags.threads,
        "device": flags.device.partition(":")[0],  # a sampler may draw its noise on the device
    }
    if partner is not None:
        described |= {
            "n_action_steps": flags.partner_n_action_steps,
            "partner": {"name": partner.name, **_partner_identity(partner, protocol, len(starts))},
            "partner_seed": flags.partner_seed,
        }
    return json.loads(json.dumps(described))  # as it is read again: tuples are lists


def starts_of(
    task: PairTask, chosen: ScenarioSet, partner: PartnerName | None, flags: StudyFlags
) -> tuple[Any, ...]:  # fmt: skip
    """The scenarios of a study; a `replay` has its own, of which there are at most as many."""
    if partner is not None:
        return study_configurations(chosen, flags.configurations)
    return (task.turned(chosen) if flags.orientations else chosen).scenarios[: flags.limit]


def digest(value: Any) -> str:
    """sha256 of a JSON value."""
    return _sha256(json.dumps(value, sort_keys=True))


def _partner_identity(partner: PartnerName, protocol: Protocol, starts: int) -> dict[str, Any]:
    """What determines a partner, read from its files without torch."""
    from ..partners.partner import make_partner
    from ..partners.recorded import read_recorded_starts

    if partner.kind == PROXY:
        proxy = TrainingRun.read(Path(partner.detail))
        files = {"weights_sha256": proxy.weights, "processors_sha256": processors_sha256(proxy.checkpoint)}
        return {**partner.to_json(), **files, "policy": proxy.policy_settings, "fps": proxy.conditions.fps}
    if partner.kind == REPLAY:
        recorded = read_recorded_starts(partner.detail, protocol.task, protocol.settings, starts)
        return {**partner.to_json(), **recorded.describe(), "recorded_sha256": recorded.sha256}
    return dict(make_partner(partner, protocol.task).describe())


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
