"""The VRNN planner's network, loss and rows of motion, against torch's distributions and hand values."""

import math

import numpy as np
import pytest
import torch
from torch.distributions import Independent, Normal, kl_divergence

from copolicy.dataset.features import ENVIRONMENT_STATE, STATE
from copolicy.dataset.task import get_task
from copolicy.tasks.table.dynamics import torque
from copolicy.tasks.table.physics import Physics
from copolicy.tasks.table.policy.motion import TableMotion
from lerobot_policy_copolicy.vrnn.loss import balanced_loss, kl_weight, published_loss
from lerobot_policy_copolicy.vrnn.motion_rows import MOTION, MotionRows, PointFeatures
from lerobot_policy_copolicy.vrnn.network import MotionNetwork, Normals
from lerobot_policy_copolicy.vrnn.prediction import encode, free_run

MOVED = TableMotion()


def poses(*entries: tuple[float, float, float]) -> torch.Tensor:
    """Poses `(T, 4)` from x, y and theta."""
    return torch.tensor([(x, y, math.cos(theta), math.sin(theta)) for x, y, theta in entries])


def scenario(goal=(960.0, 300.0), obstacles=((480.0, 300.0),)) -> torch.Tensor:
    """A scenario vector `(11,)`."""
    points = [*goal, *(value for centre in obstacles for value in centre)]
    return torch.tensor([240.0, 300.0, 3.14, *points, *([0.0] * (8 - len(points)))])


def motion_rows(scaled=False, in_body_axes=False, on_circle=False, period=1 / 30) -> MotionRows:
    return MotionRows(MOVED, PointFeatures(MOVED, scaled).eval(), period, in_body_axes, scaled, on_circle)


@pytest.mark.parametrize(("size", "parameters"), [(8, 98_464), (12, 98_980)])
def test_it_has_the_published_number_of_parameters(size, parameters):
    assert sum(weights.numel() for weights in MotionNetwork(size, size).parameters()) == parameters


def test_divergence_and_samples_are_those_of_torch():
    random = torch.Generator().manual_seed(0)
    first, second = (Normals(*torch.randn(2, 7, 6, generator=random)) for _ in range(2))

    def reference(normals: Normals) -> Independent:
        return Independent(Normal(normals.mean, normals.log_variance.exp().sqrt()), 1)

    torch.testing.assert_close(first.divergence(second), kl_divergence(reference(first), reference(second)))
    assert first.divergence(first).abs().max() < 1e-6
    drawn = Normals(first.mean[0], first.log_variance[0]).sample(torch.randn(40_000, 6, generator=random))
    torch.testing.assert_close(drawn.mean(dim=0), first.mean[0], rtol=0, atol=0.05)
    torch.testing.assert_close(drawn.var(dim=0).log(), first.log_variance[0], rtol=0, atol=0.05)


def test_the_published_loss_sums_the_divergence_over_the_batch():
    error = torch.zeros(2, 3, 12)
    error[0, 1, 0] = 6.0  # a mean over 12 columns of 3
    unit, shifted = (
        Normals(torch.zeros(2, 2, 6), torch.zeros(2, 2, 6)),
        Normals(torch.ones(2, 2, 6), torch.zeros(2, 2, 6)),
    )
    loss = published_loss(error, shifted, unit, 0.5)
    # 3 from the error of one of two samples; 2 frames of 6 latent variables, 1/2 nat each, are 6 nats for each sample.
    torch.testing.assert_close(loss, torch.tensor([3.0 + 0.5 * 2 * 6, 0.5 * 2 * 6]))
    torch.testing.assert_close(published_loss(error, shifted, unit, 0.0).mean(), torch.tensor(1.5))


