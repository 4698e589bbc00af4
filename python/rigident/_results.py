"""Answers: what a command prints with ``--json``, as dataclasses with numpy arrays."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigident._errors import Contradicted, NotIdentified, RigidentError

if TYPE_CHECKING:
    from rigident._factor import Factor

PAGE_HEIGHT_PX = 900


@dataclass(frozen=True)
class Parameter:
    """An unknown with its state."""

    name: str
    """Its name: ``m``, ``mcx``, ``Ixx``, or ``forearm.MSx`` of a link."""
    unit: str
    """Its SI unit."""
    state: str
    """``identified``, ``prior_dominated`` (only together with what was known before), ``not_identified``, or
    ``contradicted`` if the recording cannot be true."""
    value: float | None
    """Its value in that unit; ``None`` if it is not identified or contradicted."""
    u95: float | None
    """Its 95 % expanded uncertainty in that unit; ``None`` if it is not identified or contradicted."""
    frame: str | None
    """The frame that it is expressed in: ``S``, or a link's; ``None`` where there is none."""
    truth: float | None
    """Its true value where it is known; never used for the answer."""
    object: Mapping[str, Any] = field(repr=False, compare=False)
    """All that the command says of it."""


@dataclass(frozen=True)
class FitParameter:
    """A number of the fit of a recording that cannot be true. It must not be used; it helps to find the fault."""

    name: str
    """Its name, that of the parameter."""
    unit: str
    """Its SI unit."""
    value: float
    """The value that the fit has."""
    u95: float
    """The 95 % expanded uncertainty that the fit has; it does not hold."""


@dataclass(frozen=True)
class Residuals:
    """What the fit leaves of what was measured, after the filter that the rows went through."""

    channels: tuple[str, ...]
    """Names of m channels: ``fx``, …, or those of joints."""
    units: tuple[str, ...]
    """Their units."""
    time_s: NDArray[np.float64]
    """Times of n blocks of rows, s; zero for still poses."""
    values: NDArray[np.float64]
    """Measurement less prediction, n × m; NaN where a block says nothing of a channel."""


@dataclass(frozen=True)
class Result:
    """An answer, with the numbers of the command line to the last bit.

    What is not identified has no number: such a field is ``None``, never zero.
    """

    status: str
    """``identified``, ``partly_identified``, ``not_identified``, or ``implausible`` if the recording cannot be true."""
    exit_status: int
    """What the command line would end with: 0 if all that was asked for is identified, else 1."""
    parameters: tuple[Parameter, ...]
    """Every unknown, in the order of the factor's columns."""
    fit: Mapping[str, FitParameter] = field(repr=False)
    """By name, what the fit found where ``status`` is ``implausible``, else nothing: numbers that must not be used."""
    mass_kg: float | None
    """Mass of the one body, kg."""
    com_m: NDArray[np.float64] | None
    """Its centre of mass in S, 3 numbers, m."""
    com_u95_m: NDArray[np.float64] | None
    """95 % expanded uncertainty of ``com_m``, m."""
    inertia_com_kgm2: NDArray[np.float64] | None
    """Its tensor about the centre of mass, 3 × 3, axes of S, kg m²."""
    inertia_com_u95_kgm2: NDArray[np.float64] | None
    """95 % expanded uncertainty of ``inertia_com_kgm2``, 3 × 3, kg m²."""
    condition_number: float | None
    """Condition number of the rows over what they determine."""
    advice: tuple[str, ...]
    """What would identify the rest, or why it cannot be."""
    warnings: tuple[str, ...]
    """What to act on before using the numbers."""
    notes: tuple[str, ...]
    """Information that asks for nothing."""
    messages: tuple[str, ...] = field(repr=False)
    """What the command said beside its answer."""
    json: str = field(repr=False)
    """The object as the command prints it with ``--json``."""
    page: str = field(repr=False)
    """The report as the command writes it, an HTML page."""
    factor: Factor | None = field(repr=False)
    """All that the recording says of the body, to merge and to solve again; ``None`` of a factor's own answer."""
    residuals: Residuals | None = field(default=None, repr=False, compare=False)
    """What the fit leaves, if ``residuals=True`` asked for it."""
    _covariance: tuple[tuple[str, ...], NDArray[np.float64]] | None = field(default=None, repr=False, compare=False)

    @property
    def object(self) -> dict[str, Any]:
        """The whole object of ``--json``; docs/formats.md names its fields."""
        whole: dict[str, Any] = json.loads(self.json)
        return whole

    def __getitem__(self, name: str) -> Parameter:
        """Returns the parameter of a name.

        Raises:
            KeyError: There is none; it names those that there are.
        """
        return by_name(self.parameters, name, "parameters")

    def value(self, name: str) -> float:
        """Returns the value of a parameter in its unit.

        Raises:
            Contradicted: The recording cannot be true.
            NotIdentified: The data do not determine it.
            KeyError: There is no such parameter.
        """
        return float(self.values([name])[0])

    def values(self, names: Iterable[str] | None = None) -> NDArray[np.float64]:
        """Returns the values of these parameters in their units, or of all.

        Raises:
            Contradicted: The recording cannot be true.
            NotIdentified: The data do not determine one of them.
        """
        return self._numbers("value", names)

    def u95(self, names: Iterable[str] | None = None) -> NDArray[np.float64]:
        """Returns the 95 % expanded uncertainties of these parameters in their units, or of all.

        Raises:
            Contradicted: The recording cannot be true.
            NotIdentified: The data do not determine one of them.
        """
        return self._numbers("u95", names)

    def covariance(self, names: Iterable[str] | None = None) -> NDArray[np.float64]:
        """Returns the covariance of these parameters, or of all that have a number, in products of their units.

        The standard uncertainty of a sum ``w @ p`` of parameters is ``sqrt(w @ C @ w)``; its U95 is 1.96 to 2 of them, more where
        few readings show the noise: ``object["coverage_factor"]`` is there then.

        Raises:
            Contradicted: The recording cannot be true.
            NotIdentified: The data do not determine one of them.
            KeyError: There is no such parameter.
            RigidentError: This kind of answer keeps none.

        >>> import rigident
        >>> result = rigident.identify("docs/examples/bracket.csv")
        >>> c = result.covariance(["m", "mcz"])
        >>> c.shape, bool(abs(1.96 * c[0, 0] ** 0.5 / result["m"].u95 - 1) < 1e-3)
        ((2, 2), True)
        """
        if self._covariance is None:
            raise RigidentError("this kind of answer keeps no covariance")
        known, matrix = self._covariance
        if names is None:
            return matrix.copy()
        chosen = list(names)
        self.values(chosen)
        at = [known.index(name) for name in chosen]
        return matrix[np.ix_(at, at)]

    def _numbers(self, which: str, names: Iterable[str] | None) -> NDArray[np.float64]:
        chosen = self.parameters if names is None else tuple(self[name] for name in names)
        contradicted = [p.name for p in chosen if p.state == "contradicted"]
        if contradicted:
            raise Contradicted(
                f"the recording cannot be true, so without a number: {', '.join(contradicted)}; the warnings say why"
            )
        missing = [p.name for p in chosen if getattr(p, which) is None]
        if missing:
            raise NotIdentified(f"not identified, so without a number: {', '.join(missing)}")
        return np.array([getattr(p, which) for p in chosen], dtype=np.float64)

    def _repr_html_(self) -> str:
        """Shows the report in Jupyter."""
        return framed(self.page)


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_N = TypeVar("_N", bound=_Named)


