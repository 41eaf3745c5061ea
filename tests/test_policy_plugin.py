"""The plugin as LeRobot finds it."""

import json
import subprocess

import pytest

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
sys.argv = ["lerobot-teleoperate", "--teleop.type=copolicy_pair", "--help"]
from lerobot.scripts.lerobot_teleoperate import teleoperate
teleoperate()
"""


@pytest.fixture(scope="module")
def discovered(warm_python) -> subprocess.CompletedProcess:
    """A new process that looks for plugins, then the help of LeRobot's own command for teleoperators in it."""
    return subprocess.run([*warm_python, "-c", _SCRIPT], capture_output=True, text=True, check=False)


def test_lerobots_own_command_accepts_the_teleoperator(discovered):
    assert "CopolicyPairConfig ['teleop']" in discovered.stdout, discovered.stderr[-500:]
    assert "--teleop.join" in discovered.stdout


def test_lerobot_discovers_the_plugin_and_its_import_builds_nothing(discovered):
    assert discovered.returncode == 0, discovered.stderr[-500:]
    found = json.loads(next(line for line in discovered.stdout.splitlines() if line.startswith("{")))
    loaded = found.pop("loaded")
    assert found == {"policy": True, "env": True, "schedule": True, "gymnasium": True}
    assert "lerobot_policy_copolicy.copolicy.configuration_copolicy" in loaded
    lazy = ("modeling_copolicy", "denoiser_transformer", "table_carrying", "world", "pygame")
    assert not [name for name in loaded if name.split(".")[-1] in lazy]
