"""Plans of experiments: still poses and motions of a platform, trajectories of a robot's joints."""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import fspath
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rigident import _rigident
from rigident._call import PathLike, Rig, command, option, repeated, rig_file

__all__ = ["Plan", "Trajectory", "excitation", "motion", "poses"]


@dataclass(frozen=True)
class Plan:
    """A plan for a platform."""

    object: Mapping[str, Any]
    """The object of ``--json``: what is planned, and what it will tell."""
    text: str = field(repr=False)
    """The plan's file, JSON, for ``rigident run --plan`` and ``rigident demo --plan``."""
    messages: tuple[str, ...] = field(repr=False)
    """Warnings and notes."""


@dataclass(frozen=True)
class Trajectory:
    """A trajectory of a robot's joints."""

    object: Mapping[str, Any]
    """The object of ``--json``: base parameters with the U95 that is predicted, and limits."""
    columns: Mapping[str, NDArray[np.float64]]
    """Columns of the CSV by name: ``t_s``, and positions and rates of the joints, ``JOINT_rad`` and ``JOINT_radps``."""
    csv: str = field(repr=False)
    """The CSV."""
    yaml: str = field(repr=False)
    """The JointTrajectory of ROS 2."""
    messages: tuple[str, ...] = field(repr=False)
    """Warnings and notes."""

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Times of the rows, s."""
        return self.columns["t_s"]


def poses(
    n: int,
    *,
    rig: Rig | None = None,
    stroke_m: float | None = None,
    margin: float | None = None,
    objective: Literal["condition", "determinant", "worst-uncertainty"] = "condition",
    hold_s: float | None = None,
) -> Plan:
    """Plans still poses that tell the centre of mass best, as ``rigident plan poses`` does.

    Args:
        n: Number of poses.
        rig: Rig file with a platform. Default: the built-in platform.
        stroke_m: Stroke of the legs that is used, about its middle, m.
        margin: How far the poses stay away from every limit, a share.
        objective: What is made best.
        hold_s: How long each pose is held, s.

    Raises:
        RigidentError: There are no such poses.

    >>> import rigident
    >>> plan = rigident.plan.poses(4)
    >>> len(plan.object["poses_deg"])
    4
    """
    options = {
        "n": n,
        "stroke_m": stroke_m,
        "margin": margin,
        "objective": objective,
        "hold_s": hold_s,
    }
    with rig_file(rig) as path:
        return _planned(_rigident.poses({"rig": path, **options}))


def motion(
    *,
    rig: Rig | None = None,
    objective: Literal["d-optimal", "spheres", "rpy", "multisine"] = "d-optimal",
    duration_s: float = 60.0,
    body: Literal["horizontal", "vertical"] | None = None,
    no_poses: bool = False,
    highest_hz: float | None = None,
    stroke_m: float | None = None,
) -> Plan:
    """Plans a motion that tells the most, inside all limits at every instant, as ``rigident plan motion`` does.

    Args:
        rig: Rig file with a platform. Default: the built-in platform.
        objective: What the motion is made for.
        duration_s: Length of the whole experiment, s.
        body: The test body that the legs carry. Default: what the rig says, else ``horizontal``.
        no_poses: The motion alone, without the static step.
        highest_hz: Highest frequency of a D-optimal motion, Hz.
        stroke_m: Stroke of the legs that is used, about its middle, m.

    Raises:
        RigidentError: There is no such motion.
    """
    options = {
        "objective": objective,
        "duration_s": float(duration_s),
        "body": body,
        "no_poses": no_poses,
        "highest_hz": highest_hz,
        "stroke_m": stroke_m,
    }
    with rig_file(rig) as path:
        return _planned(_rigident.motion({"rig": path, **options}))


def excitation(
    model: PathLike,
    *,
    lock: Iterable[str] | str = (),
    spherical: Iterable[str] | str = (),
    tool: Iterable[str] | str = (),
    joints: Iterable[str] | str = (),
    start: Iterable[str] | str = (),
    duration_s: float = 10.0,
    bandwidth_hz: float = 1.0,
    rate_hz: float = 200.0,
    rows: Literal["base", "joint", "both"] | None = None,
    friction: Iterable[str] | str = (),
    effort_noise: Iterable[str] | str = (),
    positions: Iterable[str] | str = (),
    speed: Iterable[str] | str = (),
    effort: Iterable[str] | str = (),
    boxes: PathLike | None = None,
    floor_m: float | None = None,
    collisions: bool = True,
    seed: int = 1,
    restarts: int = 4,
) -> Trajectory:
    """Plans a trajectory of an arm's joints that tells most of its links, as ``rigident plan excitation`` does.

    Args:
        model: The robot: URDF, MJCF or SDF.
        lock: Joints that do not move, ``JOINT`` or ``JOINT=VALUE``.
        spherical: Three joints that are one spherical joint, as ``J1,J2,J3``.
        tool: A body held by a link, ``LINK@x,y,z`` in m.
        joints: Only these joints move.
        start: Where joints start and end, ``JOINT=VALUE``, rad or m.
        duration_s: Length, s.
        bandwidth_hz: Highest harmonic, Hz.
        rate_hz: Rate of the rows, 1/s.
        rows: What will be measured. Default: the joints' efforts.
        friction: Friction columns, as of :func:`rigident.identify`.
        effort_noise: 1 σ of a reading of a joint's effort, ``JOINT=SIGMA``, N m or N.
        positions: Ranges of joints instead of the model's, ``JOINT=LOW,HIGH``.
        speed: Largest rates, ``JOINT=MOST``.
        effort: Largest efforts, ``JOINT=MOST``.
        boxes: File of boxes round links, TOML.
        floor_m: Height of a floor, m.
        collisions: Whether collisions are looked for.
        seed: Seed of the random beginnings.
        restarts: Random beginnings of the search.

    Raises:
        RigidentError: The model has no such joint or no limits, or there is no such trajectory.
    """
    with tempfile.TemporaryDirectory(prefix="rigident-") as temporary:
        table, points = Path(temporary) / "trajectory.csv", Path(temporary) / "trajectory.yaml"
        words = [
            *repeated("--lock", lock),
            *repeated("--spherical", spherical),
            *repeated("--tool", tool),
            *repeated("--joints", joints),
            *repeated("--start", start),
            *option("--duration-s", float(duration_s)),
            *option("--bandwidth-hz", float(bandwidth_hz)),
            *option("--rate-hz", float(rate_hz)),
            *option("--rows", rows),
            *repeated("--friction", friction),
            *repeated("--effort-noise", effort_noise),
            *repeated("--range", positions),
            *repeated("--speed", speed),
            *repeated("--effort", effort),
            *option("--boxes", boxes),
            *option("--floor-m", None if floor_m is None else float(floor_m)),
            *option("--no-collisions", not collisions),
            f"--seed={seed}",
            f"--restarts={restarts}",
        ]
        called = command(
            "plan", "excitation", *words, "--json", f"--out={table}", f"--out={points}", "--", fspath(model)
        )
        text = table.read_text(encoding="utf-8")
        return Trajectory(
            object=json.loads(called.output),
            columns=_columns(text),
            csv=text,
            yaml=points.read_text(encoding="utf-8"),
            messages=called.messages,
        )


def _planned(planned: tuple[str, str, list[str]]) -> Plan:
    text, file, messages = planned
    return Plan(json.loads(text), file, tuple(messages))


def _columns(text: str) -> dict[str, NDArray[np.float64]]:
    """Reads the columns of a CSV; lines that begin with # are comments."""
    rows = csv.reader(io.StringIO("\n".join(line for line in text.splitlines() if not line.startswith("#"))))
    names = next(rows)
    numbers = np.array([[float(cell) for cell in row] for row in rows], dtype=np.float64)
    return {name: numbers[:, k].copy() for k, name in enumerate(names)}
