"""Plans through ONNX Runtime, against those through torch; and what happens where it is not installed."""

import copy
import sys
from typing import Any

import onnx
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from small_policies import MLP, TRANSFORMER, columns, lively_policy

from copolicy.collect.controllers.checkpoint import Checkpoint
from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError
from lerobot_policy_copolicy.copolicy.denoiser_mlp import MlpDenoiser
from lerobot_policy_copolicy.copolicy.denoiser_transformer import TransformerDenoiser
from lerobot_policy_copolicy.copolicy.fast_mlp import FastMlp
from lerobot_policy_copolicy.copolicy.fast_planner import FastPlanner
from lerobot_policy_copolicy.copolicy.fast_transformer import FastTransformer
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy
from lerobot_policy_copolicy.copolicy.onnx_denoiser import OnnxDenoiser, denoiser_graph

NETWORKS = {"transformer": {**TRANSFORMER, "n_layers": 3}, "mlp": MLP}


PLAIN: dict[str, Any] = {"planner": "plain"}
ONNX: dict[str, Any] = {"backend": "onnx"}


def plan(planner, batch: int = 3, actions: int | None = None) -> torch.Tensor:
    return planner.plan(columns(batch, 3), torch.Generator().manual_seed(0), actions=actions)


@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize(("sampler", "steps"), [("ddpm", 100), ("ddpm", 34), ("ddim", 10), ("dpmsolver++", 5)])
@pytest.mark.parametrize("prediction_type", ["epsilon", "sample"])
def test_plans_are_those_of_torch(network, sampler, steps, prediction_type):
    settings = {
        **NETWORKS[network], "sampler": sampler, "num_inference_steps": steps, "prediction_type": prediction_type,
    }  # fmt: skip
    plain, onnx_backend = (lively_policy(**settings, **choice) for choice in (PLAIN, ONNX))
    for batch in (1, 5):
        expected = plan(plain, batch)
        for actions in (None, 8, 1):
            found = plan(onnx_backend, batch, actions)
            torch.testing.assert_close(found, expected[:, : found.shape[1]], atol=1e-4, rtol=0)


def test_plans_of_the_papers_network_are_those_of_torch():
    settings = {
        "n_layers": 8, "width": 256, "n_heads": 4, "feedforward_width": 1024,
        "prediction_type": "epsilon", "sampler": "ddpm", "num_inference_steps": 34,
    }  # fmt: skip
    plain, onnx_backend = (lively_policy(**settings, **choice) for choice in (PLAIN, ONNX))
    torch.testing.assert_close(plan(onnx_backend, 2, 1), plan(plain, 2)[:, :3], atol=1e-4, rtol=0)


@pytest.mark.parametrize(
    ("network", "fast"),
    [(TransformerDenoiser(4, 20, 12, 3, 2, 32), FastTransformer), (MlpDenoiser(4, 20, 12, 3, 2, 32), FastMlp)],
)
def test_graph_is_valid_and_steps_as_torch_does(network, fast):
    generator = torch.Generator().manual_seed(0)
    for weight in network.parameters():
        torch.nn.init.normal_(weight, std=0.3, generator=generator)
    with torch.no_grad():
        ready = fast(network, torch.tensor([99, 40]), 12)
        onnx.checker.check_model(onnx.load_from_string(denoiser_graph(ready)), full_check=True)
        session = OnnxDenoiser(ready)
        for batch in (1, 4):
            actions = torch.randn(batch, 12, 4, generator=generator)
            at = ready.begin(torch.randn(batch, 3, 20, generator=generator))
            for index in (1, 0):
                expected = ready.denoise(actions, at(index))
                assert expected.std() > 0.1
                torch.testing.assert_close(session.denoise(actions, at(index)), expected, atol=2e-5, rtol=1e-4)


def test_it_runs_on_one_thread_that_does_not_spin():
    network = MlpDenoiser(4, 20, 12, 3, 1, 16)
    with torch.no_grad():
        options = OnnxDenoiser(FastMlp(network, torch.tensor([0]), 12))._session.get_session_options()
    assert (options.intra_op_num_threads, options.inter_op_num_threads) == (1, 1)
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"


@pytest.mark.parametrize("network", NETWORKS)
def test_changed_weights_are_noticed(network):
    planner = lively_policy(**NETWORKS[network], backend="onnx")
    before = plan(planner)
    torch.nn.init.normal_(planner.ema.model.head.weight, std=0.5)
    moved = plan(planner)
    assert (moved - before).abs().max() > 1e-3
    torch.testing.assert_close(plan(copy.deepcopy(planner)), moved)  # a session cannot be copied, the policy can


def test_the_backend_is_saved_with_the_policy(tmp_path):
    saved = lively_policy(backend="onnx")
    saved.save_pretrained(tmp_path)
    loaded = CopolicyPolicy.from_pretrained(tmp_path, strict=True)
    assert loaded.config.backend == "onnx"
    torch.testing.assert_close(plan(loaded.eval()), plan(saved))


@pytest.mark.parametrize("package", ["onnxruntime", "onnx"])
def test_without_the_extra_it_is_one_clear_line(tmp_path, monkeypatch, package):
    lively_policy(backend="onnx").save_pretrained(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError) as caught:
        Checkpoint(tmp_path)
    assert str(caught.value) == (
        f"{package} is not installed: this command needs the extra, pip install 'lerobot_policy_copolicy[onnx]'"
    )


def test_torch_plans_where_the_extra_is_missing(tmp_path, monkeypatch):
    lively_policy(backend="onnx").save_pretrained(tmp_path)
    for package in ("onnxruntime", "onnx"):
        monkeypatch.setitem(sys.modules, package, None)
    config = PreTrainedConfig.from_pretrained(tmp_path, cli_overrides=["--backend=torch"])
    planner = CopolicyPolicy.from_pretrained(tmp_path, config=config)
    torch.testing.assert_close(plan(planner.eval()), plan(lively_policy()))


def test_another_device_is_refused():
    planner = FastPlanner(lively_policy().diffusion.table, "onnx")
    condition, noise = torch.empty(1, 3, 20, device="meta"), torch.empty(1, 12, 4, device="meta")
    with pytest.raises(InvalidValueError, match=r"^policy.device, for policy.backend=onnx: expected cpu, found 'meta'"):
        planner.plan(MlpDenoiser(4, 20, 12, 3), condition, noise, 12)
