"""Holds a recording against Pinocchio: inverse dynamics with a free base, and the recorded wrenches as external forces."""

import csv

import numpy as np
import pinocchio as pin


def forces_of(model, data, robot, wrenches):
    """The recorded wrenches as Pinocchio's external forces, in the axes of the joints."""
    external = pin.StdVec_Force()
    for _ in range(model.njoints):
        external.append(pin.Force.Zero())
    for foot, wrench in zip(robot["feet"], wrenches):
        frame = model.frames[model.getFrameId(f"{foot['name']} sensor")]
        external[frame.parentJoint] += frame.placement.act(pin.Force(wrench))
    return external


def at_instants(model, robot, names, rows, trace):
    """MuJoCo's own accelerations, and no rounding: worst errors of torques, of the base's wrench, of the specific force."""
    data = model.createData()
    n, m = len(names), 6 * len(robot["feet"])
    joints = [model.joints[model.getJointId(name)] for name in names]
    iq, iv = [j.idx_q for j in joints], [j.idx_v for j in joints]
    worst = {"torque": 0.0, "base_force": 0.0, "base_moment": 0.0, "specific_force": 0.0}
    largest = {"torque": 0.0, "weight": sum(i.mass for i in model.inertias) * 9.80665}
    for row, kept in zip(rows, trace):
        qpos, qvel, qacc, torque = np.split(kept, np.cumsum([n + 7, n + 6, n + 6]))
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        turn = pin.Quaternion(qpos[3], *qpos[4:7]).normalized()
        r = turn.toRotationMatrix()
        q[:3], q[3:7] = qpos[:3], turn.coeffs()
        v[:3], v[3:6] = r.T @ qvel[:3], qvel[3:6]
        # MuJoCo's linear part is of the origin in the world's axes, Pinocchio's is spatial, in the base's.
        a[:3] = r.T @ qacc[:3] - np.cross(v[3:6], v[:3])
        a[3:6] = qacc[3:6]
        q[iq], v[iv], a[iv] = qpos[7:], qvel[6:], qacc[6:]
        got = pin.rnea(model, data, q, v, a, forces_of(model, data, robot, row[-m:].reshape(-1, 6)))
        worst["torque"] = max(worst["torque"], np.max(np.abs(got[iv] - torque)))
        worst["base_force"] = max(worst["base_force"], np.max(np.abs(got[:3])))
        worst["base_moment"] = max(worst["base_moment"], np.max(np.abs(got[3:6])))
        largest["torque"] = max(largest["torque"], np.max(np.abs(torque)))
        p = np.array(robot["imu"])
        origin = a[:3] + np.cross(v[3:6], v[:3]) + r.T @ [0, 0, 9.80665]
        there = origin + np.cross(a[3:6], p) + np.cross(v[3:6], np.cross(v[3:6], p))
        worst["specific_force"] = max(worst["specific_force"], np.max(np.abs(there - row[1:4])))
    return {k: float(f"{v:.3g}") for k, v in {**worst, **{f"largest_{k}": v for k, v in largest.items()}}.items()}


def of_file(path, model, robot, names):
    """The file alone: its accelerations are slopes of its rates, by cubics through seven samples; the base's attitude is taken
    as level, since with a specific force instead of gravity it does not matter. Root mean squares, and those of the signals."""
    with open(path) as file:
        reader = csv.reader(file)
        columns = {name: k for k, name in enumerate(next(reader))}
        table = np.array([[float(v) for v in row] for row in reader])
    pick = lambda wanted: table[:, [columns[c] for c in wanted]]
    t = table[:, 0]
    dt = t[1] - t[0]
    slope = np.array([22, -67, -58, 0, 58, 67, -22]) / (252 * dt)
    mean = np.array([-2, 3, 6, 7, 6, 3, -2]) / 21
    along = lambda x, kernel: np.column_stack([np.convolve(c, kernel[::-1], "valid") for c in x.T])
    gyro = pick([f"imu_g{a}_radps" for a in "xyz"])
    force = pick([f"imu_a{a}_mps2" for a in "xyz"])
    angle, rate, torque = (pick([f"{n}_{u}" for n in names]) for u in ("rad", "radps", "nm"))
    feet = pick([f"{f['name']}_{c}" for f in robot["feet"] for c in ("fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm")])
    change, acceleration = along(gyro, slope), along(rate, slope)
    data = model.createData()
    joints = [model.joints[model.getJointId(name)] for name in names]
    iq, iv = [j.idx_q for j in joints], [j.idx_v for j in joints]
    weightless = pin.Model(model)
    weightless.gravity.linear = np.zeros(3)
    p = np.array(robot["imu"])
    left, of_feet = [], []
    for k in range(3, len(t) - 3):
        w, dw = gyro[k], change[k - 3]
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        v[3:6], a[3:6] = w, dw
        a[:3] = force[k] - np.cross(dw, p) - np.cross(w, np.cross(w, p))
        q[iq], v[iv], a[iv] = angle[k], rate[k], acceleration[k - 3]
        wrench = feet[k].reshape(-1, 6)
        got = pin.rnea(weightless, data, q, v, a, forces_of(model, data, robot, wrench))
        left.append(np.concatenate([got[:6], got[iv] - torque[k]]))
    rms = lambda x: float(f"{np.sqrt(np.mean(np.square(x))):.3g}")
    left = np.array(left)
    # Angles against the integral of rates: the same instant.
    steps = (along(angle, slope) - rate[3:-3])
    # The middle half of the errors, which a landing's knocks do not reach.
    calm = lambda x: float(f"{np.quantile(np.abs(x), 0.5):.3g}")
    return {
        "base_force": (rms(left[:, :3]), calm(left[:, :3])),
        "base_moment": (rms(left[:, 3:6]), calm(left[:, 3:6])),
        "torque": (rms(left[:, 6:]), calm(left[:, 6:])),
        "rates": (rms(steps), calm(steps)),
        "signals": {"feet_force": rms(feet.reshape(len(t), -1, 6)[:, :, :3]), "torque": rms(torque)},
    }
