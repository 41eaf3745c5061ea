"""The parts of Co-GAIL's trainer: gradients, advantages, rewards, the discriminator, the worlds, the log."""

import copy
import json
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch.distributions import Normal
from torch.nn.functional import softplus

from copolicy.dataset.features import ACTION, ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import get_task
from copolicy.train.cogail.adversary import Adversary
from copolicy.train.cogail.demonstrations import Demonstrations, EncodedFrames
from copolicy.train.cogail.layers import Adam, Flat
from copolicy.train.cogail.learner import Learner, Minibatch
from copolicy.train.cogail.log import CURVES_FILE, LOG_FILE, TrainingLog
from copolicy.train.cogail.rollout import RewardScale, advantages
from copolicy.train.cogail.worlds import RestartingWorlds
from lerobot_policy_copolicy.cogail.codes import GRID, NOISE
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.inputs import HistoryInputs
from lerobot_policy_copolicy.cogail.network import CoGailNetwork, Discriminator


def assert_gradient(ours: np.ndarray, module: torch.nn.Module) -> None:
    """That of autograd, up to rounding of float32."""
    gradients = [parameter.grad for parameter in module.parameters()]
    expected = np.concatenate([gradient.flatten().numpy() for gradient in gradients if gradient is not None])
    np.testing.assert_allclose(ours, expected, rtol=2e-4, atol=2e-5)


def test_the_gradient_of_the_discriminator_is_that_of_autograd():
    torch.manual_seed(0)
    network = Discriminator(20, 4, width=8)
    reference, adversary = copy.deepcopy(network), Adversary(network, 1e-3, penalty=10.0, batch_size=6)
    expert, policy, between = (torch.randn(6, 24) for _ in range(3))
    cross_entropy, penalty, *_ = adversary.add_gradient(*(frames.numpy() for frames in (expert, policy, between)))
    between.requires_grad_()
    (slopes,) = torch.autograd.grad(reference(between).sum(), between, create_graph=True)
    expected = softplus(-reference(expert)).mean() + softplus(reference(policy)).mean()
    expected_penalty = (slopes.norm(dim=1) - 1).square().mean()
    (expected + 10 * expected_penalty).backward()
    assert cross_entropy == pytest.approx(expected.item(), rel=1e-5)
    assert penalty == pytest.approx(expected_penalty.item(), rel=1e-5)
    assert_gradient(adversary._flat.gradient, reference)


def test_a_discriminator_of_unit_slope_has_no_penalty():
    network = Discriminator(1, 1, width=2)
    weights = [torch.zeros(parameter.shape) for parameter in network.parameters()]
    # Near zero tanh is the identity: the logit is 0.6 x + 0.8 y.
    weights[0][0], weights[2][0, 0], weights[4][0, 0] = 1e-3 * torch.tensor([0.6, 0.8]), 1.0, 1e3
    with torch.no_grad():
        for parameter, values in zip(network.parameters(), weights, strict=True):
            parameter.copy_(values)
    adversary = Adversary(network, 1e-3, penalty=10.0, batch_size=4)
    frames = np.random.default_rng(0).uniform(-1, 1, (4, 2)).astype(np.float32)
    assert adversary.add_gradient(frames, frames, frames)[1] < 1e-9
    adversary._flat.values *= 1.26  # slope 2: the distance from one is 1
    assert adversary.add_gradient(frames, frames, frames)[1] == pytest.approx(1.0, abs=0.01)


def test_the_discriminator_learns_to_tell_frames_apart():
    torch.manual_seed(0)
    random = np.random.default_rng(0)
    adversary = Adversary(Discriminator(3, 1, width=16), 1e-3, penalty=10.0, batch_size=64)

    def frames(count: int, centre: float) -> np.ndarray:
        return (random.standard_normal((count, 4)) * 0.3 + centre).astype(np.float32)

    def sample(count: int) -> tuple[np.ndarray, np.ndarray]:
        drawn = frames(count, 1.0)
        return drawn[:, :3], drawn[:, 3:]

    policy = frames(640, -1.0)
    before = adversary.train(policy, sample, 1)
    after = adversary.train(policy, sample, 20)
    assert after["discriminator_loss"] < before["discriminator_loss"]
    assert after["expert_accuracy"] > 0.98
    assert after["policy_accuracy"] > 0.98
    assert adversary.reward(frames(50, 1.0)).min() > 0 > adversary.reward(policy).max()
    positive = Adversary(adversary.discriminator, 1e-3, 10.0, 64, reward="positive")
    np.testing.assert_allclose(positive.reward(policy), np.log1p(np.exp(adversary.reward(policy))), rtol=1e-4)


