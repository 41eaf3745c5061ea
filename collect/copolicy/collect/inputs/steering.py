"""The controls of a device that can steer: two axes, a hat, or a d-pad of buttons."""

from collections.abc import Sequence
from dataclasses import dataclass

from .mapping import GamepadMapping


@dataclass(frozen=True)
class SteeringAxes:
    """Two axes that steer, numbered as in `InputSample.positions`.

    Attributes:
        label: text for the screen.
        axes: x (right) and y (down).
        invert: reverse x, y.
        digital: has no value between rest and full force.
    """

    label: str
    axes: tuple[int, int]
    invert: tuple[bool, bool] = (False, False)
    digital: bool = False


def steering_options(mapping: GamepadMapping, axes: int, hats: int) -> list[SteeringAxes]:
    """Returns the steering axes of a device, the best first; empty if it has none.

    Args:
        mapping: of the device.
        axes: number of axes.
        hats: number of hats.
    """
    options: list[SteeringAxes] = []
    for label, pair in (
        ("left stick", mapping.stick("left")),
        ("right stick", mapping.stick("right")),
        ("d-pad", mapping.dpad_axes),
    ):
        if pair is not None and max(pair[0]) < axes:
            options.append(SteeringAxes(label, *pair))
    if not options or not mapping.is_known:
        mapped = {option.axes for option in options}
        options += [_raw(first, first + 1) for first in range(axes - 1) if (first, first + 1) not in mapped]
    for hat in range(hats):
        first = axes + 2 * hat
        options.append(SteeringAxes("d-pad" if hats == 1 else f"d-pad {hat + 1}", (first, first + 1), digital=True))
    if mapping.dpad_buttons is not None:
        first = axes + 2 * hats
        options.append(SteeringAxes("d-pad", (first, first + 1), digital=True))
    return options


def select_steering(options: Sequence[SteeringAxes], axes: tuple[int, int], axis_count: int) -> SteeringAxes:
    """Returns the option with these axes, or an unnamed one if there is no such option."""
    matches = (option for option in options if option.axes == tuple(axes))
    return next(matches, _raw(*axes) if max(axes) < axis_count else SteeringAxes("d-pad", axes, digital=True))


def _raw(x: int, y: int) -> SteeringAxes:
    return SteeringAxes(f"axes {x} and {y}", (x, y))
