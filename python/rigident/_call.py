"""Commands in this process, and what goes into their words."""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigident import _rigident
from rigident._errors import Place, RigidentError

PathLike = str | os.PathLike[str]
"""A path of a file."""

Rig = PathLike | Mapping[str, Any]
"""A rig file, or what one says as nested mappings."""

Known = Mapping[str, tuple[float, float]]
"""Quantities that are known beforehand: name to value and standard uncertainty (1 σ)."""


@dataclass(frozen=True)
class Called:
    """What a command did."""

    status: int
    """Its exit status: 0 all is identified or done, 1 a part of it, or a check found something."""
    output: str
    """What it would print on standard output."""
    messages: tuple[str, ...]
    """Lines that it would print on standard error: warnings and notes."""


def command(*words: PathLike, recording: _rigident.Recording | None = None) -> Called:
    """Calls any command of the command line in this process and returns what it would print.

    Other threads of Python run meanwhile, and Ctrl-C stops it.

    Raises:
        RigidentError: There is no answer; it has the exit status, and the place where there is one.

    >>> import rigident
    >>> rigident.command("model", "base-params", "human34", "--json").status
    0
    """
    status, output, messages = _rigident.call([os.fspath(word) for word in words], recording)
    return Called(status, output, tuple(messages))


def rig_path(rig: Rig | None, folder: Path) -> Path | None:
    """Returns the path of a rig file; one of nested mappings is written into the folder."""
    if rig is None or not isinstance(rig, Mapping):
        return None if rig is None else Path(rig)
    path = folder / "given.rig.toml"
    path.write_text(_rigident.toml_of(json.dumps(_plain(rig, ""))), encoding="utf-8")
    return path


def _plain(value: Any, key: str) -> Any:
    """Returns what the rig says at a key as JSON has it; arrays of numpy become lists.

    Raises:
        RigidentError: It is nothing that a rig file can hold.
    """
    if isinstance(value, Mapping):
        return {str(name): _plain(one, f"{key}.{name}".removeprefix(".")) for name, one in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(one, f"{key}[{k}]") for k, one in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise RigidentError(f"the rig: {key}: {value} is not a finite number")
    if not isinstance(value, (bool, int, float, str)):
        raise RigidentError(
            f"the rig: {key}: {type(value).__name__} is nothing that a rig file holds: numbers, text, lists and mappings are"
        )
    return value


def option(name: str, value: object) -> list[str]:
    """Returns the words of an option: none of ``None`` and ``False``, the name alone of ``True``."""
    if value is None or value is False:
        return []
    if value is True:
        return [name]
    # By `=`, so that a value that begins with a sign is one.
    return [f"{name}={value!r}" if isinstance(value, float) else f"{name}={value}"]


def repeated(name: str, values: Iterable[object] | str) -> list[str]:
    """Returns the words of an option that may be given more than once; a text is one value."""
    values = [values] if isinstance(values, str) else values
    return [word for value in values for word in option(name, value)]


@contextlib.contextmanager
def rig_file(rig: Rig | None) -> Iterator[Path | None]:
    """Gives the path of a rig file; one of nested mappings is in a file meanwhile, which no message names."""
    if rig is None or not isinstance(rig, Mapping):
        yield None if rig is None else Path(rig)
        return
    with tempfile.TemporaryDirectory(prefix="rigident-") as folder:
        path = rig_path(rig, Path(folder))
        try:
            yield path
        except RigidentError as error:
            words = str(error).replace(str(path), "the rig")
            words = re.sub(r"the rig, line \d+(, column \d+)?", "the rig", words)
            place = error.place
            if place is not None and place.file == str(path):
                place = Place("the rig", None, place.index, place.column)
            raise type(error)(words, error.status, place, error.messages) from None


def listed(values: Iterable[str] | str) -> list[str]:
    """Returns several texts as a list; a text is one value."""
    return [values] if isinstance(values, str) else list(values)


def split(values: Iterable[str] | str) -> list[str]:
    """Returns the same, texts with commas parted there."""
    return [part for value in listed(values) for part in value.split(",")]


def known_values(known: Known | None) -> list[tuple[str, float, float]]:
    """Returns what is known beforehand: name, value, standard uncertainty.

    Raises:
        TypeError: It is no mapping, or a value has no standard uncertainty beside it.
    """
    values = []
    if known is not None and not isinstance(known, Mapping):
        raise TypeError(
            f"known: {known!r} is no mapping of names to pairs of a value and its standard uncertainty (1 σ): "
            "give {'m': (3.2, 0.01)}"
        )
    for name, pair in (known or {}).items():
        try:
            value, sigma = pair
            values.append((name, float(value), float(sigma)))
        except (TypeError, ValueError) as error:
            raise TypeError(
                f"known: {name}: {pair!r} is no pair of a value and its standard uncertainty (1 σ): give ({name!r}: (value, sigma))"
            ) from error
    return values


def planes(symmetry: Mapping[str, float] | Iterable[str] | str) -> list[str]:
    """Returns planes of symmetry as texts."""
    if isinstance(symmetry, Mapping):
        return [f"{axis}±{float(sigma)!r}" for axis, sigma in symmetry.items()]
    return listed(symmetry)
