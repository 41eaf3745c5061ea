"""The card of a model: Hub metadata with its results, and a README that states only what its files hold."""

from collections.abc import Sequence
from typing import Any

from copolicy.dataset.exceptions import MissingExtraError

from .checkpoint import Checkpoint
from .dataset_card import CITATION, SOURCES
from .markdown import listing, number, share, table

try:
    from huggingface_hub import EvalResult, ModelCardData
except ModuleNotFoundError:
    raise MissingExtraError("huggingface_hub") from None

# What tells one policy from another, in the order of a reader's questions; a policy has only some of them.
_SETTINGS = (
    "type", "preset", "past_human_action", "network", "observation_features", "n_obs_steps", "horizon",
    "n_action_steps", "n_layers", "width", "n_heads", "num_train_timesteps", "prediction_type", "sampler",
    "num_inference_steps", "initial_noise_scale", "mirror", "permute_obstacles", "ema",
)  # fmt: skip
_TRAINING = ("steps", "batch_size", "seed")


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
        _results(evaluations),
        _data(checkpoint),
        _configuration(checkpoint, evaluations),
        _usage(name, evaluations),
        _limits(checkpoint, evaluations),
        CITATION,
    )
    metadata = hub_metadata(checkpoint, evaluations, name, licence)
    return f"---\n{metadata.to_yaml()}\n---\n\n" + "\n\n".join(sections) + "\n"


def hub_metadata(
    checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]], name: str, licence: str | None
) -> ModelCardData:
    """The YAML block that the Hub reads, with a model-index where there are evaluations."""
    sources = checkpoint.dataset.values("source") if checkpoint.dataset else []
    repo_id = checkpoint.repo_id
    on_hub = "/" in repo_id and not repo_id.startswith("local/")
    return ModelCardData(
        license=licence or checkpoint.config.get("license"),
        library_name="lerobot",
        pipeline_tag="robotics",
        tags=[
            "robotics", "lerobot", "copolicy", checkpoint.config["type"], "human-robot-collaboration",
            *(f"trained-on-{source}" for source in sources),
        ],
        datasets=[repo_id] if on_hub else None,
        model_name=name.rpartition("/")[2],
        eval_results=[_eval_result(evaluation) for evaluation in evaluations] or None,
    )  # fmt: skip


def _eval_result(evaluation: dict[str, Any]) -> EvalResult:
    settings, success = evaluation["settings"], evaluation["summary"]["success"]
    return EvalResult(
        task_type="robotics",
        task_name=f"table carrying, {evaluation['study']} (simulation)",
        dataset_type=f"copolicy-maps-{settings['maps']}",
        dataset_name=f"{settings['maps']} maps{'' if settings.get('complete_set', True) else ', a part of them'}",
        dataset_args={
            key: settings[key] for key in ("map_count", "orientations", "repeats", "seed") if key in settings
        },
        metric_type="success_rate",
        metric_name=f"success rate over {success['episodes']} episodes",
        metric_value=round(success["mean"], 6),
        metric_args={"standard_error": round(success["standard_error"], 6), "episodes": success["episodes"]},
    )


def _overview(checkpoint: Checkpoint, name: str) -> str:
    parts = [
        f"# {name.rpartition('/')[2]}",
        f"A policy of type `{checkpoint.config['type']}` that carries a table together with a partner: from what both "
        "did it plans the actions of both players.",
    ]
    if checkpoint.dataset is None:
        parts.append(
            "**Source of the training data: not stated.** The data set was not at hand when this card was written."
        )
    else:
        parts += [f"Training data: {SOURCES.get(source, source)}" for source in checkpoint.dataset.values("source")]
    return "\n\n".join(parts)


def _results(evaluations: Sequence[dict[str, Any]]) -> str:
    if not evaluations:
        return "## Results\n\nNot evaluated: no `eval.json` was given."
    rows = [_result_row(evaluation) for evaluation in evaluations]
    header = (
        "study", "maps", "success, % ± s.e.", "95 % interval, %", "episodes", "evaluation seed",
        "time to completion, s", "interaction force", "planning, ms a call (median)",
    )  # fmt: skip
    labels = sorted({evaluation["label"] for evaluation in evaluations})
    return "\n\n".join(
        (
            "## Results",
            *(f"**{label[0].upper()}{label[1:]}.**" for label in labels),
            table(header, rows),
            "s.e.: binomial standard error over episodes of this one training; it says nothing about other training "
            "seeds. Interval: Wilson. Times to completion count successes only. Interaction force: mean size, in "
            "units of a player's full force. A call plans for all tables that are still being carried at once.",
        )
    )