def test_the_balanced_loss_is_a_bound_per_frame():
    error = torch.zeros(1, 4, 4)
    error[0, 0, 0], error[0, 3, 0] = 0.2, 100.0
    counts = torch.tensor([[True, True, True, False]])
    unit, shifted = (
        Normals(torch.zeros(1, 2, 6), torch.zeros(1, 2, 6)),
        Normals(torch.ones(1, 2, 6), torch.zeros(1, 2, 6)),
    )
    loss = balanced_loss(error, counts, shifted, unit, 0.5, deviation=0.1)
    torch.testing.assert_close(loss, torch.tensor([(0.5 * 4 + 0.5 * 2 * 3) / 3]))


def test_the_weight_of_the_divergence_rises_in_each_cycle():
    weights = [kl_weight(step, 800, 4, 0.5) for step in (0, 50, 100, 199, 200, 250, 700, 799, 800, 5000)]
    assert weights == pytest.approx([0, 0.5, 1, 1, 0, 0.5, 1, 1, 1, 1])
    assert kl_weight(3, None, 4, 0.5) == kl_weight(3, 800, 4, 0.0) == 1.0


def test_published_rows_against_hand_values():
    # A quarter turn, theta from 0 to pi/2: the long axis points up on screen, to smaller y.
    path = poses((100, 200, 0.0), (102, 199, math.pi / 2))[None]
    rows = motion_rows().rows(path, scenario(goal=(102.0, 119.0), obstacles=((182.0, 199.0),))[None])
    expected = [2, -1, -1, 1, 80 / 8, 0, 0, 80 / 8, 0, 0, 0, 0]
    torch.testing.assert_close(rows[0, 0], torch.tensor(expected), rtol=0, atol=1e-4)


def test_scaled_rows_make_px_and_rad_comparable():
    rows = motion_rows(scaled=True, in_body_axes=True, on_circle=True)
    # At full speed along its own axis, and a rotation that moves the ends as far.
    step, turn = 50 / 30, 50 / 30 / 95
    path = poses((100, 200, math.pi / 2), (100, 200 - step, math.pi / 2 + turn))[None]
    displacement = rows.displacements(path)[0, 0]
    torch.testing.assert_close(displacement, torch.tensor([1.0, 0.0, 0.0, 1.0]), rtol=0, atol=0.01)
    values = rows.rows(path, scenario(obstacles=())[None])[0, 0, MOTION:]
    assert values.abs().max() <= 4
    assert (values[4:] == 0).all()  # absent obstacles


@pytest.mark.parametrize("in_body_axes", [True, False])
@pytest.mark.parametrize("scaled", [True, False])
def test_displacements_are_undone(in_body_axes, scaled):
    rows = motion_rows(scaled, in_body_axes, on_circle=True)
    path = poses((100, 200, 0.3), (103, 199, 0.5), (104, 190, 6.2), (99, 191, 0.1))
    moved, displacements = path[:1], rows.displacements(path[None])[0]
    for displacement, expected in zip(displacements, path[1:], strict=True):
        moved = rows.moved(moved, displacement[None])
        torch.testing.assert_close(moved[0], expected, rtol=0, atol=1e-3)


def test_the_pose_is_added_within_the_bounds_of_the_state():
    bounds = torch.tensor(get_task().spec.state.bounds, dtype=torch.float32)
    with_pose, without = PointFeatures(MOVED, True, bounds), PointFeatures(MOVED, True)
    state = MOVED.states(poses((900, 150, math.pi / 2)), torch.zeros(1, 3))
    observation = {STATE: state, ENVIRONMENT_STATE: scenario()[None]}
    encoded = with_pose(observation)
    assert encoded.shape[1] == with_pose.size == without.size + 4
    torch.testing.assert_close(encoded[0, -4:], torch.tensor([0.5, -0.5, 0, 1]), rtol=0, atol=1e-5)
    torch.testing.assert_close(encoded[:, :-4], without(observation))


