"""What of a device can steer: two axes, a hat, or a d-pad of buttons."""

from collections.abc import Sequence
from dataclasses import dataclass

from .gamepads import GamepadMapping


@dataclass(frozen=True)
class Steering:
    """Two axes that steer, counted as in `InputSample.positions`.

    Attributes:
        label: for the screen.
        axes: x (right) and y (down).
        invert: turn x, y round.
        digital: it knows nothing between rest and full force.
    """

    label: str
    axes: tuple[int, int]
    invert: tuple[bool, bool] = (False, False)
    digital: bool = False


def steerings(mapping: GamepadMapping, axes: int, hats: int) -> list[Steering]:
    """All that can steer, the best first; empty for a device that cannot.

    Args:
        mapping: of the device.
        axes: how many it has.
        hats: how many it has.
    """
    found: list[Steering] = []
    for label, pair in (
        ("left stick", mapping.stick("left")),
        ("right stick", mapping.stick("right")),
        ("d-pad", mapping.cross_axes),
    ):
        if pair is not None and max(pair[0]) < axes:
            found.append(Steering(label, *pair))
    described = bool(found) and mapping.known
    raw = [_raw(first, first + 1) for first in range(axes - 1)]
    if not described:
        taken = {one.axes for one in found}
        found += [one for one in raw if one.axes not in taken]
    for hat in range(hats):
        first = axes + 2 * hat
        found.append(Steering("d-pad" if hats == 1 else f"d-pad {hat + 1}", (first, first + 1), digital=True))
    if mapping.cross_buttons is not None:
        first = axes + 2 * hats
        found.append(Steering("d-pad", (first, first + 1), digital=True))
    return found


def steering_of(options: Sequence[Steering], axes: tuple[int, int], axis_count: int) -> Steering:
    """The one of `options` with these axes; one of its own where there is none."""
    fitting = (one for one in options if one.axes == tuple(axes))
    return next(fitting, _raw(*axes) if max(axes) < axis_count else Steering("d-pad", axes, digital=True))


def _raw(x: int, y: int) -> Steering:
    return Steering(f"axes {x} and {y}", (x, y))
