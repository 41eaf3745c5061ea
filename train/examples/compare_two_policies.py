# %% [markdown]
# # Compare two policies, with intervals
# Both act on the same starts, so that differences are taken start by start. The interval is bootstrapped over maps: the
# four orientations of a map are no maps of their own. Here the two are one model with more and with fewer denoising
# steps; name two training runs instead. In simulation, no person takes part.

# %%
from copolicy.collect import load_policy
from copolicy.evaluate import compare_episodes, coplan_episodes, success

LIMIT = 4  # maps, for a quick look; None for all

many = load_policy("pretrained", settings={"num_inference_steps": 10})
few = load_policy("pretrained", settings={"num_inference_steps": 2})

# %%
first = coplan_episodes(many, "unseen", limit=LIMIT)
second = coplan_episodes(few, "unseen", limit=LIMIT)
for name, episodes in (("10 steps", first), ("2 steps", second)):
    result = success(episodes)
    print(f"{name:8} {result['mean']:.2f} ± {result['standard_error']:.2f} of {result['episodes']}")

# %% [markdown]
# ## The difference
# An interval that contains zero says that these episodes do not tell the two apart, not that they are equal.

# %%
for name, difference in compare_episodes(first, second).items():
    if difference["bootstrap_95"] is not None:
        low, high = difference["bootstrap_95"]
        print(f"{name:16} {difference['mean']:+.3f} [{low:+.3f}, {high:+.3f}] over {difference['maps']} maps")
