# %% [markdown]
# # Explore a data set
# Open this file as a notebook (VS Code, PyCharm, Spyder, `jupytext --to ipynb`), or run it. It reads the data set of
# `uv run copolicy-quickstart` (simulated pairs, no person took part). Set `PATH` to another folder or to `USER/NAME`
# on the Hub.

# %%
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from copolicy.dataset import load_dataset
from copolicy.dataset.outline_figure import draw_fixed, label_colours, show_whole

PATH = "outputs/quickstart/dataset"
FIGURES = Path("outputs/examples")

dataset = load_dataset(PATH)
print(dataset)

# %% [markdown]
# ## One row per episode
# The episode columns (`EpisodeMeta`) as a pandas table: pair, map, source, outcome.

# %%
table = dataset.table.to_pandas()
print(table.groupby("pair_id")[["success", "duration_s"]].agg(["count", "mean"]))

# %% [markdown]
# ## One episode
# States and actions as arrays. An action is both players' force, the robot's seat first.

# %%
episode = dataset.episodes[0]
print(episode)
seconds = np.arange(len(episode)) / episode.fps
speed = np.hypot(*episode.states[:, 4:6].T)
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(7, 4), layout="constrained")
above.plot(seconds, speed)
above.set_ylabel("speed, px/s")
below.plot(seconds, episode.interaction)
below.set(xlabel="s", ylabel="interaction force")
FIGURES.mkdir(parents=True, exist_ok=True)
figure.savefig(FIGURES / "episode.png")

# %% [markdown]
# ## Routes around the obstacles of one map
# The most frequent map, with the path of every episode in the colour of its route class.

# %%
scenario, count = Counter(episode.scenario for episode in dataset.episodes).most_common(1)[0]
members = [episode for episode in dataset.episodes if episode.scenario == scenario]
colours = label_colours(episode.columns["route_class"] for episode in members)
figure, axes = plt.subplots(figsize=(7, 3.8), layout="constrained")
draw_fixed(axes, dataset.task.outline.fixed(scenario))
for episode in members:
    axes.plot(*episode.path.T, color=colours[episode.columns["route_class"]], linewidth=1)
show_whole(axes, dataset.task.outline)
axes.set_title(f"episodes of one map: {count}, source: {', '.join(sorted(set(table['source'])))}")
figure.savefig(FIGURES / "routes.png")

# %% [markdown]
# ## Checks
# The findings of `copolicy-dataset check`.

# %%
from copolicy.dataset import check_dataset  # noqa: E402

for finding in check_dataset(dataset.root).findings[:5]:
    print(finding.severity, finding.episode, finding.rule, finding.message)
