"""The packages that an installation may lack, the extra that brings each, and how a command asks for them."""

from importlib.util import find_spec

from ..exceptions import MissingExtraError

_TRAIN = (
    "accelerate", "av", "datasets", "diffusers", "diptest", "gymnasium", "h5py", "httpx", "huggingface_hub", "lerobot",
    "matplotlib", "numcodecs", "pandas", "PIL", "pyarrow", "safetensors", "sklearn", "torch", "zarr",
)  # fmt: skip
EXTRAS = {
    **dict.fromkeys(_TRAIN, "train"),
    "datatrove": "scale",
    "loguru": "scale",
    "numba": "numba",
    "onnx": "onnx",
    "onnxruntime": "onnx",
}
"""The extra that brings a package, by the name under which it is imported."""

DISTRIBUTIONS = {"PIL": "Pillow", "sklearn": "scikit-learn"}
"""Names of packages that are installed under another one."""

TABLES = ("pyarrow",)
"""Reading and writing LeRobot data sets."""
DATASETS = ("pyarrow", "lerobot", "datasets")
"""Making LeRobot data sets through LeRobot."""
POLICIES = ("torch", "lerobot", "diffusers")
"""Loading a policy."""
TRAINING = ("lerobot", "torch", "accelerate", "diffusers", "datasets", "pyarrow")
"""LeRobot's trainer."""
FIGURES = ("matplotlib",)
"""Drawing figures."""
BACKEND_PACKAGES = {"onnx": ("onnxruntime", "onnx"), "numba": ("numba",)}
"""What runs the network of a policy, beside torch."""
HUB = ("huggingface_hub", "httpx")
"""The client of the Hub."""


def require_packages(*packages: str) -> None:
    """Checks that packages are installed, without importing them.

    Args:
        packages: names under which they are imported, each a key of `EXTRAS`.

    Raises:
        MissingExtraError: one is not; it names the first of them and its extra.
    """
    for package in packages:
        if find_spec(package) is None:
            raise missing_extra(package)


def missing_extra(package: str) -> MissingExtraError:
    """The error for a package that is not there, whose extra is known."""
    return MissingExtraError(DISTRIBUTIONS.get(package, package), EXTRAS[package])


def extra_behind(error: ImportError) -> MissingExtraError | None:
    """The same for an import that failed; None where the module is no package of an extra."""
    package = (error.name or "").partition(".")[0]
    return missing_extra(package) if package in EXTRAS and find_spec(package) is None else None
