"""The state of a session that its phases share: players, folder, schedule, clock and messages."""

import uuid
from importlib.metadata import version
from typing import Any

import numpy as np

from copolicy.dataset.episode import EpisodeMeta
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.task import SceneView, get_task

from ..questionnaire import Questionnaire
from ..recording.wall_clock import WallClockAnchor
from ..rollout import Agent
from ..screen.hud import Hud, SeatStatus
from ..screen.outline_view import scene_view
from ..session import BalancedSchedule, SessionFolder
from ..ticker import MonotonicClock, Ticker
from .interludes import Interlude, Interludes
from .player import SeatedPlayer, replayed_scenario
from .roster import Roster
from .settings import PlaySettings
from .sounds import Sounds
from .trial import Trial

_TOAST_NS = 3 * 10**9


class Game:
    """The state of a session that its phases share.

    Attributes:
        task: that is played.
        roster: the players and their devices.
        schedule: of scenarios and seats.
        practice_left: practice episodes still to play.
        swapped: the players exchanged the seats that the schedule gave them.
        trial: the current or next episode.
        stop: why the session is to end; empty while it goes on.
        pause_reason: of the last pause, `player`, `device_lost` or `focus_lost`.
        problem: why the last recording or answer could not be written.
        interludes: questionnaires and breaks between blocks.
        results: outcome and verdict of every episode of this run.
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
        replayed = replayed_scenario(players)
        self.scenarios = settings.scenarios if replayed is None else (replayed,)
        # A policy was trained to act in the robot seat.
        seating = int([player.spec.kind == "policy" for player in players] == [False, True])
        self.schedule = BalancedSchedule(
            self.scenarios, settings.episodes, settings.seed, settings.pair, swap, seating, self.task
        )
        self.practice_left = 0 if folder.continued else settings.practice
        self.swapped = False
        self.trial: Trial | None = None
        self.stop = ""
        self.pause_reason = "player"
        self.problem = ""
        self.results: list[tuple[str, str]] = []
        self.interludes = Interludes(folder.path, settings.interludes())
        self._redo: tuple[Any, int] | None = None
        self._last_seating: int | None = None
        self._toast = ("", 0)
        self._view: tuple[Any, SceneView] | None = None

    def set_schedule(self, schedule: BalancedSchedule, robot: Agent) -> None:
        """Replaces the schedule and player a's agent; to be called before the first episode."""
        self.schedule, self.players[0].agent = schedule, robot

    @property
    def finished(self) -> bool:
        """The session has kept all its episodes, and all questions are answered."""
        complete = self.practice_left == 0 and self.kept >= self.settings.episodes
        return complete and self.open_questionnaire() is None

    @property
    def kept(self) -> int:
        """Number of kept episodes of the session."""
        return self.folder.counts.kept_in_session.total()

    def open_questionnaire(self) -> tuple[Interlude, Questionnaire] | None:
        """The questionnaire that is to be answered now, if there is one and somebody can answer."""
        return self.interludes.open_questionnaire(self.kept) if self.settings.answered_by() else None

    def next_trial(self) -> Trial:
        """Prepares the next episode: that of the schedule, or the last one again after a redo."""
        practice = self.practice_left > 0
        if self._redo is not None:
            scenario, seating = self._redo
        elif practice:
            scenario = self.schedule.practice(self.settings.practice - self.practice_left)
            seating = self.schedule.seating(self.folder.counts)
        else:
            scenario, seating = self.schedule.next(self.folder.counts)
        self.trial = trial = self._make_trial(scenario, seating, practice)
        if self._last_seating not in (None, trial.seating):
            self.show_message("You have changed seats: check your colour")
        self._last_seating = trial.seating
        return trial

    def exchange_seats(self) -> bool:
        """Swaps the seats of the players, in the next episode and all later ones; False where seats are fixed."""
        if not self.settings.may_exchange_seats:
            self.show_message("the study fixes the seats")
            return False
        self.swapped = not self.swapped
        self.folder.journal("swap", swapped=self.swapped)
        if self.trial is not None and not self.trial.began:
            self.trial = self._make_trial(self.trial.scenario, self._scheduled_seating, self.trial.practice)
        return True

    def _make_trial(self, scenario: Any, scheduled_seating: int, practice: bool) -> Trial:
        self._scheduled_seating = scheduled_seating
        seating = scheduled_seating ^ self.swapped
        robot, human = self.players[seating], self.players[1 - seating]
        attempt = len(self.results) + self.folder.counts.attempted.total()
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
            **self.task.name_of(scenario).columns,
            seed=int(np.random.SeedSequence(entropy).generate_state(1)[0]),
            source="human" if robot.person or human.person else "simulated",
            consent_id=",".join(consents),
            license=self.settings.license,
            software_version=version("lerobot_policy_copolicy"),
        )
        agents = (robot.agent, human.agent)
        return Trial(
            self.folder.next_path(), self.task, scenario, seating, agents, meta, self.anchor,
            self.settings.world_settings, practice, self.schedule.planned, self.clock,
        )  # fmt: skip

    def close_trial(self, verdict: str, reason: str = "") -> None:
        """Completes the recording of the episode with a verdict: `keep`, `redo` or `discard`.

        Raises:
            OSError: the recording cannot be written.
        """
        trial = self.trial
        assert trial is not None
        if trial.outcome.done:
            trial.finish(verdict != "keep", reason)
        else:
            trial.interrupt("operator_discard", reason)
        self._count_trial(trial, verdict, reason)
        # A fixed order leads to the same episode again, and after an undo to the one before.
        again = verdict == "redo" and not self.schedule.in_order
        self._redo = (trial.scenario, trial.seating ^ self.swapped) if again else None

    def end_trial(self, reason: str) -> None:
        """Completes the recording of the current episode when the session ends; keeps it if it has an outcome.

        Raises:
            OSError: the recording cannot be written.
        """
        trial = self.trial
        if trial is None or not trial.began:
            self.trial = None
            return
        if trial.outcome.done:
            trial.finish()
            self._count_trial(trial, "keep", reason)
        else:
            termination = reason if reason in ("device_lost", "focus_lost") else "operator_discard"
            trial.interrupt(termination, reason)
            self._count_trial(trial, "discard", reason)

    def abandon_trial(self, error: OSError) -> None:
        """Drops an episode that could not be written; sets `problem`."""
        trial = self.trial
        self.trial = None
        if trial is not None and trial.began:
            trial.abandon(error)
        self.results.append(("unwritten", "lost"))
        self.problem = error.strerror or str(error)

    def undo(self) -> None:
        """Undoes the last keep and shows a message."""
        try:
            undone = self.folder.undo_last_keep()
        except OSError as error:
            self.show_message(f"not undone: {error.strerror}")
            return
        repeated = f"its {self.task.words.scenario} will be repeated"
        self.show_message(f"undone: {undone.path.name}; {repeated}" if undone else "nothing to undo")

    def storage_error(self) -> RunError:
        """Returns the error for a recording or an answer that could not be written."""
        return RunError(
            f"{self.folder.path}: expected space for recordings and answers, found: {self.problem}; "
            "finished episodes and saved answers are complete, an unfinished episode is kept as .part"
        )

    def _count_trial(self, trial: Trial, verdict: str, reason: str) -> None:
        self.trial = None
        self.results.append((trial.outcome.reason or "interrupted", verdict))
        if trial.practice:
            self.practice_left -= verdict != "redo" and trial.outcome.done
        else:
            self.folder.count(trial.meta.map_id, trial.seating, verdict == "keep")
            if verdict == "keep":
                self.interludes.kept(self.kept)
        self.folder.journal(
            verdict, file=trial.path.name, outcome=trial.outcome.reason or "interrupted", reason=reason,
            practice=trial.practice,
        )  # fmt: skip

    def seats(self, trial: Trial | None = None) -> tuple[SeatedPlayer, SeatedPlayer]:
        """Returns the players of the robot seat and the human seat, of an episode or by the schedule."""
        seating = trial.seating if trial else self.schedule.seating(self.folder.counts) ^ self.swapped
        return self.players[seating], self.players[1 - seating]

    def describe_devices(self, trial: Trial) -> dict[str, str]:
        """Returns the entries of the recording's metadata record `devices`."""
        return {
            f"seat_{seat}_{key}": text
            for seat, player in enumerate(self.seats(trial))
            for key, text in player.describe().items()
        }

    def show_message(self, text: str) -> None:
        """Shows a short message for three seconds."""
        self._toast = (text, self.clock() + _TOAST_NS)

    @property
    def toast(self) -> str:
        """The message to show now; empty if there is none."""
        return self._toast[0] if self.clock() < self._toast[1] else ""

    def view(self, scenario: Any) -> SceneView:
        """Returns the view of a scenario, cached for the last one."""
        if self._view is None or self._view[0] != scenario:
            self._view = scenario, scene_view(self.task, scenario)
        return self._view[1]

    def hud(self, trial: Trial, running: bool = True) -> Hud:
        """Returns the content of the bars around the world, for a running or a coming episode."""
        kept, episodes = self.folder.counts.kept_in_session.total(), self.settings.episodes
        position = f"episode {min(kept + 1, episodes)} of {episodes}"
        if trial.practice:
            position = f"practice, {self.practice_left} left"
        forces = (trial.forces[:2], trial.forces[2:])
        statuses = [
            SeatStatus(player.label if running else f"{player.player_id}: {player.label}", force, player.lacks_device)
            for player, force in zip(self.seats(trial), forces, strict=True)
        ]
        return Hud(
            title=f"{self.settings.pair}   {position}",
            progress=kept / episodes,
            seconds=trial.seconds,
            limit_s=trial.step_limit / self.task.spec.record_hz,
            score=trial.score,
            seats=(statuses[0], statuses[1]),
            interaction=trial.interaction,
            interaction_senses=self.task.words.interaction_senses,
            interaction_missing=self.task.missing("interaction measure"),
            late_ticks=trial.loop.late + trial.loop.skipped,
            hz=trial.loop.achieved_hz,
            practice=trial.practice,
            running=running,
        )
