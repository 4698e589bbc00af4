"""A body on hooked springs, simulated beside Rigident: it shares no code with it.

Springs are lines between points: their force is along the line from the platform to the frame, of any
stretch, so that preload, pendulum and large angles are there without a formula for them. Springs have mass,
may stiffen, and may be elsewhere than the rig file states. Several worlds are integrated at once.

    python world.py FOLDER FIRST COUNT [key=value …]

writes NUMBER.csv, NUMBER.rig.toml and NUMBER.json (the truth) for each number. Keys are those of DEFAULTS.
"""

import json
import sys
from pathlib import Path

import numpy as np

G = 9.80665
DEFAULTS = dict(
    seconds=40.0,
    rate=120.0,
    marker_m=2e-4,
    amplitude=0.5,  # 1: some 6 mm and 0.5 degrees
    place_m=0.0,  # standard deviations of what the rig file states wrongly
    axis_rad=0.0,
    height_m=0.0,
    length_m=0.0,
    pull=0.0,
    stiffness=0.0,
    common=0.0,
    mass_kg=0.0,  # of each spring
    mass_is_stated=1,
    stiffens=0.0,  # relative tangent stiffness more at 15 mm
    damping=0.004,
    lean=0.12,  # tangent of the main springs' lean
    near=0.0,  # frequency of the sway along y by that along x; 0: as it comes
    air_m=0.0,  # a square plate of this side takes air with it
    rests=0,  # bare platform and one known mass at rest, as states of the rig file
    rest_m=1e-4,
    keys="",  # lines of [suspension] in the rig file, parted by ';'
)
MARKERS = np.array(
    [[0.3, 0.2, 0.02], [-0.3, 0.2, 0.05], [-0.3, -0.2, 0.02], [0.3, -0.2, 0.0], [0.0, 0.25, 0.12], [0.1, -0.1, 0.1]]
)
PLATE = dict(mass=11.3, com=[0.004, -0.003, 0.01], inertia=[0.42, 0.78, 1.15, 0.01, -0.02, 0.005])
BASE = np.array([0.02, -0.01, 0.03])
# What is placed on it for a state of rest: kg and m.
WEIGHT = (5.0, np.array([0.15, 0.1, 0.05]))


def tensor(six):
    xx, yy, zz, yz, zx, xy = six
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def cross(v):
    """Matrices of v × for vectors (..., 3)."""
    out = np.zeros(v.shape + (3,))
    out[..., 0, 1], out[..., 0, 2] = -v[..., 2], v[..., 1]
    out[..., 1, 0], out[..., 1, 2] = v[..., 2], -v[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -v[..., 1], v[..., 0]
    return out


def about(mass, com, inertia):
    """Mass matrix about the origin, 6 × 6, shifts first."""
    com = np.asarray(com, float)
    arm = cross(com)
    out = np.zeros((6, 6))
    out[:3, :3] = mass * np.eye(3)
    out[:3, 3:] = -mass * arm
    out[3:, :3] = mass * arm
    out[3:, 3:] = np.asarray(inertia) - mass * arm @ arm
    return out


def turned(q):
    """Rotation matrices of quaternions w x y z (N, 4)."""
    w, x, y, z = q.T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], -1),
            np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], -1),
            np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )


def quaternion(matrix):
    """Quaternions w x y z of rotation matrices near the identity (..., 3, 3)."""
    w = 0.5 * np.sqrt(np.maximum(1 + np.trace(matrix, axis1=-2, axis2=-1), 1e-12))
    part = np.stack(
        [
            matrix[..., 2, 1] - matrix[..., 1, 2],
            matrix[..., 0, 2] - matrix[..., 2, 0],
            matrix[..., 1, 0] - matrix[..., 0, 1],
        ],
        -1,
    )
    q = np.concatenate([w[..., None], part / (4 * w[..., None])], -1)
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


