"""The training loop of Co-GAIL."""

import logging
import math
import time
from typing import Any

import numpy as np
import torch
from lerobot.configs.train import TrainPipelineConfig
from lerobot.policies.factory import make_policy
from lerobot.utils.random_utils import set_seed
from tqdm import tqdm

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import InvalidValueError
from copolicy.dataset.task import get_task
from lerobot_policy_copolicy.cogail.configuration_cogail import CoGailConfig
from lerobot_policy_copolicy.cogail.modeling_cogail import CoGailPolicy
from lerobot_policy_copolicy.cogail.network import Discriminator

from ..finite_data import NonFiniteError
from ..finite_weights import non_finite_weight
from ..memory_training import dataset_in_memory
from ..pair_split import PairSplit
from .adversary import Adversary
from .demonstrations import Demonstrations, EncodedFrames
from .layers import joined
from .learner import Learner, Minibatch
from .log import TrainingLog
from .rollout import PolicyFrames, RewardScale, advantages, collect
from .training_state import read_checkpoint, write_checkpoint
from .worlds import RestartingWorlds

_REWARD_SAMPLE = 2048  # demonstrated frames whose rewards are averaged


def train_cogail(config: TrainPipelineConfig, split: PairSplit | None = None) -> None:
    """Trains Co-GAIL in the world of the task, or continues a run from its newest checkpoint.

    One step is one frame of one world. The number of steps is rounded down to whole updates. Everything random comes
    from torch's generator, which checkpoints store: on one machine a resumed run continues exactly.

    Args:
        split: pairs to learn from; all if None. Each checkpoint records its pairs (`training_data.json`).

    Raises:
        CopolicyError: the data set cannot be trained on, a setting is out of range, or a number is not finite.
    """
    training = CoGailTraining(config, split)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # the networks are so small that more threads only wait for each other
    try:
        training.run()
    finally:
        torch.set_num_threads(threads)


