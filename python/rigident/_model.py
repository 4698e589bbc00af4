"""Models of trees of links: base parameters and regressors."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import fspath
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigident import _rigident
from rigident._call import PathLike, command, option, repeated
from rigident._errors import RigidentError


@dataclass(frozen=True)
class BaseParameters:
    """The least set of combinations of standard parameters that rows can tell apart."""

    names: tuple[str, ...]
    """Their names, by the link and the regrouped quantity: ``forearm.MSx``."""
    standard: tuple[str, ...]
    """Names of the standard parameters, ten a link: ``forearm.m``."""
    map: NDArray[np.float64]
    """The regrouping, n × p: base parameters are ``map @ standard parameters``."""
    situation: str
    """What is measured, on what kind of base, as a sentence."""
    findings: tuple[str, ...]
    """What is strange in the model."""
    object: Mapping[str, Any] = field(repr=False, compare=False)
    """The object of ``rigident model base-params --json``."""


@dataclass(frozen=True)
class BaseMotion:
    """The motion of a base that moves, in its own axes, a row for each sample."""

    specific_force_mps2: ArrayLike
    """What an ideal accelerometer at its origin reads, n × 3, m/s²: gravity is in it."""
    rate_radps: ArrayLike
    """Angular rate, n × 3, rad/s."""
    angular_acceleration_radps2: ArrayLike
    """Its derivative, n × 3, rad/s²."""


class Model:
    """A tree of links: ``human34``, ``human58``, or the path of a URDF, MJCF, SDF or rig file.

    >>> import rigident
    >>> person = rigident.Model("human34", height_m=1.68, mass_kg=62.0)
    >>> len(person.links), len(person.base_parameters().names)
    (15, 128)
    """

    def __init__(
        self,
        model: PathLike,
        *,
        lock: Iterable[str] | str = (),
        spherical: Iterable[str] | str = (),
        tool: Iterable[str] | str = (),
        height_m: float | None = None,
        mass_kg: float | None = None,
        sex: Literal["female", "male"] | None = None,
        segment: Mapping[str, float] | None = None,
    ) -> None:
        """Reads a model and changes it as the options of the command line do; arguments as of :func:`rigident.identify`.

        ``segment`` gives lengths of a person's that are known, m.

        Raises:
            RigidentError: It is no tree of links, or has no such joint or link.
        """
        lock, spherical, tool = (
            [words] if isinstance(words, str) else list(words) for words in (lock, spherical, tool)
        )
        lock = [joint for words in lock for joint in words.split(",")]
        segment = dict(segment or {})
        triples = [[joint.strip() for joint in words.split(",")] for words in spherical]
        for words, triple in zip(spherical, triples, strict=True):
            if len(triple) != 3:
                raise RigidentError(f"spherical {words!r}: names three joints, J1,J2,J3")
        self._name = fspath(model)
        self._words = [
            *repeated("--lock", lock),
            *repeated("--spherical", spherical),
            *repeated("--tool", tool),
            *option("--height-m", None if height_m is None else float(height_m)),
            *option("--mass-kg", None if mass_kg is None else float(mass_kg)),
            *option("--sex", sex),
            *repeated("--segment", [f"{name}={float(length)!r}" for name, length in segment.items()]),
        ]
        self._tree = _rigident.Tree(
            self._name,
            lock,
            triples,
            tool,
            1.741 if height_m is None else height_m,
            73.0 if mass_kg is None else mass_kg,
            sex or "male",
            list(segment.items()),
        )
        of_a_person = [height_m, mass_kg, sex, segment or None]
        if not self._tree.is_person and any(said is not None for said in of_a_person):
            raise RigidentError(
                "height_m, mass_kg, sex and segment describe human34 and human58; the model given is neither"
            )

    @property
    def name(self) -> str:
        """Its name."""
        return self._tree.name

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links, the base first; links on fixed joints are one with what they hang on."""
        return tuple(self._tree.links)

    @property
    def joints(self) -> tuple[tuple[str, int, int], ...]:
        """Names of the joints, each with its numbers of positions and of rates, in their order in the arrays."""
        return tuple(self._tree.joints)

    @property
    def standard(self) -> tuple[str, ...]:
        """Names of the standard parameters, the columns of a regressor: m, mcx, mcy, mcz, Ixx, … of each link."""
        return tuple(self._tree.columns)

    @property
    def nominal(self) -> NDArray[np.float64]:
        """What the model says of them, tensors about the links' origins; SI units."""
        return np.array(self._tree.nominal)

    @property
    def findings(self) -> tuple[str, ...]:
        """What is strange in the file."""
        return tuple(self._tree.findings)

    def base_parameters(
        self,
        *,
        floating: bool = False,
        rows: Literal["base", "joint", "both"] | None = None,
        mimic: bool = False,
    ) -> BaseParameters:
        """Returns the base parameters, as ``rigident model base-params`` does.

        Args:
            floating: The base moves; a person's always does.
            rows: What is measured: the wrench on the base link, the joints' efforts, or both. Default: ``base`` if the base
                moves, else ``joint``.
            mimic: Mimic joints follow their leaders.

        Raises:
            RigidentError: The model is degenerate, or no joint moves.
        """
        words = [*self._words, *option("--floating", floating), *option("--rows", rows), *option("--mimic", mimic)]
        whole = json.loads(command("model", "base-params", *words, "--json", "--", self._name).output)
        # A base that is held still has no part in the joints' rows and is not among the standard ones.
        links = {name.rsplit(".", 1)[0] for p in whole["parameters"] for name, _ in p["terms"]}
        held = not (floating or self._tree.is_person) and (rows or "joint") == "joint"
        standard = [name for name in self.standard if not held or not name.startswith(f"{self.links[0]}.")]
        assert links <= {name.rsplit(".", 1)[0] for name in standard}, "columns are those of the command"
        place = {name: column for column, name in enumerate(standard)}
        regrouping = np.zeros((len(whole["parameters"]), len(standard)))
        for row, parameter in enumerate(whole["parameters"]):
            for name, weight in parameter["terms"]:
                regrouping[row, place[name]] = weight
        return BaseParameters(
            names=tuple(p["name"] for p in whole["parameters"]),
            standard=tuple(standard),
            map=regrouping,
            situation=whole["situation"],
            findings=tuple(whole["findings"]),
            object=whole,
        )

    def regressor(
        self,
        positions: ArrayLike,
        rates: ArrayLike,
        accelerations: ArrayLike,
        *,
        base: BaseMotion | None = None,
        rows: Literal["base", "joint", "both"] | None = None,
        in_base_parameters: bool = False,
    ) -> NDArray[np.float64]:
        """Returns the rows of a motion: efforts are ``regressor @ parameters``, N m or N, sample by sample.

        Args:
            positions: Of all joints in their order, samples × positions: rad or m, a quaternion w, x, y, z for a spherical
                joint. One sample may be a vector.
            rates: The same of rates, rad/s or m/s.
            accelerations: The same of accelerations, rad/s² or m/s².
            base: The base's motion; ``None`` holds it still, gravity of 9.80665 m/s² along −z of its frame.
            rows: What is measured: the wrench on the base link, the joints' efforts, or both. Default: ``base`` if the base
                moves, else ``joint``.
            in_base_parameters: Columns are those of :meth:`base_parameters`, instead of the standard ones.

        Returns:
            Samples × rows × columns.

        Raises:
            ValueError: The arrays have other shapes than the joints.

        >>> import numpy as np, rigident
        >>> person = rigident.Model("human34")
        >>> joints = sum(positions for _, positions, _ in person.joints)
        >>> rates = sum(rates for _, _, rates in person.joints)
        >>> still = rigident.BaseMotion([[0, 0, 9.80665]], [[0, 0, 0]], [[0, 0, 0]])
        >>> at_zero = np.concatenate([[1.0, 0, 0, 0][:n] if n == 4 else [0.0] * n for _, n, _ in person.joints])
        >>> rows = person.regressor(at_zero, np.zeros(rates), np.zeros(rates), base=still)
        >>> rows.shape, round(float(rows[0, 2] @ person.nominal / 9.80665), 3)
        ((1, 6, 150), 73.0)
        """
        which = rows or ("joint" if base is None else "base")
        moved = None
        if base is not None:
            parts = (base.specific_force_mps2, base.rate_radps, base.angular_acceleration_radps2)
            moved = [_samples("base", part) for part in parts]
        return self._tree.rows(
            _samples("positions", positions),
            _samples("rates", rates),
            _samples("accelerations", accelerations),
            moved,
            base is not None,
            which,
            in_base_parameters,
        )

    def __repr__(self) -> str:
        return f"Model({self._name!r}, {len(self.links)} links)"


def _samples(what: str, given: ArrayLike) -> NDArray[np.float64]:
    """Returns an array as samples × numbers."""
    array = np.asarray(given, dtype=np.float64)
    if array.ndim == 1:
        array = array[np.newaxis, :]
    if array.ndim != 2:
        raise ValueError(f"{what} has the shape {array.shape}: samples × numbers is wanted")
    if not np.isfinite(array).all():
        sample = int(np.argwhere(~np.isfinite(array))[0][0])
        raise ValueError(f"{what}: sample {sample} holds what is not finite")
    return np.ascontiguousarray(array)
