"""From trials to a person's segments."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rigident import _rigident
from rigident._call import Known, PathLike, known_values
from rigident._errors import RigidentError
from rigident._factor import Factor
from rigident._results import Result, by_name, framed, result_of


@dataclass(frozen=True)
class Segment:
    """A segment of a person. Where it is not identified, the numbers are the table's, near enough."""

    name: str
    """The link of the model."""
    identified: bool
    """Whether the motions say more of its mass than the table knows."""
    mass_kg: float
    """Mass, kg."""
    mass_u95_kg: float
    """95 % expanded uncertainty of it, kg."""
    com_m: NDArray[np.float64]
    """Centre of mass from the proximal joint, 3 numbers, m; x forward, y left, z up when standing."""
    com_u95_m: NDArray[np.float64]
    """95 % expanded uncertainty of it, m."""
    radii_m: NDArray[np.float64]
    """Radii of gyration about these axes through the centre of mass, 3 numbers, m."""
    table_mass_kg: float
    """The table's mass, kg."""
    table_mass_u95_kg: float
    """95 % expanded uncertainty of the table for one person, kg."""


@dataclass(frozen=True)
class Person:
    """An identified person, with the numbers of the command line to the last bit."""

    result: Result = field(repr=False)
    """The answer: status, whole mass, base parameters, warnings; ``result.object["person"]`` has the tables of the report."""
    mass_kg: float | None
    """The whole mass, kg; ``None`` if it is not identified."""
    mass_u95_kg: float | None
    """95 % expanded uncertainty of it, kg."""
    segments: tuple[Segment, ...]
    """The segments; none where the recording cannot be true."""
    factors: Mapping[str, Factor] = field(repr=False)
    """The factor of each motion, by the name of its file."""
    pages: Mapping[str, str] = field(repr=False)
    """Pages that play the trials, HTML, by the names of their files."""

    def __getitem__(self, name: str) -> Segment:
        """Returns the segment of a name.

        Raises:
            KeyError: There is none; it names those that there are.
        """
        return by_name(self.segments, name, "segments")

    def _repr_html_(self) -> str:
        """Shows the report in Jupyter."""
        return framed(self.result.page)


def identify_person(
    trials: PathLike | Iterable[PathLike],
    *,
    standing: PathLike | None = None,
    ground: PathLike | Iterable[PathLike] = (),
    markers: PathLike | None = None,
    osim: PathLike | None = None,
    model: str = "human34",
    mass_kg: float | None = None,
    height_m: float | None = None,
    table: str = "unknown",
    segment_mass: Known | None = None,
    plate_scale_percent: float = 1.0,
    cut_off_hz: float | None = None,
    delay_s: float | None = None,
    plates_zeroed: bool = False,
    parts: int | str = 4,
    motions: int | None = None,
    select: str = "d-optimal",
    nominal_sigma: float = 0.3,
    symmetric_sides: bool = False,
    tool: str | None = None,
    tool_link: str = "r_hand",
    tare: PathLike | Iterable[PathLike] = (),
    write_model: PathLike | None = None,
) -> Person:
    """Identifies a person's segments from markers and force plates, as ``rigident body identify`` does and with its numbers.

    Args:
        trials: C3D files with force plates, or TRC files with the ground's forces.
        standing: A trial in which the person stands upright.
        ground: Forces of the ground of each TRC trial, MOT or STO. Default: the file beside each.
        markers: File that says which segments markers are on whose names say nothing.
        osim: OpenSim model that is scaled to the person.
        model: ``human34`` or ``human58``.
        mass_kg: Mass of the person, kg, known to 0.5 % (1 σ). Default: by the plates.
        height_m: Stature, m. Default: by the markers.
        table: Whose means the table has: ``female``, ``male``, or ``unknown``.
        segment_mass: Masses of segments that are known otherwise: name to kg and standard uncertainty (1 σ).
        plate_scale_percent: How well the scales of the plates are known, 1 σ.
        cut_off_hz: Cut-off of the smoothing, Hz. Default: by the data.
        delay_s: How late the plates are against the cameras, s. Default: as found.
        plates_zeroed: Plates that are always loaded were reset right before each trial.
        parts: Parts of a single trial, each a motion, or ``strides`` of every trial.
        motions: The number of motions to identify from. Default: all.
        select: How they are chosen: ``d-optimal``, ``e-optimal``, ``published``, ``random``.
        nominal_sigma: How well the table's segments are trusted, 1 σ, relative.
        symmetric_sides: Right segments mirror left ones.
        tool: Name of what the person holds in the trials, and not in those of ``tare``.
        tool_link: The link that holds it.
        tare: Trials without the tool.
        write_model: Model file to write the segments into.

    Raises:
        RigidentError: There is no answer.
    """
    if isinstance(parts, str) and parts != "strides":
        raise RigidentError(f"parts {parts!r}: must be a number, or 'strides'")
    options = {
        "standing": standing,
        "ground": _paths(ground),
        "markers": markers,
        "osim": osim,
        "model": model,
        "mass_kg": mass_kg,
        "height_m": height_m,
        "table": table,
        "segment_mass": known_values(segment_mass),
        "plate_scale_percent": float(plate_scale_percent),
        "cut_off_hz": cut_off_hz,
        "delay_s": delay_s,
        "plates_zeroed": plates_zeroed,
        "parts": None if isinstance(parts, str) else parts,
        "motions": motions,
        "select": select,
        "nominal_sigma": float(nominal_sigma),
        "symmetric_sides": symmetric_sides,
        "tool": tool,
        "tool_link": tool_link,
        "tare": _paths(tare),
        "write_model": write_model,
    }
    found = _rigident.identify_person(_paths(trials), options)
    result = result_of(found["answer"])
    whole = json.loads(result.json).get("person", {})
    mass = whole.get("mass_kg") or {}
    return Person(
        result=result,
        mass_kg=mass.get("value"),
        mass_u95_kg=mass.get("u95"),
        segments=tuple(
            Segment(
                name=s["name"],
                identified=s["identified"],
                mass_kg=s["mass_kg"]["value"],
                mass_u95_kg=s["mass_kg"]["u95"],
                com_m=np.array([c["value"] for c in s["com_m"]]),
                com_u95_m=np.array([c["u95"] for c in s["com_m"]]),
                radii_m=np.array(s["radii_m"]),
                table_mass_kg=s["table_mass_kg"],
                table_mass_u95_kg=s["table_mass_u95_kg"],
            )
            for s in whole.get("segments", [])
        ),
        factors={name: Factor.from_bytes(data, name) for data, name in found["factors"]},
        pages=dict(found["pages"]),
    )


def _paths(given: PathLike | Iterable[PathLike]) -> list[PathLike]:
    return [given] if isinstance(given, (str, os.PathLike)) else list(given)
