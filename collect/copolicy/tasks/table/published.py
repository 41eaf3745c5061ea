"""The paper's co-planning results, as counts of episodes."""

from copolicy.dataset.task import PublishedMethod

SOURCE = (
    "Ng, Liu and Kennedy, Diffusion Co-Policy for Synergistic Human-Robot Collaborative Tasks, RA-L 2023 (arXiv "
    "2305.12171), success of co-planning as best (mean) of three seeds, and planning time: trained on demonstrations "
    "of people, 84 episodes per seed and map set. The counts are the only ones that give the printed percentages. "
    "Planning time: diffusion on a GPU (RTX 3090 Ti), the others on a CPU; the VRNN's is a mean over frames of which "
    "every second one plans"
)
"""Where `PUBLISHED` is from, and what its numbers are."""


def _method(
    name: str, best: tuple[int, int], mean: tuple[int, int], planning_ms: float, **policies: tuple
) -> PublishedMethod:
    """A method from its successes on unseen and holdout maps: of 84 for the best seed, of 252 for all three."""
    return PublishedMethod(
        name,
        policies,
        {"unseen": (best[0], 84), "holdout": (best[1], 84)},
        {"unseen": (mean[0], 252), "holdout": (mean[1], 252)},
        planning_ms,
    )


_DIFFUSION = {"type": ("copolicy",), "network": ("transformer", "mlp")}

PUBLISHED = (
    _method("CoDP-H", (34, 66), (82, 195), 93.5, **_DIFFUSION, past_human_action=(True,)),
    _method("CoDP", (27, 61), (73, 171), 87.0, **_DIFFUSION, past_human_action=(False,)),
    _method("BC-LSTM-GMM", (16, 51), (43, 139), 0.745, type=("bc_lstm_gmm",), past_human_action=(False,)),
    _method("Co-GAIL", (21, 40), (56, 99), 0.267, type=("cogail",)),
    _method("VRNN", (19, 19), (49, 51), 18.52, type=("vrnn",)),
)
"""The five methods of the paper."""
