"""Plain least squares by Pinocchio and numpy: NRMSE of every joint of one recording predicted by another.

Usage: least_squares.py ROBOT.urdf LOCKED FIRST.csv SECOND.csv; LOCKED are joints with commas, or "-".
Accelerations are central differences of the rates; rows and efforts go through a window (1 - x^2)^8 of 0.1 s. The arm never
rests.
"""

import json
import sys

import numpy as np
import pinocchio as pin

WIDTH_S = 0.1


def rows(model, path):
    """Rows and efforts by joints."""
    with open(path) as file:
        names = file.readline().strip().split(",")
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    joints = [model.names[i] for i in range(1, model.njoints)]
    column = lambda unit: np.stack([table[:, names.index(f"{j}_{unit}")] for j in joints], axis=1)
    q, v, tau = column("rad"), column("radps"), column("nm")
    step = table[1, 0] - table[0, 0]
    a = np.gradient(v, step, axis=0)
    data, n = model.createData(), len(joints)
    half = WIDTH_S / step / 2
    reach = int(np.ceil(half)) - 1
    window = (1 - (np.arange(-reach, reach + 1) / half) ** 2) ** 8
    window /= window.sum()
    regressors = np.stack([pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k]) for k in range(len(q))])
    smooth = lambda x: np.apply_along_axis(lambda c: np.convolve(c, window, mode="valid"), 0, x)
    out = []
    for j in range(n):
        own = np.zeros((len(q), 4 * n))
        own[:, 4 * j : 4 * j + 4] = np.stack([v[:, j], np.sign(v[:, j]), np.ones(len(q)), a[:, j]], axis=1)
        matrix = smooth(np.hstack([regressors[:, j, :], own]))
        out.append((matrix[::2], smooth(tau[:, j : j + 1])[::2, 0]))
    return out


def main():
    robot, locked, first, second = sys.argv[1:]
    model = pin.buildModelFromUrdf(robot)
    if locked != "-":
        ids = [model.getJointId(name) for name in locked.split(",")]
        model = pin.buildReducedModel(model, ids, pin.neutral(model))
    train, test = rows(model, first), rows(model, second)
    matrix = np.vstack([own for own, _ in train])
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1
    phi = np.linalg.lstsq(matrix / scale, np.concatenate([tau for _, tau in train]), rcond=1e-7)[0] / scale
    print(json.dumps([float(np.sqrt(np.mean((tau - own @ phi) ** 2)) / np.std(tau)) for own, tau in test]))


main()
