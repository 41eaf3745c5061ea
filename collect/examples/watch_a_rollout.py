# %% [markdown]
# # Watch and measure a rollout of two agents
# An agent is a policy, a scripted player or an earlier recording. Here the policy that comes with the package acts at
# the robot's seat, and a scripted partner that never yields at the human's. No person takes part.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from copolicy.collect import make_agent, run_episodes
from copolicy.dataset import get_task
from copolicy.dataset.outline_figure import draw_fixed, show_whole

FIGURES = Path("outputs/examples")
EPISODES = 4

robot = make_agent("policy:pretrained")
with_policy = run_episodes(robot, "scripted:stubborn", maps="unseen", limit=EPISODES)
with_nothing = run_episodes("nothing", "scripted:stubborn", maps="unseen", limit=EPISODES)

# %% [markdown]
# ## Outcomes
# An `Episode` has states, actions, and in `meta` its outcome. The success rate alone says little: a stubborn partner
# also reaches the goal with a robot that does nothing. Time and interaction force differ.

# %%
task = get_task("table")
for name, episodes in (("policy", with_policy), ("nothing", with_nothing)):
    seconds = np.mean([episode.meta.duration_s for episode in episodes])
    force = np.mean([np.abs(task.interaction(episode.states, episode.actions)).mean() for episode in episodes])
    successes = sum(episode.meta.success for episode in episodes)
    print(f"{name:8} {successes} of {len(episodes)} at the goal, {seconds:5.1f} s, interaction force {force:.2f}")

# %% [markdown]
# ## Paths

# %%
figure, panels = plt.subplots(1, 2, figsize=(10, 3), layout="constrained")
for axes, episodes, name in zip(panels, (with_policy, with_nothing), ("policy", "nothing"), strict=True):
    draw_fixed(axes, task.outline.fixed(episodes[0].scenario))
    axes.plot(*episodes[0].path.T)
    show_whole(axes, task.outline)
    axes.set_title(f"robot: {name}, {episodes[0].meta.map_id}")
FIGURES.mkdir(parents=True, exist_ok=True)
figure.savefig(FIGURES / "rollouts.png")
