"""`check_base.py URDF ANSWER [--floating] [--rows base] [--lock A,B]`: what Pinocchio's regressors say of an answer of
`rigident model base-params --json`. Prints the rank of its regressor over random motions, and how much of its rows lies
outside the span of the answer's combinations.
"""

import argparse
import json
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

NAMES = ["m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Iyy", "Izx", "Iyz", "Izz"]

parser = argparse.ArgumentParser()
parser.add_argument("urdf")
parser.add_argument("answer")
parser.add_argument("--floating", action="store_true")
parser.add_argument("--rows", default=None)
parser.add_argument("--lock", default="")
parser.add_argument("--mimic", action="store_true")
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


# Joints that follow: index of velocity, leader's, factor, offset. Only base rows, where torques need no summing.
ties = []
if options.mimic:
    assert options.floating
    for joint in ElementTree.parse(options.urdf).getroot().findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            own, leader = (model.joints[model.getJointId(n)] for n in (joint.get("name"), mimic.get("joint")))
            assert own.nq == leader.nq == 1
            ties.append((own, leader, float(mimic.get("multiplier", 1)), float(mimic.get("offset", 0))))

width = base_columns + 10 * (model.njoints - 1)
stack = []
while sum(r.shape[0] for r in stack) < 1.3 * width + 30:
    q = pin.integrate(model, pin.neutral(model), rng.uniform(-2.0, 2.0, model.nv))
    v, a = rng.uniform(-3.0, 3.0, model.nv), rng.uniform(-9.0, 9.0, model.nv)
    for own, leader, factor, offset in ties:
        q[own.idx_q] = factor * q[leader.idx_q] + offset
        v[own.idx_v], a[own.idx_v] = factor * v[leader.idx_v], factor * a[leader.idx_v]
    stack.append(rows(q, v, a))
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
