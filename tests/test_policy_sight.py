"""What no policy sees is said: sizes of obstacles that differ, in training data, in map files and environments."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
from map_file import write_lab
from small_policies import policy
from training_table import flags
from untrained_policy import save_untrained_policy

from copolicy.evaluate.cli import main as evaluate
from copolicy.train.cli import main as train
from lerobot_policy_copolicy.env import TableCarryingEnvConfig
from lerobot_policy_copolicy.pair_policy.training_data import require_same_rate

SIZES = "have a property that no policy observes: the size of each obstacle, where they differ (120,60 px)"


def test_training_says_it_and_the_checkpoint_keeps_it(copied_table, tmp_path, capsys):
    for path in (copied_table / "meta" / "episodes").glob("*/*.parquet"):
        table = pq.ParquetFile(path).read()
        sizes = pa.array(["120,60" if episode % 2 else "" for episode in table.column("episode_index").to_pylist()])
        pq.write_table(table.append_column("obstacle_sizes", sizes), path)
    assert train([*flags(copied_table, tmp_path / "run", steps=1), "--dataset.episodes=[0,1,2]"]) == 0
    assert f"Of the episodes to train on, 1 of 3 {SIZES}" in capsys.readouterr().err
    assert train(["export", str(tmp_path / "run"), "--out", str(tmp_path / "model")]) == 0
    config = json.loads((tmp_path / "model" / "config.json").read_text(encoding="utf-8"))
    assert config["unseen"] == f"1 of 3 {SIZES}"


def test_an_evaluation_on_such_maps_says_it(tmp_path, caplog):
    checkpoint, maps = save_untrained_policy(tmp_path / "policy"), write_lab(tmp_path)
    call = ["coplan", "--policy", str(checkpoint), "--step-limit", "3", "--n-action-steps", "1"]
    for name, said in ((f"{maps}#train", f"1 of 3 {SIZES}"), (f"{maps}#test", None)):
        caplog.clear()
        assert evaluate([*call, "--maps", name, "--out", str(tmp_path / "eval.json"), "--overwrite"]) == 0
        settings = json.loads((tmp_path / "eval.json").read_text(encoding="utf-8"))["settings"]
        assert settings.get("unseen") == said
        assert (SIZES in caplog.text) == (said is not None)


def test_so_does_an_environment_beside_a_policy(tmp_path, caplog):
    config = policy().config
    environment = TableCarryingEnvConfig(map_set=str(write_lab(tmp_path)))
    assert environment.scenarios
    require_same_rate(config)
    assert f"Of the maps of the environment, 1 of 4 {SIZES}" in caplog.text
