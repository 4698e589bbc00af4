"""`check_base.py URDF ANSWER [--floating] [--rows base] [--lock A,B]`: what Pinocchio's regressors say of an answer of
`rigident model base-params --json`. Prints the rank of its regressor over random motions, and how much of its rows lies
outside the span of the answer's combinations.
"""

import argparse
import json

import numpy as np
import pinocchio as pin

NAMES = ["m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Izx", "Iyz", "Izz"]

parser = argparse.ArgumentParser()
parser.add_argument("urdf")
parser.add_argument("answer")
parser.add_argument("--floating", action="store_true")
parser.add_argument("--rows", default=None)
parser.add_argument("--lock", default="")
options = parser.parse_args()
rng = np.random.default_rng(7)

if options.floating:
    model = pin.buildModelFromUrdf(options.urdf, pin.JointModelFreeFlyer())
else:
    model = pin.buildModelFromUrdf(options.urdf)
locked = [model.getJointId(name) for name in options.lock.split(",") if name]
if locked:
    model = pin.buildReducedModel(model, locked, pin.neutral(model))
data = model.createData()
answer = json.load(open(options.answer))

# A link's name leads to the joint it hangs on; the base has none where it is fixed.
column = {}
joint_of = {f.name: f.parentJoint for f in model.frames if f.type == pin.FrameType.BODY}
base_columns = 10 if options.rows == "base" and not options.floating else 0


def place(term):
    link, parameter = term.rsplit(".", 1)
    joint = joint_of[link]
    k = NAMES.index(parameter)
    return k if joint == 0 and base_columns else base_columns + 10 * (joint - 1) + k


def rows(q, v, a):
    torques = pin.computeJointTorqueRegressor(model, data, q, v, a).copy()
    if options.rows != "base" or options.floating:
        return torques[:6] if options.floating else torques
    # The wrench on a base held still: every body's, moved to the world's origin, and the base's own weight.
    pin.forwardKinematics(model, data, q, v, a)
    blocks = []
    for joint in range(1, model.njoints):
        acceleration = pin.Motion(data.a[joint])
        lifted = acceleration - data.oMi[joint].actInv(model.gravity)
        body = pin.bodyRegressor(data.v[joint], lifted)
        blocks.append(data.oMi[joint].toDualActionMatrix() @ body)
    own = pin.bodyRegressor(pin.Motion.Zero(), -model.gravity)
    return np.hstack([own] + blocks)


width = base_columns + 10 * (model.njoints - 1)
stack = []
while sum(r.shape[0] for r in stack) < 3 * width + 60:
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-2.0, 2.0, model.nv))
    stack.append(rows(q, rng.uniform(-3.0, 3.0, model.nv), rng.uniform(-9.0, 9.0, model.nv)))
stack = np.vstack(stack)

combinations = np.zeros((answer["count"], width))
for row, parameter in enumerate(answer["parameters"]):
    for term, weight in parameter["terms"]:
        combinations[row, place(term)] += weight

singular = np.linalg.svd(stack, compute_uv=False)
rank = int(np.sum(singular > 1e-10 * singular[0]))
basis = np.linalg.qr(combinations.T)[0]
outside = np.linalg.norm(stack - stack @ basis @ basis.T) / np.linalg.norm(stack)
print(json.dumps({"rank": rank, "outside": float(outside)}))
