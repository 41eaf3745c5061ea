"""The type of arrays in annotations; docstrings give their shape and unit."""

from typing import Any

import numpy as np

type Array = np.ndarray[Any, np.dtype[Any]]
"""An array of any shape and element type."""
