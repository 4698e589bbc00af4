"""A body on springs: from its free vibration to modes and body."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rigident import _rigident
from rigident._call import PathLike, Rig, rig_file
from rigident._factor import Factor
from rigident._results import Result, framed, result_of


@dataclass(frozen=True)
class Vibration:
    """A body on springs, with the numbers of the command line to the last bit."""

    exit_status: int
    """What the command line would end with: 0 if the body is identified in one way at least, else 1."""
    modes: tuple[Mapping[str, Any], ...]
    """The modes, each as in the object of ``--json``."""
    by_modes: Result | None
    """The body by the modes; ``None`` where the findings refuse it."""
    by_motion: Result | None
    """The body by the motion."""
    findings: tuple[str, ...]
    """What was found of modes and springs."""
    warnings: tuple[str, ...]
    """What to act on before using the numbers."""
    notes: tuple[str, ...]
    """Information that asks for nothing."""
    factors: Mapping[str, Factor] = field(repr=False)
    """Factors to merge with others of the same body, by the names of their files."""
    json: str = field(repr=False)
    """The object as the command prints it with ``--json``."""
    page: str = field(repr=False)
    """The page of the modes, HTML."""

    def _repr_html_(self) -> str:
        """Shows the modes in Jupyter."""
        return framed(self.page)


def identify_vibration(recording: PathLike, *, rig: Rig | None = None, modes: int | None = None) -> Vibration:
    """Identifies one body on springs by its modes and by its motion, as ``rigident vibration identify`` does.

    Args:
        recording: Path of a CSV or MCAP file, or of a rig file that lists several.
        rig: Rig file with ``[suspension]``, or what one says as nested mappings. Default: ``NAME.rig.toml`` beside a file.
        modes: The number of modes. Default: one for each coordinate that is free.

    Raises:
        RigidentError: There is no answer.
    """
    with rig_file(rig) as path:
        found = _rigident.identify_vibration(recording, path, modes)
    whole = json.loads(found["json"])
    return Vibration(
        exit_status=found["exit_status"],
        modes=tuple(whole["modes"]),
        by_modes=None if found["by_modes"] is None else result_of(found["by_modes"]),
        by_motion=None if found["by_motion"] is None else result_of(found["by_motion"]),
        findings=tuple(whole["findings"]),
        warnings=tuple(whole["warnings"]),
        notes=tuple(whole["notes"]),
        factors={name: Factor.from_bytes(data, name) for data, name in found["factors"]},
        json=found["json"],
        page=found["page"],
    )
