"""Types of a policy's JSON documents: results of `copolicy-eval`, recipe, configuration, training settings."""

from typing import Any, NotRequired, TypedDict

from ..lerobot_folder.documents import Number

Distribution = dict[str, Number]
"""Mean, standard error and quantiles of a measurement, by name."""


class SuccessDocument(TypedDict):
    """Success rate over episodes."""

    mean: float | int
    standard_error: Number
    episodes: int
    wilson_95: tuple[Number, Number] | None


class _Mean(TypedDict):
    mean: float | int


class PartnerSummaryDocument(TypedDict):
    """Summary of the episodes with one kind of partner."""

    success: _Mean


class SummaryDocument(TypedDict):
    """Summary of all episodes of a study."""

    success: SuccessDocument
    planning_ms_per_call: NotRequired[Distribution | None]
    time_to_completion_s: NotRequired[Distribution | None]
    interaction_force: NotRequired[Distribution | None]
    robot_share: NotRequired[Number]
    by_partner: NotRequired[dict[str, PartnerSummaryDocument] | None]


class EvaluatedPolicyDocument(TypedDict):
    """The evaluated policy or scripted agent; only a policy has weights."""

    weights_sha256: NotRequired[str | None]
    parameters: NotRequired[Number]
    sampler: NotRequired[str | None]
    num_inference_steps: NotRequired[Number]
    initial_noise_scale: NotRequired[Number]


class EvaluationSettingsDocument(TypedDict):
    """The protocol of a study."""

    maps: str
    map_set: NotRequired[dict[str, str] | None]
    map_count: NotRequired[int]
    complete_set: NotRequired[bool]
    orientations: NotRequired[bool]
    told_otherwise: NotRequired[list[str]]


class BaselineDocument(TypedDict):
    """A baseline agent in the same study."""

    name: str
    policy: NotRequired[EvaluatedPolicyDocument]
    summary: SummaryDocument


class EvaluationDocument(TypedDict):
    """A result of `copolicy-eval coplan` or `partner`."""

    study: str
    label: str
    settings: EvaluationSettingsDocument
    policy: EvaluatedPolicyDocument
    summary: SummaryDocument
    episodes: NotRequired[list[dict[str, Any]]]
    baselines: NotRequired[list[BaselineDocument] | None]
    name: NotRequired[str]


class ComparedDocument(TypedDict):
    """The keys of an evaluation that a comparison reads."""

    study: str
    label: str
    settings: dict[str, Any]
    policy: dict[str, Any]
    episodes: list[dict[str, Any]]


class ExportedEvaluationsDocument(TypedDict):
    """`eval.json` of an exported policy."""

    evaluations: NotRequired[list[EvaluationDocument] | None]


class RecipeDataDocument(TypedDict):
    """The data that a policy was trained on."""

    repo_id: NotRequired[str | None]
    revision: NotRequired[str | None]
    episodes: NotRequired[int | None]
    episodes_used: NotRequired[int | None]
    frames: NotRequired[int | None]
    fps: NotRequired[Number]
    version: NotRequired[str | None]
    content_hash: NotRequired[str | None]
    source: NotRequired[dict[str, int] | None]
    map_set: NotRequired[dict[str, int] | None]
    license: NotRequired[dict[str, int] | None]
    pair_id: NotRequired[dict[str, int] | None]
    split: NotRequired[str | None]
    people: NotRequired[list[str] | None]


class TrainingDataDocument(TypedDict):
    """`training_data.json` of a checkpoint."""

    repo_id: NotRequired[str | None]
    content_hash: NotRequired[str | None]
    split: NotRequired[str | None]
    pairs: NotRequired[dict[str, int] | None]
    people: NotRequired[list[str] | None]
    sources: NotRequired[list[str] | None]
    episodes: NotRequired[list[int] | None]


class _Weights(TypedDict, total=False):
    exported_from: str
    averaged: bool


class RecipeDocument(TypedDict):
    """`recipe.json` of an exported policy."""

    weights: NotRequired[_Weights | None]
    training: NotRequired[dict[str, Any] | None]
    dataset: NotRequired[RecipeDataDocument | None]
    commands: NotRequired[list[str] | None]


class _TrainingData(TypedDict, total=False):
    repo_id: str | None
    root: str | None
    revision: str | None
    episodes: list[int] | None


class TrainingDocument(TypedDict):
    """The keys of `train_config.json` that are read."""

    dataset: NotRequired[_TrainingData | None]
    batch_size: NotRequired[int | None]
    steps: NotRequired[int | None]
    optimizer: NotRequired[dict[str, Any] | None]


class TrainingStepDocument(TypedDict):
    """LeRobot's `training_step.json` of a checkpoint."""

    step: NotRequired[int]
    num_processes: NotRequired[int]


class PolicyConfigDocument(TypedDict):
    """The keys of `config.json` that cards read."""

    type: str
    license: NotRequired[str | None]
    fps: NotRequired[Number]
