"""The card of a model: Hub metadata with results, and a README with facts from the model's files only."""

from collections.abc import Mapping, Sequence
from typing import Any

from huggingface_hub import ModelCardData

from copolicy.dataset.policies.training_run import PLACE_SETTINGS

from .checkpoint_facts import CheckpointFacts
from .dataset_card import citation, source_text
from .formatting import count_text, counts_text, table
from .model_index import eval_results
from .model_results import results

# Settings that distinguish policies, in the order of the card; a policy has only some of them.
_SETTINGS = (
    "type", "preset", "past_human_action", "network", "observation_features", "n_obs_steps", "horizon",
    "n_action_steps", "n_layers", "width", "n_heads", "down_widths", "inpainting", "num_train_timesteps",
    "prediction_type", "sampler", "num_inference_steps", "timestep_spacing", "initial_noise_scale", "mirror",
    "permute_obstacles", "ema", "fps",
)  # fmt: skip
_CHOSEN_FOR = "copolicy"  # the policy type whose distinguishing settings are all above; of others all are stated
_STATED_ELSEWHERE = ("physics", "task", "use_amp", "use_peft")  # in other sections, or with the training
_UNET_SETTINGS = {"down_widths", "inpainting"}
_WITHOUT_EFFECT = {  # by network
    "transformer": _UNET_SETTINGS,
    "mlp": _UNET_SETTINGS | {"n_heads"},
    "unet": {"n_layers", "width", "n_heads"},
}
_PACKAGED = "pretrained"  # folder name of the model in the package
_TRAINING = ("steps", "batch_size", "samples", "seed")


def render_model_card(
    checkpoint: CheckpointFacts, evaluations: Sequence[dict[str, Any]], name: str, licence: str | None = None
) -> str:
    """Renders `README.md` of a checkpoint.

    Args:
        evaluations: contents of `eval.json` files of this checkpoint.
        name: name of the model, such as `user/name`.
        licence: Hub identifier; default: the licence in the configuration, else none.
    """
    sections = (
        _overview(checkpoint, name),
        results(evaluations, checkpoint.task),
        _data(checkpoint),
        _configuration(checkpoint, evaluations),
        *_reproduction(checkpoint),
        _usage(checkpoint, name, evaluations),
        _limits(checkpoint, evaluations),
        *citation(checkpoint.task.words),
    )
    metadata = hub_metadata(checkpoint, evaluations, name, licence)
    return f"---\n{metadata.to_yaml()}\n---\n\n" + "\n\n".join(sections) + "\n"


def hub_metadata(
    checkpoint: CheckpointFacts, evaluations: Sequence[dict[str, Any]], name: str, licence: str | None
) -> ModelCardData:
    """The YAML block for the Hub, with a model-index if there are evaluations."""
    repo_id = checkpoint.data.repo_id
    return ModelCardData(
        license=licence or checkpoint.config.get("license"),
        library_name="lerobot",
        pipeline_tag="robotics",
        tags=[
            "robotics", "lerobot", "copolicy", checkpoint.config["type"], "human-robot-collaboration",
            *(f"trained-on-{source}" for source in sorted(checkpoint.data.sources)),
        ],
        datasets=[repo_id] if _on_hub(repo_id) else None,
        model_name=name.rpartition("/")[2],
        eval_results=eval_results(evaluations, checkpoint.task) or None,
    )  # fmt: skip


def _on_hub(repo_id: str) -> bool:
    return "/" in repo_id and not repo_id.startswith("local/")


def _overview(checkpoint: CheckpointFacts, name: str) -> str:
    words = checkpoint.task.words
    parts = [
        f"# {name.rpartition('/')[2]}",
        f"A policy of type `{checkpoint.config['type']}` that {words.acts}: it predicts the next actions of both "
        "players, and the robot executes its own.",
        *_interface(checkpoint),
    ]
    if checkpoint.data.described:
        parts += [f"Training data: {source_text(source, words)}" for source in sorted(checkpoint.data.sources)]
    else:
        parts.append(
            "**Source of the training data: not stated.** The data set was not found when this card was written."
        )
    return "\n\n".join(parts)


def _interface(checkpoint: CheckpointFacts) -> list[str]:
    """Inputs and outputs of the policy, if the configuration states them."""
    config, rate = checkpoint.config, f" at {checkpoint.data.fps:g} Hz" if checkpoint.data.fps else ""
    if not {"n_obs_steps", "horizon", "n_action_steps"} <= config.keys():
        return []
    words, human = checkpoint.task.words, ", the human's past actions" if config.get("past_human_action") else ""
    return [
        f"Input: the last {config['n_obs_steps']} frames{rate} of {words.state_sees}, {words.scenario_sees}{human}. "
        f"Output: a chunk of {config['horizon']} actions of both players, {words.action}; up to "
        f"{config['n_action_steps']} are executed before the next chunk."
    ]


