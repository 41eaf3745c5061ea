"""Plans through ONNX Runtime and numba, against those through torch; which is chosen; and where they are missing."""

import copy
import json
import logging
import sys
from typing import Any

import numpy as np
import onnx
import pytest
import torch
from lerobot.configs import PreTrainedConfig
from small_policies import MLP, TRANSFORMER, columns, lively_policy

from copolicy.dataset.exceptions import InvalidValueError, MissingExtraError
from copolicy.train.checkpoint import Checkpoint
from lerobot_policy_copolicy import CopolicyConfig
from lerobot_policy_copolicy.copolicy.denoiser_mlp import MlpDenoiser
from lerobot_policy_copolicy.copolicy.denoiser_transformer import TransformerDenoiser
from lerobot_policy_copolicy.copolicy.fast import fastest_backend
from lerobot_policy_copolicy.copolicy.fast.fast_sampler import FastSampler
from lerobot_policy_copolicy.copolicy.fast.mlp import FastMlp
from lerobot_policy_copolicy.copolicy.fast.numba_kernels import gelu, transformer
from lerobot_policy_copolicy.copolicy.fast.onnx_denoiser import OnnxDenoiser, denoiser_graph
from lerobot_policy_copolicy.copolicy.fast.packed_weights import LANES, OUTPUTS, pack
from lerobot_policy_copolicy.copolicy.fast.transformer import FastTransformer
from lerobot_policy_copolicy.copolicy.modeling_copolicy import CopolicyPolicy

NETWORKS = {"transformer": {**TRANSFORMER, "n_layers": 3}, "mlp": MLP}


PLAIN: dict[str, Any] = {"planner": "plain"}
BACKENDS = ("onnx", "numba")
ALL = {"onnx": ("onnxruntime", "onnx"), "numba": ("numba",)}


@pytest.fixture
def fresh_choice():
    """What is installed is looked at again, and said again."""
    for remembered in (fastest_backend._is_available, fastest_backend._log_choice):
        remembered.cache_clear()
    yield
    for remembered in (fastest_backend._is_available, fastest_backend._log_choice):
        remembered.cache_clear()


def plan(planner, batch: int = 3, actions: int | None = None) -> torch.Tensor:
    return planner.sample_actions(columns(batch, 3), torch.Generator().manual_seed(0), actions=actions)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("network", NETWORKS)
