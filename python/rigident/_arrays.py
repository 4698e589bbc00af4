"""Recordings in arrays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigident import _rigident
from rigident._errors import Place, RigidentError

Arrays = Mapping[str, ArrayLike] | NDArray[np.void]
"""Columns by name, or a structured array whose fields are the columns; a data frame of pandas is such a mapping."""


def is_arrays(recording: object) -> bool:
    """Tells whether a recording is given as columns: a mapping, a structured array, or a data frame."""
    return isinstance(recording, (Mapping, np.ndarray)) or hasattr(recording, "columns")


def recording_of(arrays: Any, name: str, rig: Path | None) -> _rigident.Recording:
    """Makes a recording of columns.

    Raises:
        RigidentError: A column has another shape, dtype or unit than it may have, or holds what is not finite.
    """
    if isinstance(arrays, np.ndarray):
        if arrays.dtype.names is None:
            raise RigidentError(
                f"{name}: an array of dtype {arrays.dtype} has no names of columns: give a mapping of names to "
                "one-dimensional arrays, or a structured array",
                place=Place(file=name),
            )
        names = list(arrays.dtype.names)
    else:
        names = list(arrays.keys() if isinstance(arrays, Mapping) else arrays.columns)
    stranger = next((column for column in names if not isinstance(column, str)), None)
    if stranger is not None:
        raise RigidentError(
            f"{name}: {stranger!r} is no name of a column: names are texts, such as fx_n", place=Place(file=name)
        )
    columns = [(column, _column(arrays[column], column, name)) for column in names]
    return _rigident.Recording(name, columns, rig)


def _column(given: ArrayLike, column: str, name: str) -> NDArray[Any]:
    """Returns a column as contiguous float64 or int64."""

    def refuse(reason: str) -> RigidentError:
        return RigidentError(f"{name}: {column}: {reason}", place=Place(file=name, column=column))

    try:
        array = np.asarray(given)
    except ValueError as error:
        raise refuse(f"is no array of numbers: {error}") from error
    if isinstance(given, np.ma.MaskedArray) and np.ma.is_masked(given):
        index = int(np.flatnonzero(np.ma.getmaskarray(given))[0])
        raise RigidentError(
            f"{name}: {column}[{index}]: is masked, so there is no number: remove the row",
            place=Place(file=name, column=column, index=index),
        )
    if array.ndim != 1:
        raise refuse(
            f"has the shape {array.shape}: one dimension is wanted, a number for each sample; give each axis as a "
            "column of its own"
        )
    if array.dtype.kind == "M":
        # Stamps: whole nanoseconds, as an integer column of a rig file with scale 1e-9 is.
        raise refuse(
            f"has the dtype {array.dtype}: give seconds as t_s, or int64 nanoseconds as a column that the rig names: "
            '{"recording": {"columns": {"t_s": {"name": "' + column + '", "scale": 1e-9}}}}'
        )
    if array.dtype.kind == "f" and array.dtype.itemsize <= 8:
        return np.ascontiguousarray(array, dtype=np.float64)
    if array.dtype.kind in "iu":
        if array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
            raise refuse("has numbers beyond those of int64")
        return np.ascontiguousarray(array, dtype=np.int64)
    raise refuse(f"has the dtype {array.dtype}: real numbers are wanted, float64 or integers")
