"""Makes the partners of a study, and for each its own kind at the robot's seat."""

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from copolicy.collect.agents import HumanLimits, LimitedAgent, PolicyAgent, ScriptedAgent
from copolicy.collect.agents.human_limits import HUMAN_DELAY_S, HUMAN_NOISE
from copolicy.collect.agents.simulated_players import simulated_players
from copolicy.collect.rollout import Agent, EpisodeStart
from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import PairTask, Player, SeatExchange

from .names import HUMAN_LIKE, PROXY, REPLAY, SCRIPTED, PartnerName
from .recorded import RecordedStarts, read_recorded_starts

if TYPE_CHECKING:
    from copolicy.train.checkpoint import Checkpoint

    from ..study_flags import Protocol

_PROXY, _OWN_KIND = 0x9A87, 0x0B1D  # separate random numbers of the same seed


@dataclass(frozen=True)
class StudyPartner:
    """A partner of a study.

    Attributes:
        name: name in results.
        agent: makes its agent for the human's seat, from the seed of the partners and the number of repeats of each
            start, which only a `replay` needs.
        own_kind: makes an agent of its own kind for the robot's seat, from the seed of the robots and the same number;
            None if there is none, for the reason in `no_own_kind`.
        describe: returns its description for the result.
        policy: policy of a proxy.
        own_policy: policy of its own kind at the robot's seat.
        recorded: starts of a `replay` partner, which acts in these only.
        no_own_kind: why it has no own kind.
    """

    name: str
    agent: Callable[[int, int], Agent]
    own_kind: Callable[[int, int], Agent] | None
    describe: Callable[[], Mapping[str, Any]]
    policy: "Checkpoint | None" = None
    own_policy: "Checkpoint | None" = None
    recorded: RecordedStarts | None = None
    no_own_kind: str = ""


def make_partner(
    name: PartnerName, task: PairTask, protocol: "Protocol | None" = None, device: str = "cpu", starts: int = 0
) -> StudyPartner:
    """Makes a partner; loads the checkpoint of a proxy, reads the recordings of a `replay`.

    Args:
        protocol: of the study; only a `replay` needs it.
        device: torch device of a proxy.
        starts: largest number of recorded starts of a `replay`.

    Raises:
        FileFormatError: the checkpoint or the recordings cannot be used.
        InvalidValueError: a proxy of another task, or one whose chunks are shorter than `commit`.
    """
    if name.kind == PROXY:
        return _proxy(name, task, device)
    if name.kind == REPLAY:
        assert protocol is not None, "a protocol for a replay"
        return _replay(name, task, protocol, starts)
    return _scripted(name, task)


def _limits(name: PartnerName, **defaults: float) -> HumanLimits:
    options = {**defaults, **name.options}
    return HumanLimits(options.get("delay", 0.0), options.get("noise", 0.0))


def _limited(agent: Agent, limits: HumanLimits, task: PairTask) -> Agent:
    return agent if limits == HumanLimits() else LimitedAgent(agent, limits, task)


def _proxy(name: PartnerName, task: PairTask, device: str) -> StudyPartner:
    from copolicy.train.checkpoint import Checkpoint  # torch

    limits = _limits(name)

    def load() -> "Checkpoint":
        policy = Checkpoint(name.detail, device)
        if policy.task != task.spec.name:
            raise InvalidValueError(f"proxy {name.name}", f"a policy of the task {task.spec.name!r}", policy.task)
        executed = max(1, round(name.options.get("commit", 0.0) * policy.fps))
        if executed > policy.chunk_size:
            longest = policy.chunk_size / policy.fps
            raise InvalidValueError(f"proxy {name.name}: commit", f"at most {longest:g} s, a whole chunk", name.options)
        policy.n_action_steps = policy.n_predicted_actions = executed
        return policy

    # Two loaded policies: each has its own random numbers and history.
    policy, own = load(), load()

    def describe() -> Mapping[str, Any]:
        return {**name.to_json(), "n_action_steps": policy.n_action_steps, "policy": policy.describe()}

    return StudyPartner(
        name.name,
        lambda seed, repeats: _limited(PolicyAgent(policy, task, seed=_seed(name.name, seed, _PROXY)), limits, task),
        lambda seed, repeats: _limited(PolicyAgent(own, task, seed=_seed(name.name, seed, _OWN_KIND)), limits, task),
        describe,
        policy,
        own,
    )


