"""Recorded vectors for the suspended platform from an independent multibody engine, MuJoCo.

The engine gets the bodies, a free joint (or two slides and a ball, where z is locked), ball joints and hinges. The springs'
forces are laid on their anchors as point forces by this script, and so is nothing else: places, rates, gravity and accelerations
are the engine's. `states` are single instants with the accelerations there, `path` is a motion from the first state, by a
Runge-Kutta scheme of fourth order on the engine's accelerations with steps of 0.1 ms.

    pip install mujoco==4.0.0 numpy
    python suspension.py > suspension.json
"""
import json

import mujoco
import numpy as np

GRAVITY = 9.80665
STEP_S = 1e-4
PLATFORM = dict(mass_kg=9.0, com_m=[0.01, 0.0, -0.02], inertia_com_kgm2=[0.4, 0.35, 0.7, 0.01, 0.0, 0.02])
BASE = dict(mass_kg=30.0, com_m=[0.02, -0.2, -0.1], inertia_com_kgm2=[1.1, 0.8, 0.9, -0.08, 0.03, 0.05])
MOUNT = dict(position_m=[0.02, -0.03, 0.3], rotation_wxyz=[0.9, 0.1, -0.2, 0.3])
SMALL = dict(mass_kg=4.0, com_m=[0.03, -0.05, -0.15], inertia_com_kgm2=[0.031, 0.042, 0.025, 0.003, -0.004, 0.006])
LINKS = [
    dict(parent=0, joint_m=[0.05, 0.04, 0.1], axis=None, damping_nmspr=0.03, body=SMALL),
    dict(parent=1, joint_m=[0.0, 0.1, -0.3], axis=[0.3, 1.0, -0.2], damping_nmspr=0.02, body=SMALL),
    dict(parent=0, joint_m=[-0.1, 0.2, 0.05], axis=[1.0, 0.0, 0.5], damping_nmspr=0.0, body=SMALL),
    dict(parent=3, joint_m=[0.1, 0.0, 0.2], axis=None, damping_nmspr=0.01, body=SMALL),
]
SPRINGS = [
    dict(at_m=at, axis=axis, axial_npm=ka, lateral_npm=kl, axial_nspm=ca, lateral_nspm=cl, cubic_npm3=cubic, factor=factor)
    for at, axis, ka, kl, ca, cl, cubic, factor in [
        ([0.3, 0.25, -0.02], [0.1, 0.0, 1.0], 4000.0, 700.0, 8.0, 3.0, 2e4, 1.03),
        ([-0.35, 0.3, 0.0], [0.0, -0.2, 1.0], 4200.0, 650.0, 6.0, 2.0, 0.0, 0.98),
        ([-0.3, -0.3, 0.03], [0.0, 0.0, 1.0], 3900.0, 800.0, 8.0, 0.0, 1e4, 1.0),
        ([0.32, -0.28, 0.0], [-0.3, 0.1, 0.9], 4100.0, 720.0, 0.0, 3.0, 0.0, 1.01),
    ]
]


def inertial(body):
    xx, yy, zz, yz, zx, xy = body["inertia_com_kgm2"]
    full = " ".join(map(repr, [xx, yy, zz, xy, zx, yz]))
    com = " ".join(map(repr, body["com_m"]))
    return f'<inertial mass="{body["mass_kg"]!r}" pos="{com}" fullinertia="{full}"/>'


def element(number):
    """A link with all that hang on it."""
    link = LINKS[number - 1]
    at = " ".join(map(repr, link["joint_m"]))
    if link["axis"] is None:
        joint = f'<joint type="ball" damping="{link["damping_nmspr"]!r}"/>'
    else:
        axis = " ".join(map(repr, link["axis"]))
        joint = f'<joint type="hinge" axis="{axis}" damping="{link["damping_nmspr"]!r}"/>'
    return f'<body name="link{number}" pos="{at}">{joint}{inertial(link["body"])}{children(number)}</body>'


def children(number):
    return "".join(element(k + 1) for k, link in enumerate(LINKS) if link["parent"] == number)