@pytest.mark.parametrize(("sampler", "steps"), [("ddpm", 100), ("ddpm", 34), ("ddim", 10), ("dpmsolver++", 5)])
@pytest.mark.parametrize("prediction_type", ["epsilon", "sample"])
def test_plans_are_those_of_torch(backend, network, sampler, steps, prediction_type):
    settings = {
        **NETWORKS[network], "sampler": sampler, "num_inference_steps": steps, "prediction_type": prediction_type,
    }  # fmt: skip
    plain, quick = (lively_policy(**settings, **choice) for choice in (PLAIN, {"backend": backend}))
    for batch in (1, 5):
        expected = plan(plain, batch)
        for actions in (None, 8, 1):
            found = plan(quick, batch, actions)
            torch.testing.assert_close(found, expected[:, : found.shape[1]], atol=1e-4, rtol=0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_plans_of_the_papers_network_are_those_of_torch(backend):
    settings = {
        "n_layers": 8, "width": 256, "n_heads": 4, "feedforward_width": 1024,
        "prediction_type": "epsilon", "sampler": "ddpm", "num_inference_steps": 34,
    }  # fmt: skip
    plain, quick = (lively_policy(**settings, **choice) for choice in (PLAIN, {"backend": backend}))
    torch.testing.assert_close(plan(quick, 2, 1), plan(plain, 2)[:, :3], atol=1e-4, rtol=0)


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


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("network", NETWORKS)
def test_changed_weights_are_noticed(backend, network):
    planner = lively_policy(**NETWORKS[network], backend=backend)
    before = plan(planner)
    torch.nn.init.normal_(planner.ema.model.head.weight, std=0.5)
    moved = plan(planner)
    assert (moved - before).abs().max() > 1e-3
    torch.testing.assert_close(plan(copy.deepcopy(planner)), moved)  # a session cannot be copied, the policy can


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_backend_is_saved_with_the_policy(backend, tmp_path):
    saved = lively_policy(backend=backend)
    saved.save_pretrained(tmp_path)
    loaded = CopolicyPolicy.from_pretrained(tmp_path, strict=True)
    assert loaded.config.backend == backend
    torch.testing.assert_close(plan(loaded.eval()), plan(saved))


@pytest.mark.parametrize(("extra", "package"), [("onnx", "onnxruntime"), ("onnx", "onnx"), ("numba", "numba")])
def test_without_the_extra_it_is_one_clear_line(tmp_path, monkeypatch, extra, package):
    lively_policy(backend=extra).save_pretrained(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError) as caught:
        Checkpoint(tmp_path)
    assert str(caught.value) == (
        f"{package} is not installed: this command needs the extra, pip install 'lerobot_policy_copolicy[{extra}]'"
    )


def test_torch_plans_where_the_extra_is_missing(tmp_path, monkeypatch):
    lively_policy(backend="onnx").save_pretrained(tmp_path)
    for package in ("onnxruntime", "onnx"):
        monkeypatch.setitem(sys.modules, package, None)
    config = PreTrainedConfig.from_pretrained(tmp_path, cli_overrides=["--backend=torch"])
    planner = CopolicyPolicy.from_pretrained(tmp_path, config=config)
    torch.testing.assert_close(plan(planner.eval()), plan(lively_policy()))


@pytest.mark.parametrize("backend", BACKENDS)
def test_another_device_is_refused(backend):
    planner = FastSampler(lively_policy().diffusion.coefficients, backend)
    condition, noise = torch.empty(1, 3, 20, device="meta"), torch.empty(1, 12, 4, device="meta")
    message = f"^policy.device, for policy.backend={backend}: expected cpu, found 'meta'"
    with pytest.raises(InvalidValueError, match=message):
        planner.sample(MlpDenoiser(4, 20, 12, 3), condition, noise, 12)


@pytest.mark.parametrize(
    "sizes", [{**TRANSFORMER, "width": 12, "n_heads": 2, "feedforward_width": 30}, {**MLP, "width": 21}]
)
def test_numba_takes_networks_of_any_size(sizes):
    plain, quick = (lively_policy(**{**sizes, **choice}) for choice in (PLAIN, {"backend": "numba"}))
    for batch in (1, 2):
        torch.testing.assert_close(plan(quick, batch, 1)[:, :3], plan(plain, batch)[:, :3], atol=1e-4, rtol=0)


def test_numba_compiles_once_for_all_plans():
    quick = lively_policy(**NETWORKS["transformer"], backend="numba")
    for batch in (1, 2, 3):
        for actions in (None, 8, 1):
            plan(quick, batch, actions)
    assert len(transformer.signatures) == 1


def test_gelu_of_numba_is_the_exact_one():
    values = np.linspace(-9, 9, 20001, dtype=np.float32)[None]
    expected = torch.nn.functional.gelu(torch.from_numpy(values).double())
    gelu(values)
    torch.testing.assert_close(torch.from_numpy(values).double(), expected, atol=1e-6, rtol=0)


def test_packed_weights_hold_each_weight_where_it_is_read():
    weight = np.arange(6 * 20, dtype=np.float32).reshape(6, 20) + 1
    packed = pack(weight)
    for output, value in np.ndindex(6, 20):
        block, chunk = output // OUTPUTS, value // LANES
        assert packed[block, chunk, output % OUTPUTS, value % LANES] == weight[output, value]
    assert (packed != 0).sum() == weight.size


@pytest.mark.parametrize("network", NETWORKS)
def test_auto_plans_what_torch_plans_with_the_fastest_for_the_batch(fresh_choice, caplog, network):
    caplog.set_level(logging.INFO)
    plain, quick = (lively_policy(**{**NETWORKS[network], **choice}) for choice in (PLAIN, {"backend": "auto"}))
    used = []
    for batch in (8, 9):
        torch.testing.assert_close(plan(quick, batch), plan(plain, batch), atol=1e-4, rtol=0)
        used.append(quick.planned_with)
    assert used == [("numba",), ("numba", "onnx")]
    said = [record.message for record in caplog.records if record.message.startswith("sampling on the CPU")]
    assert said == [
        "sampling on the CPU with numba (batches of up to 8), onnx (larger batches): the fastest installed backends "
        "(backend=auto)"
    ]


def test_auto_stays_with_the_backend_of_a_study_whose_tables_end():
    planner = lively_policy(backend="auto")
    for batch in (9, 2, 1):
        plan(planner, batch)
    assert planner.planned_with == ("onnx",)


@pytest.mark.parametrize(
    ("missing", "one", "several"),
    [((), "numba", "onnx"), (("numba",), "onnx", "onnx"), (("onnx",), "numba", "torch"), (BACKENDS, "torch", "torch")],
)
def test_auto_takes_what_is_installed(fresh_choice, monkeypatch, missing, one, several):
    for backend in missing:
        for package in ALL[backend]:
            monkeypatch.setitem(sys.modules, package, None)
    history = torch.zeros(1, 3, 20)
    assert [fastest_backend.fastest_backend(history, plans) for plans in (1, 84)] == [one, several]
    planner = lively_policy(backend="auto")
    torch.testing.assert_close(plan(planner, 1), plan(lively_policy(), 1), atol=1e-4, rtol=0)
    assert planner.planned_with == (one,)


def test_auto_passes_over_a_package_that_does_not_load(fresh_choice, monkeypatch, tmp_path, caplog):
    (tmp_path / "numba").mkdir()
    (tmp_path / "numba" / "__init__.py").write_text("raise ImportError('needs another numpy')", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "numba")
    assert fastest_backend.fastest_backend(torch.zeros(1, 3, 20), 1) == "onnx"
    assert "sampling without numba: ImportError: needs another numpy" in caplog.text


def test_auto_leaves_other_devices_and_precisions_to_torch():
    history = torch.zeros(1, 3, 20)
    assert fastest_backend.fastest_backend(history.to("meta"), 1) == "torch"
    assert fastest_backend.fastest_backend(history.bfloat16(), 1) == "torch"
    with torch.autocast("cpu", torch.bfloat16):
        assert fastest_backend.fastest_backend(history, 1) == "torch"


@pytest.mark.parametrize("backend", BACKENDS)
def test_under_mixed_precision_other_backends_keep_theirs(backend):
    planner = lively_policy(backend=backend)
    expected = plan(planner)
    with torch.autocast("cpu", torch.bfloat16):
        torch.testing.assert_close(plan(planner).float(), expected, atol=0.05, rtol=0)


@pytest.mark.parametrize("stated", ["torch", "onnx", None])
def test_older_checkpoints_load_with_the_backend_that_they_state(tmp_path, stated):
    saved = lively_policy(backend="torch")
    saved.save_pretrained(tmp_path)
    path = tmp_path / "config.json"
    config = json.loads(path.read_text(encoding="utf-8"))
    config.pop("backend")
    path.write_text(json.dumps(config | ({} if stated is None else {"backend": stated})), encoding="utf-8")
    loaded = CopolicyPolicy.from_pretrained(tmp_path, strict=True).eval()
    assert loaded.config.backend == (stated or "auto")
    torch.testing.assert_close(plan(loaded), plan(saved), atol=1e-4, rtol=0)
    assert loaded.planned_with == (stated or "numba",)


def test_auto_is_the_default_also_beside_the_plain_planner():
    assert CopolicyConfig().backend == "auto"
    assert CopolicyConfig(planner="plain").backend == "auto"
