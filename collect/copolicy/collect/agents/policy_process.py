"""Policies in a process of their own, so that inference and the control loop do not share an interpreter."""

from collections.abc import Callable, Mapping
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from copolicy.dataset.arrays import Array
from copolicy.dataset.exceptions import RunError
from copolicy.dataset.worker_pool import WorkerPool

from .policy import Policy

_ATTRIBUTES = ("name", "task", "n_obs_steps", "n_action_steps", "fps", "keeps_history")
_loaded: dict[str, Policy] = {}  # in the process of the policies


class PolicyProcess:
    """A process that loads policies and predicts their action chunks.

    A thread of the control loop's process waits for each chunk (`PolicyAgent` in real time), without Python's lock: the
    loop does not stop for the policy's Python code, its garbage collection or its imports. The process ignores Ctrl-C
    and ends with the program.

    Attributes:
        policies: the loaded policies by name, for use in this process.
    """

    def __init__(self, load: Callable[[], Mapping[str, Policy]]):
        """Starts the process and waits until the policies are loaded.

        Args:
            load: loads the policies in the process; a function of a module, or a `functools.partial` of one.

        Raises:
            CopolicyError: what `load` raises.
            RunError: the process ended meanwhile.
        """
        self._pool = WorkerPool(1)
        try:
            attributes = self._call(_load, load)
        except BaseException:
            self.close()
            raise
        self.policies: dict[str, Policy] = {
            name: _RemotePolicy(name, self._call, values) for name, values in attributes.items()
        }

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return self._pool.submit(function, *arguments).result()
        except BrokenProcessPool:
            expected = "expected a running process, found that it ended (killed, or out of memory)"
            raise RunError(f"inference: {expected}; run the same command to continue") from None

    def close(self) -> None:
        """Ends the process after the chunk that it predicts."""
        self._pool.shutdown(cancel_futures=True)


class _RemotePolicy:
    """A policy of the process, see `Policy`."""

    def __init__(self, key: str, call: Callable[..., Any], attributes: Mapping[str, Any]):
        self._key, self._call = key, call
        self._set(attributes)

    def _set(self, attributes: Mapping[str, Any]) -> None:
        self.name: str = attributes["name"]
        self.task: str = attributes["task"]
        self.n_obs_steps: int = attributes["n_obs_steps"]
        self.n_action_steps: int = attributes["n_action_steps"]
        self.fps: int = attributes["fps"]
        self.keeps_history: bool = attributes["keeps_history"]

    def reset(self, seed: int) -> None:
        self._call(_reset, self._key, seed)

    def predict_action_chunk(self, observations: dict[str, Array]) -> Array:
        chunk, attributes = self._call(_predict, self._key, observations)
        self._set(attributes)  # some are known only after the first call
        return chunk


def _load(load: Callable[[], Mapping[str, Policy]]) -> dict[str, dict[str, Any]]:
    _loaded.update(load())
    return {name: _attributes(policy) for name, policy in _loaded.items()}


def _reset(key: str, seed: int) -> None:
    _loaded[key].reset(seed)


def _predict(key: str, observations: dict[str, Array]) -> tuple[Array, dict[str, Any]]:
    chunk = _loaded[key].predict_action_chunk(observations)
    return chunk, _attributes(_loaded[key])


def _attributes(policy: Policy) -> dict[str, Any]:
    return {name: getattr(policy, name) for name in _ATTRIBUTES}
