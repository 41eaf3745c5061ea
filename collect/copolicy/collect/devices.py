"""The command `copolicy-collect devices`: lists the connected gamepads and shows their input."""

import sys
import time
from pathlib import Path
from typing import Any, TextIO

from copolicy.dataset.exceptions import InvalidValueError, RunError

from .inputs import CalibrationStore, Gamepad, Gamepads, InputSample, MappingStore, StickCalibration, user_config_folder
from .sdl import init_events, pygame

_UPDATE_HZ = 20
_JOYSTICK_EVENTS = (
    pygame.JOYDEVICEADDED,
    pygame.JOYDEVICEREMOVED,
    pygame.JOYAXISMOTION,
    pygame.JOYBALLMOTION,
    pygame.JOYHATMOTION,
    pygame.JOYBUTTONDOWN,
    pygame.JOYBUTTONUP,
    # SDL adds these when a mapping is looked up.
    pygame.CONTROLLERDEVICEADDED,
    pygame.CONTROLLERDEVICEREMOVED,
)
_BAR = 21  # characters, an odd number: the middle is the centre


def open_gamepads(config_folder: Path | None = None) -> Gamepads:
    """Opens all connected gamepads; needs neither a window nor a display.

    Args:
        config_folder: with the mappings; by default the user's settings.

    Raises:
        FileFormatError: the file of mappings cannot be read.
    """
    mappings = MappingStore(config_folder or user_config_folder())
    init_events()
    gamepads = Gamepads(mappings)
    # The events of connected gamepads may have been read by other code of this process.
    for index in range(pygame.joystick.get_count()):
        gamepads.handle(pygame.event.Event(pygame.JOYDEVICEADDED, device_index=index))
    return gamepads


def poll_gamepads(gamepads: Gamepads) -> list[Gamepad]:
    """Handles the joystick events and returns the gamepads that were unplugged.

    Removes all joystick events from the queue, so that it does not fill up, and leaves those of the window.
    """
    unplugged = []
    for event in pygame.event.get(_JOYSTICK_EVENTS):
        _, removed = gamepads.handle(event)
        if removed is not None:
            unplugged.append(removed)
    return unplugged


def list_devices(gamepads: Gamepads, calibrations: CalibrationStore) -> list[dict[str, Any]]:
    """Facts about every gamepad, sorted by instance id, JSON-able."""
    return [
        {
            "instance": gamepad.instance_id,
            "name": gamepad.name,
            "guid": gamepad.guid,
            "axes": gamepad.axes,
            "buttons": gamepad.buttons,
            "hats": gamepad.hats,
            "calibrated": gamepad.guid in calibrations,
        }
        for gamepad in sorted(gamepads, key=lambda gamepad: gamepad.instance_id)
    ]


def table_lines(devices: list[dict[str, Any]]) -> list[str]:
    """The result of `list_devices` as lines of text with aligned columns."""
    if not devices:
        return ["no gamepad is connected"]
    rows = [[str(name) for name in devices[0]]]
    rows += [[{True: "yes", False: "no"}.get(value, str(value)) for value in device.values()] for device in devices]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def show_input(
    gamepads: Gamepads,
    calibrations: CalibrationStore,
    seconds: float,
    out: TextIO,
) -> dict[int, dict[str, Any]]:
    """Shows the input of every gamepad live, and returns its range.

    Args:
        gamepads: to show; gamepads that are connected meanwhile are added.
        calibrations: for the force that is shown.
        seconds: duration.
        out: a terminal, which is updated in place; to another file only the last state is written.

    Returns:
        By instance id: name, range of each axis, buttons that were pressed, readings, and whether it was unplugged.

    Raises:
        InvalidValueError: a duration that is not positive.
        RunError: no gamepad is connected.
    """
    if not seconds > 0:
        raise InvalidValueError("seconds", "a positive number", seconds)
    if not len(gamepads):
        raise RunError("expected at least one gamepad, found none connected")
    summaries: dict[int, dict[str, Any]] = {}
    height, lines = 0, []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for gamepad in poll_gamepads(gamepads):
            summaries[gamepad.instance_id]["unplugged"] = True
        lines = []
        for gamepad in gamepads:
            sample = gamepad.sample(time.monotonic_ns())
            _add_sample(summaries, gamepad, sample)
            lines += _gamepad_lines(gamepad, sample, calibrations.for_gamepad(gamepad))
        if out.isatty():
            # Move the cursor up over the last lines and clear the screen below it.
            out.write((f"\x1b[{height}A\x1b[J" if height else "") + "".join(f"{line}\n" for line in lines))
            out.flush()
            height = len(lines)
        time.sleep(1 / _UPDATE_HZ)
    if not out.isatty():
        out.write("".join(f"{line}\n" for line in lines))
    return summaries


def devices_command(seconds: float | None, as_json: bool, config_folder: Path | None = None) -> dict[str, Any]:
    """Runs the command: prints the list or the live test, and returns the summary for `--json`."""
    gamepads = open_gamepads(config_folder)
    calibrations = CalibrationStore(config_folder or user_config_folder())
    devices = list_devices(gamepads, calibrations)
    if not as_json:
        print("\n".join(table_lines(devices)))
    if seconds is None:
        return {"devices": devices} if as_json else {}
    summaries = show_input(gamepads, calibrations, seconds, sys.stderr if as_json else sys.stdout)
    return {"devices": devices, "test": summaries} if as_json else {}


def _add_sample(summaries: dict[int, dict[str, Any]], gamepad: Gamepad, sample: InputSample) -> None:
    new = {"name": gamepad.name, "axes": [], "buttons": [], "readings": 0, "unplugged": False}
    summary = summaries.setdefault(gamepad.instance_id, new)
    summary["readings"] += 1
    ranges = summary["axes"] or [[value, value] for value in sample.axes]
    summary["axes"] = [
        [round(min(low, value), 3), round(max(high, value), 3)]
        for (low, high), value in zip(ranges, sample.axes, strict=True)
    ]
    pressed = {index for index, down in enumerate(sample.buttons) if down}
    summary["buttons"] = sorted(pressed | set(summary["buttons"]))


def _gamepad_lines(gamepad: Gamepad, sample: InputSample, calibration: StickCalibration) -> list[str]:
    x, y = gamepad.force(sample, calibration)
    header = f"{gamepad.instance_id}: {gamepad.name}   force {x:+.2f} {y:+.2f}"
    lines = [header, f"  {_description(gamepad, calibration)}"]
    lines += [f"  axis {index:<3} {_bar(value)} {value:+.2f}" for index, value in enumerate(sample.axes)]
    for hat in range(gamepad.hats):
        right, down = sample.directions[2 * hat : 2 * hat + 2]
        lines.append(f"  hat {hat:<4} {right:+.0f} {down:+.0f}")
    pressed = " ".join(str(index) for index, down in enumerate(sample.buttons) if down)
    return [*lines, f"  buttons  {pressed or '-'}"]


def _description(gamepad: Gamepad, calibration: StickCalibration) -> str:
    buttons = "buttons known" if gamepad.mapping.is_known else "buttons unknown: set them up in the lobby of play"
    steering = "cannot steer: no stick, no d-pad"
    if gamepad.steering_options:
        steering = f"steers with: {gamepad.steering(calibration).label}"
    return f"{steering}; {buttons}"


def _bar(value: float) -> str:
    middle = _BAR // 2
    end = middle + round(max(-1.0, min(1.0, value)) * middle)
    low, high = sorted((middle, end))
    return "[" + "".join("#" if low <= index <= high else " " for index in range(_BAR)) + "]"
