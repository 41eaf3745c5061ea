"""The trainer of Co-GAIL: PPO in the world of the task against a discriminator of demonstrated frames.

stable-baselines3's PPO is not used. Its `train` has no place for losses beside its own, and these two need minibatches
of demonstrations in step with its own; its rollouts take the reward from the environment, while this reward is computed
after the rollout, by a discriminator trained on the rollout. A subclass would replace `collect_rollouts` and `train`,
which are the algorithm, and keep the dependency.
"""
