"""Distance of a data set's routes to those of people in 330 labelled human-human demonstrations.

Source: Yang and Mavrogiannis, "Implicit Communication in Human-Robot Collaborative Transport", HRI 2025, labels of
the training demonstrations of Ng et al.; BSD-3-Clause, see `human_passing_sides/`. The labels come without
trajectories and maps, so distributions are compared for each number of obstacles.
"""

import csv
from collections import Counter
from importlib.resources import files

import numpy as np

from copolicy.dataset.exceptions import FileFormatError
from copolicy.dataset.statistics.entropy import jensen_shannon
from copolicy.dataset.statistics.estimate import Estimate, Null
from copolicy.dataset.statistics.resampling import interval
from copolicy.dataset.statistics.route_entropy import MIN_EPISODES, label_entropy
from copolicy.dataset.statistics.trajectories import Trajectories

_LABELS = "human_passing_sides/train_passing_labels.csv"
_MIRROR = str.maketrans("LR", "RL")
_REPLICATES = 1000


def human_routes() -> dict[int, Counter[str]]:
    """Counts of the human route classes, by number of obstacles.

    Raises:
        FileFormatError: the packaged file is damaged.
    """
    text = files(__package__).joinpath(_LABELS).read_text(encoding="utf-8")
    counts: dict[int, Counter[str]] = {}
    for row in csv.reader(text.splitlines()):
        if len(row) != 2 or not row[1] or set(row[1]) - set("LR"):
            raise FileFormatError(_LABELS, "rows of run_id,label with letters L and R", repr(row))
        counts.setdefault(len(row[1]), Counter())[row[1]] += 1
    return dict(sorted(counts.items()))


def human_route_entropy(rng: np.random.Generator) -> dict[str, dict]:
    """Entropy of the human routes for each number of obstacles, as `label_entropy` has it."""
    return {f"{size}_obstacles": label_entropy(counts, size, rng) for size, counts in human_routes().items()}


def human_reference(rng: np.random.Generator) -> dict[str, dict | str]:
    """The routes of people, as a part of the statistics document."""
    source = "Yang and Mavrogiannis, HRI 2025: passing sides of 330 human-human demonstrations; "
    return {
        "source": f"{source}labels, not trajectories (BSD-3-Clause)",
        "routes": human_route_entropy(rng),
    }


def human_distance(data: Trajectories, rng: np.random.Generator) -> dict[str, Estimate]:
    """Jensen-Shannon divergence between the routes of a data set and the human ones, per number of obstacles.

    The handedness of the labels is not documented, so the divergence is computed for the labels and for their mirror
    image, and the smaller one is the value; the null distribution is of the smaller one as well.
    """
    labels = [label for label in data.labels if label is not None]
    reference = human_route_entropy(rng)
    estimates = {}
    for size, human in human_routes().items():
        counts = Counter(label for label in labels if len(label) == size)
        estimates[f"human_distance_{size}_obstacles"] = _distance(size, counts, human, reference, rng)
    return estimates


def _distance(
    size: int, counts: Counter[str], human: Counter[str], reference: dict[str, dict], rng: np.random.Generator
) -> Estimate:
    key = f"{size}_obstacles"
    definition = (
        f"Jensen-Shannon divergence (0 the same, 1 nothing in common) between this data set's routes and those of "
        f"{sum(human.values())} human-human demonstrations with {size} obstacle(s), over all maps; the smaller of the "
        "labels as they are and with L and R exchanged."
    )
    details: dict = {"human": reference[key], "counts": dict(counts.most_common())}
    total = sum(counts.values())
    if total < MIN_EPISODES:
        note = f"fewer than {MIN_EPISODES} episodes with {size} obstacle(s) and a route"
        return Estimate(None, "bits", definition, total, note=note, details=details)
    support = sorted({*counts, *human, *(label.translate(_MIRROR) for label in human)})
    mirror = [support.index(label.translate(_MIRROR)) for label in support if label.translate(_MIRROR) in support]
    if len(mirror) != len(support):
        support = sorted({*support, *(label.translate(_MIRROR) for label in support)})
        mirror = [support.index(label.translate(_MIRROR)) for label in support]
    data_counts, human_counts = (np.array([counter[label] for label in support]) for counter in (counts, human))
    direct = float(jensen_shannon(data_counts, human_counts))
    mirrored = float(jensen_shannon(data_counts, human_counts[mirror]))
    value = min(direct, mirrored)
    reading = "as labelled" if direct <= mirrored else "mirrored"
    human_counts = human_counts if direct <= mirrored else human_counts[mirror]
    human_total = human_counts.sum()
    data_replicates = rng.multinomial(total, data_counts / total, size=_REPLICATES)
    human_replicates = rng.multinomial(human_total, human_counts / human_total, size=_REPLICATES)
    bounds = interval(value, jensen_shannon(data_replicates, human_replicates), 0.0, 1.0)
    pooled = (data_counts + human_counts) / (data_counts + human_counts).sum()
    first, second = (rng.multinomial(count, pooled, size=_REPLICATES) for count in (total, human_total))
    draws = np.minimum(jensen_shannon(first, second), jensen_shannon(first, second[:, mirror]))
    details |= {
        "reading": reading,
        "as_labelled_bits": direct,
        "mirrored_bits": mirrored,
        "distance": float(np.sqrt(value)),  # the square root of the divergence is a metric
    }
    null = Null.from_draws("both drawn from their pooled shares", value, draws)
    return Estimate(value, "bits", definition, total, bounds, "episodes and labels", null, details=details)
