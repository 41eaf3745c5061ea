"""The playback of a replay: position, speed, and whether it is playing."""

from dataclasses import dataclass

from copolicy.dataset.task_spec import RECORD_HZ

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""The speeds of a replay, times real time."""


@dataclass
class Playback:
    """The position in an episode and how it changes.

    Attributes:
        steps: length of the episode.
        position: in [0, `steps`]; fractions lie between two states.
        speed: one of `SPEEDS`.
        playing: the position advances with time.
        hz: steps per second.
    """

    steps: int
    position: float = 0.0
    speed: float = 1.0
    playing: bool = True
    hz: int = RECORD_HZ

    def advance(self, seconds: float) -> None:
        """Advances by an amount of real time; stops at the end."""
        if self.playing:
            self.seek(self.position + seconds * self.hz * self.speed)
            self.playing = self.position < self.steps

    def seek(self, position: float) -> None:
        """Goes to a position, limited to the episode."""
        self.position = min(float(self.steps), max(0.0, position))

    def step(self, count: int) -> None:
        """Pauses, and goes some whole steps forward or back."""
        self.playing = False
        # Between two states, one step back is the earlier state and one step forward the later.
        base = int(self.position) if count > 0 else -int(-self.position // 1)
        self.seek(base + count)

    def toggle(self) -> None:
        """Plays or pauses; at the end, plays from the beginning."""
        if not self.playing and self.position >= self.steps:
            self.position = 0.0
        self.playing = not self.playing

    def change_speed(self, by: int) -> None:
        """Changes to another speed of `SPEEDS`, by a number of entries."""
        index = SPEEDS.index(self.speed) + by
        self.speed = SPEEDS[min(len(SPEEDS) - 1, max(0, index))]