def _scripted(name: PartnerName, task: PairTask) -> StudyPartner:
    players = simulated_players(task)
    if name.kind == HUMAN_LIKE:
        # The scripted player knows its own delay, so that it is no delay of the wrapper.
        limits = HumanLimits(noise=name.options.get("noise", HUMAN_NOISE))
        described: dict[str, Any] = {
            "kind": HUMAN_LIKE, "delay_s": name.options.get("delay", list(HUMAN_DELAY_S)), "noise": limits.noise,
        }  # fmt: skip
    else:
        limits = _limits(name)
        described = {**name.to_json(), "profile": asdict(players.partners[name.detail])}

    def player(scenario: Any, seed: int) -> Player:
        if name.kind == SCRIPTED:
            return players.make_partner(scenario, name.detail, seed)
        assert players.make_human_like is not None, "checked with the name"
        delay_s = name.options.get("delay")
        if delay_s is None:
            delay_s = float(np.random.default_rng([seed, 1]).uniform(*HUMAN_DELAY_S))
        return players.make_human_like(scenario, seed, delay_s)

    def agent(seed: int, repeats: int) -> Agent:
        # The seed of the partners is in that of the start.
        made = ScriptedAgent("partner", lambda seat, index, start: player(start.scenario, start.seed))
        return _limited(made, limits, task)

    def own_kind(seed: int, repeats: int) -> Agent:
        exchange = task.exchange
        assert exchange is not None, "an own kind only with the exchange"

        def make(seat: int, index: int, start: EpisodeStart) -> Player:
            own_seed = int(np.random.SeedSequence([start.seed, seed, _OWN_KIND]).generate_state(1)[0])
            return _ExchangedPlayer(player(exchange.scenario(start.scenario), own_seed), exchange)

        return _limited(ScriptedAgent(f"own-kind:{name.name}", make), limits, task)

    missing = "" if task.exchange is not None else task.missing("exchange of seats")
    return StudyPartner(name.name, agent, None if missing else own_kind, lambda: described, no_own_kind=missing)


class _ExchangedPlayer:
    """A player of the human's seat that acts at the robot's: it sees the world with exchanged seats."""

    def __init__(self, player: Player, exchange: SeatExchange):
        self._player, self._exchange = player, exchange

    @property
    def changes(self) -> int:
        """Changes of strategy of the player."""
        return self._player.changes

    def act(self, state: Array) -> Array:
        """The robot's action."""
        action = self._player.act(self._exchange.states(state))
        joint = np.concatenate((np.zeros_like(action), action))
        return self._exchange.actions(joint)[: len(action)]


def _replay(name: PartnerName, task: PairTask, protocol: "Protocol", count: int) -> StudyPartner:
    recorded = read_recorded_starts(name.detail, task, protocol.settings, count)
    limits = _limits(name)
    return StudyPartner(
        name.name,
        lambda seed, repeats: _limited(recorded.agent(repeats), limits, task),
        lambda seed, repeats: recorded.agent(repeats),
        lambda: {**name.to_json(), **recorded.describe()},
        recorded=recorded,
    )


def scripted_partners(kinds: Sequence[str], task: PairTask) -> list[StudyPartner]:
    """Partners of scripted kinds of a task, without further limits."""
    return [make_partner(PartnerName(kind, SCRIPTED, kind), task) for kind in kinds]


def _seed(name: str, seed: int, stream: int) -> int:
    entropy = [seed, zlib.crc32(name.encode()), stream]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])
