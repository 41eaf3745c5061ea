"""The plugin as LeRobot finds it."""

import json
import subprocess
import sys

_SCRIPT = """
import json, logging, sys
logging.disable()
from lerobot.utils.import_utils import register_third_party_plugins
register_third_party_plugins()
from lerobot.configs import PreTrainedConfig
from lerobot.envs import EnvConfig
from lerobot.optim import LRSchedulerConfig
import gymnasium
print(json.dumps({
    "policy": "copolicy" in PreTrainedConfig.get_known_choices(),
    "env": "table_carrying" in EnvConfig.get_known_choices(),
    "schedule": "copolicy_cosine" in LRSchedulerConfig.get_known_choices(),
    "gymnasium": "copolicy/TableCarrying-v0" in gymnasium.registry,
    "loaded": sorted(name for name in sys.modules if "copolicy" in name or "pygame" in name),
}))
"""


def test_lerobot_discovers_the_plugin_and_its_import_builds_nothing():
    run = subprocess.run([sys.executable, "-c", _SCRIPT], capture_output=True, text=True, check=True)
    found = json.loads(run.stdout.splitlines()[-1])
    loaded = found.pop("loaded")
    assert found == {"policy": True, "env": True, "schedule": True, "gymnasium": True}
    assert "lerobot_policy_copolicy.copolicy.configuration_copolicy" in loaded
    lazy = ("modeling_copolicy", "denoiser_transformer", "table_carrying", "world", "pygame")
    assert not [name for name in loaded if name.split(".")[-1] in lazy]
