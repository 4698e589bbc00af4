"""Mass, centre of mass and inertia tensor of bodies, robots and people, each with a 95 % uncertainty.

The functions call the commands of the command line ``rigident`` in this process: their numbers are its numbers. What a
column, a field or an option means stands in docs/formats.md and docs/commands.md.

>>> import rigident
>>> result = rigident.identify("docs/examples/bracket.csv")
>>> result.status
'identified'
"""

from rigident import plan
from rigident._arrays import Arrays
from rigident._call import Called, Known, Rig, command
from rigident._errors import Place, RigidentError
from rigident._factor import Factor
from rigident._identify import identify
from rigident._model import BaseMotion, BaseParameters, Model
from rigident._results import Parameter, Result

__all__ = [
    "Arrays",
    "BaseMotion",
    "BaseParameters",
    "Called",
    "Factor",
    "Known",
    "Model",
    "Parameter",
    "Place",
    "Result",
    "Rig",
    "RigidentError",
    "command",
    "identify",
    "plan",
]
