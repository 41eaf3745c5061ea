"""Power of a repeated-measures design, to plan how many people a study needs."""

from typing import Any

from copolicy.dataset.exceptions import InvalidValueError

DEFINITION = (
    "one-way repeated-measures ANOVA (noncentral F): effect as partial eta squared, the correlation of a "
    "person's values in two conditions, and epsilon for unequal variances of the differences; one value (a mean over "
    "trials) for each person and condition"
)


def people_needed(
    conditions: int, eta_squared: float, *, correlation: float = 0.5, epsilon: float = 1.0, power: float = 0.8,
    alpha: float = 0.05, people: int | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Number of people for a power, or the power with a number of people.

    Raises:
        InvalidValueError: a number out of range.
    """
    ranges = {
        "conditions": (conditions, conditions >= 2, "at least 2"),
        "effect": (eta_squared, 0 < eta_squared < 1, "partial eta squared above 0 and below 1"),
        "correlation": (correlation, -1 < correlation < 1, "above -1 and below 1"),
        "epsilon": (epsilon, 1 / max(conditions - 1, 1) <= epsilon <= 1, f"{1 / max(conditions - 1, 1):.3g} to 1"),
        "power": (power, alpha < power < 1, f"above alpha = {alpha:g} and below 1"),
        "alpha": (alpha, 0 < alpha < 1, "above 0 and below 1"),
        "people": (people, people is None or people >= 2, "at least 2"),
    }
    for name, (value, valid, expected) in ranges.items():
        if not valid:
            raise InvalidValueError(name, expected, value)
    from scipy import stats  # takes a second to import

    effect = eta_squared / (1 - eta_squared) * conditions * epsilon / (1 - correlation)  # noncentrality for each person

    def power_of(n: int) -> float:
        first = (conditions - 1) * epsilon
        second = (n - 1) * first
        return float(stats.ncf.sf(stats.f.ppf(1 - alpha, first, second), first, second, n * effect))

    result = {"conditions": conditions, "partial_eta_squared": eta_squared, "correlation": correlation,
              "epsilon": epsilon, "alpha": alpha}  # fmt: skip
    if people is not None:
        return {
            **result,
            "people": people,
            "power": power_of(people),
            "definition": DEFINITION,
        }
    n = 2
    while n < 100_000 and power_of(n) < power:
        n += 1 if n < 200 else n // 20
    return {
        **result, "people": n, "power": power_of(n), "wanted_power": power,
        "definition": DEFINITION,
    }  # fmt: skip