def build(z_locked):
    at, turn = (" ".join(map(repr, MOUNT[k])) for k in ("position_m", "rotation_wxyz"))
    free = '<freejoint/>'
    if z_locked:
        free = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="ball"/>'
    return mujoco.MjModel.from_xml_string(f"""
<mujoco><compiler angle="radian" balanceinertia="false"/><option gravity="0 0 {-GRAVITY!r}"/><worldbody>
<body name="platform">{free}{inertial(PLATFORM)}
<body name="link0" pos="{at}" quat="{turn}">{inertial(BASE)}{children(0)}</body></body>
</worldbody></mujoco>""")


class Rig:
    def __init__(self, z_locked, rest):
        self.model = build(z_locked)
        self.data = mujoco.MjData(self.model)
        self.lin = 2 if z_locked else 3
        self.names = ["platform"] + [f"link{k}" for k in range(len(LINKS) + 1)]
        self.ids = [mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_BODY, n) for n in self.names]
        joints = [self.model.body_jntadr[i] for i in self.ids[2:]]
        self.q = [int(self.model.jnt_qposadr[j]) for j in joints]
        self.v = [int(self.model.jnt_dofadr[j]) for j in joints]
        # Least-norm upright preloads that carry the weight in the reference pose with the joints at rest.
        self.data.qpos[:], self.data.qvel[:] = self.pack(np.zeros(3), [1, 0, 0, 0], rest), 0.0
        mujoco.mj_forward(self.model, self.data)
        mass = self.model.body_mass[1:]
        com = (mass[:, None] * self.data.xipos[1:]).sum(0) / mass.sum()
        anchors = np.array([s["at_m"] for s in SPRINGS])
        lhs = np.stack([np.ones(len(anchors)), anchors[:, 1], -anchors[:, 0]])
        weight = mass.sum() * GRAVITY
        self.preload = np.linalg.lstsq(lhs, weight * np.array([1, com[1], -com[0]]), rcond=None)[0]

    def pack(self, position, attitude, joints):
        q = np.zeros(self.model.nq)
        q[:self.lin], q[self.lin:self.lin + 4] = position[:self.lin], np.array(attitude) / np.linalg.norm(attitude)
        for at, link, joint in zip(self.q, LINKS, joints):
            if link["axis"] is None:
                q[at:at + 4] = np.array(joint) / np.linalg.norm(joint)
            else:
                q[at] = joint
        return q

    def springs(self):
        """Wrench of the springs about P's origin; lays it on the engine's body as well."""
        platform, data = self.ids[0], self.data
        here, turn = data.xpos[platform], data.xmat[platform].reshape(3, 3)
        six = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_XBODY, platform, six, 0)
        data.qfrc_applied[:] = 0.0
        elastic, damping = np.zeros(6), np.zeros(6)
        for spring, preload in zip(SPRINGS, self.preload):
            at, n = np.array(spring["at_m"]), np.array(spring["axis"]) / np.linalg.norm(spring["axis"])
            along, across = np.outer(n, n), np.eye(3) - np.outer(n, n)
            arm = turn @ at
            d, rate = here + arm - at, six[3:] + np.cross(six[:3], arm)
            k = spring["factor"] * (spring["axial_npm"] * along + spring["lateral_npm"] * across)
            c = spring["axial_nspm"] * along + spring["lateral_nspm"] * across
            force = np.array([0, 0, preload]) - k @ d - spring["cubic_npm3"] * (d @ d) * d
            loss = -c @ rate
            elastic += np.concatenate([force, np.cross(arm, force)])
            damping += np.concatenate([loss, np.cross(arm, loss)])
            mujoco.mj_applyFT(self.model, data, force + loss, np.zeros(3), here + arm, platform, data.qfrc_applied)
        return elastic, damping

    def forward(self, qpos, qvel):
        self.data.qpos[:], self.data.qvel[:] = qpos, qvel
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)
        wrenches = self.springs()
        mujoco.mj_forward(self.model, self.data)
        return wrenches

    def balls(self):
        own = [(self.lin, self.lin)]
        return own + [(q, v) for q, v, link in zip(self.q, self.v, LINKS) if link["axis"] is None]

    def slope(self, state):
        """Derivative of places and rates; quaternions by q' = q (0, w) / 2."""
        nq = self.model.nq
        qpos, qvel = state[:nq].copy(), state[nq:]
        out = np.zeros(len(state))
        out[:self.lin] = qvel[:self.lin]
        for at, v, link in zip(self.q, self.v, LINKS):
            if link["axis"] is not None:
                out[at] = qvel[v]
        for at, v in self.balls():
            mujoco.mju_mulQuat(out[at:at + 4], qpos[at:at + 4], np.concatenate([[0.0], 0.5 * qvel[v:v + 3]]))
            qpos[at:at + 4] /= np.linalg.norm(qpos[at:at + 4])
        self.forward(qpos, qvel)
        out[nq:] = self.data.qacc
        return out

    def step(self, y, h):
        a = self.slope(y)
        b = self.slope(y + h / 2 * a)
        c = self.slope(y + h / 2 * b)
        d = self.slope(y + h * c)
        return y + h / 6 * (a + 2 * b + 2 * c + d)

    def joint_rates(self):
        """Places and rates of the joints in the words of the simulator: quaternions, and rates in links' axes."""
        turns, rates = [], []
        for at, v, link in zip(self.q, self.v, LINKS):
            if link["axis"] is None:
                turns.append(self.data.qpos[at:at + 4].tolist())
                rates.append(self.data.qvel[v:v + 3].tolist())
            else:
                n = np.array(link["axis"]) / np.linalg.norm(link["axis"])
                half = 0.5 * self.data.qpos[at]
                turns.append([np.cos(half), *(np.sin(half) * n)])
                rates.append((self.data.qvel[v] * n).tolist())
        return turns, rates

    def record(self, qpos, qvel):
        elastic, damping = self.forward(qpos, qvel)
        mujoco.mj_rnePostConstraint(self.model, self.data)
        frames = []
        for body in self.ids:
            rate, acceleration = np.zeros(6), np.zeros(6)
            kind = mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(self.model, self.data, kind, body, rate, 0)
            mujoco.mj_objectAcceleration(self.model, self.data, kind, body, acceleration, 0)
            # The engine's acceleration is that against free fall.
            linear = acceleration[3:] + np.array([0, 0, -GRAVITY])
            frames.append(dict(
                position_m=self.data.xpos[body].tolist(), rotation_wxyz=self.data.xquat[body].tolist(),
                velocity_mps=rate[3:].tolist(), rate_radps=rate[:3].tolist(),
                acceleration_mps2=linear.tolist(), angular_acceleration_radps2=acceleration[:3].tolist()))
        turns, rates = self.joint_rates()
        return dict(joint_wxyz=turns, joint_rate_radps=rates, frames=frames,
                    springs=elastic.tolist(), damping=damping.tolist())


