"""The pads that are plugged in: what they are, and what they say."""

import sys
import time
from pathlib import Path
from typing import Any, TextIO

from copolicy.dataset.exceptions import InvalidValueError, RunError

from .inputs import CalibrationStore, Gamepad, Gamepads, InputSample, MappingStore, StickCalibration, user_config_folder
from .sdl import init_events, pygame

_PICTURES_HZ = 20
_OF_JOYSTICKS = (
    pygame.JOYDEVICEADDED,
    pygame.JOYDEVICEREMOVED,
    pygame.JOYAXISMOTION,
    pygame.JOYBALLMOTION,
    pygame.JOYHATMOTION,
    pygame.JOYBUTTONDOWN,
    pygame.JOYBUTTONUP,
    # Of looking up what SDL knows of a pad.
    pygame.CONTROLLERDEVICEADDED,
    pygame.CONTROLLERDEVICEREMOVED,
)
_BAR = 21  # characters, an odd number: the middle is the centre


def open_pads(config_folder: Path | None = None) -> Gamepads:
    """All pads that are plugged in; needs neither a window nor a display.

    Args:
        config_folder: of the user's mappings; by default that of this user.

    Raises:
        FileFormatError: the file of mappings is none.
    """
    mappings = MappingStore(config_folder or user_config_folder())
    init_events()
    pads = Gamepads(mappings)
    # Where somebody in this process has taken the events that tell of them, the pads are there all the same.
    for index in range(pygame.joystick.get_count()):
        pads.handle(pygame.event.Event(pygame.JOYDEVICEADDED, device_index=index))
    return pads


def follow_pads(pads: Gamepads) -> list[Gamepad]:
    """Reads the sticks, and the events of plugging and unplugging; returns the pads that went.

    Takes all events of joysticks from the queue, so that it never fills up, and leaves those of the window.
    """
    gone = []
    for event in pygame.event.get(_OF_JOYSTICKS):
        _, left = pads.handle(event)
        if left is not None:
            gone.append(left)
    return gone


def list_devices(pads: Gamepads, calibrations: CalibrationStore) -> list[dict[str, Any]]:
    """Every pad by its instance id, JSON-able."""
    return [
        {
            "instance": pad.instance_id,
            "name": pad.name,
            "guid": pad.guid,
            "axes": pad.axes,
            "buttons": pad.buttons,
            "hats": pad.hats,
            "calibrated": pad.guid in calibrations,
        }
        for pad in sorted(pads, key=lambda pad: pad.instance_id)
    ]


def table(devices: list[dict[str, Any]]) -> list[str]:
    """The list as lines of text."""
    if not devices:
        return ["no pad is plugged in"]
    rows = [[str(name) for name in devices[0]]]
    rows += [[{True: "yes", False: "no"}.get(value, str(value)) for value in one.values()] for one in devices]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def watch(
    pads: Gamepads,
    calibrations: CalibrationStore,
    seconds: float,
    out: TextIO,
) -> dict[int, dict[str, Any]]:
    """Shows what every pad says, live, and tells at the end what of it moved.

    Args:
        pads: to watch; pads that are plugged in meanwhile are watched too.
        calibrations: turn axes into the force that is shown.
        seconds: how long.
        out: a terminal, drawn over; otherwise only the last picture is written.

    Returns:
        By instance id: name, range of each axis, buttons that were pressed, readings, and whether it was unplugged.

    Raises:
        InvalidValueError: no time at all.
        RunError: there is no pad.
    """
    if not seconds > 0:
        raise InvalidValueError("seconds", "a positive number", seconds)
    if not len(pads):
        raise RunError("expected at least one pad, found none plugged in")
    found: dict[int, dict[str, Any]] = {}
    height, lines = 0, []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for pad in follow_pads(pads):
            found[pad.instance_id]["unplugged"] = True
        lines = []
        for pad in pads:
            sample = pad.sample(time.monotonic_ns())
            _remember(found, pad, sample)
            lines += _picture(pad, sample, calibrations.for_gamepad(pad))
        if out.isatty():
            # Up over the last picture, and clear what is below.
            out.write((f"\x1b[{height}A\x1b[J" if height else "") + "".join(f"{line}\n" for line in lines))
            out.flush()
            height = len(lines)
        time.sleep(1 / _PICTURES_HZ)
    if not out.isatty():
        out.write("".join(f"{line}\n" for line in lines))
    return found


def devices_command(seconds: float | None, as_json: bool, config_folder: Path | None = None) -> dict[str, Any]:
    """What the command does: prints the table or the live test, and returns its summary."""
    pads = open_pads(config_folder)
    calibrations = CalibrationStore(config_folder or user_config_folder())
    devices = list_devices(pads, calibrations)
    if not as_json:
        print("\n".join(table(devices)))
    if seconds is None:
        return {"devices": devices} if as_json else {}
    found = watch(pads, calibrations, seconds, sys.stderr if as_json else sys.stdout)
    return {"devices": devices, "test": found} if as_json else {}


def _remember(found: dict[int, dict[str, Any]], pad: Gamepad, sample: InputSample) -> None:
    new = {"name": pad.name, "axes": [], "buttons": [], "readings": 0, "unplugged": False}
    one = found.setdefault(pad.instance_id, new)
    one["readings"] += 1
    ranges = one["axes"] or [[value, value] for value in sample.axes]
    one["axes"] = [
        [round(min(low, value), 3), round(max(high, value), 3)]
        for (low, high), value in zip(ranges, sample.axes, strict=True)
    ]
    pressed = {index for index, down in enumerate(sample.buttons) if down}
    one["buttons"] = sorted(pressed | set(one["buttons"]))


def _picture(pad: Gamepad, sample: InputSample, calibration: StickCalibration) -> list[str]:
    x, y = pad.force(sample, calibration)
    lines = [f"{pad.instance_id}: {pad.name}   force {x:+.2f} {y:+.2f}", f"  {_about(pad, calibration)}"]
    lines += [f"  axis {index:<3} {_bar(value)} {value:+.2f}" for index, value in enumerate(sample.axes)]
    for hat in range(pad.hats):
        right, down = sample.directions[2 * hat : 2 * hat + 2]
        lines.append(f"  hat {hat:<4} {right:+.0f} {down:+.0f}")
    pressed = " ".join(str(index) for index, down in enumerate(sample.buttons) if down)
    return [*lines, f"  buttons  {pressed or '-'}"]


def _about(pad: Gamepad, calibration: StickCalibration) -> str:
    known = "buttons known" if pad.mapping.is_known else "buttons not known: the lobby of play sets them up"
    steers = (
        f"steers with: {pad.steering(calibration).label}"
        if pad.steering_options
        else "cannot steer: no stick, no d-pad"
    )
    return f"{steers}; {known}"


def _bar(value: float) -> str:
    middle = _BAR // 2
    place = middle + round(max(-1.0, min(1.0, value)) * middle)
    low, high = sorted((middle, place))
    return "[" + "".join("#" if low <= index <= high else " " for index in range(_BAR)) + "]"
