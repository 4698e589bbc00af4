"""Factors: all that recordings say of a body, in a few hundred numbers."""

from __future__ import annotations

import functools
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigident import _rigident
from rigident._arrays import Arrays
from rigident._call import Known, PathLike, Rig, rig_file
from rigident._errors import RigidentError
from rigident._identify import ask_options, given, read_options
from rigident._results import result_of

if TYPE_CHECKING:
    from rigident._results import Result

Key = TypeVar("Key", bound=Hashable)


def _named(number: int, factor: Factor) -> str:
    """Returns what messages call a factor: its number, and its recordings."""
    first, *more = factor.recordings
    others = f" and {len(more)} more" if more else ""
    return f"factor {number} ({first}{others})"


@dataclass(frozen=True)
class Factor:
    """The information factor of one or of many recordings: its triangle grows with the rigs alone; factors merge in any order.

    >>> import rigident
    >>> factor = rigident.Factor.of("docs/examples/bracket.csv")
    >>> factor.rows, factor.parameters[0], factor.recordings
    (5958, 'm', ('bracket',))
    >>> again = rigident.Factor.from_bytes(factor.to_bytes())
    >>> again == factor
    True
    >>> f"{factor.solve().mass_kg:.3f}"
    '3.201'
    """

    data: bytes = field(repr=False)
    """The bytes of the factor file."""
    name: str = field(default="factor", compare=False)
    """A name for messages."""
    warnings: tuple[str, ...] = field(default=(), repr=False, compare=False)
    """Warnings and notes of the checks when it was made."""

    @classmethod
    def of(
        cls,
        recording: PathLike | Arrays,
        *,
        rig: Rig | None = None,
        name: str = "arrays",
        calibration: PathLike | None = None,
        model: PathLike | None = None,
        lock: Iterable[str] | str = (),
        spherical: Iterable[str] | str = (),
        tool: Iterable[str] | str = (),
        height_m: float | None = None,
        mass_kg: float | None = None,
        sex: str | None = None,
    ) -> Factor:
        """Reduces a recording, a file's or one in memory, to its factor; arguments as of :func:`rigident.identify`.

        Raises:
            RigidentError: The recording cannot be used.
        """
        with rig_file(rig) as path:
            options = read_options(path, calibration, model, lock, spherical, tool, height_m, mass_kg, sex)
            data, warnings = _rigident.factor(given(recording, name, path), options)
        return cls(data, cls.from_bytes(data, name).recordings[0], tuple(warnings))

    @classmethod
    def from_bytes(cls, data: bytes, name: str = "factor") -> Factor:
        """Takes the bytes of a factor file.

        Raises:
            RigidentError: They are no factor: of a worker's half-written file it says what is missing.
        """
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise TypeError(f"{type(data).__name__} is no factor: give the bytes of a factor file")
        _rigident.contents(bytes(data), name)
        return cls(bytes(data), name)

    @classmethod
    def read(cls, path: PathLike) -> Factor:
        """Reads a factor file.

        Raises:
            OSError: It cannot be read.
            RigidentError: It is no factor.
        """
        return cls.from_bytes(Path(path).read_bytes(), str(path))

    @classmethod
    def merge(cls, *factors: Factor, shared_offset: bool = False, force: bool = False) -> Factor:
        """Merges factors of one body, as ``rigident merge`` does: in any order, and one whose recordings are all in others
        counts once.

        Raises:
            RigidentError: They are of other models or bodies, or have only some recordings in common.

        >>> import rigident
        >>> factor = rigident.Factor.of("docs/examples/bracket.csv")
        >>> rigident.Factor.merge(factor, factor).rows == factor.rows
        True
        """
        if not factors:
            raise RigidentError("there is no factor to merge: give one at least")
        for one in factors:
            if not isinstance(one, Factor):
                raise TypeError(f"{type(one).__name__} is no factor: Factor.from_bytes and Factor.read make one")
        named = [(factor.data, _named(number, factor)) for number, factor in enumerate(factors, start=1)]
        data, warnings = _rigident.merge(named, shared_offset, force)
        return cls(data, "merged", tuple(warnings))

    @classmethod
    def merge_by_key(cls, pairs: Iterable[tuple[Key, Factor]]) -> dict[Key, Factor]:
        """Merges the factors that have the same key, whatever a key is: what a worker does with its share of a collection.

        Raises:
            RigidentError: As of :meth:`merge`.

        >>> import rigident
        >>> factor = rigident.Factor.of("docs/examples/bracket.csv")
        >>> list(rigident.Factor.merge_by_key([("bracket", factor), ("bracket", factor)]))
        ['bracket']
        """
        groups: dict[Key, list[Factor]] = {}
        for key, factor in pairs:
            groups.setdefault(key, []).append(factor)
        return {key: cls.merge(*factors) for key, factors in groups.items()}

    def solve(
        self,
        *,
        rig: Rig | None = None,
        estimate: Iterable[str] | str = (),
        known: Known | None = None,
        symmetry: Mapping[str, float] | Iterable[str] | str = (),
        tare: PathLike | Factor | Iterable[PathLike | Factor] = (),
        without_platform: bool = False,
    ) -> Result:
        """Identifies the body of the factor, as ``rigident solve`` does; arguments as of :func:`rigident.identify`.

        Raises:
            RigidentError: There is no answer.
        """
        ask = ask_options(estimate, known, symmetry, tare)
        with rig_file(rig) as path:
            return result_of(_rigident.solve((self.data, self.name), path, ask, without_platform))

    def to_bytes(self) -> bytes:
        """Returns the bytes of the factor file."""
        return self.data

    def write(self, path: PathLike) -> None:
        """Writes the factor file, which must not exist.

        Raises:
            FileExistsError: It is there already.
        """
        with open(path, "xb") as file:
            file.write(self.data)

    @functools.cached_property
    def _contents(self) -> dict[str, Any]:
        return _rigident.contents(self.data, self.name)

    def __getstate__(self) -> dict[str, Any]:
        # What was read of the bytes is not sent to other processes.
        return {"data": self.data, "name": self.name, "warnings": self.warnings}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)

    @property
    def rows(self) -> int:
        """Rows that it was made of."""
        rows: int = self._contents["rows"]
        return rows

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the unknowns, in the order of the columns."""
        return tuple(self._contents["parameters"])

    @property
    def units(self) -> tuple[str, ...]:
        """Their SI units."""
        return tuple(self._contents["units"])

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings in it; of more than 64 a few names and their number, in words."""
        return tuple(self._contents["recordings"])

    @property
    def runs(self) -> int:
        """The number of recordings in it."""
        return int(self._contents["runs"])

    @property
    def r(self) -> NDArray[np.float64]:
        """The triangle R of the whitened rows, n × n: their information is ``R.T @ R``."""
        r: NDArray[np.float64] = self._contents["r"]
        return r.copy()

    @property
    def z(self) -> NDArray[np.float64]:
        """The right-hand side beside it, n: the estimate solves ``R @ x = z``."""
        z: NDArray[np.float64] = self._contents["z"]
        return z.copy()
