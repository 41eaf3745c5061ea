"""How screens, cards, pages and figures speak of a task."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from .task_spec import TaskSpec, Vector


@dataclass(frozen=True)
class TaskWords:
    """The part `words` of a task: phrases, put into sentences that are the same for every task.

    Attributes:
        about: what the players do, a sentence without its end.
        episodes_of: what an episode shows.
        tag: for the Hub.
        numbers: units and axes of state, scenario and action, in sentences.
        cast: who and what takes part.
        act, act_s: the verb of a player, and its third person.
        place: where everything happens.
        episode: what an episode is.
        record: what meta/episodes holds, a sentence.
        invitation: title of a session's window; that of the task where empty.
        instruction: what players read before they begin; the sentence of the task where empty.
        purpose: what policies learn to do with a partner.
        limits: how far the data are from robots, the beginning of a sentence.
        scenario, scenarios: the noun.
        scenario_sees: what a policy sees of one.
        noun: what moves, in a word.
        body: the point of it that is followed.
        state_sees: what a policy sees of it.
        acts: what a policy does with a partner, and where.
        action: what the numbers of an action are.
        running: what a study still plans for.
        success, failure, did_not: of episodes; the second begins with "ended".
        scene: what a film shows.
        stand_in: who plays simulated episodes, a sentence.
        label, label_class: what a strategy label is called, and what it is a kind of.
        labels: how labels are read, on a card and on the page.
        meanings: of labels, in figures; by the label.
        interaction: what the interaction measure is called.
        interaction_unit: of the measure.
        interaction_senses: what it means where it is positive, negative and zero.
        interaction_above: the same of positive values, after "above".
        interaction_note: what it is, in sentences.
        citation: what a paper is cited for, a sentence.
        paper: BibTeX.
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
    body: str = "what moves"
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
        """What the spec alone can say."""
        vectors = {"State": spec.state, "Scenario": spec.scenario, "Action of each player": spec.action}
        numbers = " ".join(f"{name}: {_numbers(vector)}." for name, vector in vectors.items())
        about = f"Two players, one task ({spec.sentence.rstrip('.')})"
        return cls(about, f"two players at the task {spec.name!r}", spec.name, numbers)


def _numbers(vector: Vector) -> str:
    return ", ".join(f"{name} ({unit})" for name, unit in zip(vector.names, vector.units, strict=True))
