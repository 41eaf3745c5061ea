"""Optional packages, the extra that installs each, and checks that they are installed."""

from importlib.util import find_spec

from ..exceptions import MissingExtraError

_TRAIN = (
    "accelerate", "av", "datasets", "diffusers", "gymnasium", "h5py", "lerobot", "matplotlib", "numcodecs", "pandas",
    "PIL", "safetensors", "torch", "zarr",
)  # fmt: skip
EXTRAS = {
    **dict.fromkeys(_TRAIN, "train"),
    "datatrove": "scale",
    "loguru": "scale",
    "numba": "numba",
    "onnx": "onnx",
    "onnxruntime": "onnx",
}
"""Name of the extra by import name of a package."""

DISTRIBUTIONS = {"PIL": "Pillow"}
"""Distribution name by import name, where they differ."""

DATASETS = ("lerobot", "datasets")
"""Packages to create data sets through LeRobot."""
POLICIES = ("torch", "lerobot", "diffusers")
"""Packages to load a policy."""
TRAINING = ("lerobot", "torch", "accelerate", "diffusers", "datasets")
"""Packages of LeRobot's trainer."""
FIGURES = ("matplotlib",)
"""Packages to draw figures."""
BACKEND_PACKAGES = {"onnx": ("onnxruntime", "onnx"), "numba": ("numba",)}
"""Packages by inference backend, beside torch."""


def require_packages(*packages: str) -> None:
    """Checks that packages are installed, without importing them.

    Args:
        packages: import names, each a key of `EXTRAS`.

    Raises:
        MissingExtraError: a package is missing; the message names the first one and its extra.
    """
    for package in packages:
        if find_spec(package) is None:
            raise missing_extra(package)


def missing_extra(package: str) -> MissingExtraError:
    """The error for a missing package of an extra."""
    return MissingExtraError(DISTRIBUTIONS.get(package, package), EXTRAS[package])


def missing_extra_error(error: ImportError) -> MissingExtraError | None:
    """The error for a failed import; None if the module does not belong to an extra."""
    package = (error.name or "").partition(".")[0]
    return missing_extra(package) if package in EXTRAS and find_spec(package) is None else None
