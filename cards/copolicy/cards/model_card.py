"""The card of a model: Hub metadata with its results, and a README that states only what its files hold."""

from collections.abc import Sequence
from typing import Any

from huggingface_hub import ModelCardData

from .checkpoint import Checkpoint
from .dataset_card import citation, source_text
from .markdown import listing, share, table
from .model_index import eval_results
from .model_results import results

# What tells one policy from another, in the order of a reader's questions; a policy has only some of them.
_SETTINGS = (
    "type", "preset", "past_human_action", "network", "observation_features", "n_obs_steps", "horizon",
    "n_action_steps", "n_layers", "width", "n_heads", "num_train_timesteps", "prediction_type", "sampler",
    "num_inference_steps", "initial_noise_scale", "mirror", "permute_obstacles", "ema", "fps",
)  # fmt: skip
_WITH_PACKAGE = "pretrained"  # folder of the model that the package brings
_TRAINING = ("steps", "batch_size", "samples", "seed")


def render_model_card(
    checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]], name: str, licence: str | None = None
) -> str:
    """The text of `README.md` for a checkpoint.

    Args:
        evaluations: contents of `eval.json` files of this checkpoint.
        name: of the model, `user/name` or the like.
        licence: the Hub's identifier; by default what the configuration says, else none is stated.
    """
    sections = (
        _overview(checkpoint, name),
        results(evaluations, checkpoint.task),
        _data(checkpoint),
        _configuration(checkpoint, evaluations),
        *_again(checkpoint),
        _usage(checkpoint, name, evaluations),
        _limits(checkpoint, evaluations),
        *citation(checkpoint.task.words),
    )
    metadata = hub_metadata(checkpoint, evaluations, name, licence)
    return f"---\n{metadata.to_yaml()}\n---\n\n" + "\n\n".join(sections) + "\n"


def hub_metadata(
    checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]], name: str, licence: str | None
) -> ModelCardData:
    """The YAML block that the Hub reads, with a model-index where there are evaluations."""
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


def _overview(checkpoint: Checkpoint, name: str) -> str:
    words = checkpoint.task.words
    parts = [
        f"# {name.rpartition('/')[2]}",
        f"A policy of type `{checkpoint.config['type']}` that {words.acts}: it plans the next actions of both players, "
        "and the robot executes its half.",
        *_interface(checkpoint),
    ]
    if checkpoint.data.at_hand:
        parts += [f"Training data: {source_text(source, words)}" for source in sorted(checkpoint.data.sources)]
    else:
        parts.append(
            "**Source of the training data: not stated.** The data set was not at hand when this card was written."
        )
    return "\n\n".join(parts)


def _interface(checkpoint: Checkpoint) -> list[str]:
    """What goes in and what comes out, where the configuration says so."""
    config, rate = checkpoint.config, f" at {checkpoint.data.fps:g} Hz" if checkpoint.data.fps else ""
    if not {"n_obs_steps", "horizon", "n_action_steps"} <= config.keys():
        return []
    words, human = checkpoint.task.words, ", the human's past actions" if config.get("past_human_action") else ""
    return [
        f"In: the last {config['n_obs_steps']} frames{rate} of {words.state_sees}, {words.scenario_sees}{human}. Out: "
        f"{config['horizon']} actions of both players, {words.action}; up to {config['n_action_steps']} are executed "
        "before the next plan."
    ]


def _data(checkpoint: Checkpoint) -> str:
    data = checkpoint.data
    where = "" if _on_hub(data.repo_id) else " (a local name, not one on the Hub)"
    lines = [f"- Data set: `{data.repo_id}`{where}" if data.repo_id else "- Data set: not stated"]
    for title, value in (("Revision", data.revision), ("Version", data.version), ("Content", data.content_hash)):
        lines += [f"- {title}: `{value}`"] if value else []
    if not data.at_hand:
        lines += ["- Source: not stated", f"- Episodes used: {'all' if data.used is None else data.used}"]
    else:
        lines += [
            f"- Source: {listing(data.sources)}",
            f"- Episodes used: {share(data.used or 0, data.episodes or 0)}",
            f"- Frames: {data.frames:,} at {data.fps:g} Hz",
            f"- Pairs: {listing(data.pairs)}" if data.pairs else "- Pairs: not stated",
            f"- {checkpoint.task.words.scenario.capitalize()} sets: {listing(data.map_sets)}",
            f"- Licences: {listing(data.licences)}",
        ]
    return "## Training data\n\n" + "\n".join(lines)