def minibatch(reference: CoGailNetwork, settings: CoGailConfig, size: int = 40) -> tuple[Minibatch, torch.Tensor]:
    """Frames of which some are clipped in ratio and value, and PPO's loss of them by autograd."""
    inputs, codes, actions = torch.randn(size, 20), torch.rand(size, 2) * 2 - 1, torch.randn(size, 4)
    with torch.no_grad():
        drawn = Normal(reference.mean(inputs, codes), reference.log_deviation.exp())
        before = drawn.log_prob(actions).sum(dim=1) + 0.3 * torch.randn(size)
        values = reference.value(inputs, codes) + 0.3 * torch.randn(size)
    returns, estimates = torch.randn(size), torch.randn(size)
    distribution = Normal(reference.mean(inputs, codes), reference.log_deviation.exp())
    ratio = (distribution.log_prob(actions).sum(dim=1) - before).exp()
    limited = ratio.clamp(1 - settings.clip, 1 + settings.clip)
    assert bool((ratio != limited).any())
    policy = -torch.minimum(ratio * estimates, limited * estimates).mean()
    value = reference.value(inputs, codes)
    near = values + (value - values).clamp(-settings.clip, settings.clip)
    assert bool((near != value).any())
    value_loss = 0.5 * torch.maximum((value - returns).square(), (near - returns).square()).mean()
    entropy = distribution.entropy().sum(dim=1).mean()
    code = (reference.infer_code(inputs, reference.mean(inputs, codes)[:, 2:]) - codes).norm(dim=1).mean()
    loss = policy + settings.value_weight * value_loss - settings.entropy_weight * entropy + settings.code_weight * code
    parts = inputs, codes, actions, before, values, returns, estimates
    return Minibatch(*(part.numpy() for part in parts)), loss


def test_the_gradient_of_the_policy_is_that_of_autograd():
    torch.manual_seed(1)
    network = CoGailNetwork(20, 4, width=8, deviation=0.5)
    settings = CoGailConfig(device="cpu", entropy_weight=0.03)
    reference, learner = copy.deepcopy(network), Learner(network, settings)
    own, loss = minibatch(reference, settings)
    inputs, actions = torch.randn(30, 20), torch.randn(30, 4)
    inferred = reference.mean(inputs, reference.infer_code(inputs, actions[:, 2:]))
    # The distance itself, not its square, of the partner's half alone.
    inverse = (inferred[:, 2:] - actions[:, 2:]).square().sum(dim=1).sqrt().mean()
    (loss + settings.inverse_weight * inverse).backward()
    terms = learner.add_gradient(own, inputs.numpy(), actions.numpy())
    assert terms[-1] == pytest.approx(inverse.item(), rel=1e-5)
    assert_gradient(learner.flat.gradient, reference)


def test_the_losses_of_the_code_ignore_the_robots_half():
    torch.manual_seed(2)
    learner = Learner(CoGailNetwork(20, 4, width=8), CoGailConfig(device="cpu"))
    own, _ = minibatch(CoGailNetwork(20, 4, width=8), CoGailConfig(device="cpu"))
    inputs, actions = torch.randn(30, 20).numpy(), torch.randn(30, 4).numpy()
    robots = actions.copy()
    robots[:, :2] += 1.0
    assert learner.add_gradient(own, inputs, actions)[-2:] == learner.add_gradient(own, inputs, robots)[-2:]
    partners = actions.copy()
    partners[:, 2:] += 1.0
    assert learner.add_gradient(own, inputs, actions)[-1] != learner.add_gradient(own, inputs, partners)[-1]


def test_adam_is_torchs():
    torch.manual_seed(3)
    layer = torch.nn.Linear(5, 3)
    reference, flat = copy.deepcopy(layer), Flat(layer)
    ours, theirs = Adam(flat, 1e-2, 1e-5), torch.optim.Adam(reference.parameters(), lr=1e-2, eps=1e-5)
    for _ in range(5):
        flat.gradient[:] = np.concatenate([torch.randn(p.shape).flatten().numpy() for p in layer.parameters()])
        start = 0
        for parameter in reference.parameters():
            parameter.grad = torch.from_numpy(flat.gradient[start : start + parameter.numel()].copy()).view_as(
                parameter
            )
            start += parameter.numel()
        torch.nn.utils.clip_grad_norm_(reference.parameters(), 0.5)
        theirs.step()
        ours.step(0.5)
    for mine, expected in zip(layer.parameters(), reference.parameters(), strict=True):
        torch.testing.assert_close(mine, expected, rtol=1e-4, atol=1e-6)


