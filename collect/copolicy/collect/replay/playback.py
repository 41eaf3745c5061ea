"""Where a replay stands: playing, paused, fast, slow, step by step, forward and back."""

from dataclasses import dataclass

from copolicy.dataset.task_spec import RECORD_HZ

SPEEDS = (0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""What a replay can be shown at, times real time."""


@dataclass
class Playback:
    """The position in an episode and how it moves.

    Attributes:
        steps: length of the episode.
        position: between 0 and `steps`; fractions lie between two states.
        speed: one of `SPEEDS`.
        playing: it moves by itself.
        hz: steps a second.
    """

    steps: int
    position: float = 0.0
    speed: float = 1.0
    playing: bool = True
    hz: int = RECORD_HZ

    def advance(self, seconds: float) -> None:
        """Lets real time pass; stops at the end."""
        if self.playing:
            self.seek(self.position + seconds * self.hz * self.speed)
            self.playing = self.position < self.steps

    def seek(self, position: float) -> None:
        """Goes to a position, or as near as there is one."""
        self.position = min(float(self.steps), max(0.0, position))

    def step(self, count: int) -> None:
        """Stops, and goes some whole steps forward or back."""
        self.playing = False
        # From between two states, one step back is the state before, one forward the state after.
        base = int(self.position) if count > 0 else -int(-self.position // 1)
        self.seek(base + count)

    def toggle(self) -> None:
        """Plays or pauses; plays from the beginning where it stands at the end."""
        if not self.playing and self.position >= self.steps:
            self.position = 0.0
        self.playing = not self.playing

    def change_speed(self, by: int) -> None:
        """To a neighbouring speed."""
        index = SPEEDS.index(self.speed) + by
        self.speed = SPEEDS[min(len(SPEEDS) - 1, max(0, index))]
