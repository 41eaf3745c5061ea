"""Phrases with which screens, cards, pages and figures describe a task."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .task_spec import TaskSpec, Vector


@dataclass(frozen=True)
class TaskWords:
    """The part `words` of a task: phrases that are inserted into sentences common to all tasks.

    Attributes:
        about: what the players do; a sentence without its full stop.
        episodes_of: the content of an episode.
        tag: tag on the Hub.
        numbers: units and axes of state, scenario and action; sentences.
        cast: the participants.
        act, act_s: verb for a player's activity, and its third person.
        place: where the task takes place.
        episode: definition of an episode.
        record: content of meta/episodes; a sentence.
        invitation: title of a session's window; the title of the task if empty.
        instruction: instruction for players before they start; the sentence of the task if empty.
        purpose: what policies learn to do with a partner.
        limits: how the data differ from real robots; the beginning of a sentence.
        scenario, scenarios: noun for a scenario, singular and plural.
        scenario_sees: what a policy observes of the scenario.
        noun: noun for the moving body.
        body: name of the tracked point.
        state_sees: what a policy observes of the moving body.
        acts: what a policy does with a partner, and where.
        action: meaning of the numbers of an action.
        running: noun for the episodes of a study that are still running.
        success, failure, did_not: verb phrases for episodes; `failure` begins with "ended".
        scene: content of a video.
        stand_in: who plays simulated episodes; a sentence.
        label, label_class: name of a strategy label, and of its category.
        labels: how to read labels, on a card and on the report page.
        meanings: meaning of each label, in figures.
        interaction: name of the interaction measure.
        interaction_unit: unit of the interaction measure.
        interaction_senses: meaning of positive, negative and zero values.
        interaction_above: meaning of positive values, after "above".
        interaction_note: definition of the interaction measure; sentences.
        citation: reason to cite the paper; a sentence.
        paper: BibTeX entry.
    """

    about: str
    episodes_of: str
    tag: str
    numbers: str
    cast: str = "Two players"
    act: str = "act"
    act_s: str = "acts"
    place: str = "simulation"
    episode: str = "one attempt from start to end"
    record: str = "One record an episode: who acted with whom in which scenario, and how it ended."
    invitation: str = ""
    instruction: str = ""
    purpose: str = "act with a partner"
    limits: str = "The task is simulated under known dynamics"
    scenario: str = "scenario"
    scenarios: str = "scenarios"
    scenario_sees: str = "the scenario"
    noun: str = "body"
    body: str = "the moving body"
    state_sees: str = "the state"
    acts: str = "acts together with a partner, in simulation"
    action: str = "within their bounds"
    running: str = "episodes that still run"
    success: str = "succeeded"
    failure: str = "ended without success"
    did_not: str = "did not succeed"
    scene: str = "The scene and both players' forces"
    stand_in: str = "Two scripted players stand in for people."
    label: str = "strategy label"
    label_class: str = "strategy label"
    labels: tuple[str, str] = ("", "")
    meanings: Mapping[str, str] = field(default_factory=dict)
    interaction: str = "interaction measure"
    interaction_unit: str = "as the task defines it"
    interaction_senses: tuple[str, str, str] = ("positive", "negative", "zero")
    interaction_above: str = "is positive"
    interaction_note: str = ""
    citation: str = ""
    paper: str = ""

    @classmethod
    def from_spec(cls, spec: TaskSpec) -> "TaskWords":
        """Default phrases from the specification of a task."""
        vectors = {"State": spec.state, "Scenario": spec.scenario, "Action of each player": spec.action}
        numbers = " ".join(f"{name}: {_numbers(vector)}." for name, vector in vectors.items())
        about = f"Two players, one task ({spec.sentence.rstrip('.')})"
        return cls(about, f"two players at the task {spec.name!r}", spec.name, numbers)


def _numbers(vector: Vector) -> str:
    return ", ".join(f"{name} ({unit})" for name, unit in zip(vector.names, vector.units, strict=True))
