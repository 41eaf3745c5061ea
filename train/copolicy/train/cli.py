"""`copolicy-train`: LeRobot's trainer with the data set in memory, and errors as one line."""

import argparse
import contextlib
import io
import logging
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from copolicy.dataset.command_line import commands as commandline
from copolicy.dataset.command_line.extras import TRAINING, require_packages
from copolicy.dataset.exceptions import (
    CopolicyError,
    FileFormatError,
    InvalidValueError,
    MissingExtraError,
    OutputExistsError,
    RunError,
)
from copolicy.dataset.files.local_path import require_repo_id, similar_path
from copolicy.dataset.files.staging import disk_error_number, error_chain, named_errors
from copolicy.dataset.policies.training_run import POLICY_FILES, find_policy_folder
from copolicy.dataset.publication.repo_id import checked_repo_id, local_repo_id

from .pair_split import SPLIT_HELP, PairSplit
from .plugins import register_plugins
from .policy_commands import policy_parser
from .settings_check import require_usable_numbers
from .suitability import require_fitting_data, require_type_of_run
from .world_training import IN_WORLD, WORLD_HELP, require_right_trainer, trainer_of, with_world_defaults

_PROG = "copolicy-train"
# draccus puts this before the reason if a section of the configuration is optional.
_UNDECODED = "Could not decode the value into any of the given types:"
# draccus says this without the reason if the settings of a policy contradict each other.
_NOT_MADE = "Couldn't instantiate class"
_SETTINGS = "train_config.json"
_HELP = """\
usage: copolicy-train --dataset.root=FOLDER [flags of lerobot-train] [--json] [--debug]
       copolicy-train cogail --dataset.root=FOLDER      train Co-GAIL in the world of the task (cogail --help)
       copolicy-train export CHECKPOINT --out FOLDER    write the averaged weights for publication (export --help)
       copolicy-train pretrained                        print the path of the model that comes with the package

Trains a policy like lerobot-train (same flags, batches and checkpoints; each resumes the other's runs), with the data
set in memory: hundreds of thousands of samples per second are loaded instead of hundreds.

Defaults other than LeRobot's:
  --policy.type=copolicy         the diffusion co-policy (--policy.preset=small trains on a CPU in minutes)
  --policy.push_to_hub=false     nothing is uploaded
  --dataset.repo_id=local/NAME   NAME is the name of the folder in --dataset.root
  --num_workers=0                batches come from memory

Episodes that the data set marks as discarded or excluded are left out. Each checkpoint records the episodes of its run;
a resumed run uses these, without episodes excluded since. A NaN, infinite or empty value is refused before the first
step. A loss that is not finite ends the run with status 1 and keeps the last good checkpoint.

--split=pairs:S04,S05 trains on the episodes of these pairs only, --split=not-pairs:S04,S05 on all others;
--split=pairs:0.25:7 on whole pairs with about a quarter of the episodes, chosen with the seed 7 (0 if left out), and
--split=not-pairs:0.25:7 on the rest. No person of the one is in the other. Each checkpoint records its pairs and the
data set's content hash in training_data.json, which copolicy-eval compares for robots and partners.

--config_path and --policy.path also take the folder of a run; its newest checkpoint is used.

example:
  copolicy-train --dataset.root=data/table --policy.preset=small --policy.device=cpu \\
      --batch_size=512 --steps=3000 --output_dir=outputs/small
  copolicy-train --config_path=outputs/small/checkpoints/last/pretrained_model/train_config.json \\
      --resume=true --steps=6000

Mixed precision: set ACCELERATE_MIXED_PRECISION=bf16. Several GPUs: accelerate launch --num_processes 2
--mixed_precision bf16 $(which copolicy-train) ...; several processes on a CPU: torchrun --nproc_per_node 2 $(which
copolicy-train) ... Each process trains on --batch_size different frames per step.

--json prints one JSON object on stdout, --debug prints the traceback of an error.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status: 0 success, 1 problem of the data or the run, 2 wrong call."""
    flags = list(sys.argv[1:] if argv is None else argv)
    in_world = flags[:1] == [IN_WORLD]
    flags = flags[in_world:]
    if flags and not flags[0].startswith("-"):  # LeRobot's trainer has flags only
        parser, names = policy_parser()
        if flags[0] in names:
            return commandline.run(parser, flags)
    common = [flag for flag in flags if flag in ("--json", "--debug", "--version")]
    flags = [flag for flag in flags if flag not in common]
    parser = argparse.ArgumentParser(prog=_PROG, add_help=False)
    commandline.add_version_flag(parser)
    commandline.add_common_flags(parser)
    parser.add_argument("flags", nargs="*")
    parser.set_defaults(handler=_train, needs=TRAINING, in_world=in_world)
    if in_world:
        flags = with_world_defaults(flags)
    if "--help" in flags or "-h" in flags:
        parser.set_defaults(handler=_print_help, needs=())
        common = []
    first = os.environ.get("RANK", "0") == "0"
    # Of several processes, only the first prints the summary.
    with contextlib.nullcontext() if first else contextlib.redirect_stdout(io.StringIO()):
        return commandline.run(parser, [*common, "--", *flags])


