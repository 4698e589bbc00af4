"""From a recording to an answer."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigident._arrays import Arrays, is_arrays, recording_of
from rigident._call import (
    Called,
    Known,
    PathLike,
    Rig,
    command,
    known_words,
    option,
    repeated,
    rig_path,
)
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
    with tempfile.TemporaryDirectory(prefix="rigident-") as temporary:
        folder = Path(temporary)
        words = [
            *repeated("--estimate", estimate),
            *known_words(known or {}, symmetry),
            *tare_words(tare, folder),
            *option("--calibration", calibration),
            *option("--forget", None if forget_s is None else float(forget_s)),
            *option("--window", None if window_s is None else float(window_s)),
            *tree_words(model, lock, spherical, tool, height_m, mass_kg, sex),
            *repeated("--friction", friction),
            *repeated("--drive", drive),
            *option("--nominal-sigma", None if nominal_sigma is None else float(nominal_sigma)),
            *option("--symmetric-sides", symmetric_sides),
            *option("--payload", payload),
            *option("--write-model", write_model),
            *repeated("--write-load", loads),
        ]
        return answered("identify", recording, rig, name, words, folder)


def answered(
    verb: str,
    recording: PathLike | Arrays,
    rig: Rig | None,
    name: str,
    words: list[str],
    folder: Path,
) -> Result:
    """Calls a command that answers and reads what it printed and wrote."""
    from rigident._factor import Factor

    out = folder / "answer"
    called = reduced(verb, recording, rig, name, [*words, "--json", f"--out={out}"], folder)
    page = (out / "report.html").read_text(encoding="utf-8")
    kept = sorted(out.glob("*.factor"))
    factor = Factor.from_bytes(kept[0].read_bytes(), kept[0].stem) if kept else None
    return result_of(called.output, called.status, called.told, page, factor)


def reduced(
    verb: str,
    recording: PathLike | Arrays,
    rig: Rig | None,
    name: str,
    words: list[str],
    folder: Path,
) -> Called:
    """Calls a command that takes a recording, from a file or from memory."""
    path = rig_path(rig, folder)
    words = [*words, *option("--rig", path)]
    if not is_arrays(recording):
        return command(verb, *words, "--", _path(recording))
    if not name:
        raise RigidentError("the recording needs a name: name=…")
    return command(verb, *words, "--", name, recording=recording_of(recording, name, path))


def tree_words(
    model: PathLike | None,
    lock: Iterable[str] | str,
    spherical: Iterable[str] | str,
    tool: Iterable[str] | str,
    height_m: float | None,
    mass_kg: float | None,
    sex: str | None,
) -> list[str]:
    """Returns the words that say which tree, and what is changed about it."""
    return [
        *option("--model", model),
        *repeated("--lock", lock),
        *repeated("--spherical", spherical),
        *repeated("--tool", tool),
        *option("--height-m", None if height_m is None else float(height_m)),
        *option("--mass-kg", None if mass_kg is None else float(mass_kg)),
        *option("--sex", sex),
    ]


def tare_words(tare: Any, folder: Path) -> list[str]:
    """Returns the words of runs with the bare fixture; factors are written into the folder."""
    from rigident._factor import Factor

    words = []
    runs = [tare] if _is_path(tare) or isinstance(tare, Factor) else list(tare)
    for number, run in enumerate(runs):
        if isinstance(run, Factor):
            path = folder / f"tare-{number}.factor"
            run.write(path)
            words.append(f"--tare={path}")
        else:
            words.append(f"--tare={_path(run)}")
    return words


def _is_path(value: object) -> bool:
    return isinstance(value, str) or hasattr(value, "__fspath__")


def _path(value: Any) -> PathLike:
    if not _is_path(value):
        raise TypeError(
            f"{type(value).__name__} is no recording: give a path, a mapping of columns, a structured array or a data frame"
        )
    path: PathLike = value
    return path
