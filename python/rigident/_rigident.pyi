"""The compiled part of the package."""

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Recording",
    "Tree",
    "call",
    "contents",
    "factor",
    "identify",
    "identify_person",
    "identify_vibration",
    "main",
    "merge",
    "motion",
    "poses",
    "solve",
    "toml_of",
]

_Matrix = NDArray[np.float64]
_Given = str | PathLike[str] | Recording
_Answered = dict[str, Any]

def main(words: Sequence[str]) -> int: ...
def call(
    words: Sequence[str], recording: Recording | None = None
) -> tuple[int, str, list[str]]: ...
def identify(recording: _Given, options: Mapping[str, Any]) -> _Answered: ...
def identify_person(
    trials: Sequence[str | PathLike[str]], options: Mapping[str, Any]
) -> dict[str, Any]: ...
def identify_vibration(
    recording: str | PathLike[str], rig: PathLike[str] | None, modes: int | None
) -> dict[str, Any]: ...
def factor(recording: _Given, options: Mapping[str, Any]) -> tuple[bytes, list[str]]: ...
def merge(
    factors: Sequence[tuple[bytes, str]], shared_offset: bool, force: bool
) -> tuple[bytes, list[str]]: ...
def solve(
    factor: tuple[bytes, str],
    rig: PathLike[str] | None,
    ask: Mapping[str, Any],
    without_platform: bool,
) -> _Answered: ...
def poses(options: Mapping[str, Any]) -> tuple[str, str, list[str]]: ...
def motion(options: Mapping[str, Any]) -> tuple[str, str, list[str]]: ...
def contents(bytes: bytes, name: str) -> dict[str, Any]: ...
def toml_of(json: str) -> str: ...
@final
class Recording:
    def __new__(
        cls,
        name: str,
        columns: Sequence[tuple[str, NDArray[np.float64] | NDArray[np.int64]]],
        rig: PathLike[str] | None = None,
    ) -> Recording: ...
    def __len__(self) -> int: ...

@final
class Tree:
    def __new__(
        cls,
        name: str,
        lock: Sequence[str],
        spherical: Sequence[Sequence[str]],
        tool: Sequence[str],
        height_m: float,
        mass_kg: float,
        sex: str,
        lengths_m: Sequence[tuple[str, float]],
    ) -> Tree: ...
    @property
    def name(self) -> str: ...
    @property
    def is_person(self) -> bool: ...
    @property
    def links(self) -> list[str]: ...
    @property
    def joints(self) -> list[tuple[str, int, int]]: ...
    @property
    def nominal(self) -> list[float]: ...
    @property
    def findings(self) -> list[str]: ...
    @property
    def columns(self) -> list[str]: ...
    def rows(
        self,
        positions: _Matrix,
        rates: _Matrix,
        accelerations: _Matrix,
        base: Sequence[_Matrix] | None,
        floating: bool,
        rows: str,
        in_base_parameters: bool,
    ) -> _Matrix: ...