def by_name(all_of_them: Iterable[_N], name: str, what: str) -> _N:
    """Returns the one of a name.

    Raises:
        KeyError: There is none; it names those that there are.
    """
    those = list(all_of_them)
    for one in those:
        if one.name == name:
            return one
    raise KeyError(f"{name}: the {what} are {', '.join(one.name for one in those)}")


def framed(page: str) -> str:
    """Puts a whole page into a frame of another one."""
    return (
        f'<iframe srcdoc="{html.escape(page)}" sandbox="allow-scripts" '
        f'style="width:100%;height:{PAGE_HEIGHT_PX}px;border:0"></iframe>'
    )


def result_of(answered: Mapping[str, Any]) -> Result:
    """Takes an answer of the compiled part."""
    from rigident._factor import Factor

    text, kept = answered["json"], answered["factor"]
    whole = json.loads(text)

    def vector(key: str) -> NDArray[np.float64] | None:
        return np.array(whole[key], dtype=np.float64) if key in whole else None

    def tensor(key: str) -> NDArray[np.float64] | None:
        if key not in whole:
            return None
        xx, yy, zz, yz, zx, xy = whole[key]
        return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]], dtype=np.float64)

    return Result(
        status=whole["status"],
        exit_status=answered["exit_status"],
        parameters=tuple(
            Parameter(
                name=p["name"],
                unit=p["unit"],
                state=p["state"],
                value=p.get("value"),
                u95=p.get("u95"),
                frame=p.get("frame"),
                truth=p.get("truth"),
                object=p,
            )
            for p in whole.get("parameters", [])
        ),
        fit={
            p["name"]: FitParameter(name=p["name"], unit=p["unit"], value=p["value"], u95=p["u95"])
            for p in whole.get("fit", {}).get("parameters", [])
        },
        mass_kg=whole.get("mass_kg"),
        com_m=vector("com_m"),
        com_u95_m=vector("com_u95_m"),
        inertia_com_kgm2=tensor("inertia_com_kgm2"),
        inertia_com_u95_kgm2=tensor("inertia_com_u95_kgm2"),
        condition_number=whole.get("condition_number"),
        advice=tuple(whole.get("advice", [])),
        warnings=tuple(whole.get("warnings", [])),
        notes=tuple(whole.get("notes", [])),
        messages=tuple(answered["messages"]),
        json=text,
        page=answered["page"],
        factor=None if kept is None else Factor.from_bytes(*kept),
        residuals=_residuals(answered["residuals"]),
        _covariance=_covariance(answered["covariance"]),
    )


def _residuals(found: Mapping[str, Any] | None) -> Residuals | None:
    if found is None:
        return None
    channels = tuple(found["channels"])
    time_s, values = (np.frombuffer(found[key], dtype="<f8").astype(np.float64) for key in ("time_s", "values"))
    return Residuals(channels, tuple(found["units"]), time_s, values.reshape(len(time_s), len(channels)))


def _covariance(found: Mapping[str, Any] | None) -> tuple[tuple[str, ...], NDArray[np.float64]] | None:
    if found is None:
        return None
    names = tuple(found["names"])
    return names, np.array(found["rows"], dtype=np.float64).reshape(len(names), len(names))
