"""Plans a motion: feet, centre of mass, the base's attitude and the free joints are given over time, the legs follow by
inverse kinematics, and inverse dynamics give torques and the feet's forces. Pinocchio; every array has one row an instant."""

import numpy as np
import pinocchio as pin

GRAVITY = 9.80665


def step(x):
    """0 to 1 with three continuous derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)


def window(t, start, end, ramp):
    """1 from `start` to `end`, with ramps outside."""
    return step((t - start + ramp) / ramp) * (1.0 - step((t - end) / ramp))


def through(t, knots):
    """Polynomials through knots (time, value, rate, acceleration), the jerk zero at each; held constant outside."""
    y = np.where(t < knots[0][0], knots[0][1], knots[-1][1]).astype(float)
    for (t0, p0, v0, a0), (t1, p1, v1, a1) in zip(knots, knots[1:]):
        T = t1 - t0
        s = (t - t0) / T
        c = [p0, v0 * T, a0 * T**2 / 2, 0.0]
        d, dv, da = p1 - sum(c), v1 * T - c[1] - 2 * c[2], a1 * T**2 - 2 * c[2]
        ends = [[1, n, n * (n - 1), n * (n - 1) * (n - 2)] for n in range(4, 8)]
        c += list(np.linalg.solve(np.array(ends, float).T, [d, dv, da, 0.0]))
        y = np.where((t >= t0) & (t <= t1), sum(k * s**n for n, k in enumerate(c)), y)
    return y


def waves(t, rng, amplitude, low, high):
    """Two sines of random phase, together at most `amplitude`."""
    f = rng.uniform([low, 0.5 * (low + high)], [0.5 * (low + high), high])
    phase = rng.uniform(0, 2 * np.pi, 2)
    return amplitude * (0.6 * np.sin(2 * np.pi * f[0] * t + phase[0]) + 0.4 * np.sin(2 * np.pi * f[1] * t + phase[1]))


def landed(z, speed, T):
    """Depth at which a fall at `speed` is stopped in `T` with the smallest peak of force."""
    t = np.linspace(0, T, 200)
    best = None
    for depth in np.linspace(0.2, 0.9, 71) * speed * T:
        y = through(t, [(0, 0, -speed, -GRAVITY), (T, -depth, 0, 0)])
        peak = np.max(np.diff(y, 2)) / (t[1] ** 2)
        if best is None or peak < best[0]:
            best = (peak, z - depth)
    return best[1]


class Plan:
    """Positions q, rates v, accelerations a (Pinocchio's), joint torques, and the map from a wrench on the base to torques."""

    def __init__(self, model, feet, legs, t, q0, base, joints, centre, places, turns, load, gate, fall):
        """`base`: rotations; `joints`: dict name to angles; `centre`: of mass; `places`, `turns`: of feet, lists;
        `load`: share of each foot, `gate`: whether any stands; until `fall` none does."""
        data = model.createData()
        frames = [model.getFrameId(foot["name"]) for foot in feet]
        columns = [0, 1, 2] + [model.joints[model.getJointId(name)].idx_v for name in legs]
        n = len(t)
        q = np.tile(q0, (n, 1))
        for name, angles in joints.items():
            q[:, model.joints[model.getJointId(name)].idx_q] = angles
        self.residual = 0.0
        previous = q0.copy()
        for k in range(n):
            now = q[k]
            now[:3] = previous[:3]
            for name in legs:
                i = model.joints[model.getJointId(name)].idx_q
                now[i] = previous[i]
            now[3:7] = pin.Quaternion(base[k]).coeffs()
            for _ in range(30):
                error, jacobian = self.errors(model, data, frames, feet, now, centre[k], places, turns, k)
                size = np.max(np.abs(error))
                if size < 1e-12:
                    break
                change = np.zeros(model.nv)
                change[columns] = np.linalg.solve(jacobian[:, columns], -error)
                now[:] = pin.integrate(model, now, change)
            if size > 1e-9:
                raise SystemExit(f"no pose at {t[k]:.3f} s: {size:.3g}; legs too short?")
            self.residual = max(self.residual, size)
            previous = now
        self.t, self.q = t, q
        self.rates(model)
        self.fly(model, data, int(np.searchsorted(t, fall)))
        self.rates(model)
        self.dynamics(model, data, frames, feet, load, gate)

    def rates(self, model):
        n, dt = len(self.t), self.t[1] - self.t[0]
        ahead = np.array([pin.difference(model, self.q[k], self.q[k + 1]) for k in range(n - 1)]) / dt
        self.v = np.vstack([1.5 * ahead[0] - 0.5 * ahead[1], 0.5 * (ahead[1:] + ahead[:-1]), ahead[-1]])
        middle = np.diff(ahead, axis=0) / dt
        self.a = np.vstack([middle[0], middle, middle[-1]])

    def fly(self, model, data, end):
        """Before the landing the base moves as momentum has it: backwards from there, the joints as they are."""
        dt = self.t[1] - self.t[0]
        mass = sum(inertia.mass for inertia in model.inertias)
        last = pin.computeCentroidalMap(model, data, self.q[end]) @ self.v[end]

        def base_rate(q, k, time):
            momentum = last.copy()
            momentum[2] += mass * GRAVITY * (self.t[end] - time)
            shares = pin.computeCentroidalMap(model, data, q)
            return np.linalg.solve(shares[:, :6], momentum - shares[:, 6:] @ self.v[k, 6:])

        for k in range(end, 0, -1):
            back = np.zeros(model.nv)
            back[:6] = -0.5 * dt * base_rate(self.q[k], k, self.t[k])
            half = pin.integrate(model, self.q[k], back)
            half[7:] = 0.5 * (self.q[k, 7:] + self.q[k - 1, 7:])
            back[:6] = -dt * base_rate(half, k, self.t[k] - 0.5 * dt)
            self.q[k - 1, :7] = pin.integrate(model, self.q[k], back)[:7]

    @staticmethod
    def errors(model, data, frames, feet, q, centre, places, turns, k):
        pin.computeJointJacobians(model, data, q)
        jacobian_of_centre = pin.jacobianCenterOfMass(model, data, q)
        pin.updateFramePlacements(model, data)
        errors, jacobians = [data.com[0] - centre], [jacobian_of_centre]
        for frame, foot, place, turn in zip(frames, feet, places, turns):
            at = data.oMf[frame]
            if foot["points"] == 1:
                errors.append(at.translation - place[k])
                jacobians.append(pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3])
            else:
                wanted = pin.SE3(turn[k], place[k])
                error = pin.log6(wanted.actInv(at))
                errors.append(error.vector)
                jacobians.append(pin.Jlog6(wanted.actInv(at)) @ pin.getFrameJacobian(model, data, frame, pin.LOCAL))
        return np.concatenate(errors), np.vstack(jacobians)

    def dynamics(self, model, data, frames, feet, load, gate):
        n = len(self.t)
        self.gate = gate
        self.torque = np.zeros((n, model.nv - 6))
        self.lever = np.zeros((n, model.nv - 6, 6))
        self.forces = np.zeros((n, len(feet), 6))
        wide = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01])
        for k in range(n):
            need = pin.rnea(model, data, self.q[k], self.v[k], self.a[k]).copy()
            pin.computeJointJacobians(model, data, self.q[k])
            pin.updateFramePlacements(model, data)
            stacked, weights = [], []
            for i, (frame, foot) in enumerate(zip(frames, feet)):
                j = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
                rows = 3 if foot["points"] == 1 else 6
                stacked.append(j[:rows])
                weights.append((load[k, i] + 1e-9) * wide[:rows])
            stacked, weights = np.vstack(stacked), np.concatenate(weights)
            onto = stacked[:, :6].T
            # f = W Aᵀ (A W Aᵀ)⁻¹ w: least forces that carry the wrench w, in the axes of the base.
            share = (weights[:, None] * onto.T) @ np.linalg.inv((onto * weights) @ onto.T)
            force = gate[k] * share @ need[:6]
            self.torque[k] = need[6:] - stacked[:, 6:].T @ force
            self.lever[k] = -gate[k] * stacked[:, 6:].T @ share
            at = 0
            for i, foot in enumerate(feet):
                rows = 3 if foot["points"] == 1 else 6
                self.forces[k, i, :rows] = force[at : at + rows]
                at += rows