def _configuration(checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]]) -> str:
    averaged = (checkpoint.recipe.get("weights") or {}).get("averaged")
    # Said otherwise below, or of no consequence.
    skipped = ({"ema"} if averaged else set()) | ({"n_heads"} if checkpoint.config.get("network") == "mlp" else set())
    rows = [(f"`{key}`", checkpoint.config[key]) for key in _SETTINGS if key in checkpoint.config.keys() - skipped]
    training = [
        (f"training `{key}`", checkpoint.training[key]) for key in _TRAINING if checkpoint.training.get(key) is not None
    ]
    optimizer = checkpoint.training.get("optimizer") or {}
    training += [(f"optimizer `{key}`", optimizer[key]) for key in ("type", "lr", "weight_decay") if key in optimizer]
    sizes = {evaluation["policy"].get("parameters") for evaluation in evaluations} - {None}
    size = [("parameters", f"{parameters:,}") for parameters in sizes]
    weights = [("sha256 of the weights", f"`{checkpoint.weights_sha256}`")]
    if averaged:
        weights.insert(0, ("weights", "moving average over the training, alone"))
    text = table(("setting", "value"), [*rows, *size, *training, *weights])
    if not checkpoint.training:
        text += "\n\nHow it was trained is not stated (no `train_config.json` or `recipe.json`)."
    return f"## Policy and training\n\n{text}"


def _again(checkpoint: Checkpoint) -> list[str]:
    """How it was made, where that is on record."""
    if not checkpoint.commands:
        return []
    return ["## How it was made\n\n```bash\n" + "\n".join(checkpoint.commands) + "\n```"]


def _usage(checkpoint: Checkpoint, name: str, evaluations: Sequence[dict[str, Any]]) -> str:
    maps = evaluations[0]["settings"]["maps"] if evaluations else "holdout"
    commands = ["pip install 'lerobot_policy_copolicy[train]'"]
    place = "checkpoint"
    if checkpoint.folder.name == _WITH_PACKAGE:
        place = _WITH_PACKAGE  # the commands know it by this name
    elif _on_hub(name):
        commands.append(f"hf download {name} --local-dir checkpoint")
    commands += [
        f"copolicy-collect play --players keyboard policy:{place}",
        f"copolicy-eval coplan --policy {place} --maps {maps} --out eval.json",
    ]
    text = "## How to use it\n\n```bash\n" + "\n".join(commands) + "\n```"
    if place == _WITH_PACKAGE:
        text += "\n\nIt comes with the package; `copolicy-train pretrained` says where it is, for LeRobot's commands."
    return text


def _limits(checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]]) -> str:
    words = checkpoint.task.words
    lines = [f"- Everything above was measured in {words.place}; nothing here says how a real robot would {words.act}."]
    if "simulated" in checkpoint.data.sources:
        lines.append(f"- Trained on simulated pairs: how it {words.act_s} with a person has not been measured.")
    if any(evaluation["study"] == "partner" for evaluation in evaluations):
        lines.append(
            "- The partners of the study above are simulated too, by the same kind of pilot as the training data."
        )
    incomplete = [e["settings"]["maps"] for e in evaluations if not e["settings"].get("complete_set", True)]
    lines += [f"- Only a part of the {words.scenarios} of {maps} was tried." for maps in incomplete]
    contradictions = [line for e in evaluations for line in e["settings"].get("told_otherwise", ())]
    lines += [
        f"- Evaluated under other conditions than it was trained under: {line}."
        for line in dict.fromkeys(contradictions)
    ]
    return "## Limits\n\n" + "\n".join(lines)
