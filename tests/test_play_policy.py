"""A policy at the stick: its plans are taken up on its own grid of frames, and a slow one never holds the loop."""

import threading
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from mcap.reader import make_reader
from untrained_policy import save_untrained_policy

from copolicy.collect.agents import PolicyAgent, load_policy
from copolicy.collect.cli import main
from copolicy.collect.rollout import EpisodeStart
from copolicy.dataset.exceptions import FileFormatError, RunError
from copolicy.dataset.features import ENVIRONMENT_STATE, HUMAN_ACTION, STATE
from copolicy.dataset.recording.messages.copolicy_pb2 import EpisodeEvent, PlayerInput
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.task import get_task
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.task import TableTask
from copolicy.tasks.table.world import TableWorld

MAP = MAP_SETS["training"][0]
ONE = np.array([0])


class Counter:
    """A policy whose every action tells which chunk it is from and which of its actions it is."""

    name = "policy:counter"
    n_obs_steps = 2
    fps = 10
    n_action_steps = 3
    keeps_history = False
    task = "table"

    def __init__(self):
        self.histories: list[dict[str, np.ndarray]] = []
        self.seeds: list[int] = []
        self.gate = threading.Event()
        self.gate.set()

    def reset(self, seed: int) -> None:
        self.seeds.append(seed)

    def predict_action_chunk(self, observations: dict[str, np.ndarray]) -> np.ndarray:
        self.gate.wait(10)
        self.histories.append({key: column[0] for key, column in observations.items()})
        plan = np.zeros((6, 4))
        plan[:, 0] = 0.1 * len(self.histories)
        plan[:, 1] = 0.1 * np.arange(6)
        plan[:, 2:] = -plan[:, :2]
        return plan[None]


def begin(agent, config=MAP, seat=0, seed=0):
    agent.begin(seat, [EpisodeStart(config, seed, TableWorld(config).observation)])


@pytest.fixture
def counter():
    return Counter()


@pytest.fixture
def agent(counter):
    agent = PolicyAgent(counter, real_time=True)
    begin(agent, seed=5)
    yield agent
    counter.gate.set()
    agent.close()


def _run(agent, world, steps, human=(0.0, 0.0), wait=True):
    """The forces of some steps; the human's force grows by 0.01 a step."""
    forces = []
    for _ in range(steps):
        if wait:
            agent.wait(10)
        (force,) = agent.act(world.observation[None], ONE)
        shift = 0.01 * world.step_count
        action = np.array([*force, human[0] + shift, human[1]])
        world.step(action)
        agent.acted(action[None], ONE)
        forces.append(force)
    return np.array(forces)


def test_a_new_plan_acts_from_the_step_on_at_which_it_is_ready(agent, counter):
    forces = _run(agent, TableWorld(MAP), 24)
    # Plan 1 from frame 0; the next is asked for at frame 2, and is there a step later: it acts from within frame 2 on.
    first = [[0.1, 0.0]] * 3 + [[0.1, 0.1]] * 3 + [[0.1, 0.2]]
    second = [[0.2, 0.0]] * 2 + [[0.2, 0.1]] * 3 + [[0.2, 0.2]]
    third = [[0.3, 0.0]] * 2 + [[0.3, 0.1]] * 3 + [[0.3, 0.2]]
    np.testing.assert_allclose(forces[:19], [*first, *second, *third])
    assert counter.seeds == [5]


def test_a_plan_that_is_asked_for_at_every_frame_acts_at_every_step(counter):
    counter.n_action_steps = 1
    agent = PolicyAgent(counter, real_time=True)
    begin(agent)
    forces = _run(agent, TableWorld(MAP), 9)
    agent.close()
    # Frame 0 has the plan of the start; from then on each frame's own plan acts from its second step.
    np.testing.assert_allclose(forces[:, 0], [0.1, 0.2, 0.2, 0.2, 0.3, 0.3, 0.3, 0.4, 0.4])
    np.testing.assert_allclose(forces[:, 1], [0, 0, 0, 0.1, 0, 0, 0.1, 0, 0])


