"""Programs that stand for those of a SLURM cluster."""

import os
import shlex
import stat
from pathlib import Path

import pytest


def stand_in_cluster(folder: Path, monkeypatch: pytest.MonkeyPatch, python: list[str]) -> Path:
    """Programs in `folder`, first on the PATH: `sbatch` keeps a script and runs it here, once for each array index.

    Args:
        python: start of a command line that runs a script of Python, as `srun` does.
    """
    folder.mkdir()
    programs = {
        "sbatch": """#!/bin/bash
script="${@: -1}"
number=$(($(ls "$CLUSTER"/*.job 2>/dev/null | wc -l) + 1))
cp "$script" "$CLUSTER/$number.job"
echo "$@" >"$CLUSTER/$number.arguments"
last=$(sed -n 's/^#SBATCH --array=0-\\([0-9]*\\).*/\\1/p' "$script")
for index in $(seq 0 "$last"); do
  SLURM_ARRAY_TASK_ID=$index SLURM_NODELIST=node SLURM_JOB_ID=$number bash "$script" >>"$CLUSTER/$number.log" 2>&1
done
echo "Submitted batch job $number"
""",
        "srun": f"""#!/bin/bash
while [[ "$1" == -* ]]; do [ "$1" = -n ] && shift; shift; done
exec {shlex.join(python)} "$(command -v "$1")" "${{@:2}}"
""",
        "scontrol": '#!/bin/bash\necho "${@: -1}"\n',
    }
    for name, text in programs.items():
        (folder / name).write_text(text, encoding="utf-8")
        (folder / name).chmod((folder / name).stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("CLUSTER", str(folder))
    return folder
