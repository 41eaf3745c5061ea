"""Episodes of a policy with a simulated partner, and their images; reproducible, in simulated time."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from copolicy.dataset.task import PairTask, SceneView, get_task

from ..agents import Policy, PolicyAgent, ScriptedAgent
from ..episodes import episode_from_trace
from ..replay.frames import LAST_FRAME_S
from ..replay.track import Track, frame_positions, track_from_episode
from ..rollout import Rollout, Trace
from ..screen.canvas import Canvas, new_surface
from ..screen.dialogs import outcome_colour, outcome_text
from ..screen.outline_view import scene_view
from ..screen.palette import MUTED, TEXT
from ..sdl import pygame

SIZE = (1200, 690)
"""Width and height of an image in canvas units."""

_WORLD = (0, 0, 1200, 600)
_CAPTION_Y = 646
_TRAIL_STRIDE = 3  # steps


def demonstrate(
    policy: Policy,
    scenario: Any,
    partner: str = "S01",
    seed: int = 0,
    settings: Any = None,
    task: PairTask | None = None,
) -> Track:
    """Runs an episode of a policy at the robot's seat and a simulated partner to its end.

    The agent requests chunks as in real time, but each step waits for the pending chunk, so that the result does not
    depend on the speed of the machine.

    Args:
        policy: at the robot's seat.
        scenario: of the task.
        partner: name of a simulated pair, whose player at the human's seat is the partner.
        seed: of the policy and of the partner.
        settings: of the world; the task's default if None.
        task: the table if None.

    Raises:
        InvalidValueError: the policy learned another task.
    """
    task = task or get_task()
    robot, human = PolicyAgent(policy, task, real_time=True), ScriptedAgent.from_pair(partner, task)
    try:
        rollout = Rollout(task, [scenario], (robot, human), seeds=[seed], settings=settings)
        trace = Trace(rollout)
        while len(rollout.running):
            robot.wait()
            rollout.step()
    finally:
        robot.close()
    episode = episode_from_trace(rollout, trace, 0, scenario, seed, settings)
    return track_from_episode(Path(task.name_of(scenario).scenario), episode)


def draw_images(track: Track, size: tuple[int, int], images_per_second: int, speed: float) -> Iterator[pygame.Surface]:
    """Draws the images of an episode in order, all on the same surface.

    Args:
        track: the episode.
        size: width and height of the surface, px.
        images_per_second: of the video.
        speed: times real time.
    """
    surface = new_surface(size)
    view = scene_view(track.task, track.episode.scenario)
    positions = frame_positions(track, images_per_second, speed)
    for position in [*positions, *[positions[-1]] * round(LAST_FRAME_S * images_per_second)]:
        _draw(surface, view, track, position, speed)
        yield surface


def _draw(surface: pygame.Surface, view: SceneView, track: Track, position: float, speed: float) -> None:
    canvas = Canvas(surface, SIZE)
    canvas.clear()
    pose = track.pose_at(position)
    trail = [*track.poses[: int(position) + 1 : _TRAIL_STRIDE], pose]
    view.draw(surface, canvas.rect(*_WORLD), pose, track.forces_at(position), trail)
    # These font sizes are readable in a GIF of 600 px, which shows them at half the size.
    canvas.seat_mark(0, 40, _CAPTION_Y, 20)
    canvas.text("robot", (72, _CAPTION_Y - 16), 36, TEXT, "midleft")
    canvas.text(track.episode.meta.controller_0, (72, _CAPTION_Y + 18), 28, MUTED, "midleft", 400)
    ended = position >= track.steps
    reason = track.episode.meta.termination_reason
    if ended:
        canvas.text(outcome_text(reason), (600, _CAPTION_Y), 48, outcome_colour(track.task.spec, reason), "center")
    else:
        canvas.text(f"{position / track.hz:.0f} s", (600, _CAPTION_Y - 10), 44, TEXT, "center")
        canvas.text(f"{speed:g}x", (600, _CAPTION_Y + 26), 26, MUTED, "center")
    canvas.text("simulated partner", (1128, _CAPTION_Y - 16), 36, TEXT, "midright")
    canvas.text("no person takes part", (1128, _CAPTION_Y + 18), 28, MUTED, "midright")
    canvas.seat_mark(1, 1160, _CAPTION_Y, 20)
