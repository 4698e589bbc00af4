"""Records what Pinocchio says of a tree with every kind of joint: `python record.py > vectors.json`.

Needs the wheel `pin`. The tree, its states and the parameters are written beside the answers, so that the test that
reads them needs no Python.
"""

import json

import numpy as np
import pinocchio as pin

rng = np.random.default_rng(1)
GRAVITY = np.array([0.0, 0.0, -9.80665])


def some(n=3):
    return rng.uniform(-1.0, 1.0, n)


def rotation():
    return pin.exp3(some() * 2.0)


def ours(inertia):
    """Pinocchio's order m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz in the order of the notation."""
    p = inertia.toDynamicParameters()
    return [p[k] for k in COLUMNS]


COLUMNS = [0, 1, 2, 3, 4, 6, 9, 8, 7, 5]
KINDS = ["revolute", "prismatic", "universal", "spherical", "free"]


def joint(kind):
    a, b = some(), some()
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    if kind == "universal":
        b = b - a * a.dot(b)
        b = b / np.linalg.norm(b)
    model = {
        "revolute": lambda: pin.JointModelRevoluteUnaligned(a),
        "prismatic": lambda: pin.JointModelPrismaticUnaligned(a),
        "universal": lambda: pin.JointModelUniversal(a, b),
        "spherical": lambda: pin.JointModelSpherical(),
        "free": lambda: pin.JointModelFreeFlyer(),
    }[kind]()
    return model, a, b


def tree():
    """A chain of one joint of each kind, then a leaf of each kind somewhere on it; a free base."""
    model = pin.Model()
    model.gravity.linear = GRAVITY
    links = []
    wanted = [("free", 0)] + [(k, n + 1) for n, k in enumerate(KINDS)] + [(k, 1 + (3 * n) % 6) for n, k in enumerate(KINDS)]
    for number, (kind, parent) in enumerate(wanted):
        made, a, b = joint(kind)
        place = pin.SE3.Identity() if number == 0 else pin.SE3(rotation(), some())
        index = model.addJoint(parent, made, place, f"joint{number}")
        g = rng.uniform(-1.0, 1.0, (3, 3))
        inertia = pin.Inertia(1.0 + abs(some(1)[0]), some(), g @ g.T + 0.1 * np.eye(3))
        model.appendBodyToJoint(index, inertia, pin.SE3.Identity())
        links.append(
            {
                "kind": kind,
                "parent": max(parent - 1, 0),
                "axes": [a.tolist(), b.tolist()],
                "rotation": place.rotation.tolist(),
                "position": place.translation.tolist(),
                "phi": ours(inertia),
            }
        )
    return model, links


def coordinates(kind, q):
    """Quaternions w first."""
    q = q.tolist()
    if kind == "spherical":
        return [q[3], q[0], q[1], q[2]]
    if kind == "free":
        return q[:3] + [q[6], q[3], q[4], q[5]]
    return q


def main():
    model, links = tree()
    data = model.createData()
    cases = []
    for _ in range(4):
        q = pin.integrate(model, pin.neutral(model), rng.uniform(-2.0, 2.0, model.nv))
        v, a = rng.uniform(-2.0, 2.0, model.nv), rng.uniform(-4.0, 4.0, model.nv)
        forces = pin.rnea(model, data, q, v, a).copy()
        regressor = pin.computeJointTorqueRegressor(model, data, q, v, a).copy()
        order = [10 * j + k for j in range(model.njoints - 1) for k in COLUMNS]
        base = pin.SE3(pin.Quaternion(q[3:7]).toRotationMatrix(), q[:3])
        # What an IMU at the base's origin reads; rates and accelerations are components in its axes.
        acceleration = a[:3] + np.cross(v[3:6], v[:3]) - base.rotation.T @ GRAVITY
        positions = []
        for link, made in list(zip(links, model.joints[1:]))[1:]:
            positions += coordinates(link["kind"], q[made.idx_q : made.idx_q + made.nq])
        cases.append(
            {
                "base": {"specific_force": acceleration.tolist(), "rate": v[3:6].tolist(), "change": a[3:6].tolist()},
                "q": positions,
                "v": v[6:].tolist(),
                "dv": a[6:].tolist(),
                "forces": forces.tolist(),
                "regressor": regressor[:, order].tolist(),
            }
        )
    print(json.dumps({"pinocchio": pin.__version__, "links": links, "cases": cases}))


main()