def _result_row(evaluation: dict[str, Any]) -> tuple[object, ...]:
    settings, summary = evaluation["settings"], evaluation["summary"]
    success = summary["success"]
    low, high = success["wilson_95"]
    part = "" if settings.get("complete_set", True) else f", first {settings['map_count']}"
    turned = ", four start orientations" if settings.get("orientations") else ""
    return (
        evaluation["study"],
        settings["maps"] + part + turned,
        f"{100 * success['mean']:.1f} ± {100 * success['standard_error']:.1f}",
        f"{100 * low:.1f} to {100 * high:.1f}",
        success["episodes"],
        settings.get("seed", "not stated"),
        number((summary.get("time_to_completion_s") or {}).get("mean")),
        number((summary.get("interaction_force") or {}).get("mean")),
        f"{number(summary['planning_ms_per_call'].get('p50'))} on {settings.get('device', 'a device not stated')}",
    )


def _data(checkpoint: Checkpoint) -> str:
    name = f"`{checkpoint.repo_id}`" if checkpoint.repo_id else "not stated"
    lines = [f"- Data set: {name}"]
    revision = (checkpoint.training.get("dataset") or {}).get("revision")
    if revision:
        lines.append(f"- Revision: `{revision}`")
    chosen = checkpoint.training_episodes
    facts = checkpoint.dataset
    if facts is None:
        lines += ["- Source: not stated", f"- Episodes used: {'all' if chosen is None else len(chosen)}"]
    else:
        used = len(facts.episodes) if chosen is None else len(chosen)
        lines += [
            f"- Source: {listing(facts.counts('source'))}",
            f"- Episodes used: {share(used, len(facts.episodes))}",
            f"- Frames: {facts.info['total_frames']:,} at {facts.info['fps']:g} Hz",
            f"- Map sets: {listing(facts.counts('map_set'))}",
            f"- Licences: {listing(facts.counts('license'))}",
        ]
    return "## Training data\n\n" + "\n".join(lines)


def _configuration(checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]]) -> str:
    rows = [(f"`{key}`", checkpoint.config[key]) for key in _SETTINGS if key in checkpoint.config]
    training = [(f"training `{key}`", checkpoint.training[key]) for key in _TRAINING if key in checkpoint.training]
    optimizer = checkpoint.training.get("optimizer") or {}
    training += [(f"optimizer `{key}`", optimizer[key]) for key in ("type", "lr", "weight_decay") if key in optimizer]
    sizes = {evaluation["policy"].get("parameters") for evaluation in evaluations} - {None}
    size = [("parameters", f"{parameters:,}") for parameters in sizes]
    weights = [("sha256 of the weights", f"`{checkpoint.weights_sha256}`")]
    text = table(("setting", "value"), [*rows, *size, *training, *weights])
    if not checkpoint.training:
        text += "\n\nHow it was trained is not stated (no `train_config.json`)."
    return f"## Policy and training\n\n{text}"


def _usage(name: str, evaluations: Sequence[dict[str, Any]]) -> str:
    maps = evaluations[0]["settings"]["maps"] if evaluations else "holdout"
    return f"""## How to use it

```bash
pip install 'lerobot_policy_copolicy[train]'
hf download {name} --local-dir checkpoint
copolicy-eval coplan --policy checkpoint --maps {maps} --out eval.json
copolicy-collect play --pilots policy:checkpoint joystick --pair P01 --out recordings
```"""


def _limits(checkpoint: Checkpoint, evaluations: Sequence[dict[str, Any]]) -> str:
    lines = ["- Everything above was measured in a simulated plane; nothing here says how a real robot would carry."]
    if checkpoint.dataset and "simulated" in checkpoint.dataset.values("source"):
        lines.append("- Trained on simulated pairs: how it carries with a person has not been measured.")
    incomplete = [e["settings"]["maps"] for e in evaluations if not e["settings"].get("complete_set", True)]
    lines += [f"- Only a part of the maps of {maps} was tried." for maps in incomplete]
    return "## Limits\n\n" + "\n".join(lines)
