"""What all phases of a session share: the players, the folder, the schedule, the clock, what the screen needs."""

import uuid
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import SceneView, get_task

from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent
from ..screen.hud import Hud, SeatStatus
from ..screen.outline_view import scene_view
from ..session import Balance, SessionFolder
from ..ticker import MonotonicClock, Ticker
from .player import Player, replayed_map
from .roster import Roster
from .settings import PlaySettings
from .sounds import Sounds
from .trial import Trial

_TOAST_NS = 3 * 10**9


class Game:
    """The state of a session that outlives its phases.

    Attributes:
        task: that is played.
        roster: the players and what they hold.
        swapped: the players changed the seats that the schedule gave them.
        trial: the episode that is played or about to be.
        stop: why the session is to end; empty while it goes on.
        pause_reason: of the last pause, `player`, `device_lost` or `focus_lost`.
        problem: why the last recording could not be written.
        toast: a short message for the screen.
        results: outcome of every episode of this run, by its verdict.
    """

    def __init__(
        self,
        settings: PlaySettings,
        roster: Roster,
        folder: SessionFolder,
        sounds: Sounds,
        clock: MonotonicClock,
    ):
        self.settings = settings
        self.task = get_task(settings.task)
        self.roster = roster
        self.players = players = roster.players
        self.folder = folder
        self.sounds = sounds
        self.clock = clock
        self.ticker = Ticker(clock, self.task.spec.record_hz)
        self.anchor = WallClockAnchor.now()
        people = all(player.person for player in players)
        swap = people if settings.swap_seats is None else settings.swap_seats
        replayed = replayed_map(players)
        self.maps = settings.map_configs() if replayed is None else (replayed,)
        # A policy learned the robot's half of the plans, and to listen to the human's.
        robot = int([player.spec.kind == "policy" for player in players] == [False, True])
        self.balance = Balance(self.maps, settings.episodes, settings.seed, settings.pair, swap, robot, self.task)
        self.practice_left = 0 if folder.continued else settings.practice
        self.swapped = False
        self.trial: Trial | None = None
        self.stop = ""
        self.pause_reason = "player"
        self.problem = ""
        self.results: list[tuple[str, str]] = []
        self._again: tuple[Any, int] | None = None
        self._last_seating: int | None = None
        self._toast = ("", 0)
        self._view: tuple[Any, SceneView] | None = None

    # The schedule.

    def play_by(self, balance: Balance, robot: Agent) -> None:
        """Plays by another schedule, with an agent at the robot's seat; before the first episode."""
        self.balance, self.players[0].agent = balance, robot

    @property
    def finished(self) -> bool:
        """The session has kept all it was to keep."""
        return self.practice_left == 0 and self.folder.counts.kept_here.total() >= self.settings.episodes

    def next_trial(self) -> Trial:
        """Prepares the next episode of the schedule, or the same again after a redo."""
        practice = self.practice_left > 0
        if self._again is not None:
            config, seating = self._again
        elif practice:
            config = self.balance.practice(self.settings.practice - self.practice_left)
            seating = self.balance.seating(self.folder.counts)
        else:
            config, seating = self.balance.next(self.folder.counts)
        self.trial = trial = self._make_trial(config, seating, practice)
        if self._last_seating not in (None, trial.seating):
            self.say("You have changed seats: look at your colours")
        self._last_seating = trial.seating
        return trial

    def reseat(self) -> None:
        """Swaps the seats of the players, for the episode that is about to begin and the rest of the block."""
        self.swapped = not self.swapped
        self.folder.journal("swap", swapped=self.swapped)
        if self.trial is not None and not self.trial.began:
            self.trial = self._make_trial(self.trial.map_config, self._planned, self.trial.practice)

    def _make_trial(self, config: Any, planned: int, practice: bool) -> Trial:
        self._planned = planned
        seating = planned ^ self.swapped
        robot, human = self.players[seating], self.players[1 - seating]
        attempt = len(self.results) + self.folder.counts.tried.total()
        entropy = [self.settings.seed, *self.settings.pair.encode(), *self.folder.session_id.encode(), attempt]
        consents = [player.consent for player in (robot, human) if player.consent]
        meta = EpisodeMeta(
            episode_uuid=str(uuid.uuid4()),
            session_id=self.folder.session_id,
            pair_id=self.settings.pair,
            player_0_id=robot.player_id,
            player_1_id=human.player_id,
            controller_0=robot.agent.name,
            controller_1=human.agent.name,
            **self.task.name_of(config).columns,
            seed=int(np.random.SeedSequence(entropy).generate_state(1)[0]),
            source="human" if robot.person or human.person else "simulated",
            consent_id=",".join(consents),
            license=self.settings.license,
            software_version=version("lerobot_policy_copolicy"),
        )
        agents = (robot.agent, human.agent)
        return Trial(
            self.folder.next_path(), self.task, config, seating, agents, meta, self.anchor, self.settings.physics,
            practice, self.clock,
        )  # fmt: skip

    # Verdicts.

    def close_trial(self, verdict: str, reason: str = "") -> None:
        """Completes the recording of the episode: `keep`, `redo` or `discard`.

        Raises:
            OSError: it cannot be written.
        """
        trial = self.trial
        assert trial is not None
        if trial.outcome.done:
            trial.finish(verdict != "keep", reason)
        else:
            trial.interrupt("operator_discard", reason)
        self._closed(trial, verdict, reason)
        self._again = (trial.map_config, trial.seating ^ self.swapped) if verdict == "redo" else None

    def break_off(self, reason: str) -> None:
        """Ends the running episode in order, since the session ends: one that had its outcome is kept as it is.

        Raises:
            OSError: it cannot be written.
        """
        trial = self.trial
        if trial is None or not trial.began:
            self.trial = None
            return
        if trial.outcome.done:
            trial.finish()
            self._closed(trial, "keep", reason)
        else:
            termination = reason if reason in ("device_lost", "focus_lost") else "operator_discard"
            trial.interrupt(termination, reason)
            self._closed(trial, "discard", reason)

    def lose_trial(self, error: OSError) -> None:
        """Lets go of an episode that could not be written; `problem` says why."""
        trial = self.trial
        self.trial = None
        if trial is not None and trial.began:
            trial.abandon(error)
        self.results.append(("unwritten", "lost"))
        self.problem = error.strerror or str(error)

    def undo(self) -> None:
        """Takes the last keep back and says so."""
        try:
            undone = self.folder.undo_last_keep()
        except OSError as error:
            self.say(f"not undone: {error.strerror}")
            return
        self.say(f"undone: {undone.path.name}; its map comes again" if undone else "nothing to undo")

    def no_room(self) -> RunError:
        """What to tell where nobody can be asked what to do."""
        return RunError(
            f"{self.folder.path}: expected room for a recording, found: {self.problem}; "
            "finished episodes are complete, what there is of this one stays as .part"
        )

    def _closed(self, trial: Trial, verdict: str, reason: str) -> None:
        self.trial = None
        self.results.append((trial.outcome.reason or "interrupted", verdict))
        if trial.practice:
            self.practice_left -= verdict != "redo" and trial.outcome.done
        else:
            self.folder.count(trial.meta.map_id, trial.seating, verdict == "keep")
        self.folder.journal(
            verdict, file=trial.path.name, outcome=trial.outcome.reason or "interrupted", reason=reason,
            practice=trial.practice,
        )  # fmt: skip

    # The seats.

    def seats(self, trial: Trial | None = None) -> tuple[Player, Player]:
        """Who sits on the robot's and on the human's seat."""
        seating = trial.seating if trial else self.balance.seating(self.folder.counts) ^ self.swapped
        return self.players[seating], self.players[1 - seating]

    def describe_devices(self, trial: Trial) -> dict[str, str]:
        """For the recording's record `devices`."""
        return {
            f"seat_{seat}_{key}": text
            for seat, player in enumerate(self.seats(trial))
            for key, text in player.describe().items()
        }

    # The screen.

    def say(self, text: str) -> None:
        """Shows a short message for three seconds."""
        self._toast = (text, self.clock() + _TOAST_NS)

    @property
    def toast(self) -> str:
        """The message that is to be shown now."""
        return self._toast[0] if self.clock() < self._toast[1] else ""

    def view(self, config: Any) -> SceneView:
        """The view of a map, kept as long as the map is the same."""
        if self._view is None or self._view[0] != config:
            self._view = config, scene_view(self.task, config)
        return self._view[1]

    def title(self, trial: Trial) -> str:
        """Where the session is."""
        if trial.practice:
            return f"{self.settings.pair}   practice, {self.practice_left} left"
        kept = self.folder.counts.kept_here.total()
        return f"{self.settings.pair}   episode {min(kept + 1, self.settings.episodes)} of {self.settings.episodes}"

    def hud(self, trial: Trial, carrying: bool = True) -> Hud:
        """What the bars show of an episode, or of one that is about to begin."""
        robot, human = self.seats(trial)
        forces = ((trial.forces[0], trial.forces[1]), (trial.forces[2], trial.forces[3]))
        statuses = [
            SeatStatus(player.label if carrying else f"{player.player_id}: {player.label}", force, player.missing)
            for player, force in zip((robot, human), forces, strict=True)
        ]
        return Hud(
            title=self.title(trial),
            done=self.folder.counts.kept_here.total() / self.settings.episodes,
            seconds=trial.seconds,
            limit_s=trial.step_limit / self.task.spec.record_hz,
            score=trial.score,
            seats=(statuses[0], statuses[1]),
            interaction=trial.interaction,
            senses=self.task.words.interaction_senses,
            missing=self.task.missing("interaction measure"),
            late=trial.loop.late + trial.loop.skipped,
            hz=trial.loop.achieved_hz,
            practice=trial.practice,
            carrying=carrying,
        )
