"""`copolicy-train`: LeRobot's trainer with data sets in memory, and with errors that a user can act on."""

import argparse
import contextlib
import io
import logging
import os
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from copolicy.dataset.command_line import commands as commandline
from copolicy.dataset.command_line.extras import TRAINING, require_packages
from copolicy.dataset.exceptions import CopolicyError, FileFormatError, MissingExtraError, OutputExistsError, RunError
from copolicy.dataset.files.local_path import require_repo_id, similar_path
from copolicy.dataset.files.staging import disk_error_number, named_errors
from copolicy.dataset.policies.training_run import POLICY_FILES, find_policy_folder
from copolicy.dataset.publication.repo_id import checked_repo_id, local_repo_id

from .policy_commands import policy_parser
from .settings_check import require_usable_numbers

_PROG = "copolicy-train"
# What draccus puts before the reason, where a section of the configuration may also be absent.
_UNDECODED = "Could not decode the value into any of the given types:"
_SETTINGS = "train_config.json"
_HELP = """\
usage: copolicy-train --dataset.root=FOLDER [flags of lerobot-train] [--json] [--debug]
       copolicy-train export CHECKPOINT --out FOLDER    averaged weights alone, to give away (export --help)
       copolicy-train pretrained                        where the model that comes with the package is

Trains a policy as lerobot-train does (same flags, same batches, same checkpoints, and each resumes the other's runs),
with the data set in memory: loading goes from hundreds to hundreds of thousands of samples a second.

Set unless you give them:
  --policy.type=copolicy         the diffusion co-policy (--policy.preset=small trains on a CPU in minutes)
  --policy.push_to_hub=false     nothing is uploaded
  --dataset.repo_id=local/NAME   NAME is that of the folder of --dataset.root
  --num_workers=0                batches come from memory

Episodes that the data set marks as discarded or excluded are left out; each checkpoint records which ones were used,
and a resumed run goes on with these, less what was excluded since. A value that is NaN, infinite or empty is refused
before the first step; a loss that is not finite ends the run with status 1 and leaves the last good checkpoint.

--config_path and --policy.path take the folder of a run too, which means its newest checkpoint.

example:
  copolicy-train --dataset.root=data/table --policy.preset=small --policy.device=cpu \\
      --batch_size=512 --steps=3000 --output_dir=outputs/small
  copolicy-train --config_path=outputs/small/checkpoints/last/pretrained_model/train_config.json \\
      --resume=true --steps=6000

Mixed precision: ACCELERATE_MIXED_PRECISION=bf16 before the command. Several GPUs: accelerate launch --num_processes 2
--mixed_precision bf16 $(which copolicy-train) ...; several processes on a CPU: torchrun --nproc_per_node 2 $(which
copolicy-train) ... Each process gets --batch_size frames of a step, no two the same.

--json prints one JSON object on stdout, --debug the traceback of an error.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit status (0 done, 1 the data or the run has a problem, 2 the call is wrong)."""
    flags = list(sys.argv[1:] if argv is None else argv)
    if flags and not flags[0].startswith("-"):  # LeRobot's trainer has flags only
        parser, names = policy_parser()
        if flags[0] in names:
            return commandline.run(parser, flags)
    own = [flag for flag in flags if flag in ("--json", "--debug", "--version")]
    flags = [flag for flag in flags if flag not in own]
    parser = argparse.ArgumentParser(prog=_PROG, add_help=False)
    commandline.add_version_flag(parser)
    commandline.add_common_flags(parser)
    parser.add_argument("flags", nargs="*")
    parser.set_defaults(handler=_train, needs=TRAINING)
    if "--help" in flags or "-h" in flags:
        parser.set_defaults(handler=_print_help, needs=())
        own = []
    first = os.environ.get("RANK", "0") == "0"
    # Of several processes, one says what was done.
    with contextlib.nullcontext() if first else contextlib.redirect_stdout(io.StringIO()):
        return commandline.run(parser, [*own, "--", *flags])


def with_defaults(flags: Sequence[str]) -> list[str]:
    """The flags, preceded by the ones that `copolicy-train` sets where they are not given."""
    given = {flag[2:].partition("=")[0]: flag for flag in flags if flag.startswith("--")}
    added = [] if "num_workers" in given else ["--num_workers=0"]
    if "config_path" not in given:
        if not given.keys() & {"policy.type", "policy.path", "reward_model.type", "reward_model.path"}:
            added.append("--policy.type=copolicy")
        if "policy.push_to_hub" not in given and not any(name.startswith("reward_model.") for name in given):
            added.append("--policy.push_to_hub=false")
        root = _value("dataset.root", flags)
        if root and "dataset.repo_id" not in given:
            added.append(f"--dataset.repo_id={local_repo_id(Path(root))}")
    return [*added, *flags]


def _value(name: str, flags: Sequence[str]) -> str | None:
    """Value of `--name=value` or `--name value`."""
    for position, flag in enumerate(flags):
        if flag.startswith(f"--{name}="):
            return flag.partition("=")[2]
        if flag == f"--{name}" and position + 1 < len(flags):
            return flags[position + 1]
    return None


