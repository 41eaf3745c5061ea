# %% [markdown]
# # Compare two policies, with intervals
# Both act on the same starts, so that differences are taken start by start. The interval is bootstrapped over maps: the
# four orientations of a map count as one map. Here both are the same model, with many and with few denoising steps;
# name two training runs instead. All episodes are simulated, no person takes part.

# %%
from copolicy.collect import load_policy
from copolicy.evaluate import compare_episodes, coplan_episodes, success

LIMIT = 4  # maps, for a quick look; None for all

ten_steps = load_policy("pretrained", settings={"num_inference_steps": 10})
two_steps = load_policy("pretrained", settings={"num_inference_steps": 2})

# %%
first = coplan_episodes(ten_steps, "unseen", limit=LIMIT)
second = coplan_episodes(two_steps, "unseen", limit=LIMIT)
for name, episodes in (("10 steps", first), ("2 steps", second)):
    result = success(episodes)
    print(f"{name:8} {result['mean']:.2f} ± {result['standard_error']:.2f} of {result['episodes']}")

# %% [markdown]
# ## The difference
# An interval that contains zero means that these episodes show no difference, not that the policies are equal.

# %%
for name, difference in compare_episodes(first, second).items():
    if difference["bootstrap_95"] is not None:
        low, high = difference["bootstrap_95"]
        print(f"{name:16} {difference['mean']:+.3f} [{low:+.3f}, {high:+.3f}] over {difference['maps']} maps")
