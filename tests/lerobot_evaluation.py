"""Runs `lerobot-eval` on a short episode."""

import json
import sys
from pathlib import Path
from typing import Any

from lerobot.policies.factory import get_policy_class
from lerobot.scripts import lerobot_eval


def evaluated(monkeypatch, policy: str, checkpoint: Path, out: Path, **flags: Any) -> list[dict]:
    """Evaluates one episode without a display, and returns the batch of each action.

    Args:
        policy: type of the policy.
        flags: of the environment.
    """
    seen, policy_class = [], get_policy_class(policy)
    select_action = policy_class.select_action

    def noted(self, batch, **kwargs):
        seen.append(batch)
        return select_action(self, batch, **kwargs)

    settings = {
        "policy.path": checkpoint, "policy.device": "cpu",
        "env.type": "table_carrying", **{f"env.{name}": value for name, value in flags.items()},
        "eval.n_episodes": 1, "eval.batch_size": 1, "eval.use_async_envs": "false", "seed": 0, "output_dir": out,
    }  # fmt: skip
    with monkeypatch.context() as patch:
        patch.setattr(policy_class, "select_action", noted)
        patch.setattr(sys, "argv", ["lerobot-eval", *(f"--{name}={value}" for name, value in settings.items())])
        lerobot_eval.main()
    result = json.loads((out / "eval_info.json").read_text(encoding="utf-8"))
    assert result["overall"]["n_episodes"] == 1
    return seen
