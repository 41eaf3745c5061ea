"""What simulated pairs do: success, time, routes beside people's, disagreement, leading, pauses, slips, clearance.

    uv run python tests/benchmarks/simulated_pairs.py                           records pairs-sim-376 for it, minutes
    uv run python tests/benchmarks/simulated_pairs.py --recordings recordings/pairs-sim-376

The profiles of the players were tuned on these very aggregates (time, clearance, shares of the human route labels), so
agreement with people is a fit, not a finding; nothing here was measured on people but the labels.

The chosen routes are read by letting the players act once more on the recorded states; their actions must come out bit
for bit, so recordings of other players are refused.
"""

import argparse
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from copolicy.collect.simulate.command import simulate
from copolicy.collect.simulate.recipes import RECIPES, Recipe
from copolicy.dataset import clock
from copolicy.dataset.command_line.commands import progress
from copolicy.dataset.episode import Episode
from copolicy.dataset.recording.reader import read_episode
from copolicy.dataset.statistics.estimate import Estimate
from copolicy.dataset.statistics.leadership import leadership_statistics
from copolicy.dataset.statistics.resampling import Bootstrap
from copolicy.dataset.statistics.trajectories import EpisodeRow, Trajectories
from copolicy.dataset.task_spec import RECORD_HZ
from copolicy.tasks.table.agents import simulated_pair
from copolicy.tasks.table.agents.clearance import square_clearance
from copolicy.tasks.table.features import theta_of
from copolicy.tasks.table.statistics.human_routes import human_distance

FPS = 10
QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Carried:
    """One episode with the routes that its players chose at the start."""

    episode: Episode
    chosen: tuple[str, str]
    changes: tuple[int, int]
    pauses: int
    slips: int

    @property
    def disagreed(self) -> bool:
        """Whether the two began with different routes."""
        return self.chosen[0] != self.chosen[1]

    @property
    def clearance(self) -> float:
        """Least distance between the table and an obstacle, px; of the solid that planning uses."""
        x, y, _, _, *_ = self.episode.states.T
        theta, config = theta_of(self.episode.states), self.episode.map_config
        return min(
            float(square_clearance(x, y, theta, centre, config.obstacle_size).min()) for centre in config.obstacles
        )


def carried(path: Path, recipe: Recipe) -> Carried:
    """An episode, with the routes and changes of its players, who act once more on the recorded states."""
    episode = read_episode(path)
    players = simulated_pair(episode.map_config, episode.meta.pair_id, episode.meta.seed, recipe.clearance)
    chosen = (players[0].route_choice.route.sides, players[1].route_choice.route.sides)
    repeated = np.array([np.concatenate([player.act(state) for player in players]) for state in episode.states])
    if not np.array_equal(repeated, episode.actions):
        raise SystemExit(f"{path}: expected actions of the players of this version and recipe, found others")
    changes = (players[0].route_choice.changes, players[1].route_choice.changes)
    pauses, slips = (sum(getattr(player.motor_noise, name) for player in players) for name in ("pauses", "slips"))
    return Carried(episode, chosen, changes, pauses, slips)


def frames(episodes: list[Episode]) -> Trajectories:
    """As a data set has them, 10 frames a second."""
    trips = [(clock.frame_states(e.states, FPS), clock.frame_actions(e.actions, FPS)) for e in episodes]
    rows = [
        EpisodeRow(
            e.meta.episode_uuid, e.meta.pair_id, e.meta.map_id, e.meta.source, e.meta.success, e.meta.duration_s,
            e.map_config,
        )
        for e in episodes
    ]  # fmt: skip
    return Trajectories.from_episodes(trips, rows, FPS)


