"""How well `copolicy-collect play` keeps its time, without a window and with one.

    python tests/benchmarks/loop.py                                  ten minutes headless, two in a window under Xvfb
    python tests/benchmarks/loop.py --headless-min 1 --window-min 0.5

Two virtual joysticks are moved 250 times a second. Each position is a code for the moment of its setting, so that
the recording itself tells how old the newest input was when its step was handed to the recorder (a stick that is
read once a step is up to 4 ms old then, since it was set; a stick that moves at a random moment waits half a step
more on average). Figures are of all episodes of a run together; pauses between episodes are no periods. On a machine
that is busy with other things they say more about that.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

_CODES = 20_000  # different positions of an axis, 4 ms apart: 80 s
_HZ = 250


def main() -> None:
    """Runs both, or as one of the two child processes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--headless-min", type=float, default=10.0, help="minutes without a window (default 10)")
    parser.add_argument("--window-min", type=float, default=2.0, help="minutes with a window (default 2)")
    parser.add_argument("--window", default="1200x760", help="size of the window (default 1200x760)")
    parser.add_argument("--child", choices=("headless", "window"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        minutes = arguments.headless_min if arguments.child == "headless" else arguments.window_min
        print(json.dumps(measure(minutes, arguments.child == "window", arguments.window)))
        return
    results = {"load_before": os.getloadavg()[0], "processors": len(os.sched_getaffinity(0))}
    if arguments.headless_min:
        results["headless"] = _child("headless", {"SDL_VIDEODRIVER": "dummy"})
    if arguments.window_min:
        if shutil.which("Xvfb") is None:
            print("Xvfb is not installed: the window is left out", file=sys.stderr)
        else:
            results["window"] = _in_xvfb()
    print(json.dumps(results, indent=2))


def _child(kind: str, environment: dict[str, str]) -> dict:
    done = subprocess.run(
        [sys.executable, *sys.argv, "--child", kind],
        env=os.environ | environment | {"SDL_AUDIODRIVER": "dummy"},
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    return json.loads(done.stdout)


def _in_xvfb() -> dict:
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "2600x1700x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            display = f":{pipe.readline().strip()}"
        return _child("window", {"DISPLAY": display, "SDL_VIDEODRIVER": "x11"})
    finally:
        server.terminate()
        server.wait()


def measure(minutes: float, windowed: bool, size: str) -> dict:
    """Plays for some minutes and reads the recordings."""
    from virtual_joystick import VirtualJoystick

    from copolicy.collect.play.application import Application
    from copolicy.collect.play.phase import NextPhase
    from copolicy.collect.play.session_run import prepared
    from copolicy.collect.play.settings import PlayerSpec, PlaySettings
    from copolicy.collect.sdl import pygame

    pygame.display.init()
    pads = [VirtualJoystick("Benchmark pad", axes=6), VirtualJoystick("Benchmark pad", axes=6)]
    width, height = (int(side) for side in size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        settings = PlaySettings(
            pair="bench", out=Path(folder) / "out", players=(PlayerSpec("joystick"), PlayerSpec("joystick")),
            episodes=100_000, headless=not windowed, window=(width, height), countdown_s=0.0, mute=True,
            config_folder=Path(folder),
        )  # fmt: skip
        with prepared(settings) as application:
            if windowed:
                for pad in application.game.roster.gamepads:
                    application.game.roster.assign(pad)
                application = Application(application.game, application._window, NextPhase.READY)
            hands = _Hands(application, pads, minutes * 60)
            hands.start()
            application.run()
            pictures = application.frames
        hands.join()
        return _read(settings.out, hands) | {"minutes": minutes, "pictures_a_second": round(pictures / minutes / 60, 1)}


class _Hands(threading.Thread):
    """Moves the sticks, answers what the window asks, and ends the run."""

    def __init__(self, application, pads, seconds: float):
        super().__init__(daemon=True)
        self.set_ns: dict[int, int] = {}
        self._application, self._pads, self._seconds = application, pads, seconds

    def run(self) -> None:
        game, pads = self._application.game, self._pads
        begin, count = time.monotonic(), 0
        while time.monotonic() - begin < self._seconds:
            count += 1
            phase = type(self._application.phase).__name__
            trial = game.trial
            y = trial.world.pose[1] if trial else 300.0
            for pad in pads:
                if not pad.is_open:
                    continue
                # Up and down, hitting nothing; still while there is a menu, which a stick would move in.
                push = 0.7 * np.sign(300.0 - y + 60 * np.sin(count / 200))
                pad.move(0.0, push if phase == "Running" else 0.0)
                pad.axis(4, 2 * (count % _CODES) / _CODES - 1)
            self.set_ns[count] = time.monotonic_ns()
            if phase in ("Ready", "ResultPhase", "Paused") and count % 50 == 0:
                pads[0].button(0, count % 100 == 0)
            time.sleep(max(0.0, begin + count / _HZ - time.monotonic()))
        game.stop = "end of the benchmark"


def _read(out: Path, hands: _Hands) -> dict:
    from mcap.reader import make_reader

    from copolicy.collect.ticker import DT_NS
    from copolicy.dataset.recording.messages.copolicy_pb2 import LoopTiming, PlayerInput

    periods, work, late, latency, skipped, steps = [], [], [], [], 0, 0
    counts = np.array(sorted(hands.set_ns))
    times = np.array([hands.set_ns[count] for count in counts])
    for path in sorted(out.rglob("*.mcap")):
        timings, inputs = [], []
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages(["/loop/timing", "/player/0/input"]):
                if channel.topic == "/loop/timing":
                    timings.append(LoopTiming.FromString(message.data))
                else:
                    inputs.append(PlayerInput.FromString(message.data))
        starts = [timing.start_ns for timing in timings]
        periods += np.diff(starts).tolist()
        work += [timing.work_ns for timing in timings]
        late += [timing.late_ns for timing in timings]
        skipped += sum(timing.skipped_ticks for timing in timings)
        steps += len(timings)
        for timing, one in zip(timings, inputs, strict=True):
            handed = timing.start_ns + timing.work_ns
            code = round((one.axes[4] + 1) / 2 * _CODES)
            newest = int(np.searchsorted(times, handed)) - 1
            for place in range(newest, max(-1, newest - 100), -1):
                if abs(counts[place] % _CODES - code) <= 1:
                    latency.append(handed - times[place])
                    break
    return {
        "steps": steps,
        "period_ms": _percentiles(periods),
        "late_ms": _percentiles(late),
        "work_ms": _percentiles(work),
        "input_to_record_ms": _percentiles(latency),
        "skipped_ticks": skipped,
        "periods_over_1.5_steps": int((np.array(periods) > 1.5 * DT_NS).sum()),
    }


def _percentiles(values: list[int]) -> dict[str, float]:
    p50, p99, most = np.percentile(np.array(values) / 1e6, (50, 99, 100))
    return {"p50": round(float(p50), 3), "p99": round(float(p99), 3), "max": round(float(most), 3)}


if __name__ == "__main__":
    main()
