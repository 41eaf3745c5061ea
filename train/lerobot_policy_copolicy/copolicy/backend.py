"""What can run the network of a plan, and what it needs."""

from importlib.util import find_spec

from copolicy.dataset.exceptions import MissingExtraError

# Packages of the extra of the same name.
BACKENDS = {"torch": (), "onnx": ("onnxruntime", "onnx"), "numba": ("numba",)}


def require_backend(backend: str) -> None:
    """Checks that the packages of a backend are installed.

    Raises:
        MissingExtraError: one is not.
    """
    for package in BACKENDS[backend]:
        if find_spec(package) is None:
            raise MissingExtraError(package, backend)