def test_advantages_bootstrap_at_a_truncation_and_not_at_an_end():
    rewards, values = np.array([[1.0], [2.0], [3.0], [4.0]]), np.array([[0.5], [1.0], [1.5], [2.0]])
    gamma, gae_lambda = 0.9, 0.5
    # Frame 0 continues, frame 1 is truncated in a state of value 7, frame 2 ends, frame 3 continues in one of value 5.
    next_values, ended = np.array([[1.0], [7.0], [0.0], [5.0]]), np.array([[False], [True], [True], [False]])
    last, end = 4 + 0.9 * 5 - 2, 3 - 1.5
    truncated = 2 + 0.9 * 7 - 1
    first = 1 + 0.9 * 1 - 0.5 + 0.45 * truncated
    estimates = advantages(rewards, values, next_values, ended, gamma, gae_lambda)
    np.testing.assert_allclose(estimates[:, 0], [first, truncated, end, last])


def test_rewards_are_divided_by_the_deviation_of_the_return_so_far():
    scale, random = RewardScale(3, gamma=0.5), np.random.default_rng(0)
    rewards, ended = random.standard_normal((6, 3)) + 2, random.random((6, 3)) < 0.3
    scaled = scale.scaled(rewards, ended)
    returns, seen = np.zeros(3), []
    for frame in range(6):
        returns = 0.5 * returns + rewards[frame]
        seen.append(returns)
        np.testing.assert_allclose(scaled[frame], rewards[frame] / np.std(np.concatenate(seen)), rtol=2e-3)
        returns = returns * ~ended[frame]


def demonstrations(task, history_start: str = "first", augmentations=()) -> Demonstrations:
    """Two episodes of 30 frames in two training maps, in which the table moves to the right."""
    scenarios = task.scenario_sets["training"][:2]
    vectors = np.repeat([task.scenario_vector(scenario) for scenario in scenarios], 30, axis=0)
    states = np.concatenate([task.states_of(np.array([task.start_of(scenario)] * 30)) for scenario in scenarios])
    states[:, 0] += np.tile(np.arange(30), 2)
    columns = {
        STATE: torch.from_numpy(states).float(),
        ENVIRONMENT_STATE: torch.from_numpy(vectors).float(),
        ACTION: torch.full((60, 4), 0.5),
        "episode_index": torch.arange(2).repeat_interleave(30),
    }

    class Episodes(dict):
        column_names = ("episode_index", "map_id")

    meta = SimpleNamespace(total_episodes=2, episodes=Episodes(episode_index=[0, 1], map_id=["training-00"] * 2))
    frames = SimpleNamespace(columns=columns, first=torch.tensor([0, 30]).repeat_interleave(30))
    return Demonstrations(SimpleNamespace(frames=frames, meta=meta), task, 4, history_start, augmentations)  # pyright: ignore[reportArgumentType]


def test_histories_stay_in_their_episode():
    shown = demonstrations(get_task()).windows(torch.tensor([0, 2, 30, 40]))
    x = shown.states[:, :, 0] - shown.states[:, :1, 0]
    assert x.tolist() == [[0, 0, 0, 0], [0, 0, 1, 2], [0, 0, 0, 0], [0, 1, 2, 3]]
    zeros = demonstrations(get_task(), "zeros").windows(torch.tensor([2, 40])).states
    assert (zeros[0, 0] == 0).all()
    assert (zeros[0, 1:] == shown.states[1, 1:]).all()