def _print_help(arguments: argparse.Namespace) -> dict:
    print(_HELP)
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


def _train(arguments: argparse.Namespace) -> dict:
    flags = [_newest(flag) for flag in _joined(with_defaults(arguments.flags))]
    for name in ("config_path", "policy.path"):
        _check_local_path(name, _value(name, flags))
    for name in ("dataset.repo_id", "policy.repo_id"):
        _check_repo_id(name, _value(name, flags))
    # LeRobot and its libraries print here and there; stdout is for the summary.
    with contextlib.redirect_stdout(sys.stderr), _lerobot(flags):
        from .episode_choice import check_local_dataset
        from .memory_training import train_from_memory

        config = _parse()
        _validate(config)
        if config.dataset.root is not None and not config.dataset.streaming:
            check_local_dataset(config.dataset.root)
        try:
            with named_errors(Path(config.output_dir or "")):
                train_from_memory(config)
        except CopolicyError:
            raise
        except Exception as error:
            if disk_error_number(error) is not None:
                _remove_unfinished(Path(config.output_dir or ""), config.resume)
            if isinstance(error, OSError) and error.errno is not None:
                raise  # the system's own, of a file; the Hub client's have pages of advice instead
            raise RunError(f"training stopped: {type(error).__name__}: {_line(error)}") from error
    output = Path(config.output_dir or "")
    checkpoint = find_policy_folder(output)
    return {
        "output_dir": str(output),
        "steps": config.steps,
        "checkpoint": None if checkpoint is None else str(checkpoint),
    }


def _remove_unfinished(output: Path, resumed: bool) -> None:
    """Half a checkpoint that a full disk left, and a run that came to none: nobody can go on with either."""
    checkpoints = output / "checkpoints"
    if resumed and not (checkpoints / "last").is_symlink():
        return  # which of them is whole cannot be told
    last = (checkpoints / "last").resolve()
    numbered = [folder for folder in checkpoints.glob("*") if folder.name.isdigit() and not folder.is_symlink()]
    whole = [folder for folder in numbered if last.name.isdigit() and int(folder.name) <= int(last.name)]
    for folder in set(numbered) - set(whole):
        shutil.rmtree(folder, ignore_errors=True)
    if not whole and not resumed and output != Path():
        shutil.rmtree(output, ignore_errors=True)


@contextlib.contextmanager
def _lerobot(flags: Sequence[str]) -> Iterator[None]:
    """LeRobot with its plugins, and `flags` where it looks for them: it reads `sys.argv` again and again."""
    # A state-only data set has no video: that no video decoder loads is 80 lines about nothing.
    quiet = logging.getLogger("lerobot.utils.import_utils")
    quiet.addFilter(_no_video)
    before, sys.argv = sys.argv, [_PROG, *flags]
    try:
        from lerobot.utils.import_utils import register_third_party_plugins

        register_third_party_plugins()
        yield
    finally:
        sys.argv = before
        quiet.removeFilter(_no_video)


def _no_video(record: logging.LogRecord) -> bool:
    return "torchcodec" not in record.getMessage()


def _parse():
    """LeRobot's configuration from `sys.argv`; argparse and draccus exit with a page of usage, here it is one line."""
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
    except SystemExit:
        problem = " ".join(printed.getvalue().rpartition("error: ")[2].split())
        raise CopolicyError(problem.replace(f"{_UNDECODED} ", "") or "unreadable flags (see --help)") from None
    except CopolicyError:
        raise
    except Exception as error:
        raise CopolicyError(_line(error)) from error


def _validate(config) -> None:
    """LeRobot's own checks, which its trainer repeats, before anything else is done."""
    output = config.output_dir
    if output is not None and Path(output).is_dir() and not config.resume:
        raise OutputExistsError(output)
    require_usable_numbers(config)
    try:
        config.validate()
    except CopolicyError:
        raise
    except Exception as error:
        raise CopolicyError(_line(error)) from error


def _joined(flags: Sequence[str]) -> list[str]:
    """The flags with `--config_path FILE` and `--policy.path FOLDER` as one word each."""
    joined: list[str] = []
    for flag in flags:
        if joined and joined[-1] in ("--config_path", "--policy.path"):
            joined[-1] += f"={flag}"
        else:
            joined.append(flag)
    return joined


def _newest(flag: str) -> str:
    """A flag that names a run by its folder, or a checkpoint through a link that was not copied, names the newest."""
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
    """A path that is not there must not be taken for the name of a Hub repository."""
    if value is None or Path(value).exists():
        return
    expected = f"a file or folder for --{name}"
    if value.endswith((".json", ".yaml", ".yml")):
        similar = similar_path(value)
        raise FileFormatError(value, expected, "none" if similar is None else f"none; did you mean {similar}?")
    require_repo_id(value, expected, "from another folder it is looked up on the Hub")


def _check_repo_id(name: str, value: str | None) -> None:
    """LeRobot takes a name without a user for a local data set; the Hub's other rules hold for it too."""
    if value not in (None, "", "null", "None"):
        checked_repo_id(value if "/" in value else f"local/{value}", f"--{name}")


def _line(error: BaseException) -> str:
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
