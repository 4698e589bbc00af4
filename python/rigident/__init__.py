"""Mass, centre of mass and inertia tensor of bodies, robots and people, each with a 95 % uncertainty.

The functions call the commands of the command line ``rigident`` in this process: their numbers are its numbers. What a
column, a field or an option means is in docs/formats.md and docs/commands.md.

>>> import rigident
>>> result = rigident.identify("docs/examples/bracket.csv")
>>> result.status
'identified'
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rigident import plan
    from rigident._arrays import Arrays
    from rigident._call import Called, Known, Rig, command
    from rigident._errors import Contradicted, NoNumber, NotIdentified, Place, RigidentError
    from rigident._factor import Factor
    from rigident._identify import identify
    from rigident._model import BaseMotion, BaseParameters, Model
    from rigident._person import Person, Segment, identify_person
    from rigident._results import FitParameter, Parameter, Residuals, Result
    from rigident._vibration import Vibration, identify_vibration

__all__ = [
    "Arrays",
    "BaseMotion",
    "BaseParameters",
    "Called",
    "Contradicted",
    "Factor",
    "FitParameter",
    "Known",
    "Model",
    "NoNumber",
    "NotIdentified",
    "Parameter",
    "Person",
    "Place",
    "Residuals",
    "Result",
    "Rig",
    "RigidentError",
    "Segment",
    "Vibration",
    "command",
    "identify",
    "identify_person",
    "identify_vibration",
    "plan",
]

# Loaded when they are asked for: the command starts in half the time without numpy.
_MODULES = {
    "_arrays": ("Arrays",),
    "_call": ("Called", "Known", "Rig", "command"),
    "_errors": ("Contradicted", "NoNumber", "NotIdentified", "Place", "RigidentError"),
    "_factor": ("Factor",),
    "_identify": ("identify",),
    "_model": ("BaseMotion", "BaseParameters", "Model"),
    "_person": ("Person", "Segment", "identify_person"),
    "_results": ("FitParameter", "Parameter", "Residuals", "Result"),
    "_vibration": ("Vibration", "identify_vibration"),
}


def __getattr__(name: str) -> Any:
    if name == "plan":
        return importlib.import_module("rigident.plan")
    for module, names in _MODULES.items():
        if name in names:
            return getattr(importlib.import_module(f"rigident.{module}"), name)
    raise AttributeError(f"module 'rigident' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
