"""The paper's results: co-planning as counts of episodes, and its two studies with people."""

from copolicy.dataset.task import PublishedFront, PublishedMethod, PublishedPeople

SOURCE = (
    "Ng, Liu and Kennedy, Diffusion Co-Policy for Synergistic Human-Robot Collaborative Tasks, RA-L 2023 (arXiv "
    "2305.12171): success of co-planning as best and mean of three seeds, 84 episodes per seed and map set, trained "
    "on demonstrations of people. The counts are the only ones that give the printed percentages. The time of a "
    "decision is from the paper's study with people: diffusion with 34 denoising steps on a GPU (RTX 3090 Ti), the "
    "others on a CPU; the VRNN's is a mean over frames of which every second one plans"
)
"""Where `PUBLISHED` is from, and what its numbers are."""


PEOPLE_SOURCE = (
    "Ng, Liu and Kennedy (RA-L 2023, arXiv 2305.12171). Study in simulation: five people, 60 starts, mean success and "
    "mean wall time of successes; the program stood still while a diffusion policy planned (93.5 ms in every 100 ms), "
    "so that 32.3 s are some 20 s of simulated time. Study with a real robot: six people, two trials each with either "
    "player's end in front; the printed 'standard deviations' are the sample standard deviation divided by six. The "
    "standard deviations here are of the only successes that give the printed numbers (tests/data/robot_study)"
)
"""Where `PublishedMethod.people` is from, and what its numbers are."""


def _method(
    name: str,
    best: tuple[int, int],
    mean: tuple[int, int],
    planning_ms: float,
    people: PublishedPeople,
    **policies: tuple,
) -> PublishedMethod:
    """A method from its successes on unseen and holdout maps: of 84 for the best seed, of 252 for all three.

    The percentages of the paper: CoDP-H 40.48 (32.54) and 78.57 (77.38), CoDP 32.14 (28.97) and 72.62 (67.86),
    BC-LSTM-GMM 19.05 (17.06) and 60.71 (55.16), Co-GAIL 25.00 (22.22) and 47.62 (39.28), VRNN 22.62 (19.44) and 22.62
    (20.24).
    """
    return PublishedMethod(
        name,
        policies,
        {"unseen": (best[0], 84), "holdout": (best[1], 84)},
        {"unseen": (mean[0], 252), "holdout": (mean[1], 252)},
        planning_ms,
        people,
    )


def _people(
    success: float, wall_time_s: float, human_front: tuple[int, float], robot_front: tuple[int, float]
) -> PublishedPeople:
    """Results beside people; by front the successes of 12 trials and the standard deviation between six people."""
    fronts = {"human_front": human_front, "robot_front": robot_front}
    people = 6
    return PublishedPeople(
        success,
        wall_time_s,
        {name: PublishedFront(k, 12, people, sd, sd / people) for name, (k, sd) in fronts.items()},
    )


_DIFFUSION = {"type": ("copolicy",), "network": ("transformer", "mlp")}

PUBLISHED = (
    _method(
        "CoDP-H",
        (34, 66),
        (82, 195),
        93.5,
        _people(0.68, 32.3, (9, 0.27386), (11, 0.20412)),
        **_DIFFUSION,
        past_human_action=(True,),
    ),
    _method(
        "CoDP",
        (27, 61),
        (73, 171),
        87.0,
        _people(0.61, 31.0, (8, 0.25820), (11, 0.20412)),
        **_DIFFUSION,
        past_human_action=(False,),
    ),
    _method(
        "BC-LSTM-GMM",
        (16, 51),
        (43, 139),
        0.745,
        _people(0.36, 22.3, (4, 0.25820), (12, 0.0)),
        type=("bc_lstm_gmm",),
        past_human_action=(False,),
    ),
    _method("Co-GAIL", (21, 40), (56, 99), 0.267, _people(0.37, 23.9, (8, 0.25820), (6, 0.44721)), type=("cogail",)),
    _method("VRNN", (19, 19), (49, 51), 18.52, _people(0.35, 15.8, (9, 0.27386), (9, 0.41833)), type=("vrnn",)),
)
"""The five methods of the paper."""