class Worlds:
    """Platforms on springs, one for each seed."""

    def __init__(self, seeds, keys):
        self.keys, self.n = keys, len(seeds)
        self.random = [np.random.default_rng(seed) for seed in seeds]
        built = [self.build(random) for random in self.random]
        stack = lambda name: np.array([one[name] for one in built])
        for name in ("p", "g", "k", "rest", "pull", "mass", "body", "plate"):
            setattr(self, name, stack(name))
        self.bodies = [one["ten"] for one in built]
        self.cubic = keys["stiffens"] / (3 * 0.015**2)
        self.r, self.q = np.zeros((self.n, 3)), np.tile([1.0, 0, 0, 0], (self.n, 1))
        if keys["near"]:
            self.tune(keys["near"])
        self.settle()

    def build(self, random):
        lean, pull = self.keys["lean"], 60.0
        side = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1.0]])
        at = np.column_stack([0.29 * side[:, 0], 0.24 * side[:, 1], np.full(4, 0.11)])
        at += random.uniform(-0.02, 0.02, (4, 3))
        tilt = np.column_stack([-lean * side[:, 0], -lean * side[:, 1], np.ones(4)])
        tilt += random.uniform(-0.03, 0.03, (4, 3))
        across = np.array([[0.42, 0.05, 0.03], [-0.42, -0.06, 0.05], [0.04, 0.33, 0.04], [-0.05, -0.33, 0.02]])
        ways = np.array([[1, 0.03, 0], [-1, 0.02, 0.03], [0.02, 1, 0.0], [0.0, -1, 0.03]])
        p, n = np.vstack([at, across]), np.vstack([tilt, ways])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        length = np.concatenate([random.uniform(0.3, 0.4, 4), np.full(4, 0.35)])
        k = np.concatenate([2600 * random.uniform(0.9, 1.1, 4), [1500, 1700, 2700, 3000]])
        mass = 20.4 * random.uniform(0.95, 1.05)
        com = np.array([0.03, -0.02, 0.06]) + random.uniform(-0.02, 0.02, 3)
        inertia = np.array([0.22, 0.45, 0.5, 0.02, -0.03, 0.01]) * random.uniform(0.9, 1.1)
        body = about(mass, BASE + com, tensor(inertia))
        plate = about(PLATE["mass"], PLATE["com"], tensor(PLATE["inertia"]))
        # Pulls that carry the weight, as far as springs of these axes can.
        weight = (mass + PLATE["mass"] + 4 * self.keys["mass_kg"]) * G
        pulls = np.concatenate([0.25 * weight * random.uniform(0.9, 1.1, 4), np.full(4, pull)])
        ten = dict(mass=mass, com=com.tolist(), inertia=inertia.tolist())
        own = np.full(8, self.keys["mass_kg"])
        return dict(p=p, g=p + n * length[:, None], k=k, rest=length, pull=pulls, mass=own, body=body, plate=plate, ten=ten)

    def moving(self, with_body=True, added=None):
        """Mass matrices of what moves about P's origin, and the weights: total and first moment."""
        third = [sum(about(m / 3, at, np.zeros((3, 3))) for m, at in zip(ms, ats)) for ms, ats in zip(self.mass, self.p)]
        half = [sum(about(m / 2, at, np.zeros((3, 3))) for m, at in zip(ms, ats)) for ms, ats in zip(self.mass, self.p)]
        own = self.plate + (self.body if with_body else 0)
        if added is not None:
            own = own + about(added[0], added[1], np.zeros((3, 3)))
        heavy = own + np.array(half)
        moves = own + np.array(third)
        side = self.keys["air_m"]
        if side:
            # A square plate takes 0.579 π/4 ρ b³ with it, M. Patton 1965 by Blevins.
            air = 0.579 * np.pi / 4 * 1.2 * side**3
            moves = moves + np.diag([0, 0, air, air * side**2 / 20, air * side**2 / 20, 0])
        moment = np.stack([heavy[:, 5, 1], heavy[:, 3, 2], heavy[:, 4, 0]], -1)
        return moves, heavy[:, 0, 0], moment

    def wrench(self, r, turn, weight, moment, rates=None):
        """Force in the world and moment about P's origin, world axes."""
        arm = np.einsum("nij,nsj->nsi", turn, self.p)
        line = self.g - r[:, None] - arm
        length = np.sqrt(np.einsum("nsi,nsi->ns", line, line))
        line /= length[..., None]
        u = length - self.rest
        pull = self.pull + self.k * u * (1 + self.cubic * u * u)
        force = pull[..., None] * line
        if rates is not None:
            v, w = rates
            moves = v[:, None] + np.cross(w[:, None], arm)
            rate = self.k * (2 * self.keys["damping"] / 12.0)
            force -= (0.15 * rate)[..., None] * moves
            force -= (0.85 * rate * np.einsum("nsi,nsi->ns", moves, line))[..., None] * line
        total = force.sum(1)
        total[:, 2] -= G * weight
        about_p = np.cross(arm, force).sum(1)
        lever = np.einsum("nij,nj->ni", turn, moment)
        about_p[:, 0] -= G * lever[:, 1]
        about_p[:, 1] += G * lever[:, 0]
        return total, about_p

    def stiffness(self, r, q, weight, moment):
        """Slopes of the wrench about a pose, by differences."""
        out = np.zeros((self.n, 6, 6))
        for j in range(6):
            ends = []
            for side in (1e-6, -1e-6):
                step = np.zeros((self.n, 6))
                step[:, j] = side
                small = np.column_stack([np.ones(self.n), 0.5 * step[:, 3:]])
                small /= np.linalg.norm(small, axis=1, keepdims=True)
                f, m = self.wrench(r + step[:, :3], turned(small) @ turned(q), weight, moment)
                ends.append(np.column_stack([f, m]))
            out[:, :, j] = -(ends[0] - ends[1]) / 2e-6
        return out

    def equilibrium(self, weight, moment, r, q):
        for _ in range(40):
            f, m = self.wrench(r, turned(q), weight, moment)
            step = np.linalg.solve(self.stiffness(r, q, weight, moment), np.column_stack([f, m])[..., None])[..., 0]
            r = r + step[:, :3]
            small = np.column_stack([np.ones(self.n), 0.5 * step[:, 3:]])
            q = quaternion(turned(small / np.linalg.norm(small, axis=1, keepdims=True)) @ turned(q))
            if np.abs(step).max() < 1e-13:
                break
        assert np.abs(step).max() < 1e-9, step
        return r, q

    def settle(self):
        """Finds the rest, and makes P level there: the platform is levelled before it is measured."""
        for _ in range(6):
            moves, weight, moment = self.moving()
            r, q = self.equilibrium(weight, moment, self.r * 0, np.tile([1.0, 0, 0, 0], (self.n, 1)))
            turn = turned(q)
            # The frame's anchors move so that P rests level at the origin.
            self.g = np.einsum("nji,nsj->nsi", turn, self.g - r[:, None])
            line = self.g - self.p
            length = np.sqrt(np.einsum("nsi,nsi->ns", line, line))
            u = length - self.rest
            self.pull = self.pull + self.k * u * (1 + self.cubic * u * u)
            self.rest = length
        r, q = self.equilibrium(weight, moment, self.r * 0, np.tile([1.0, 0, 0, 0], (self.n, 1)))
        self.r, self.q = r, q
        self.moves = moves
        self.axes = self.g - self.r[:, None] - np.einsum("nij,nsj->nsi", turned(self.q), self.p)
        self.axes = np.einsum("nji,nsj->nsi", turned(self.q), self.axes)
        self.length = np.linalg.norm(self.axes, axis=-1)
        self.axes /= self.length[..., None]
        k = self.stiffness(self.r, self.q, weight, moment)
        self.hz = np.sqrt(np.array([np.sort(np.linalg.eigvals(np.linalg.solve(m, s)).real) for m, s in zip(moves, k)]))
        self.hz /= 2 * np.pi

    def tune(self, ratio):
        """Makes the frequency of the sway along y that of the sway along x, times a ratio."""
        for _ in range(30):
            self.settle()
            moves, weight, moment = self.moving()
            k = self.stiffness(self.r, self.q, weight, moment)
            for i in range(self.n):
                values, shapes = np.linalg.eig(np.linalg.solve(moves[i], k[i]))
                values, shapes = values.real, np.abs(shapes.real)
                sways = [np.argmax(shapes[j] / np.linalg.norm(shapes[:3], axis=0).clip(1e-9) * (shapes[j] > 0.1 * np.linalg.norm(shapes, axis=0))) for j in (0, 1)]
                off = ratio**2 * values[sways[0]] / values[sways[1]]
                self.k[i, 6:] *= np.clip(off, 0.5, 2.0) ** 0.7

    def swing(self):
        """Poses at the cameras' rate after a strike: positions (T, N, 3), quaternions (T, N, 4)."""
        keys = self.keys
        moves, weight, moment = self.moving()
        inverse = np.linalg.inv(moves)
        size = keys["amplitude"]
        v = np.array([random.choice([-1, 1], 3) * random.uniform(0.03, 0.07, 3) for random in self.random]) * size
        w = np.array([random.choice([-1, 1], 3) * random.uniform(0.06, 0.14, 3) for random in self.random]) * size
        state = np.column_stack([self.r, self.q, v, w])
        steps = max(1, int(np.ceil(240 / keys["rate"])))
        dt = 1 / (keys["rate"] * steps)

        def slope(s):
            r, q, v, w = s[:, :3], s[:, 3:7], s[:, 7:10], s[:, 10:]
            q = q / np.linalg.norm(q, axis=1, keepdims=True)
            turn = turned(q)
            world = np.einsum("nij,nj->ni", turn, v), np.einsum("nij,nj->ni", turn, w)
            f, m = self.wrench(r, turn, weight, moment, world)
            f, m = np.einsum("nji,nj->ni", turn, f), np.einsum("nji,nj->ni", turn, m)
            momentum = np.einsum("nij,nj->ni", moves, np.column_stack([v, w]))
            f = f - np.cross(w, momentum[:, :3])
            m = m - np.cross(w, momentum[:, 3:]) - np.cross(v, momentum[:, :3])
            change = np.einsum("nij,nj->ni", inverse, np.column_stack([f, m]))
            a, b, c, d = q.T
            x, y, z = w.T
            dq = 0.5 * np.column_stack([-b * x - c * y - d * z, a * x + c * z - d * y, a * y - b * z + d * x, a * z + b * y - c * x])
            return np.column_stack([world[0], dq, change])

        out = []
        for frame in range(int(keys["seconds"] * keys["rate"])):
            out.append(state[:, :7].copy())
            for _ in range(steps):
                a = slope(state)
                b = slope(state + 0.5 * dt * a)
                c = slope(state + 0.5 * dt * b)
                state = state + dt / 6 * (a + 2 * b + 2 * c + slope(state + dt * c))
                state[:, 3:7] /= np.linalg.norm(state[:, 3:7], axis=1, keepdims=True)
        out = np.array(out)
        return out[..., :3], out[..., 3:]

    def seen(self, i, r, q):
        """Poses of world i by markers with noise (T, 7)."""
        turn = turned(q)
        at = r[:, None] + np.einsum("tij,mj->tmi", turn, MARKERS)
        at = at + self.random[i].normal(0, self.keys["marker_m"], at.shape)
        own = MARKERS - MARKERS.mean(0)
        middle = at.mean(1)
        u, _, vt = np.linalg.svd(np.einsum("tmi,mj->tij", at - middle[:, None], own))
        u[..., -1] *= np.sign(np.linalg.det(u @ vt))[:, None]
        found = u @ vt
        place = middle - np.einsum("tij,j->ti", found, MARKERS.mean(0))
        return np.column_stack([place, quaternion(found)])

    def rests(self, i_all):
        """Rest poses without the body and with a known mass, (N, 7) each."""
        level = np.tile([1.0, 0, 0, 0], (self.n, 1))
        _, *bare = self.moving(with_body=False)
        _, *loaded = self.moving(added=WEIGHT)
        return [np.column_stack(self.equilibrium(*own, self.r * 0, level)) for own in (bare, loaded)]

    def rig(self, i, rests):
        """The rig file as somebody measures it."""
        keys, random = self.keys, self.random[i]
        raised = random.normal(0, 1) * keys["height_m"]
        common = random.normal(0, 1) * keys["common"]
        lines = ["[suspension]", f"base_position_m = {BASE.tolist()}"]
        lines += [line for line in str(keys["keys"]).split(";") if line]
        for s in range(self.k.shape[1]):
            at = self.p[i, s] + random.normal(0, 1, 3) * keys["place_m"] + [0, 0, raised]
            n = self.axes[i, s]
            n = n + np.cross(random.normal(0, 1, 3) * keys["axis_rad"], n)
            k = self.k[i, s] * (1 + random.normal(0, 1) * keys["stiffness"] + common)
            length = self.length[i, s] + random.normal(0, 1) * keys["length_m"]
            lines += ["[[suspension.spring]]", f"at_m = {at.tolist()}", f"axis = {n.tolist()}", f"axial_npm = {k}"]
            lines += [f"length_m = {length}"]
            if s > 3:
                lines += [f"pull_n = {self.pull[i, s] * (1 + random.normal(0, 1) * keys['pull'])}"]
            if keys["mass_kg"] and keys["mass_is_stated"]:
                lines += [f"mass_kg = {keys['mass_kg']}"]
        plate = PLATE
        lines += ["[suspension.platform]", f"mass_kg = {plate['mass']}", f"com_m = {plate['com']}"]
        lines += [f"inertia_com_kgm2 = {plate['inertia']}"]
        for name, pose in rests:
            lines += ["[[suspension.rest]]"] + name
            lines += [f"position_m = {pose[:3].tolist()}", f"rotation_wxyz = {pose[3:].tolist()}"]
            lines += [f"position_std_m = {keys['rest_m']}", f"rotation_std_rad = {2 * keys['rest_m']}"]
        return "\n".join(lines) + "\n"