def with_defaults(flags: Sequence[str]) -> list[str]:
    """Puts the defaults of `copolicy-train` before the flags, unless the flags set them."""
    names = {flag[2:].partition("=")[0] for flag in flags if flag.startswith("--")}
    added = [] if "num_workers" in names else ["--num_workers=0"]
    if "config_path" not in names:
        if not names & {"policy.type", "policy.path", "reward_model.type", "reward_model.path"}:
            added.append("--policy.type=copolicy")
        if "policy.push_to_hub" not in names and not any(name.startswith("reward_model.") for name in names):
            added.append("--policy.push_to_hub=false")
        root = _value("dataset.root", flags)
        if root and "dataset.repo_id" not in names:
            added.append(f"--dataset.repo_id={local_repo_id(Path(root))}")
    return [*added, *flags]


def _without_split(flags: Sequence[str]) -> tuple[list[str], PairSplit | None]:
    """The flags without `--split`, which LeRobot's configuration does not have, and its value."""
    text = _value("split", flags)
    if text is None:
        if "--split" in flags:
            raise InvalidValueError("--split", SPLIT_HELP, "")
        return list(flags), None
    position = next(index for index, flag in enumerate(flags) if flag.partition("=")[0] == "--split")
    width = 2 if flags[position] == "--split" else 1
    rest = [*flags[:position], *flags[position + width :]]
    if any(flag.partition("=")[0] == "--split" for flag in rest):
        raise InvalidValueError("--split", "the flag once", text)
    return rest, PairSplit.parse(text)


def _check_split(config: Any, split: PairSplit | None) -> None:
    if split is None:
        return
    if config.resume:
        expected = "no such flag with --resume=true, which trains on the episodes of the run"
        raise InvalidValueError("--split", expected, split.text)
    if config.dataset.episodes is not None:
        raise InvalidValueError("--split", "no such flag beside --dataset.episodes", split.text)


def _value(name: str, flags: Sequence[str]) -> str | None:
    """Value of `--name=value` or `--name value`."""
    for position, flag in enumerate(flags):
        if flag.startswith(f"--{name}="):
            return flag.partition("=")[2]
        if flag == f"--{name}" and position + 1 < len(flags):
            return flags[position + 1]
    return None


def _print_help(arguments: argparse.Namespace) -> dict[str, Any]:
    print(WORLD_HELP if arguments.in_world else _HELP)
    try:
        require_packages(*TRAINING)
    except MissingExtraError as error:
        print(f"The flags of lerobot-train are listed once it is installed: {error}")
        return {}
    with _lerobot(with_defaults(arguments.flags)):
        from lerobot.configs import parser
        from lerobot.configs.train import TrainPipelineConfig

        parser.print_scoped_help(TrainPipelineConfig, sys.argv[1:])
    return {}


def _train(arguments: argparse.Namespace) -> dict[str, Any]:
    own_flags, split = _without_split(arguments.flags)
    flags = [_with_newest_checkpoint(flag) for flag in _joined(with_defaults(own_flags))]
    for name in ("config_path", "policy.path"):
        _check_local_path(name, _value(name, flags))
    for name in ("dataset.repo_id", "policy.repo_id"):
        _check_repo_id(name, _value(name, flags))
    # LeRobot and its libraries print to stdout, which is reserved for the summary.
    with contextlib.redirect_stdout(sys.stderr), _lerobot(flags):
        from .episode_choice import check_local_dataset

        source = _value("config_path", flags) or _value("policy.path", flags)
        require_type_of_run(_value("config_path", flags), _value("policy.type", flags))
        config = _parse()
        _validate(config)
        require_right_trainer(config, arguments.in_world, source)
        _check_split(config, split)
        if config.dataset.root is not None and not config.dataset.streaming:
            check_local_dataset(config.dataset.root)
            require_fitting_data(config, source)
        try:
            with named_errors(Path(config.output_dir or "")):
                trainer_of(arguments.in_world)(config, split)
        except CopolicyError:
            raise
        except Exception as error:
            if disk_error_number(error) is not None:
                _remove_unfinished(Path(config.output_dir or ""), config.resume)
            if isinstance(error, OSError) and error.errno is not None:
                raise  # an error of a file; errors of the Hub's client have no errno and a text of many lines
            raise RunError(f"training stopped: {type(error).__name__}: {_one_line(error)}") from error
    output = Path(config.output_dir or "")
    checkpoint = find_policy_folder(output)
    return {
        "output_dir": str(output),
        "steps": config.steps,
        "checkpoint": None if checkpoint is None else str(checkpoint),
    }


def _remove_unfinished(output: Path, resumed: bool) -> None:
    """Removes an incomplete checkpoint (as after a full disk), and a new run without any complete one."""
    checkpoints = output / "checkpoints"
    if resumed and not (checkpoints / "last").is_symlink():
        return  # without the link, complete checkpoints are unknown
    last = (checkpoints / "last").resolve()
    numbered = [folder for folder in checkpoints.glob("*") if folder.name.isdigit() and not folder.is_symlink()]
    complete = [folder for folder in numbered if last.name.isdigit() and int(folder.name) <= int(last.name)]
    for folder in set(numbered) - set(complete):
        shutil.rmtree(folder, ignore_errors=True)
    if not complete and not resumed and output != Path():
        shutil.rmtree(output, ignore_errors=True)