def test_a_plan_for_the_next_frame_waits_for_that_frame(counter):
    counter.n_action_steps, counter.keeps_history = 1, True
    agent = PolicyAgent(counter, real_time=True)
    begin(agent)
    forces = _run(agent, TableWorld(MAP), 9)
    agent.close()
    np.testing.assert_array_equal(forces[::3].repeat(3, axis=0), forces)
    np.testing.assert_allclose(forces[::3, 0], [0.1, 0.2, 0.3])


def test_at_the_humans_seat_a_policy_sees_the_seats_exchanged(counter):
    agent, world, exchange = PolicyAgent(counter), TableWorld(MAP), get_task().exchange
    assert exchange is not None
    begin(agent, seat=1)
    seen = world.observation
    for step in range(6):
        (force,) = agent.act(world.observation[None], ONE)
        assert force.tolist() == pytest.approx([0.1, 0.1 * (step // 3)])  # its robot's half
        action = np.array([0.01 * step, 0.5, *force])
        world.step(action)
        agent.acted(action[None], ONE)
        if step == 2:
            seen = world.observation
    counter.n_action_steps = 2
    agent.act(world.observation[None], ONE)
    first, second = counter.histories
    turned = exchange.states
    np.testing.assert_array_equal(first[STATE][0], turned(TableWorld(MAP).observation))
    np.testing.assert_array_equal(second[STATE], turned(np.array([seen, world.observation])))
    np.testing.assert_allclose(second[HUMAN_ACTION], [[0.01, 0.5], [0.04, 0.5]])  # what the robot really did
    assert first[ENVIRONMENT_STATE][0, 2] == pytest.approx((MAP.start[2] + np.pi) % (2 * np.pi))


def test_without_an_exchange_the_other_seat_gets_the_other_half(counter, monkeypatch):
    monkeypatch.setattr(TableTask, "exchange", None)
    agent = PolicyAgent(counter)
    begin(agent, seat=1)
    assert agent.act(TableWorld(MAP).observation[None], ONE).tolist() == [[-0.1, 0.0]]


def test_the_history_is_on_the_grid_of_the_data_set(agent, counter):
    world = TableWorld(MAP)
    rest = world.observation
    _run(agent, world, 6)
    seen = world.observation
    _run(agent, world, 3)
    agent.wait(10)
    before, at_frame_two = counter.histories[:2]
    np.testing.assert_array_equal(before[STATE], [rest, rest])
    np.testing.assert_array_equal(before[HUMAN_ACTION], np.zeros((2, 2)))
    np.testing.assert_array_equal(at_frame_two[STATE][1], seen)
    # The human's action of a frame is the mean of its three steps, and it is that of the frame before.
    np.testing.assert_allclose(at_frame_two[HUMAN_ACTION][:, 0], [0.01, 0.04])


def test_a_slow_plan_lets_go_and_is_taken_up_where_it_is_due(agent, counter):
    world = TableWorld(MAP)
    _run(agent, world, 6)
    counter.gate.clear()
    started = time.monotonic()
    forces = _run(agent, world, 18, wait=False)  # frames 2 to 7 while the plan for frame 2 is being made
    assert time.monotonic() - started < 0.5, "the loop waited for a plan"
    np.testing.assert_allclose(forces[::3], [[0.1, 0.2], [0.1, 0.3], [0.1, 0.4], [0.1, 0.5], [0, 0], [0, 0]])
    counter.gate.set()
    agent.wait(10)
    # Frame 8 is the seventh action of the plan for frame 2, which has six: it lets go, and asks again.
    assert _run(agent, world, 1).tolist() == [[0.0, 0.0]]
    assert len(agent.latencies) == 2
    assert agent.latencies[1] > 0
    begin(agent)
    agent.wait(10)
    _run(agent, TableWorld(MAP), 1)
    assert len(agent.latencies) == 1  # of this episode only


def test_the_age_of_a_plan_is_recorded(agent):
    world = TableWorld(MAP)
    agent.wait(10)
    time.sleep(0.05)
    agent.act(world.observation[None], ONE)
    message = agent.input
    assert message.age_ns > 50e6
    assert list(message.axes) == pytest.approx([0.1, 0.0])


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory) -> Path:
    """An untrained co-policy as a checkpoint folder."""
    return save_untrained_policy(tmp_path_factory.mktemp("checkpoint"))


def test_the_same_seed_gives_the_same_chunk_whatever_else_draws(checkpoint):
    history = {
        STATE: np.tile(TableWorld(MAP).observation, (2, 3, 1)),
        ENVIRONMENT_STATE: np.random.default_rng(0).random((2, 3, 11)),
        HUMAN_ACTION: np.zeros((2, 3, 2)),
    }
    policy = load_policy(checkpoint)
    chunks = []
    for _ in range(2):
        policy.reset(3)
        torch.rand(5)
        before = torch.get_rng_state()
        chunks.append(policy.predict_action_chunk(history))
        assert torch.equal(torch.get_rng_state(), before)  # nor does it change what others draw
    np.testing.assert_array_equal(*chunks)
    assert chunks[0].shape == (2, 10, 4)
    assert (policy.n_obs_steps, policy.n_action_steps, policy.keeps_history) == (3, 8, False)
    assert policy.name.startswith("policy:copolicy-")


def test_a_folder_without_a_checkpoint_is_named(tmp_path):
    with pytest.raises(FileFormatError) as error:
        load_policy(tmp_path)
    assert str(error.value) == (
        f"{tmp_path}: expected a checkpoint folder with config.json and model.safetensors, found an empty folder"
    )


def test_a_policy_and_a_recording_carry_the_table_in_real_time(checkpoint, tmp_path, capsys):
    from copolicy.collect.recording.recorder import EpisodeRecorder
    from copolicy.collect.recording.wall_clock import WallClockAnchor
    from copolicy.dataset.episode import EpisodeMeta

    # A recorded human who pulls hard: the episode is over in seconds, whatever an untrained policy does.
    config = MapConfig(start=(780.0, 300.0, 3.14), goal=(960.0, 300.0))
    world, path = TableWorld(config), tmp_path / "earlier.mcap"
    with EpisodeRecorder(path, config, EpisodeMeta("u"), WallClockAnchor.simulated(0)) as recorder:
        for _ in range(120):
            world.step((0, 0, 1, 0))
            recorder.step((0, 0, 1, 0), world.recorded, 0.0)
        recorder.finish(True, "goal")
    out = tmp_path / "out"
    flags = ["--pair", "H1", "--out", str(out), "--headless", "--episodes", "1", "--countdown", "0.5", "--json"]
    assert main(["play", *flags, "--players", f"policy:{checkpoint}", f"replay:{path}"]) == 0
    assert '"complete": true' in capsys.readouterr().out
    (recorded,) = out.rglob("*.mcap")
    episode = read_episode(recorded)
    assert episode.map_config == config
    assert episode.meta.controller_0.startswith("policy:copolicy-")
    assert episode.meta.controller_1 == "replay:earlier"
    assert episode.meta.source == "simulated"
    np.testing.assert_array_equal(episode.actions[:, 2:], np.tile([1.0, 0.0], (len(episode.actions), 1))[:120])
    with recorded.open("rb") as file:
        messages = list(make_reader(file).iter_messages(["/player/0/input", "/episode/event"]))
    events = [EpisodeEvent.FromString(m.data) for _, channel, m in messages if channel.topic == "/episode/event"]
    (plans,) = [event.detail for event in events if event.kind == "plans"]
    assert plans.startswith("seat 0: ")
    inputs = [PlayerInput.FromString(m.data) for _, channel, m in messages if channel.topic == "/player/0/input"]
    assert len(inputs) == len(episode.actions)
    assert max(sample.age_ns for sample in inputs) > 10**7


def test_an_error_of_the_policy_ends_the_loop(counter, monkeypatch):
    """Whether it is raised at the start of an episode or by a chunk; without it, a robot would act from no seed."""
    for name in ("reset", "predict_action_chunk"):
        with monkeypatch.context() as patch:

            def fail(*_: object, name: str = name) -> None:
                raise RunError(f"{name} failed")

            patch.setattr(counter, name, fail)
            agent = PolicyAgent(counter, real_time=True)
            begin(agent)
            world = TableWorld(MAP)
            limit = time.monotonic() + 10
            while agent._pending is not None and not agent._pending.done() and time.monotonic() < limit:
                time.sleep(0.01)
            with pytest.raises(RunError, match=f"{name} failed"):
                agent.act(world.observation[None], ONE)
            agent.close()