def _data(checkpoint: CheckpointFacts) -> str:
    data = checkpoint.data
    locality = "" if _on_hub(data.repo_id) else " (a local name, not one on the Hub)"
    lines = [f"- Data set: `{data.repo_id}`{locality}" if data.repo_id else "- Data set: not stated"]
    for title, value in (("Revision", data.revision), ("Version", data.version), ("Content", data.content_hash)):
        lines += [f"- {title}: `{value}`"] if value else []
    if not data.described:
        lines += ["- Source: not stated", f"- Episodes used: {'all' if data.used is None else data.used}"]
    else:
        lines += [
            f"- Source: {counts_text(data.sources)}",
            f"- Episodes used: {count_text(data.used or 0, data.episodes or 0)}",
            f"- Frames: {data.frames:,} at {data.fps:g} Hz",
            f"- Pairs: {counts_text(data.pairs)}" if data.pairs else "- Pairs: not stated",
            f"- {checkpoint.task.words.scenario.capitalize()} sets: {counts_text(data.map_sets)}",
            f"- Licences: {counts_text(data.licences)}",
        ]
    return "## Training data\n\n" + "\n".join(lines)


def _configuration(checkpoint: CheckpointFacts, evaluations: Sequence[dict[str, Any]]) -> str:
    averaged = (checkpoint.recipe.get("weights") or {}).get("averaged")
    # Stated in another row, or without effect.
    skipped = ({"ema"} if averaged else set()) | _WITHOUT_EFFECT.get(checkpoint.config.get("network") or "", set())
    names = (*_SETTINGS, *_own_settings(checkpoint.config))
    rows = [(f"`{key}`", checkpoint.config[key]) for key in names if key in checkpoint.config.keys() - skipped]
    training = [
        (f"training `{key}`", checkpoint.training[key]) for key in _TRAINING if checkpoint.training.get(key) is not None
    ]
    optimizer = checkpoint.training.get("optimizer") or {}
    training += [(f"optimizer `{key}`", optimizer[key]) for key in ("type", "lr", "weight_decay") if key in optimizer]
    scheduler = checkpoint.training.get("scheduler") or {}
    training += [(f"scheduler `{key}`", value) for key, value in scheduler.items() if value is not None]
    sizes = {evaluation["policy"].get("parameters") for evaluation in evaluations} - {None}
    size = [("parameters", f"{parameters:,}") for parameters in sizes]
    weights = [("sha256 of the weights", f"`{checkpoint.weights_sha256}`")]
    if averaged:
        weights.insert(0, ("weights", "moving average over the training only"))
    text = table(("setting", "value"), [*rows, *size, *training, *weights])
    if not checkpoint.training:
        text += "\n\nThe training settings are not stated (no `train_config.json` or `recipe.json`)."
    return f"## Policy and training\n\n{text}"


def _own_settings(config: Mapping[str, Any]) -> list[str]:
    """Settings that only this type of policy has; those of the optimizer are stated with the training."""
    if config["type"] == _CHOSEN_FOR:
        return []
    return [
        name
        for name, value in config.items()
        if name not in (*_SETTINGS, *PLACE_SETTINGS, *_STATED_ELSEWHERE)
        and not name.startswith(("optimizer_", "scheduler_"))
        and not (value is None or value == [] or isinstance(value, dict))
    ]


def _reproduction(checkpoint: CheckpointFacts) -> list[str]:
    """Commands that reproduce the model, if stated."""
    if not checkpoint.commands:
        return []
    return ["## Reproduction\n\n```bash\n" + "\n".join(checkpoint.commands) + "\n```"]


def _usage(checkpoint: CheckpointFacts, name: str, evaluations: Sequence[dict[str, Any]]) -> str:
    maps = evaluations[0]["settings"]["maps"] if evaluations else "holdout"
    commands = ["pip install 'lerobot_policy_copolicy[train]'"]
    policy = "checkpoint"
    if checkpoint.folder.name == _PACKAGED:
        policy = _PACKAGED  # the name that the commands accept
    elif _on_hub(name):
        commands.append(f"hf download {name} --local-dir checkpoint")
    commands += [
        f"copolicy-collect play --players keyboard policy:{policy}",
        f"copolicy-eval coplan --policy {policy} --maps {maps} --out eval.json",
    ]
    text = "## Usage\n\n```bash\n" + "\n".join(commands) + "\n```"
    if policy == _PACKAGED:
        text += "\n\nThe package includes it; `copolicy-train pretrained` prints its folder, for LeRobot's commands."
    return text


def _limits(checkpoint: CheckpointFacts, evaluations: Sequence[dict[str, Any]]) -> str:
    words = checkpoint.task.words
    lines = [f"- All results are from {words.place}; how a real robot would {words.act} was not evaluated."]
    if "simulated" in checkpoint.data.sources:
        lines.append(f"- Trained on simulated pairs: how it {words.act_s} with a person was not evaluated.")
    if any(evaluation["study"] == "partner" for evaluation in evaluations):
        lines.append(
            "- The partners of the study are also simulated, by the same kind of scripted agent as the training data."
        )
    incomplete = [e["settings"]["maps"] for e in evaluations if not e["settings"].get("complete_set", True)]
    lines += [f"- Only a part of the {words.scenarios} of {maps} was evaluated." for maps in incomplete]
    contradictions = [line for e in evaluations for line in e["settings"].get("told_otherwise", ())]
    lines += [f"- Evaluated under other conditions than trained: {line}." for line in dict.fromkeys(contradictions)]
    return "## Limits\n\n" + "\n".join(lines)