@pytest.mark.parametrize("start_frames", ["first", "any"])
def test_worlds_restart_with_the_codes_of_the_grid_in_turn(start_frames):
    torch.manual_seed(0)
    task = get_task()
    settings = task.settings_type(step_limit=7)
    worlds = RestartingWorlds(demonstrations(task), 5, settings, 10, start_frames)
    drawn, truncated = [worlds.codes.clone()], 0
    for _ in range(18):
        step = worlds.step(np.zeros((5, 4)))
        assert (step.ended == step.truncated).all()
        assert len(step.final_histories) == int(step.truncated.sum())
        truncated += int(step.truncated.sum())
        drawn.append(worlds.codes[torch.from_numpy(step.ended)])
    codes = torch.cat(drawn)
    assert len(codes) == truncated + 5 == 35  # a step limit of 7 is in the third frame at 10 Hz
    expected = GRID[torch.arange(len(codes)) % 25]
    assert (codes - expected).abs().max() <= NOISE + 1e-6
    reasons, length = worlds.take_episodes()
    assert (dict(reasons), length) == ({"timeout": 30}, 3.0)
    moved = worlds.histories[:, -1, 0] != task.scenario_sets["training"][0].start[0]
    assert bool(moved.any()) == (start_frames == "any")


def test_a_success_is_told_from_other_ends():
    torch.manual_seed(0)
    task = get_task()
    worlds = RestartingWorlds(demonstrations(task), 2, task.settings_type(), 10, "first")
    goal, centre = worlds.scenarios[0, 3:5].tolist(), worlds.scenarios[1, 5:7].tolist()
    worlds._worlds[0].restore((*goal, 0.0, 0.0, 0.0, 0.0))
    worlds._worlds[1].restore((*centre, 0.0, 0.0, 0.0, 0.0))  # on its obstacle
    step = worlds.step(np.zeros((2, 4)))
    assert step.ended.tolist() == [True, True]
    assert step.succeeded.tolist() == [True, False]
    assert not step.truncated.any()
    assert worlds.take_episodes()[0] == {"goal": 1, "collision_obstacle": 1}


def test_worlds_continue_from_their_state():
    torch.manual_seed(0)
    task = get_task()
    worlds = RestartingWorlds(demonstrations(task), 3, task.settings_type(step_limit=9), 10, "any")
    random = np.random.default_rng(0)
    actions = random.uniform(-1, 1, (8, 3, 4))
    for action in actions[:2]:
        worlds.step(action)
    state, generator = copy.deepcopy(worlds.state()), torch.get_rng_state()
    steps = [worlds.step(action) for action in actions[2:]]
    again = RestartingWorlds(demonstrations(task), 3, task.settings_type(step_limit=9), 10, "any")
    again.load(state)
    torch.set_rng_state(generator)
    for step, action in zip(steps, actions[2:], strict=True):
        assert (again.step(action).ended == step.ended).all()
    assert any(step.ended.any() for step in steps)
    assert torch.equal(again.histories, worlds.histories)
    assert torch.equal(again.codes, worlds.codes)


def test_symmetries_give_other_scenarios_with_worlds_of_their_own():
    torch.manual_seed(0)
    task = get_task()
    mirrored = demonstrations(task, augmentations=[task.features.symmetries["mirror"]])
    worlds = RestartingWorlds(mirrored, 12, task.settings_type(step_limit=9), 10, "first")
    assert len({tuple(vector) for vector in worlds.scenarios.tolist()}) > 2  # two maps and their mirror images
    for index, world in enumerate(worlds._worlds):
        np.testing.assert_allclose(world.observation, worlds.histories[index, -1].numpy(), atol=1e-4)
    inputs = HistoryInputs(task.spec, 4, None, "symmetric")
    frames = EncodedFrames(mirrored, inputs, lambda actions: actions)
    encoded, actions = frames.sample(50)
    assert encoded.shape == (50, inputs.size)
    assert set(np.unique(actions[:, 1])) == {-0.5, 0.5}


def test_the_log_drops_rows_after_the_checkpoint_and_an_unfinished_line(tmp_path):
    row = {
        **dict.fromkeys(
            ("reward", "expert_accuracy", "policy_accuracy", "discriminator_loss", "gradient_penalty"), 0.5
        ),
        **dict.fromkeys(("code_loss", "inverse_loss", "kl", "clipped", "entropy", "value_loss"), 0.5),
        "episodes": {"goal": 1},
    }
    log = TrainingLog(tmp_path, 0)
    for step in (10, 20, 30):
        log.add({"step": step, **row})
    with (tmp_path / LOG_FILE).open("a", encoding="utf-8") as file:
        file.write('{"step": 4')
    assert [entry["step"] for entry in TrainingLog(tmp_path, 20).rows] == [10, 20]
    lines = (tmp_path / LOG_FILE).read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["step"] for line in lines] == [10, 20]
    TrainingLog(tmp_path, 20).draw("a run")
    assert (tmp_path / CURVES_FILE).read_bytes().startswith(b"\x89PNG")
