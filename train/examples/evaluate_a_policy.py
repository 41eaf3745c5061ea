# %% [markdown]
# # Evaluate your own LeRobot policy
# Any LeRobot policy that was trained on a data set of a pair task: the co-policy, `act`, `diffusion`, your plugin. Name
# its checkpoint or training run; `pretrained` is the model that comes with the package. All episodes are simulated, no
# person takes part.

# %%
from pathlib import Path

import matplotlib.pyplot as plt

from copolicy.collect import load_policy, make_agent, run_episodes
from copolicy.dataset import get_task
from copolicy.dataset.outline_figure import GREEN, VERMILION, draw_fixed, panels, show_whole
from copolicy.evaluate import coplan_episodes, success

POLICY = "pretrained"
LIMIT = 4  # maps, for a quick look; None for all
FIGURES = Path("outputs/examples")

# %% [markdown]
# ## Co-planning
# The paper's first study: both players execute one action chunk. The standard error is binomial, over these episodes;
# it does not cover the choice of training seed.

# %%
policy = load_policy(POLICY)
episodes = coplan_episodes(policy, "holdout", limit=LIMIT)
result = success(episodes)
print(f"{policy.name}: {result['mean']:.2f} ± {result['standard_error']:.2f} of {result['episodes']} maps")

# %% [markdown]
# ## A scripted agent at the human's seat
# A policy that succeeds in co-planning may still be a poor partner.

# %%
for partner in ("stubborn", "follower"):
    episodes_with_partner = run_episodes(make_agent(f"policy:{POLICY}"), f"scripted:{partner}", "holdout", limit=LIMIT)
    durations = [f"{episode.meta.duration_s:.1f} s" for episode in episodes_with_partner]
    print(partner, success(episodes_with_partner)["mean"], durations)

# %% [markdown]
# ## One panel per map

# %%
outline = get_task(policy.task).outline
figure = plt.figure(layout="constrained")
for axes, episode in zip(panels(figure, outline, len(episodes), 2, 0.2), episodes, strict=True):
    draw_fixed(axes, outline.fixed(episode.scenario))
    axes.plot(*episode.path.T, color=GREEN if episode.meta.success else VERMILION)
    show_whole(axes, outline)
    axes.set_title(f"{episode.meta.map_id}: {episode.meta.termination_reason}", fontsize=9)
FIGURES.mkdir(parents=True, exist_ok=True)
figure.savefig(FIGURES / "coplanning.png")
