"""The results of every model card as the Hub's own library reads them back."""

import json
import shutil
from pathlib import Path

import pytest
from huggingface_hub import ModelCard, ModelCardData
from huggingface_hub.repocard_data import model_index_to_eval_results

from copolicy.cards.cli import main
from copolicy.cards.model_index import eval_results

PRETRAINED = Path(__file__).parent.parent / "train" / "lerobot_policy_copolicy" / "pretrained"


def _evaluation(study: str = "coplan", mean: float = 0.5, maps: str = "unseen", **settings) -> dict:
    """The parts of a result of `copolicy-eval` that go into a model index."""
    return {
        "study": study,
        "policy": {"sampler": settings.pop("sampler", "ddim"), "num_inference_steps": 10},
        "settings": {"maps": maps, "map_count": 84, "orientations": False, "repeats": 1, "seed": 0, **settings},
        "summary": {"success": {"mean": mean, "standard_error": 0.01, "episodes": 84}},
    }


def _read_back(evaluations: list[dict]) -> list:
    """Through the YAML of a card, as the Hub has it."""
    data = ModelCardData(model_name="m", eval_results=eval_results(evaluations))
    card = ModelCard(f"---\n{data.to_yaml()}\n---\n")
    return model_index_to_eval_results(card.data.to_dict()["model-index"])[1]


def test_the_shipped_card_gives_every_result_its_own_study():
    (index,) = [ModelCard.load(PRETRAINED / "README.md").data.to_dict()["model-index"]]
    name, results = model_index_to_eval_results(index)
    assert name == "copolicy-pretrained"
    evaluations = json.loads((PRETRAINED / "eval.json").read_text(encoding="utf-8"))["evaluations"]
    assert len(index[0]["results"]) == len(results) == len(evaluations)
    for result, evaluation in zip(results, evaluations, strict=True):
        settings, success = evaluation["settings"], evaluation["summary"]["success"]
        assert result.task_name == f"table carrying, {evaluation['study']} (simulation)"
        assert result.dataset_type == f"copolicy-maps-{settings['maps']}"
        assert result.dataset_args is not None
        for key in ("orientations", "map_count", "seed", "actions_per_plan"):
            assert result.dataset_args[key] == settings[key]
        assert result.metric_value == round(success["mean"], 6)
        assert result.metric_args == {
            "standard_error": round(success["standard_error"], 6), "episodes": success["episodes"],
        }  # fmt: skip
    assert [(result.dataset_config, result.dataset_split) for result in results] == [
        ("coplan", "all"),
        ("coplan", "all"),  # of other maps
        ("coplan-four-orientations", "all"),
        ("partner-four-orientations", "60-starts"),
    ]


def test_the_shipped_card_is_what_the_command_writes(tmp_path):
    folder = shutil.copytree(PRETRAINED, tmp_path / "pretrained")
    flags = ["--repo-id", "local/copolicy-pretrained", "--license", "apache-2.0", "--overwrite"]
    assert main(["model", str(folder), *flags]) == 0
    written = (folder / "README.md").read_text(encoding="utf-8")
    assert written == (PRETRAINED / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("changes", "configs"),
    [
        ([{}, {"maps": "holdout"}], ["coplan", "coplan"]),
        ([{}, {"study": "partner"}], ["coplan", "partner"]),
        ([{}, {"orientations": True}], ["coplan", "coplan-four-orientations"]),
        ([{}, {"seed": 1}], ["coplan-seed-0", "coplan-seed-1"]),
        ([{}, {"fps": 30}], ["coplan", "coplan-fps-30"]),
        ([{"sampler": "ddpm"}, {}], ["coplan-sampler-ddpm", "coplan-sampler-ddim"]),
        ([{"seed": 1, "repeats": 2}, {}], ["coplan-repeats-2-seed-1", "coplan-repeats-1-seed-0"]),
        ([{"partners": {"slow": {}}}, {"partners": {"slow": {}, "erratic": {}}}],
         ["coplan-partners-slow", "coplan-partners-erratic-slow"]),
        ([{}, {}, {}], ["coplan-run-1", "coplan-run-2", "coplan-run-3"]),
        ([{}, {}, {"seed": 1}], ["coplan-seed-0-run-1", "coplan-seed-0-run-2", "coplan-seed-1"]),
        ([{}, {"complete_set": False, "map_count": 5}], ["coplan", "coplan"]),
        ([{"complete_set": False, "map_count": 5}, {"complete_set": False, "map_count": 6}], ["coplan", "coplan"]),
    ],
)  # fmt: skip
def test_no_two_results_are_merged(changes, configs):
    evaluations = [_evaluation(mean=0.1 * (index + 1), **change) for index, change in enumerate(changes)]
    results = _read_back(evaluations)
    assert len({result.unique_identifier for result in results}) == len(evaluations)
    assert [result.dataset_config for result in results] == configs
    assert [result.metric_value for result in results] == [
        round(e["summary"]["success"]["mean"], 6) for e in evaluations
    ]
    for result, evaluation in zip(results, evaluations, strict=True):
        assert result.dataset_args is not None
        assert result.dataset_args["seed"] == evaluation["settings"]["seed"]
        assert result.dataset_type == f"copolicy-maps-{evaluation['settings']['maps']}"


def test_a_part_of_the_maps_is_a_split_of_its_own():
    complete, incomplete = _read_back([_evaluation(), _evaluation(complete_set=False, map_count=5)])
    assert (complete.dataset_split, incomplete.dataset_split) == ("all", "5-maps")
    assert incomplete.dataset_name == "unseen maps, a part of them"
    (starts,) = _read_back([_evaluation("partner", complete_set=False, configurations=60)])
    assert starts.dataset_split == "60-starts"


def test_baselines_are_no_results_of_the_model():
    evaluation = _evaluation("partner", 0.9)
    evaluation["baselines"] = [{"name": "passive", "summary": _evaluation(mean=0.2)["summary"]}]
    (result,) = _read_back([evaluation])
    assert result.metric_value == 0.9