class CoGailTraining:
    """Data, worlds, networks and optimizers of a training.

    Attributes:
        config: LeRobot's settings of the run.
        policy: the policy that is trained.
        step: frames in the world so far.
    """

    def __init__(self, config: TrainPipelineConfig, split: PairSplit | None = None):
        self.config, self.step = config, 0
        if not isinstance(config.policy, CoGailConfig):
            found = "none" if config.policy is None else config.policy.type
            raise InvalidValueError("--policy.type", "cogail, which this command trains", found)
        self.settings = settings = config.policy
        if settings.device != "cpu":
            raise InvalidValueError("--policy.device", "cpu, which the small networks are trained on", settings.device)
        if config.batch_size != 1:
            expected = "no such flag (a step is one frame; --policy.expert_batch_size is the batch of demonstrations)"
            raise InvalidValueError("--batch_size", expected, config.batch_size)
        self._updates = config.steps // settings.frames_per_update
        if not self._updates:
            expected = f"at least {settings.frames_per_update}, the frames of one update (--policy.frames_per_update)"
            raise InvalidValueError("--steps", expected, config.steps)
        if config.seed is not None:
            set_seed(config.seed)
        dataset, self._data = dataset_in_memory(config, split)
        policy = make_policy(cfg=settings, ds_meta=dataset.meta)
        assert isinstance(policy, CoGailPolicy)
        self.policy = policy.train()
        filled = policy.config.filled
        task = get_task(filled.task)
        self._demonstrations = Demonstrations(dataset, task, settings.history, filled.history_start, policy.symmetries)
        self._expert = EncodedFrames(self._demonstrations, policy.inputs, policy.action_scale.scaled)
        world_settings = task.settings_type(**(settings.physics or {}))
        self._worlds = RestartingWorlds(
            self._demonstrations, settings.n_worlds, world_settings, filled.fps, filled.start_frames
        )
        self._learner = Learner(policy.network, settings)
        discriminator = Discriminator(policy.inputs.size, len(policy.network.log_deviation), settings.width)
        self._adversary = Adversary(
            discriminator,
            settings.discriminator_lr,
            settings.gradient_penalty,
            settings.expert_batch_size,
            policy.config.filled.reward,
        )
        self._scale = RewardScale(settings.n_worlds, settings.gamma)

    def run(self) -> None:
        """Trains to the last update, and writes checkpoints, log and curves."""
        config, frames = self.config, self.settings.frames_per_update
        assert config.output_dir is not None
        if config.resume and config.checkpoint_path is not None:
            self.step, state = read_checkpoint(config.checkpoint_path)
            self._load(state)
        log = TrainingLog(config.output_dir, self.step)
        if not self.step:
            cloning = self._learner.pretrain(self._expert.sample, len(self._expert))
            logging.info("Behaviour cloning: mean squared error %.4f in its last epoch", cloning)
            self._require_finite({"loss of behaviour cloning": cloning})
        title = f"{config.output_dir.name}: Co-GAIL, preset {self.settings.preset}, seed {config.seed}"
        with tqdm(total=self._updates * frames, initial=self.step, unit="frame", unit_scale=True) as bar:
            while self.step < self._updates * frames:
                row = self._update()
                log.add(row)
                bar.update(frames)
                success = sum(row["episodes"].get(reason, 0) for reason in self.policy_task.spec.successes)
                bar.set_postfix(reward=f"{row['reward']:.2f}", success=f"{success}/{sum(row['episodes'].values())}")
                last = self.step >= self._updates * frames
                # Of a frequency that is no multiple of an update's frames, the first update beyond.
                due = config.save_freq > 0 and self.step // config.save_freq > (self.step - frames) // config.save_freq
                if config.save_checkpoint and (last or due):
                    write_checkpoint(config, self.step, self.policy, self._state(), self._data)
                    log.draw(title)

    @property
    def policy_task(self) -> Any:
        """The task of the policy."""
        return self._demonstrations.task

    def _update(self) -> dict[str, Any]:
        settings, learner, started = self.settings, self._learner, time.perf_counter()
        update = self.step // settings.frames_per_update
        learner.optimizer.lr = settings.optimizer_lr * (1 - update / self._updates)
        count = settings.frames_per_update // settings.n_worlds
        frames = collect(learner, self._worlds, self.policy.inputs, self.policy.action_scale.physical, count)
        actions = frames.actions.clip(-1.0, 1.0) if settings.bounded_actions else frames.actions
        seen = _flat(joined(frames.inputs, actions))
        first = update < settings.n_first_updates
        passes = settings.first_discriminator_passes if first else settings.discriminator_passes
        metrics = self._adversary.train(seen, self._expert.sample, passes)
        rewards = self._adversary.reward(seen).reshape(frames.values.shape)
        metrics |= learner.improve(self._with_advantages(frames, rewards), self._expert.sample)
        self.step += settings.frames_per_update
        episodes, length = self._worlds.take_episodes()
        metrics |= {
            "reward": float(rewards.mean()),
            "reward_deviation": self._scale.deviation,
            "deviation": float(np.exp(learner.log_deviation).mean()),
        }
        self._require_finite(metrics)
        return {
            "step": self.step,
            **{name: float(f"{value:.6g}") for name, value in metrics.items()},
            "episodes": dict(episodes),
            "episode_frames": length,
            "seconds": round(time.perf_counter() - started, 3),
        }

    def _with_advantages(self, frames: PolicyFrames, rewards: Array) -> Minibatch:
        settings = self.settings
        scaled = self._scale.scaled(rewards, frames.ended)
        next_values = frames.next_values
        if settings.after_success == "demonstrated":
            demonstrated = self._adversary.reward(joined(*self._expert.sample(_REWARD_SAMPLE))).mean()
            following = demonstrated / self._scale.deviation / (1 - settings.gamma)
            next_values = np.where(frames.succeeded, following, next_values).astype(np.float32)
        estimates = advantages(scaled, frames.values, next_values, frames.ended, settings.gamma, settings.gae_lambda)
        normal = (estimates - estimates.mean()) / (estimates.std() + 1e-5)
        parts = frames.inputs, frames.codes, frames.actions
        numbers = frames.log_probabilities, frames.values, estimates + frames.values, normal
        return Minibatch(*map(_flat, (*parts, *numbers)))

    def _require_finite(self, metrics: dict[str, float]) -> None:
        for name, value in metrics.items():
            if not math.isfinite(value):
                raise NonFiniteError(f"training stopped at step {self.step}: expected a finite {name}, found {value}")
        if problem := non_finite_weight(self.policy.network.state_dict()):
            raise NonFiniteError(f"training stopped at step {self.step}: expected finite weights, found {problem}")

    def _state(self) -> dict[str, Any]:
        return {
            "learner": self._learner.state(),
            "adversary": self._adversary.state(),
            "scale": self._scale.state(),
            "worlds": self._worlds.state(),
        }

    def _load(self, state: dict[str, Any]) -> None:
        self._learner.optimizer.load(state["learner"])
        self._adversary.load(state["adversary"])
        self._scale.load(state["scale"])
        self._worlds.load(state["worlds"])


def _flat(values: Array) -> Array:
    """`(T, W, ...)` to `(T W, ...)`."""
    return values.reshape(-1, *values.shape[2:])
