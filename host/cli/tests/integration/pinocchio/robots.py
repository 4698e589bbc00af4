"""What Pinocchio reads of the URDFs of the wheel example-robot-data, or of the texts on stdin if there are any.

Prints a list, one item a description: where it is, and `null` or degrees of freedom and inertias by joint, about the joint's
frame, the base's by the name "": m, mcx, mcy, mcz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz.
"""

import json
import sys
from importlib.metadata import distribution

import pinocchio as pin


def said(build, what):
    try:
        model = build(what)
    except Exception:
        return None
    inertias = zip(["", *model.names[1:]], model.inertias)
    return {"nv": model.nv, "bodies": {name: list(own.toDynamicParameters()) for name, own in inertias}}


texts = json.load(sys.stdin)
if texts:
    print(json.dumps([[text, said(pin.buildModelFromXML, text)] for text in texts]))
else:
    files = [f.locate() for f in distribution("example-robot-data").files if f.suffix == ".urdf"]
    print(json.dumps([[str(path), said(pin.buildModelFromUrdf, str(path))] for path in files]))
