"""What a task has of simulated players, by name; flags ask it before anything heavy is loaded."""

from copolicy.dataset.exceptions import CopolicyError, UnknownNameError
from copolicy.dataset.task import PairTask, SimulatedPlayers


def simulated_players(task: PairTask) -> SimulatedPlayers:
    """The task's part `agents`.

    Raises:
        CopolicyError: it has none.
    """
    if task.agents is None:
        raise CopolicyError(task.missing("agents"))
    return task.agents


def pair_name(task: PairTask, name: str | None, kind: str = "simulated pair") -> str:
    """The name of a simulated pair, or that of the task's first one.

    Raises:
        UnknownNameError: no such pair.
        CopolicyError: the task has no simulated players.
    """
    pairs = simulated_players(task).pairs
    if name and name not in pairs:
        raise UnknownNameError(kind, name, pairs)
    return name or next(iter(pairs))
