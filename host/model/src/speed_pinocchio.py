"""Times Pinocchio's joint-torque regressor: models as JSON on standard input, figures as JSON on standard output."""

import json
import sys
import time

import numpy as np
import pinocchio as pin


def microseconds(model):
    data = model.createData()
    q = pin.neutral(model)
    v, a = np.full(model.nv, 0.3), np.full(model.nv, 0.7)
    if model.nv:
        q = pin.integrate(model, q, np.full(model.nv, 0.4))
    call = pin.computeJointTorqueRegressor
    best, calls = 1e9, 500
    for _ in range(25):
        started = time.perf_counter()
        for _ in range(calls):
            call(model, data, q, v, a)
        best = min(best, (time.perf_counter() - started) / calls)
    return best * 1e6


asked = json.load(sys.stdin)
overhead = microseconds(pin.Model())
figures = []
for one in asked:
    if one["floating"]:
        model = pin.buildModelFromUrdf(one["path"], pin.JointModelFreeFlyer())
    else:
        model = pin.buildModelFromUrdf(one["path"])
    figures.append([model.nv, microseconds(model) - overhead])
print(json.dumps({"version": pin.__version__, "models": figures}))