def main(folder, first, count, keys):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    worlds = Worlds([1000 + first + i for i in range(count)], keys)
    positions, attitudes = worlds.swing()
    rests = worlds.rests(None) if keys["rests"] else []
    header = "t_s,x_m,y_m,z_m,qw,qx,qy,qz"
    t = np.arange(len(positions)) / keys["rate"]
    for i in range(count):
        name = folder / f"{first + i}"
        poses = worlds.seen(i, positions[:, i], attitudes[:, i])
        np.savetxt(f"{name}.csv", np.column_stack([t, poses]), "%.9f", ",", header=header, comments="")
        stated = []
        for state, own in zip((["body = false"], [f"added_kg = {WEIGHT[0]}", f"added_at_m = {WEIGHT[1].tolist()}"]), rests):
            noise = worlds.random[i].normal(0, keys["rest_m"], 3)
            small = np.concatenate([[1.0], worlds.random[i].normal(0, keys["rest_m"], 3)])[None]
            q = quaternion(turned(small / np.linalg.norm(small)) @ turned(own[i : i + 1, 3:]))[0]
            stated.append((state, np.concatenate([own[i, :3] + noise, q])))
        Path(f"{name}.rig.toml").write_text(worlds.rig(i, stated))
        truth = dict(worlds.bodies[i], hz=worlds.hz[i].tolist(), sag_mm=1e3 * worlds.keys["rests"])
        Path(f"{name}.json").write_text(json.dumps(truth))


if __name__ == "__main__":
    chosen = dict(DEFAULTS)
    for argument in sys.argv[4:]:
        key, value = argument.split("=", 1)
        assert key in DEFAULTS, key
        chosen[key] = value if key == "keys" else type(DEFAULTS[key])(float(value))
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), chosen)
