"""Types of the JSON documents that commands write to the `meta/` folder of a data set."""

from typing import Any, NotRequired, TypedDict

Number = float | int | None


class NullDistribution(TypedDict):
    """Null distribution of a statistic."""

    mean: Number
    low: Number
    high: Number
    p: Number


class _Routes(TypedDict, total=False):
    counts: dict[str, int]


class Configuration(TypedDict):
    """Values of a statistic for one configuration; `counts` are the episodes of each route."""

    episodes: int
    counts: NotRequired[dict[str, int]]
    entropy_bits: NotRequired[Number]
    interval: NotRequired[tuple[Number, Number] | None]
    effective_modes: NotRequired[Number]
    effective_modes_interval: NotRequired[tuple[Number, Number] | None]


class EstimateDetails(TypedDict, total=False):
    """The parts of an estimate that cards and the report show; other keys are kept."""

    configurations: dict[str, Configuration]
    effective_modes: Number
    reading: str
    counts: dict[str, int]
    human: _Routes


class EstimateDocument(TypedDict):
    """One statistic."""

    value: Number
    unit: str
    interval: NotRequired[tuple[Number, Number] | None]
    episodes: NotRequired[int]
    definition: NotRequired[str]
    note: NotRequired[str]
    null: NotRequired[NullDistribution]
    details: NotRequired[EstimateDetails]


class _Described(TypedDict, total=False):
    episodes: int
    sources: dict[str, int]
    left_out: dict[str, int]


class _HumanReference(TypedDict, total=False):
    source: str


class StatisticsDocument(TypedDict):
    """`meta/copolicy_stats.json`, written by `copolicy-dataset stats`."""

    definition_version: NotRequired[str]
    dataset: NotRequired[_Described]
    human_reference: NotRequired[_HumanReference]
    statistics: NotRequired[dict[str, dict[str, EstimateDocument]]]


class FindingDocument(TypedDict):
    """One finding of a check."""

    rule: str
    severity: str
    message: str
    episode: NotRequired[str | None]
    figure: NotRequired[Number | str]
    limit: NotRequired[Number | str]


class CheckDocument(TypedDict):
    """`meta/copolicy_check.json`, written by `copolicy-dataset check`; also what `check --json` prints."""

    findings: NotRequired[list[FindingDocument]]
    date: NotRequired[str]
    rules_version: NotRequired[str]
    rules: NotRequired[int]
    content_hash: NotRequired[str | None]


class ReleaseDocument(TypedDict):
    """The keys of `meta/copolicy_release.json`, the record of a release, that cards read."""

    version: str
    date: str
    content_hash: str


class ConversionRecord(TypedDict):
    """`meta/copolicy.json`, written by `copolicy-convert`."""

    converter: NotRequired[str]
    version: NotRequired[str]
    left_out: NotRequired[dict[str, list[str]]]
    notes: NotRequired[dict[str, list[str]]]
    appended: NotRequired[list[dict[str, Any]]]
