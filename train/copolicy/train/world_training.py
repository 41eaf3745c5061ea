"""`copolicy-train cogail`: its flags, its help, and which trainer a policy needs."""

from collections.abc import Callable, Sequence
from typing import Any

from copolicy.dataset.exceptions import InvalidValueError

from .pair_split import PairSplit

IN_WORLD = "cogail"
"""Name of the command, and type of the policy that it trains."""

WORLD_HELP = """\
usage: copolicy-train cogail --dataset.root=FOLDER [flags of lerobot-train] [--json] [--debug]

Trains Co-GAIL (Wang et al., CoRL 2021): behaviour cloning, then PPO in the world of the task against a discriminator of
demonstrated frames, with a code for the partner's strategy. The worlds have the scenarios of the data set's episodes.
A step is one frame of one world; the run takes whole updates of --policy.frames_per_update. The flags, the choice of
episodes and the checkpoints are those of copolicy-train; the run folder also gets training_log.jsonl (a row an update)
and training_curves.png.

Defaults other than copolicy-train's:
  --steps=6000000, --save_freq=300000   frames in the world
  --policy.device=cpu                   the networks are too small for a GPU

Presets: --policy.preset=paper (default), corrected, scan. --policy.code=drawn, inferred or episode is how the policy
gets its code in execution. All other settings of the training are --policy.* flags too.

example:
  copolicy-train cogail --dataset.root=data/table --output_dir=outputs/cogail --steps=6000000 --seed=0
  copolicy-train cogail --config_path=outputs/cogail --resume=true
"""

_DEFAULTS = {"steps": "6000000", "save_freq": "300000", "batch_size": "1", "policy.device": "cpu"}


def with_world_defaults(flags: Sequence[str]) -> list[str]:
    """Puts the defaults of `copolicy-train cogail` before the flags, unless the flags or a resumed run set them."""
    names = {flag[2:].partition("=")[0] for flag in flags if flag.startswith("--")}
    if "config_path" in names:
        return list(flags)
    added = [f"--{name}={value}" for name, value in _DEFAULTS.items() if name not in names]
    if not names & {"policy.type", "policy.path"}:
        added.append(f"--policy.type={IN_WORLD}")
    return [*added, *flags]


def require_right_trainer(config: Any, in_world: bool, source: str | None = None) -> None:
    """Refuses a policy that the other command trains.

    Args:
        config: LeRobot's `TrainPipelineConfig`.
        in_world: the command is `copolicy-train cogail`.
        source: the run or checkpoint that the policy is of, if it is not new.

    Raises:
        InvalidValueError: names the command, and the run or else the flag.
    """
    found, where = (None if config.policy is None else config.policy.type), source or "--policy.type"
    if in_world and found != IN_WORLD:
        raise InvalidValueError(where, f"{IN_WORLD}, or the command copolicy-train alone", found)
    if not in_world and found == IN_WORLD:
        expected = f"a policy that learns from batches, or the command copolicy-train {IN_WORLD}"
        raise InvalidValueError(where, expected, found)


def trainer_of(in_world: bool) -> Callable[[Any, PairSplit | None], None]:
    """The function that trains on the pairs of a split; imports torch and LeRobot."""
    if in_world:
        from .cogail.training import train_cogail

        return train_cogail
    from .memory_training import train_from_memory

    return train_from_memory
