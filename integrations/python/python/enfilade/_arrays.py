"""Arguments as arrays that the native part takes, converted only where they differ."""

from typing import Any, Tuple

import numpy as np


def points(name: str, value: Any) -> np.ndarray:
    """Returns rows of three float32 or float64, without a copy if they are that already."""
    array = np.asarray(value)
    _check(name, array, "fiu", "numbers")
    if array.dtype not in (np.float32, np.float64):
        array = array.astype(np.float64)
    return np.require(array, array.dtype.newbyteorder("="), ["C_CONTIGUOUS", "ALIGNED"])


def faces(name: str, value: Any) -> np.ndarray:
    """Returns rows of three integers of 32 or 64 bits, without a copy if they are that already."""
    array = np.asarray(value)
    if array.size == 0:
        array = array.reshape(-1, 3).astype(np.int64)
    _check(name, array, "iu", "integers, the numbers of three vertices")
    if array.dtype.itemsize < 4:
        array = array.astype(np.int64)
    return np.require(array, array.dtype.newbyteorder("="), ["C_CONTIGUOUS", "ALIGNED"])


def point(name: str, value: Any) -> Tuple[float, float, float]:
    """Returns three finite numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} is {value!r}: expected three finite numbers, x, y and z")
    x, y, z = array.tolist()
    return float(x), float(y), float(z)


def _check(name: str, array: np.ndarray, kinds: str, wanted: str) -> None:
    if array.dtype.kind not in kinds:
        raise ValueError(f"{name} has the type {array.dtype}: expected {wanted}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} has the shape {array.shape}: expected (n, 3)")