def test_headings_stay_on_the_circle_or_drift():
    path = torch.tensor([[600.0, 300.0, 1.0, 0.0]])
    drifted, kept = path, path
    for _ in range(20):
        drifted = motion_rows().moved(drifted, torch.tensor([[0.0, 0.0, 0.1, 0.1]]))
        kept = motion_rows(on_circle=True).moved(kept, torch.tensor([[0.0, 0.0, 0.1, 0.1]]))
    assert drifted[0, 2:].norm() > 3
    torch.testing.assert_close(kept[0, 2:].norm(), torch.tensor(1.0))


def test_the_encoder_sees_each_row_and_the_prior_does_not():
    torch.manual_seed(0)
    network = MotionNetwork(12, 12, width=8)
    rows = torch.randn(3, 5, 12)
    torch.manual_seed(1)
    first = encode(network, rows)
    changed = rows.clone()
    changed[:, -1] += 1.0
    torch.manual_seed(1)
    second = encode(network, changed)
    predicted = [network.decode(encoded.latents, encoded.tops) for encoded in (first, second)]
    assert predicted[0].shape == (3, 5, 12)
    torch.testing.assert_close(first.posterior.mean[:, :-1], second.posterior.mean[:, :-1])
    assert (first.posterior.mean[:, -1] - second.posterior.mean[:, -1]).abs().max() > 1e-4
    torch.testing.assert_close(network.prior(first.tops).mean, network.prior(second.tops).mean)
    # Its prediction of a row uses the row by the latent variable alone.
    assert (predicted[0][:, -1] - predicted[1][:, -1]).abs().max() > 1e-6


class Surroundings(PointFeatures):
    """Counts its calls and keeps its inputs."""

    def __init__(self):
        super().__init__(MOVED, scaled=True)
        self.seen: list[torch.Tensor] = []

    def forward(self, observation):
        self.seen.append(observation[STATE])
        return super().forward(observation)


def test_free_running_recomputes_the_surroundings():
    features = Surroundings()
    rows = MotionRows(MOVED, features, 1 / 6, True, True, True)
    network = MotionNetwork(MOTION + features.size, MOTION, width=8)
    start = poses((300, 300, 0.2), (310, 290, 3.0))
    state = torch.zeros(2, 2, 8)
    run = free_run(network, rows, state, start, scenario().expand(2, -1), 4)
    assert run.poses.shape == (2, 4, 4)
    assert len(features.seen) == 3  # the last predicted row is not an input
    for step, seen in enumerate(features.seen):
        torch.testing.assert_close(seen[:, :4], run.poses[:, step])
        before = start if step == 0 else run.poses[:, step - 1]
        torch.testing.assert_close(seen[:, 4:6], (run.poses[:, step, :2] - before[:, :2]) * 6)
    torch.testing.assert_close(run.poses[..., 2:].norm(dim=-1), torch.ones(2, 4))


def test_free_running_on_invented_surroundings():
    features = Surroundings()
    rows = MotionRows(MOVED, features, 1 / 30, False, False, False)
    size = MOTION + features.size
    network = MotionNetwork(size, size, width=8)
    start = poses((300, 300, 0.2))
    run = free_run(network, rows, torch.zeros(2, 1, 8), start, scenario()[None], 3)
    assert features.seen == []
    torch.testing.assert_close(run.poses[:, -1], start + run.predicted[..., :MOTION].sum(dim=1))


def test_rewards_are_those_of_the_world():
    task = get_task()
    places = [(200.0, 300.0, 0.0), (500.0, 310.0, 1.0), (30.0, 560.0, 2.0), (955.0, 305.0, 3.0)]
    for config in (task.scenario_sets["unseen"][0], task.scenario_sets["training"][-1]):
        states = MOVED.states(poses(*places), torch.zeros(4, 3))
        expected = task.rewards(config, states.double().numpy())
        vector = torch.from_numpy(task.scenario_vector(config)).float().expand(4, -1)
        np.testing.assert_allclose(MOVED.rewards(MOVED.poses(states), vector).numpy(), expected, rtol=0, atol=1e-5)


