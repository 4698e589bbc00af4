"""Why there is no answer."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """Says where something is wrong; what does not apply is ``None``."""

    file: str | None = None
    """Name of the file or of the recording."""
    line: int | None = None
    """Line of the file, from 1."""
    index: int | None = None
    """Index in an array, from 0."""
    column: str | None = None
    """Column of the recording, or key of the rig file."""


class RigidentError(Exception):
    """Says what happened, where, and what to do, in the words of the command line.

    >>> import rigident
    >>> try:
    ...     rigident.identify({"t_s": [0.0, 0.1], "fx_n": [1.0, float("nan")]})
    ... except rigident.RigidentError as error:
    ...     print(error.status, error.place.column, error.place.index)
    2 fx_n 1
    """

    status: int
    """Exit status of the command line: 1 stopped, 2 bad input or usage, 3 link or hardware."""
    place: Place | None
    """Where it is, if it is at a place."""
    messages: tuple[str, ...]
    """Warnings and notes that came before."""

    def __init__(
        self,
        message: str,
        status: int = 2,
        place: Place | tuple[str | None, int | None, int | None, str | None] | None = None,
        messages: Iterable[str] = (),
    ) -> None:
        super().__init__(message)
        self.status = status
        self.place = Place(*place) if isinstance(place, tuple) else place
        self.messages = tuple(messages)

    def __reduce__(self) -> tuple[type[RigidentError], tuple[object, ...]]:
        # Workers send it to the process that started them.
        return type(self), (str(self), self.status, self.place, self.messages)


class NoNumber(RigidentError, ValueError):
    """Says that a quantity has no number that may be used."""

    def __init__(
        self,
        message: str,
        status: int = 1,
        place: Place | tuple[str | None, int | None, int | None, str | None] | None = None,
        messages: Iterable[str] = (),
    ) -> None:
        super().__init__(message, status, place, messages)


class NotIdentified(NoNumber):
    """Says that the data do not determine a parameter."""


class Contradicted(NoNumber):
    """Says that the recording cannot be true: the numbers of its fit, in ``Result.fit``, must not be used."""
