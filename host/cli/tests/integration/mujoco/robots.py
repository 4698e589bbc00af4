"""The three robots: soles, sensors, postures, and what each does when."""

import numpy as np
import pinocchio as pin

from motion import GRAVITY, landed, step, through, waves, window


def sole(name, link, x, y, bottom, radius, sensor, turn):
    """A flat foot on four spheres."""
    spheres = [[a, b, bottom + radius] for a in x for b in y]
    centre = [0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]), bottom]
    return dict(
        name=name, link=link, spheres=spheres, radius=radius, points=4, centre=centre, sensor=sensor, turn=turn
    )


def point(name, link, at, radius, sensor, turn):
    """A ball; its place is the lowest point of it while the foot is level."""
    return dict(name=name, link=link, spheres=[at], radius=radius, points=1, centre=at, sensor=sensor, turn=turn)


def turned(axis, angle):
    axis = np.array(axis, float)
    half = 0.5 * angle
    w = [np.cos(half), *(np.sin(half) * axis / np.linalg.norm(axis))]
    return [float(f"{v:.9f}") for v in w]


G1 = dict(
    name="g1",
    urdf="g1_29dof_rev_1_0.urdf",
    seed=101,
    alike=False,
    base="pelvis",
    imu=[0.04525, 0.0, -0.08339],
    lock=[],
    feet=[
        sole("left_foot", "left_ankle_roll_link", (-0.06, 0.13), (-0.045, 0.045), -0.035, 0.005,
             [0.01, 0.002, -0.02], turned([1, 2, 3], 0.4)),
        sole("right_foot", "right_ankle_roll_link", (-0.06, 0.13), (-0.045, 0.045), -0.035, 0.005,
             [0.01, -0.002, -0.02], turned([0, 0, 1], np.pi / 2)),
    ],
    legs=[f"{side}_{j}_joint" for side in ("left", "right")
          for j in ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")],
    posture={
        **{f"{s}_{j}_joint": v for s in ("left", "right")
           for j, v in (("hip_pitch", -0.35), ("knee", 0.7), ("ankle_pitch", -0.35), ("elbow", 0.6))},
        "left_shoulder_roll_joint": 0.35,
        "right_shoulder_roll_joint": -0.35,
    },
    # Amplitudes of the free joints, rad.
    free={
        "waist_yaw_joint": 0.35, "waist_roll_joint": 0.2, "waist_pitch_joint": 0.2,
        **{f"{s}_{j}_joint": a for s in ("left", "right")
           for j, a in (("shoulder_pitch", 0.5), ("shoulder_roll", 0.4), ("shoulder_yaw", 0.6), ("elbow", 0.6),
                        ("wrist_roll", 0.8), ("wrist_pitch", 0.8), ("wrist_yaw", 0.8))},
    },
    pair=lambda name: name.replace("right_", "left_") if name.startswith("right_") else None,
    rate=125,
    contact=0.03,  # time constant of the ground, s
    stiff=15.0,
    ankle=(400.0, 1.0),
    leg=(800.0, 10.0),
)

JVRC1 = dict(
    name="jvrc1",
    urdf="jvrc1.urdf",
    seed=202,
    alike=True,
    base="base_link",
    imu=[-0.06, 0.02, 0.1],
    lock=[f"{s}_{j}" for s in "RL" for j in ("UTHUMB", "LTHUMB", "UINDEX", "LINDEX", "ULITTLE", "LLITTLE")],
    feet=[
        sole("right_foot", "R_ANKLE_P_S", (-0.08, 0.14), (-0.05, 0.05), -0.1, 0.01,
             [0.0, 0.0, -0.05], turned([0, 1, 0], 0.3)),
        sole("left_foot", "L_ANKLE_P_S", (-0.08, 0.14), (-0.05, 0.05), -0.1, 0.01,
             [0.0, 0.0, -0.05], turned([1, 0, 0], np.pi)),
    ],
    legs=[f"{s}_{j}" for s in "RL" for j in ("HIP_P", "HIP_R", "HIP_Y", "KNEE", "ANKLE_R", "ANKLE_P")],
    posture={
        **{f"{s}_{j}": v for s in "RL"
           for j, v in (("HIP_P", -0.45), ("KNEE", 0.9), ("ANKLE_P", -0.45), ("ELBOW_P", -0.9), ("SHOULDER_P", 0.1))},
        "L_SHOULDER_R": 0.4, "R_SHOULDER_R": -0.4,
    },
    free={
        "WAIST_Y": 0.35, "WAIST_P": 0.2, "WAIST_R": 0.2, "NECK_Y": 0.6, "NECK_R": 0.4, "NECK_P": 0.4,
        **{f"{s}_{j}": a for s in "RL"
           for j, a in (("SHOULDER_P", 0.5), ("SHOULDER_R", 0.35), ("SHOULDER_Y", 0.6), ("ELBOW_P", 0.6),
                        ("ELBOW_Y", 0.8), ("WRIST_R", 0.8), ("WRIST_Y", 0.8))},
    },
    pair=lambda name: "L" + name[1:] if name.startswith("R_") else None,
    rate=100,
    contact=0.02,
    stiff=15.0,
    ankle=(1200.0, 4.0),
    leg=(2500.0, 40.0),
)

SOLO12 = dict(
    name="solo12",
    urdf="solo12.urdf",
    seed=303,
    alike=False,
    base="base_link",
    imu=[0.1, -0.03, 0.02],
    lock=[],
    feet=[
        point(f"{leg}_foot", f"{leg}_LOWER_LEG", [0.0, side * 0.008, -0.16], 0.015, [0.0, side * 0.008, -0.15],
              turned(axis, angle))
        for leg, side, axis, angle in (("FL", 1, [0, 1, 0], 0.5), ("FR", -1, [1, 0, 0], 0.7),
                                       ("HL", 1, [0, 0, 1], 2.0), ("HR", -1, [1, 1, 1], 1.0))
    ],
    legs=[f"{leg}_{j}" for leg in ("FL", "FR", "HL", "HR") for j in ("HAA", "HFE", "KFE")],
    posture={f"{leg}_{j}": v for leg, s in (("FL", 1), ("FR", 1), ("HL", -1), ("HR", -1))
             for j, v in (("HFE", 0.7 * s), ("KFE", -1.4 * s))},
    free={},
    pair=lambda name: name[0] + "L" + name[2:] if name[1:3] in ("R_",) else None,
    rate=200,
    contact=0.02,
    stiff=30.0,
    leg=(0.0, 0.0),
)


def levelled(model, robot):
    """The posture with the soles' mean on the ground; places of feet and of the centre of mass in it."""
    q = pin.neutral(model)
    for name, angle in robot["posture"].items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    places = np.array([data.oMf[model.getFrameId(f["name"])].translation for f in robot["feet"]])
    ground = robot["feet"][0]["radius"] if robot["feet"][0]["points"] == 1 else 0.0
    up = ground - places[:, 2].mean()
    q[2] += up
    places[:, 2] = ground
    centre = pin.centerOfMass(model, data, q)
    return q, places, centre


def humanoid(model, robot, t):
    """Drop, squats and swaying on two feet, then the first foot alone, then two feet; a hop where there is time for one."""
    rng = np.random.default_rng(robot["seed"] + 1)
    q0, soles, centre = levelled(model, robot)
    size = centre[2] / 0.65
    n = len(t)
    fall, alone, hop = 0.22, (3.0, 3.9), robot["hop"]
    single = window(t, alone[0], alone[1], 0.4)
    calm = 1.0 - 0.4 * window(t, alone[0] - 0.9, alone[1] + 1.0, 0.6)
    if hop:
        calm = calm * (1.0 - 0.85 * window(t, hop - 0.3, hop + 0.3, 0.5))

    joints = {}
    for name, amplitude in robot["free"].items():
        middle = robot["posture"].get(name, 0.0)
        joints[name] = middle + calm * waves(t, rng, amplitude, *robot["speeds"])
    angles = [calm * waves(t, rng, a, 0.4, 1.0) for a in (0.09, 0.13, 0.16)]
    base = [pin.rpy.rpyToMatrix(*(a[k] for a in angles)) for k in range(n)]

    # The centre of mass: over both feet, then over the first.
    both = soles.mean(axis=0)
    first = soles[0].copy()
    over = window(t, alone[0] - 0.5, alone[1] + 0.2, 1.2)[:, None]
    where = both + 0.88 * over * (first - both)
    busy = window(t, 0.8, 1.2, 0.5) + (0.0 if hop else 0.5 * window(t, 6.0, 9.0, 0.6))
    x = where[:, 0] + 0.01 + busy * waves(t, rng, 0.025, 0.4, 0.8) + single * waves(t, rng, 0.008, 0.4, 0.8)
    y = where[:, 1] + busy * waves(t, rng, robot["sway"], 0.4, 0.7) + single * waves(t, rng, 0.004, 0.4, 0.8)

    speed = 1.05
    z0 = centre[2] - 0.035 * size
    impact = GRAVITY * fall - speed
    high = z0 - (speed * fall - 0.5 * GRAVITY * fall**2)
    course = [
        (0.0, high, speed, -GRAVITY), (fall, z0, -impact, -GRAVITY), (fall + 0.3, landed(z0, impact, 0.3), 0, 0),
        (1.1, z0 - 0.02, 0, 0), (1.5, z0 - 0.10 * size, 0, 0), (1.95, z0 - 0.02, 0, 0), (2.5, z0 - 0.03, 0, 0),
        (3.1, z0 - 0.01, 0, 0), (3.5, z0 - 0.06 * size, 0, 0), (3.9, z0 - 0.02, 0, 0), (4.8, z0 - 0.02, 0, 0),
        (5.3, z0 - 0.09 * size, 0, 0),
    ]
    air = 0.0
    if hop:
        up = 0.55
        air = 2 * up / GRAVITY
        course += [
            (hop, z0, up, -GRAVITY), (hop + air, z0, -up, -GRAVITY), (hop + air + 0.3, landed(z0, up, 0.3), 0, 0),
            (hop + air + 0.8, z0 - 0.02, 0, 0),
        ]
    else:
        course += [(5.9, z0 - 0.02, 0, 0)]
    centres = np.column_stack([x, y, through(t, course)])

    flight = 1.0 - step((t - (fall - 0.16)) / 0.16)
    lifts = 0.08 * flight
    if hop:
        lifts = lifts + 0.03 * window(t, hop + 0.5 * air, hop + 0.5 * air, 0.5 * air)
    places, turns = [], []
    for i, place in enumerate(soles):
        at = np.tile(place, (n, 1))
        at[:, 2] += lifts
        turn = np.zeros((n, 3))
        if i == 1:
            at[:, 2] += single * (0.08 + waves(t, rng, 0.03, 0.5, 1.0))
            at[:, 0] += single * waves(t, rng, 0.10, 0.5, 0.9)
            at[:, 1] += single * (0.03 + waves(t, rng, 0.03, 0.5, 0.9)) * np.sign(place[1])
            turn = single[:, None] * np.column_stack([waves(t, rng, a, 0.5, 1.1) for a in (0.12, 0.3, 0.25)])
        places.append(at)
        turns.append([pin.rpy.rpyToMatrix(*turn[k]) for k in range(n)])
    loads = np.ones((n, 2))
    loads[:, 1] = 1.0 - window(t, alone[0] - 0.4, alone[1] + 0.4, 0.3)
    gate = step((t - fall + 0.005) / 0.02)
    if hop:
        gate = gate * (1.0 - window(t, hop, hop + air, 0.015))
    return q0, base, joints, centres, places, turns, loads, gate, fall


def quadruped(model, robot, t):
    """Drop, four feet, without the first foot, four feet, without the last, four feet."""
    rng = np.random.default_rng(robot["seed"] + 1)
    q0, soles, centre = levelled(model, robot)
    n = len(t)
    fall = 0.24
    spans = [(2.3, 3.4, 0), (4.5, 5.5, 3)]
    lifted = [window(t, a, b, 0.3) for a, b, _ in spans]
    calm = 1.0 - 0.5 * sum(window(t, a - 0.3, b + 0.2, 0.4) for a, b, _ in spans)
    angles = [calm * waves(t, rng, a, 0.5, 1.5) for a in (0.14, 0.12, 0.16)]
    base = [pin.rpy.rpyToMatrix(*(a[k] for a in angles)) for k in range(n)]

    middle = soles.mean(axis=0)
    busy = calm * window(t, 0.6, 9.0, 0.4)
    x = middle[0] + busy * waves(t, rng, 0.03, 0.5, 1.3)
    y = middle[1] + busy * waves(t, rng, 0.03, 0.5, 1.3)
    for a, b, foot in spans:
        # Towards the middle of the three that stay.
        to = -0.26 * (soles[foot] - middle)
        w = window(t, a - 0.3, b + 0.3, 0.7)
        x, y = x + w * to[0], y + w * to[1]
    speed = 1.12
    impact = GRAVITY * fall - speed
    z0 = centre[2]
    low = landed(z0, impact, 0.2)
    high = z0 - (speed * fall - 0.5 * GRAVITY * fall**2)
    z = through(t, [
        (0.0, high, speed, -GRAVITY), (fall, z0, -impact, -GRAVITY), (fall + 0.2, low, 0, 0), (0.8, z0, 0, 0),
        (1.1, z0 - 0.06, 0, 0), (1.4, z0 + 0.02, 0, 0), (1.7, z0 - 0.04, 0, 0), (2.0, z0 + 0.01, 0, 0),
        (2.8, z0 - 0.03, 0, 0), (3.6, z0 + 0.01, 0, 0), (3.9, z0 - 0.05, 0, 0), (4.2, z0 + 0.01, 0, 0),
        (5.0, z0 - 0.02, 0, 0), (5.8, z0, 0, 0),
    ])
    flight = 1.0 - step((t - (fall - 0.14)) / 0.14)
    places, turns = [], []
    loads = np.ones((n, 4))
    for i, place in enumerate(soles):
        at = np.tile(place, (n, 1))
        at += flight[:, None] * np.column_stack(
            [waves(t, rng, 0.03, 0.5, 1.5), waves(t, rng, 0.03, 0.5, 1.5), 0.04 + 0 * t])
        for (a, b, foot), up in zip(spans, lifted):
            if foot == i:
                at += up[:, None] * np.column_stack(
                    [waves(t, rng, 0.06, 0.7, 2.0), waves(t, rng, 0.05, 0.7, 2.0), 0.06 + waves(t, rng, 0.03, 0.7, 2.0)])
                loads[:, i] -= window(t, a - 0.3, b + 0.3, 0.2)
        places.append(at)
        turns.append(None)
    gate = step((t - fall + 0.005) / 0.02)
    return q0, base, {}, np.column_stack([x, y, z]), places, turns, loads, gate, fall


G1["plan"], G1["seconds"], G1["hop"] = humanoid, 6.0, None
G1["speeds"], JVRC1["speeds"] = (0.5, 1.4), (0.4, 1.1)
G1["sway"], JVRC1["sway"] = 0.04, 0.02
JVRC1["plan"], JVRC1["seconds"], JVRC1["hop"] = humanoid, 6.8, 5.8
SOLO12["plan"], SOLO12["seconds"] = quadruped, 6.0
ROBOTS = {r["name"]: r for r in (G1, JVRC1, SOLO12)}
