"""Backends that run the network in inference, and the packages that they need."""

from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, require_packages

AUTO = "auto"
BACKENDS = {AUTO: (), "torch": (), **BACKEND_PACKAGES}


def require_backend(backend: str) -> None:
    """Checks that the packages of a backend are installed.

    Raises:
        MissingExtraError: a package is missing.
    """
    require_packages(*BACKENDS[backend])
