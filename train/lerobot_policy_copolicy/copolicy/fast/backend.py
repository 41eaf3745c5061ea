"""What can run the network of a plan, and what it needs."""

from copolicy.dataset.command_line.extras import BACKEND_PACKAGES, require_packages

AUTO = "auto"
BACKENDS = {AUTO: (), "torch": (), **BACKEND_PACKAGES}


def require_backend(backend: str) -> None:
    """Checks that the packages of a backend are installed.

    Raises:
        MissingExtraError: one is not.
    """
    require_packages(*BACKENDS[backend])
