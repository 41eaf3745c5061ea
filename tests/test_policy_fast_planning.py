"""The fast planner, against plans of the plain sampler from the same weights and the same noise."""

import copy
import pickle

import pytest
import torch
from small_policies import MLP, OBSERVATIONS, TRANSFORMER, columns, lively_policy

from copolicy.dataset.exceptions import InvalidValueError
from lerobot_policy_copolicy.copolicy.denoiser_mlp import MlpDenoiser
from lerobot_policy_copolicy.copolicy.denoiser_transformer import TransformerDenoiser
from lerobot_policy_copolicy.copolicy.fast.mlp import FastMlp
from lerobot_policy_copolicy.copolicy.fast.transformer import FastTransformer

SAMPLERS = [("ddpm", 100), ("ddpm", 34), ("ddim", 10), ("dpmsolver++", 10)]
PAPER = {"n_layers": 8, "width": 256, "n_heads": 4, "feedforward_width": 1024}


def plan(planner, batch: int = 3, seed: int = 0, actions: int | None = None) -> torch.Tensor:
    return planner.sample_actions(columns(batch, 3, seed=seed), torch.Generator().manual_seed(seed), actions=actions)


@pytest.mark.parametrize("network", [{**TRANSFORMER, "n_layers": 3}, MLP], ids=["transformer", "mlp"])
@pytest.mark.parametrize(("sampler", "steps"), SAMPLERS)
@pytest.mark.parametrize("prediction_type", ["epsilon", "sample", "v_prediction"])
def test_plans_are_those_of_the_plain_sampler(network, sampler, steps, prediction_type):
    settings = {
        **network, "sampler": sampler, "num_inference_steps": steps, "prediction_type": prediction_type,
        "initial_noise_scale": 0.8,
    }  # fmt: skip
    plain, fast = (lively_policy(1, **settings, planner=name) for name in ("plain", "fast"))
    expected = plan(plain)
    assert (expected.abs() < 0.999).float().mean() > 0.1  # not every action may sit at its limit
    for actions in (None, 10, 8, 1):
        found = plan(fast, actions=actions)
        tokens = 12 if actions is None else 2 + actions
        assert found.shape == (3, tokens, 4)
        torch.testing.assert_close(found, expected[:, :tokens], atol=1e-4, rtol=0)
        torch.testing.assert_close(plan(plain, actions=actions), expected[:, :tokens], atol=0, rtol=0)


@pytest.mark.parametrize(("sampler", "steps"), [("ddpm", 100), ("ddpm", 34), ("ddim", 10)])
def test_plans_of_the_papers_network_are_those_of_the_plain_sampler(sampler, steps):
    settings = {**PAPER, "prediction_type": "epsilon", "sampler": sampler, "num_inference_steps": steps}
    plain, fast = (lively_policy(**settings, planner=name) for name in ("plain", "fast"))
    expected = plan(plain, 2)
    assert (expected.abs() < 0.999).float().mean() > 0.02  # not every action may sit at its limit
    for tokens in (12, 10, 3):  # a whole plan, and what reaches eight executed actions and one
        found = plan(fast, 2, actions=tokens - 2)
        torch.testing.assert_close(found[:, :tokens], expected[:, :tokens], atol=1e-4, rtol=0)


@pytest.mark.parametrize("frames", [1, 2, 5])
@pytest.mark.parametrize("network", [TRANSFORMER, MLP], ids=["transformer", "mlp"])
def test_any_length_of_history_and_plan(network, frames):
    settings = {**network, "n_obs_steps": frames, "horizon": 9, "n_action_steps": 4}
    plain, fast = (lively_policy(**settings, planner=name) for name in ("plain", "fast"))
    plans = [planner.sample_actions(columns(2, frames), torch.Generator().manual_seed(0)) for planner in (plain, fast)]
    torch.testing.assert_close(plans[1], plans[0], atol=1e-4, rtol=0)


@pytest.mark.parametrize("executed", [1, 8])
def test_queue_and_chunk_execute_the_same_actions(executed):
    plain, fast = (lively_policy(n_action_steps=executed, planner=name, sampler="ddpm") for name in ("plain", "fast"))
    chosen = []
    for planner in (plain, fast):
        torch.manual_seed(3)  # LeRobot passes no generator
        planner.reset()
        chosen.append([planner.select_action(columns(2, seed=frame)) for frame in range(10)])
    torch.testing.assert_close(chosen[1], chosen[0], atol=1e-4, rtol=0)
    noise = torch.randn(2, 12, 4)
    chunks = []
    for planner in (plain, fast):
        torch.manual_seed(4)
        chunks.append(planner.predict_action_chunk(columns(2, 3), noise=noise))
    assert chunks[1].shape == (2, executed, 4)
    torch.testing.assert_close(chunks[1], chunks[0], atol=1e-4, rtol=0)