def case(z_locked, seed, states):
    draw = np.random.default_rng(seed)
    rest = [[1, 0, 0, 0] if link["axis"] is None else 0.0 for link in LINKS]
    rig = Rig(z_locked, rest)
    recorded, starts = [], []
    for _ in range(states):
        joints = [draw.normal(size=4) if link["axis"] is None else draw.uniform(-3, 3) for link in LINKS]
        attitude = np.concatenate([[1.0], draw.uniform(-0.15, 0.15, 3)])
        qpos = rig.pack(draw.uniform(-0.03, 0.03, 3), attitude, joints)
        qvel = draw.uniform(-2.0, 2.0, rig.model.nv)
        qvel[:rig.lin] *= 0.2
        starts.append(np.concatenate([qpos, qvel]))
        recorded.append(rig.record(qpos, qvel))
    y, path, nq = starts[0], [], rig.model.nq
    for n in range(1, 2501):
        y = rig.step(y, STEP_S)
        if n in (1000, 2500):
            qpos = y[:nq].copy()
            for at, _ in rig.balls():
                qpos[at:at + 4] /= np.linalg.norm(qpos[at:at + 4])
            path.append(dict(time_s=n * STEP_S, **rig.record(qpos, y[nq:])))
    return dict(z_locked=z_locked, rest_wxyz=[[1.0, 0.0, 0.0, 0.0]] * len(LINKS), preload_n=rig.preload.tolist(),
                states=recorded, path=path)


print(json.dumps(dict(
    engine=f"MuJoCo {mujoco.__version__}", gravity_mps2=GRAVITY, platform=PLATFORM, base=BASE, mount=MOUNT, links=LINKS,
    springs=SPRINGS, cases=[case(False, 1, 4), case(True, 2, 4)])))