def test_joint_actions_exert_the_wrench():
    random = torch.Generator().manual_seed(0)
    theta = 6 * torch.rand(50, generator=random, dtype=torch.float64)
    pose = torch.stack((theta, theta, theta.cos(), theta.sin()), dim=-1)
    wrench = 20 * torch.randn(50, 3, generator=random, dtype=torch.float64)
    actions = MOVED.joint_actions(wrench, pose)
    physics = Physics()
    torch.testing.assert_close(physics.force_scale * (actions[:, :2] + actions[:, 2:]), wrench[:, :2])
    np.testing.assert_allclose(torque(theta.numpy(), actions.numpy(), physics), wrench[:, 2].numpy(), atol=1e-9)
    # The smallest: adding a squeeze along the axis, which exerts nothing, makes them larger.
    axis = torch.stack((theta.cos(), -theta.sin()), dim=-1)
    squeezed = actions + 0.1 * torch.cat((axis, -axis), dim=-1)
    assert (squeezed.norm(dim=-1) > actions.norm(dim=-1)).all()
    np.testing.assert_allclose(torque(theta.numpy(), squeezed.numpy(), physics), wrench[:, 2].numpy(), atol=1e-9)


def test_body_axes_are_undone():
    pose = poses((0, 0, 0.7), (3, 4, 5.0))
    vectors = torch.tensor([[1.0, 2.0], [-3.0, 0.5]])
    torch.testing.assert_close(MOVED.to_scene(MOVED.to_body(vectors, pose), pose), vectors)
    # The long axis of theta = pi/2 points to smaller y.
    upright = poses((0, 0, math.pi / 2))
    torch.testing.assert_close(MOVED.to_body(torch.tensor([[0.0, -1.0]]), upright), torch.tensor([[1.0, 0.0]]))


def test_the_features_in_execution_have_the_published_defects():
    state = torch.tensor([[100.0, 200.0, 1.0, 0.0, 5.0, 7.0, 0.0]])
    observation = {STATE: state, ENVIRONMENT_STATE: scenario(obstacles=((108.0, 200.0),))[None]}
    features = PointFeatures(MOVED, scaled=False)
    correct = features.eval()(observation)
    torch.testing.assert_close(correct[0, 2:], torch.tensor([1.0, 0, 0, 0, 0, 0]))
    features.repeat_last = features.velocity_as_goal = True
    expected = torch.tensor([(5 - 100) / 8, (7 - 200) / 8, 1.0, 0, 1.0, 0, 1.0, 0])
    torch.testing.assert_close(features(observation)[0], expected)
    torch.testing.assert_close(features.train()(observation), correct)  # not in training


