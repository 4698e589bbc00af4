"""Commands in this process, and what goes into their words."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rigident import _rigident
from rigident._errors import RigidentError

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
    told: tuple[str, ...]
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
    status, output, told = _rigident.call([os.fspath(word) for word in words], recording)
    return Called(status, output, tuple(told))


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
    """Returns the words of an option that may stand more than once; a text is one value."""
    values = [values] if isinstance(values, str) else values
    return [word for value in values for word in option(name, value)]


def known_words(known: Known, symmetry: Mapping[str, float] | Iterable[str] | str) -> list[str]:
    """Returns the words of what is known beforehand."""
    words = [f"--known={name}={float(value)!r}±{float(sigma)!r}" for name, (value, sigma) in known.items()]
    if isinstance(symmetry, Mapping):
        return words + [f"--symmetry={axis}±{float(sigma)!r}" for axis, sigma in symmetry.items()]
    return words + repeated("--symmetry", symmetry)