def test_fewer_tokens_are_denoised_where_fewer_actions_are_executed(monkeypatch):
    seen = []
    original = FastTransformer.denoise

    def denoise(self, noisy_actions, inputs):
        seen.append(noisy_actions.shape[1])
        return original(self, noisy_actions, inputs)

    monkeypatch.setattr(FastTransformer, "denoise", denoise)
    planner = lively_policy(n_action_steps=1, sampler="ddim", num_inference_steps=2)
    planner.select_action(columns(2))
    planner.sample_actions(columns(2, 3))
    assert seen == [3, 3, 12, 12]


@pytest.mark.parametrize("network", [TRANSFORMER, MLP], ids=["transformer", "mlp"])
def test_changed_weights_are_noticed(network):
    planner = lively_policy(**network)
    weights = {name: value.clone() for name, value in planner.state_dict().items()}
    before = plan(planner)

    optimizer = torch.optim.AdamW(planner.get_optim_params(), lr=0.05)
    planner.train()
    sample = {**columns(4, 3), "action": torch.rand(4, 12, 4)}
    planner(sample)[0].backward()
    optimizer.step()
    planner.update()
    planner.eval()
    moved = plan(planner)
    assert (moved - before).abs().max() > 1e-3
    planner._fast = None  # the plain sampler, on these very weights
    torch.testing.assert_close(plan(planner), moved, atol=1e-4, rtol=0)

    planner = lively_policy(1, **network)
    plan(planner)
    planner.load_state_dict(weights)
    torch.testing.assert_close(plan(planner), before, atol=1e-5, rtol=0)


def test_tables_are_made_once_for_the_same_weights(monkeypatch):
    made = []
    original = FastTransformer.__init__

    def init(self, *arguments):
        made.append(arguments[2])
        original(self, *arguments)

    monkeypatch.setattr(FastTransformer, "__init__", init)
    planner = lively_policy()
    for _ in range(3):
        plan(planner)
        plan(planner, actions=1)
    assert made == [12, 3]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda planner: pickle.loads(pickle.dumps(planner))])
def test_a_policy_that_has_planned_can_be_copied(duplicate):
    planner = lively_policy()
    expected = plan(planner)
    torch.testing.assert_close(plan(duplicate(planner)), expected, atol=1e-6, rtol=0)


def test_planning_leaves_no_trace_in_a_checkpoint():
    planner, fresh = lively_policy(), lively_policy()
    plan(planner)
    assert planner.state_dict().keys() == fresh.state_dict().keys()
    assert lively_policy(planner="plain").state_dict().keys() == fresh.state_dict().keys()


def test_under_mixed_precision_the_tables_keep_theirs():
    planner = lively_policy(sampler="ddim", num_inference_steps=10)
    expected = plan(lively_policy(sampler="ddim", num_inference_steps=10))
    with torch.autocast("cpu", torch.bfloat16):
        rounded = plan(planner)
    assert (rounded.float() - expected).abs().max() > 0
    torch.testing.assert_close(plan(planner), expected)


@pytest.mark.parametrize("actions", [0, 11])
def test_more_actions_than_a_plan_holds_are_refused(actions):
    with pytest.raises(InvalidValueError, match=f"^actions: expected 1 to 10, found {actions}$"):
        plan(lively_policy(), actions=actions)


@pytest.mark.parametrize(
    ("network", "fast"),
    [
        (TransformerDenoiser(4, 20, 12, 3, 4, 32), FastTransformer),
        (MlpDenoiser(4, 20, 12, 3, 4, 32), FastMlp),
    ],
)
def test_one_step_is_the_networks(network, fast):
    network.eval()
    generator = torch.Generator().manual_seed(0)
    for weight in network.parameters():
        torch.nn.init.normal_(weight, std=0.3, generator=generator)
    actions, condition = torch.randn(5, 12, 4, generator=generator), torch.randn(5, 3, 20, generator=generator)
    timesteps = torch.tensor([99, 50, 0])
    with torch.no_grad():
        ready = fast(network, timesteps, 12)
        at = ready.begin(condition)
        for index in (2, 0, 1):
            expected = network(actions, timesteps[index].expand(5), condition)
            assert expected.std() > 0.1
            torch.testing.assert_close(ready.denoise(actions, at(index)), expected, atol=1e-5, rtol=1e-5)


def test_history_reaches_the_plan_through_the_tables():
    planner = lively_policy(initial_noise_scale=0.0)
    batch = columns(1, 3)
    before = planner.sample_actions(batch)
    for key in OBSERVATIONS:
        changed = {**batch, key: batch[key] + 0.1 * batch[key].abs().amax(dim=(0, 1))}
        assert (planner.sample_actions(changed) - before).abs().max() > 1e-3