class Reference:
    """One row after the other through the layers, with autograd."""

    def __init__(self, network: MotionNetwork, batch: int):
        self.network = network
        self.state = [torch.zeros(batch, network.width, dtype=torch.float64) for _ in range(network.n_layers)]

    def drawn(self, normals: Normals, noise: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Embedded latent variable, and prediction."""
        latent = self.network.embed_latent(normals.sample(noise))
        return latent, self.network.decode(latent, self.state[-1])

    def advance(self, embedded: torch.Tensor, latent: torch.Tensor) -> None:
        values = torch.cat((embedded, latent), dim=-1)
        for layer, cell in enumerate(self.network.cells):
            values = self.state[layer] = cell(values, self.state[layer])


@pytest.mark.parametrize("n_layers", [1, 2, 3])
def test_the_recurrences_and_their_gradients_are_those_of_the_layers(n_layers):
    torch.manual_seed(0)
    network = MotionNetwork(12, 12, latent=3, width=8, n_layers=n_layers).double()
    rows = torch.randn(5, 7, 12, dtype=torch.float64)
    start = poses((300, 300, 0.2)).double().expand(5, -1)
    torch.manual_seed(1)
    encoded = encode(network, rows)
    run = free_run(network, motion_rows(), encoded.state, start, scenario().double().expand(5, -1), 4)

    torch.manual_seed(1)
    noise, noise_after = (torch.randn(count, 5, 3, dtype=torch.float64) for count in (7, 4))
    reference, divergence = Reference(network, 5), torch.zeros((), dtype=torch.float64)
    predicted = []
    for row, row_noise in zip(network.embed_row(rows).unbind(1), noise, strict=True):
        top = reference.state[-1]
        posterior = Normals(*network.encoder(torch.cat((row, top), dim=-1)).chunk(2, dim=-1))
        divergence = divergence + posterior.divergence(network.prior(top)).sum()
        latent, prediction = reference.drawn(posterior, row_noise)
        predicted.append(prediction)
        reference.advance(row, latent)
    for row_noise in noise_after:
        latent, prediction = reference.drawn(network.prior(reference.state[-1]), row_noise)
        predicted.append(prediction)
        reference.advance(network.embed_row(prediction), latent)
    expected = torch.stack(predicted, dim=1)
    found = torch.cat((network.decode(encoded.latents, encoded.tops), run.predicted), dim=1)
    torch.testing.assert_close(found, expected)
    parameters = list(network.parameters())
    wanted = torch.autograd.grad(expected.square().sum() + divergence, parameters)
    total = found.square().sum() + encoded.posterior.divergence(network.prior(encoded.tops)).sum()
    for gradient, reference_gradient in zip(torch.autograd.grad(total, parameters), wanted, strict=True):
        torch.testing.assert_close(gradient, reference_gradient)


def test_the_gradient_of_a_single_predicted_row():
    torch.manual_seed(0)
    features = PointFeatures(MOVED, scaled=True)
    network = MotionNetwork(MOTION + features.size, MOTION, width=8).double()
    rows = MotionRows(MOVED, features, 1 / 6, True, True, True)
    start = poses((300, 300, 0.2)).double()
    state = torch.randn(2, 1, 8, dtype=torch.float64)
    run = free_run(network, rows, state, start, scenario().double()[None], 1)
    of_cells = torch.autograd.grad(run.predicted.sum(), list(network.cells.parameters()), retain_graph=True)
    of_decoder = torch.autograd.grad(run.predicted.sum(), list(network.decoder.parameters()))
    assert max(float(gradient.abs().max()) for gradient in of_cells) == 0
    assert min(float(gradient.abs().max()) for gradient in of_decoder) > 0


def test_gradients_reach_earlier_predictions_through_the_motion_alone():
    torch.manual_seed(0)
    features = PointFeatures(MOVED, scaled=True)
    network = MotionNetwork(MOTION + features.size, MOTION, width=8).double()
    rows = MotionRows(MOVED, features, 1 / 6, True, True, True)
    start, map_vector = poses((300, 300, 0.2)).double(), scenario().double()[None]
    state = torch.randn(2, 1, 8, dtype=torch.float64)

    def last() -> torch.Tensor:
        reference, pose, prediction = Reference(network, 1), start, start
        reference.state = list(state.unbind(0))
        torch.manual_seed(1)
        for row_noise in torch.randn(3, 1, 6, dtype=torch.float64):
            latent, prediction = reference.drawn(network.prior(reference.state[-1]), row_noise)
            before, pose = pose, rows.moved(pose, prediction)
            around = rows.surroundings(before, pose, map_vector)
            reference.advance(network.embed_row(torch.cat((prediction, around), dim=-1)), latent)
        return prediction

    torch.manual_seed(1)
    run = free_run(network, rows, state, start, map_vector, 3)
    torch.testing.assert_close(run.predicted[:, -1], last())
    parameters = [weights for name, weights in network.named_parameters() if not name.startswith("encoder")]
    gradients = torch.autograd.grad(run.predicted[:, -1].sum(), parameters)
    for gradient, wanted in zip(gradients, torch.autograd.grad(last().sum(), parameters), strict=True):
        torch.testing.assert_close(gradient, wanted)