def report(name: str, runs: list[Carried]) -> None:
    """Prints the table."""
    episodes = [run.episode for run in runs]
    minutes = sum(len(e.actions) for e in episodes) / RECORD_HZ / 60
    good = [e for e in episodes if e.meta.success]
    steps = np.array([len(e.actions) for e in good])
    ends = Counter(e.meta.termination_reason for e in episodes)
    speed = np.concatenate([np.hypot(e.states[:, 4], e.states[:, 5]) for e in episodes])
    disagreed = [run for run in runs if run.disagreed]
    clearance = np.quantile([run.clearance for run in runs], QUANTILES)
    print(f"\n{name}: {len(runs)} episodes of simulated pairs, no person took part; profiles tuned on these aggregates")
    _line("success", f"{100 * len(good) / len(runs):.1f} %; " + ", ".join(f"{k} {v}" for k, v in ends.most_common()))
    _line("steps of successes", f"{steps.mean():.0f} ± {steps.std(ddof=1):.0f} of 1/{RECORD_HZ} s ({_range(steps)})")
    _line("speed", f"mean {speed.mean():.1f} px/s, 95 % below {np.quantile(speed, 0.95):.1f}")
    nearest = ", ".join(f"{q:.0%} {c:.1f}" for q, c in zip(QUANTILES, clearance, strict=True))
    _line("nearest to an obstacle", f"{nearest} px (quantiles over episodes)")
    data = frames(episodes)
    for key, estimate in human_distance(data, np.random.default_rng(0)).items():
        _line(f"routes, {key.split('_')[2]} obstacle(s)", _routes(estimate))
    _line("began with different routes", f"{100 * len(disagreed) / len(runs):.1f} % of episodes")
    _line("changes of mind", _changes(runs, disagreed))
    bootstrap = Bootstrap(data.pairs, 1000, np.random.default_rng(0))
    for key, estimate in leadership_statistics(data, bootstrap, np.random.default_rng(1)).items():
        _line(key.replace("_", " "), _against_null(estimate))
    for what in ("pauses", "slips"):
        count = sum(getattr(run, what) for run in runs)
        _line(what, f"{count / len(runs):.2f} an episode, {count / minutes / 2:.2f} a minute and player")


def _line(name: str, text: str) -> None:
    print(f"{name:<30} {text}")


def _range(values: np.ndarray) -> str:
    low, high = np.quantile(values, (0.05, 0.95))
    return f"90 % of them {low:.0f} to {high:.0f}"


def _changes(runs: list[Carried], disagreed: list[Carried]) -> str:
    robot, human = np.sum([run.changes for run in runs], axis=0)
    yielded = sum(sum(run.changes) > 0 for run in disagreed)
    return (
        f"{(robot + human) / len(runs):.2f} an episode ({robot} of the robot seat, {human} of the human seat); "
        f"after disagreeing {100 * yielded / max(len(disagreed), 1):.0f} % have one or more"
    )


def _routes(estimate: Estimate) -> str:
    if estimate.value is None or estimate.interval is None or estimate.null is None:
        return f"- ({estimate.note})"
    details = estimate.details
    counts = " ".join(f"{word} {count}" for word, count in details["counts"].items())
    return (
        f"{estimate.value:.3f} [{estimate.interval[0]:.3f}, {estimate.interval[1]:.3f}] bits, labels "
        f"{details['reading']} (as labelled {details['as_labelled_bits']:.3f}, mirrored "
        f"{details['mirrored_bits']:.3f}); same shares would give up to {estimate.null.high:.3f}; {counts}"
    )


def _against_null(estimate: Estimate) -> str:
    if estimate.value is None or estimate.interval is None or estimate.null is None:
        return f"- ({estimate.note})"
    null = estimate.null
    return (
        f"{estimate.value:.3g} [{estimate.interval[0]:.3g}, {estimate.interval[1]:.3g}]"
        f"{'' if estimate.unit == '1' else ' ' + estimate.unit}; by chance {null.mean:.3g} [{null.low:.3g}, "
        f"{null.high:.3g}], p = {null.p:.2g}"
    )


def main() -> None:
    """Records, unless there are recordings, and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipe", choices=sorted(RECIPES), default="pairs-sim-376")
    parser.add_argument("--recordings", type=Path, help="of the recipe; by default they are made for it")
    arguments = parser.parse_args()
    recipe = RECIPES[arguments.recipe]
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.recordings or Path(temporary)
        if arguments.recordings is None:
            simulate(folder, **vars(recipe))
        files = sorted(folder.glob("*.mcap"))
        if not files:
            raise SystemExit(f"{folder}: expected recordings, found none")
        runs = [carried(path, recipe) for path in progress(files, len(files), "episodes")]
    report(arguments.recipe, runs)


if __name__ == "__main__":
    main()
