"""From a recording to an answer."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigident import _rigident
from rigident._arrays import Arrays, is_arrays, recording_of
from rigident._call import Known, PathLike, Rig, known_values, listed, planes, rig_file, split
from rigident._errors import RigidentError
from rigident._results import Result, result_of

if TYPE_CHECKING:
    from rigident._factor import Factor


def identify(
    recording: PathLike | Arrays,
    *,
    rig: Rig | None = None,
    name: str = "arrays",
    estimate: Iterable[str] | str = (),
    known: Known | None = None,
    symmetry: Mapping[str, float] | Iterable[str] | str = (),
    tare: PathLike | Factor | Iterable[PathLike | Factor] = (),
    calibration: PathLike | None = None,
    forget_s: float | None = None,
    window_s: float | None = None,
    model: PathLike | None = None,
    lock: Iterable[str] | str = (),
    spherical: Iterable[str] | str = (),
    tool: Iterable[str] | str = (),
    friction: Iterable[str] | str = (),
    drive: Iterable[str] | str = (),
    nominal_sigma: float | None = None,
    symmetric_sides: bool = False,
    height_m: float | None = None,
    mass_kg: float | None = None,
    sex: str | None = None,
    payload: str | None = None,
    write_model: PathLike | None = None,
    write_load: PathLike | Iterable[PathLike] = (),
    residuals: bool = False,
) -> Result:
    """Identifies the body, or the tree of links, of a recording, as ``rigident identify`` does and with its numbers.

    Args:
        recording: Path of a CSV or MCAP file, of a rig file that lists several, or columns in memory: a mapping of names
            to one-dimensional arrays, a structured array, or a data frame. Names say the units: ``t_s``, ``fx_n``, …,
            ``mz_nm``, ``imu_ax_mps2``, …, ``imu_gz_radps``, ``JOINT_rad``, ``JOINT_nm`` (docs/formats.md).
        rig: Rig file, or what one says as nested mappings. Default: ``NAME.rig.toml`` beside a file.
        name: Name of a recording in memory.
        estimate: What must be identified for ``exit_status`` 0: any of m, mc, I, offset, or single names.
        known: Quantities known beforehand, each with its standard uncertainty (1 σ).
        symmetry: Planes through the origin of S that the mass is symmetric about: axis to standard uncertainty, m.
        tare: Runs with the bare fixture, recordings or factors, which are taken off with their uncertainty.
        calibration: Calibration of the rig, as ``rigident calibrate rig`` writes it.
        forget_s: Time constant of forgetting, s.
        window_s: Length of the end of the recording that alone is used, s.
        model: The tree: human34, human58, a URDF, MJCF or SDF.
        lock: Joints that do not move, ``JOINT`` or ``JOINT=VALUE`` in rad or m.
        spherical: Three joints that are one spherical joint, as ``J1,J2,J3``.
        tool: A body held by a link, ``LINK@x,y,z`` in m.
        friction: Friction columns, as ``viscous,coulomb`` of every joint or ``JOINT=viscous`` of one.
        drive: Drives that turn with several joints, as ``m6=joint_5+joint_6``.
        nominal_sigma: How well the nominal model is trusted, 1 σ, relative.
        symmetric_sides: Right links mirror left ones.
        height_m: Stature of the person, m.
        mass_kg: Mass of the person, kg.
        sex: ``female`` or ``male``.
        payload: Link that carries what ``tare`` did not, ``LINK`` or ``LINK@x,y,z``.
        write_model: Model file to write.
        write_load: Files of controllers to write the payload into.
        residuals: Keep the residuals of every row, ``result.residuals``.

    Raises:
        RigidentError: There is no answer; it has the exit status, and the file, line, column or index where there is one.

    >>> import rigident
    >>> result = rigident.identify("docs/examples/bracket.csv")
    >>> f"{result.mass_kg:.3f} kg ± {result['m'].u95:.3f} kg"
    '3.201 kg ± 0.024 kg'
    >>> result.com_m.shape, result.inertia_com_kgm2.shape
    ((3,), (3, 3))
    """
    loads = [write_load] if isinstance(write_load, (str, os.PathLike)) else list(write_load)
    with rig_file(rig) as path:
        options = {
            "read": read_options(path, calibration, model, lock, spherical, tool, height_m, mass_kg, sex),
            "ask": ask_options(estimate, known, symmetry, tare),
            "forget_s": _number(forget_s),
            "window_s": _number(window_s),
            "friction": listed(friction),
            "drive": listed(drive),
            "nominal_sigma": _number(nominal_sigma),
            "symmetric_sides": symmetric_sides,
            "payload": payload,
            "write_model": write_model,
            "write_load": loads,
            "residuals": residuals,
        }
        return result_of(_rigident.identify(given(recording, name, path), options))


def given(recording: PathLike | Arrays, name: str, rig: Path | None) -> PathLike | _rigident.Recording:
    """Returns the path of a recording, or one in memory."""
    if not is_arrays(recording):
        return _path(recording)
    if not name:
        raise RigidentError("the recording needs a name: name=…")
    return recording_of(recording, name, rig)


def read_options(
    rig: Path | None,
    calibration: PathLike | None,
    model: PathLike | None,
    lock: Iterable[str] | str,
    spherical: Iterable[str] | str,
    tool: Iterable[str] | str,
    height_m: float | None,
    mass_kg: float | None,
    sex: str | None,
) -> dict[str, Any]:
    """Returns how a recording is read: its rig, and which tree it is of."""
    tree = {
        "model": None if model is None else os.fspath(model),
        "lock": split(lock),
        "spherical": listed(spherical),
        "tool": listed(tool),
        "height_m": _number(height_m),
        "mass_kg": _number(mass_kg),
        "sex": sex,
    }
    return {"rig": rig, "calibration": calibration, "tree": tree}


def ask_options(
    estimate: Iterable[str] | str,
    known: Known | None,
    symmetry: Mapping[str, float] | Iterable[str] | str,
    tare: PathLike | Factor | Iterable[PathLike | Factor],
) -> dict[str, Any]:
    """Returns what is asked of an answer, and what is known beside the rows."""
    from rigident._factor import Factor

    runs = [tare] if _is_path(tare) or isinstance(tare, Factor) else list(tare)  # type: ignore[arg-type]
    return {
        "estimate": listed(estimate),
        "known": known_values(known),
        "symmetry": planes(symmetry),
        "tare": [(run.data, run.name) if isinstance(run, Factor) else _path(run) for run in runs],
    }


def _number(value: float | None) -> float | None:
    return None if value is None else float(value)


def _is_path(value: object) -> bool:
    return isinstance(value, str) or hasattr(value, "__fspath__")


def _path(value: Any) -> PathLike:
    if not _is_path(value):
        raise TypeError(
            f"{type(value).__name__} is no recording: give a path, a mapping of columns, a structured array or a data frame"
        )
    path: PathLike = value
    return path