@contextlib.contextmanager
def _lerobot(flags: Sequence[str]) -> Iterator[None]:
    """Registers LeRobot's plugins and puts `flags` into `sys.argv`, which LeRobot reads several times."""
    # A data set of states has no video, so 80 lines of log about a missing video decoder are suppressed.
    logger = logging.getLogger("lerobot.utils.import_utils")
    logger.addFilter(_not_about_decoders)
    before, sys.argv = sys.argv, [_PROG, *flags]
    try:
        import lerobot.policies  # noqa: F401 (registers LeRobot's own types of policies)

        register_plugins()
        yield
    finally:
        sys.argv = before
        logger.removeFilter(_not_about_decoders)


def _not_about_decoders(record: logging.LogRecord) -> bool:
    return "torchcodec" not in record.getMessage()


def _parse():
    """Parses LeRobot's configuration from `sys.argv`; replaces the usage text of argparse and draccus by one line."""
    from lerobot.configs import parser
    from lerobot.configs.train import TrainPipelineConfig

    def configured(config: TrainPipelineConfig) -> TrainPipelineConfig:
        return config

    # LeRobot's wrapper fills in the argument from sys.argv.
    parsed: Callable[..., TrainPipelineConfig] = parser.wrap()(configured)

    printed = io.StringIO()
    try:
        with contextlib.redirect_stderr(printed):
            return parsed()
    except SystemExit as exit:
        problem = " ".join(printed.getvalue().rpartition("error: ")[2].split())
        if _NOT_MADE in problem:
            problem += f" {_one_line(list(error_chain(exit))[-1])}"
        raise CopolicyError(problem.replace(f"{_UNDECODED} ", "") or "unreadable flags (see --help)") from None
    except CopolicyError:
        raise
    except Exception as error:
        raise CopolicyError(_one_line(error)) from error


def _validate(config) -> None:
    """Runs LeRobot's checks of the configuration before any work; its trainer repeats them."""
    output = config.output_dir
    if output is not None and Path(output).is_dir() and not config.resume:
        raise OutputExistsError(output)
    require_usable_numbers(config)
    try:
        config.validate()
    except CopolicyError:
        raise
    except Exception as error:
        raise CopolicyError(_one_line(error)) from error


def _joined(flags: Sequence[str]) -> list[str]:
    """The flags with `--config_path FILE` and `--policy.path FOLDER` joined by `=`."""
    joined: list[str] = []
    for flag in flags:
        if joined and joined[-1] in ("--config_path", "--policy.path"):
            joined[-1] += f"={flag}"
        else:
            joined.append(flag)
    return joined


def _with_newest_checkpoint(flag: str) -> str:
    """Replaces the folder of a run, or a path through a `last` link that was not copied, by the newest checkpoint."""
    name, _, value = flag.partition("=")
    if name not in ("--config_path", "--policy.path") or not value:
        return flag
    path, file = Path(value), ""
    if name == "--config_path" and path.suffix:
        if path.name != _SETTINGS or (path.is_file() and path.parent.parent.name != "last"):
            return flag
        path, file = path.parent, path.name
    folder = find_policy_folder(path, (_SETTINGS, *POLICY_FILES) if name == "--config_path" else POLICY_FILES)
    if folder is None or folder == path:
        return flag
    logging.info("%s: the newest checkpoint is %s", value, folder)
    return f"{name}={folder / file}"


def _check_local_path(name: str, value: str | None) -> None:
    """Refuses a folder without a checkpoint, and a path that does not exist, which LeRobot looks up on the Hub."""
    if value is None:
        return
    if Path(value).exists():
        needed = _SETTINGS if name == "config_path" else "config.json"  # weights may be adapters
        if Path(value).is_dir() and find_policy_folder(Path(value), (needed,)) is None:
            raise FileFormatError(value, f"a checkpoint or the folder of a run for --{name}", "none in this folder")
        return
    expected = f"a file or folder for --{name}"
    if value.endswith((".json", ".yaml", ".yml")):
        similar = similar_path(value)
        raise FileFormatError(value, expected, "none" if similar is None else f"none; did you mean {similar}?")
    require_repo_id(value, expected, "from another folder it is looked up on the Hub")


def _check_repo_id(name: str, value: str | None) -> None:
    """Checks a name by the Hub's rules; LeRobot also takes a name without a user, for a local data set."""
    if value not in (None, "", "null", "None"):
        checked_repo_id(value if "/" in value else f"local/{value}", f"--{name}")


def _one_line(error: BaseException) -> str:
    """The texts of an error and of its causes, up to three, on one line."""
    causes = []
    current: BaseException | None = error
    while current is not None and len(causes) < 3:
        text = " ".join(str(current).split())
        if text and text not in causes:
            causes.append(text)
        current = current.__cause__
    return ": ".join(causes) or type(error).__name__


if __name__ == "__main__":
    sys.exit(main())
