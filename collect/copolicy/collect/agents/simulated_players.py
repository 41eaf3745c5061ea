"""Access to a task's simulated players by name, without heavy imports, for command-line flags."""

from copolicy.dataset.exceptions import CopolicyError, UnknownNameError
from copolicy.dataset.task import PairTask, SimulatedPlayers


def simulated_players(task: PairTask) -> SimulatedPlayers:
    """The simulated players of a task, `PairTask.agents`.

    Raises:
        CopolicyError: the task has none.
    """
    if task.agents is None:
        raise CopolicyError(task.missing("agents"))
    return task.agents


def pair_name(task: PairTask, name: str | None, label: str = "simulated pair") -> str:
    """Checks the name of a simulated pair, by default that of the task's first pair; errors say `label`.

    Raises:
        UnknownNameError: no such pair.
        CopolicyError: the task has no simulated players.
    """
    pairs = simulated_players(task).pairs
    if name and name not in pairs:
        raise UnknownNameError(label, name, pairs)
    return name or next(iter(pairs))
