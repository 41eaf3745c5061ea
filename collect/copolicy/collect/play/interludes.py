"""What comes between the blocks of a session: questionnaires, then a break."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..questionnaire import AnswerFile, Item, Questionnaire


@dataclass(frozen=True)
class Interlude:
    """What comes after a block of episodes.

    Attributes:
        block: number of the block, from 1.
        episodes: kept in the session by the end of the block.
        questionnaires: about the block.
        break_s: shortest break before the next block, s; no break after the last block.
    """

    block: int
    episodes: int
    questionnaires: tuple[Questionnaire, ...] = ()
    break_s: float = 0.0


class Interludes:
    """The interludes of a session, and which of them are due.

    What is answered follows from the file of answers, so an interrupted session goes on with the first open question.

    Attributes:
        answers: file of the session's answers.
        blocks: number of blocks.
    """

    def __init__(self, folder: Path, interludes: Sequence[Interlude]):
        self.answers = AnswerFile(folder)
        self.blocks = len(interludes)
        self._interludes = sorted(interludes, key=lambda interlude: interlude.episodes)
        self._last_kept: int | None = None

    def open_questionnaire(self, kept: int) -> tuple[Interlude, Questionnaire] | None:
        """The first questionnaire with open items after the blocks that are complete with `kept` episodes."""
        for interlude in self._interludes:
            for questionnaire in interlude.questionnaires if interlude.episodes <= kept else ():
                if self.open_items(interlude, questionnaire):
                    return interlude, questionnaire
        return None

    def open_items(self, interlude: Interlude, questionnaire: Questionnaire) -> list[Item]:
        """The items without an answer."""
        answered = self.answers.values(interlude.block, questionnaire.name)
        return [item for item in questionnaire.items if item.name not in answered]

    def kept(self, kept: int) -> None:
        """To be called when an episode was kept, with the number of the session's kept episodes."""
        self._last_kept = kept

    def break_due(self, kept: int) -> Interlude | None:
        """The interlude whose break is due; none in a session that has just been continued."""
        if kept != self._last_kept:
            return None
        return next((one for one in self._interludes[:-1] if one.episodes == kept and one.break_s > 0), None)

    def rested(self) -> None:
        """Ends the break that is due."""
        self._last_kept = None
