"""Steps per second of the table world, alone and on all holdout maps, beside rotating and comparing sprite masks.

uv run python tests/benchmarks/world.py
"""

import itertools
import math
import os
import statistics
import time

import numpy as np

os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import pygame

from copolicy.tasks.table.agents import simulated_pair
from copolicy.tasks.table.geometry import BOARD, BOARD_CORNER_RADIUS, CIRCLE_CENTRE, CIRCLE_RADIUS, IMAGE_SIZE, TRIANGLE
from copolicy.tasks.table.map_config import MapConfig
from copolicy.tasks.table.maps import MAP_SETS
from copolicy.tasks.table.physics import GOAL_SIZE
from copolicy.tasks.table.world import TableWorld

STEPS = 40_000
ROUNDS = 5


def carried(config: MapConfig) -> list[np.ndarray]:
    """The actions of one episode of simulated players on a map: free stretches and narrow ones as they come."""
    world, pilots = TableWorld(config), simulated_pair(config, "S01", 0)
    actions = []
    done = False
    while not done:
        actions.append(np.concatenate([pilot.act(world.observation) for pilot in pilots]))
        done = world.step(actions[-1]).done
    return actions


def steps_per_second(episodes: list[tuple[MapConfig, list[np.ndarray]]]) -> float:
    """Steps of all worlds together, in turns, each reset where its episode ends."""
    worlds = [(TableWorld(config), itertools.cycle(actions)) for config, actions in episodes]
    rounds = max(1, STEPS // len(worlds))
    begin = time.perf_counter()
    for _ in range(rounds):
        for world, actions in worlds:
            if world.step(next(actions)).done:
                world.reset()
    return rounds * len(worlds) / (time.perf_counter() - begin)


class MaskTable:
    """The same verdict the slow way: turn the picture, build its mask, compare it with the masks of the squares."""

    def __init__(self, config: MapConfig):
        width, height = IMAGE_SIZE
        self.picture = pygame.Surface(IMAGE_SIZE, pygame.SRCALPHA)
        white = pygame.Color("white")
        middle = (width / 2, height / 2)
        centre = (CIRCLE_CENTRE[0] + middle[0], CIRCLE_CENTRE[1] + middle[1])
        left, top, right, bottom = BOARD
        board = pygame.Rect(left + middle[0], top + middle[1], right - left, bottom - top)
        pygame.draw.circle(self.picture, white, centre, CIRCLE_RADIUS)
        pygame.draw.rect(self.picture, white, board, border_radius=int(BOARD_CORNER_RADIUS))
        pygame.draw.polygon(self.picture, white, [(u + middle[0], v + middle[1]) for u, v in TRIANGLE])
        squares = [(centre, config.obstacle_size) for centre in config.obstacles] + [(config.goal, GOAL_SIZE)]
        self.squares = [
            (pygame.mask.Mask((size, size), fill=True), int(x - size / 2), int(y - size / 2))
            for (x, y), size in squares
        ]

    def contact(self, pose: tuple[float, float, float]) -> bool:
        """Whether any square is touched."""
        turned = pygame.transform.rotate(self.picture, math.degrees(pose[2]))
        mask = pygame.mask.from_surface(turned)
        width, height = mask.get_size()
        left, top = int(pose[0]) - width // 2, int(pose[1]) - height // 2
        return any(mask.overlap(square, (x - left, y - top)) is not None for square, x, y in self.squares)


def mask_steps_per_second(config: MapConfig, actions: list[np.ndarray]) -> float:
    """Steps of one world whose contacts are found with masks; the dynamics are the same code."""
    world, masks = TableWorld(MapConfig(config.start, config.goal)), MaskTable(config)
    begin = time.perf_counter()
    for action in actions:
        done = world.step(action).done
        if masks.contact(world.pose) or done:
            world.reset()
    return len(actions) / (time.perf_counter() - begin)


def main() -> None:
    """Prints the medians of five interleaved rounds."""
    episodes = [(config, carried(config)) for config in MAP_SETS["holdout"]]
    crowded = next(episode for episode in episodes if len(episode[0].obstacles) == 3)
    measures = {
        "one world": lambda: steps_per_second([crowded]),
        f"{len(episodes)} worlds (holdout), in turns": lambda: steps_per_second(episodes),
        "one world with sprite masks": lambda: mask_steps_per_second(*crowded),
    }
    samples: dict[str, list[float]] = {name: [] for name in measures}
    for _ in range(ROUNDS):
        for name, measure in measures.items():
            samples[name].append(measure())
    median = {name: statistics.median(values) for name, values in samples.items()}
    for name, value in median.items():
        print(f"{name:<36} {value:>10,.0f} steps/s  (best {max(samples[name]):,.0f})")
    print(f"{'ratio to sprite masks':<36} {median['one world'] / median['one world with sprite masks']:>10.0f}")


if __name__ == "__main__":
    main()
