"""Recorded vectors for the platform's mechanics from an independent multibody engine, Pinocchio.

The hexapod is built as what it is, a closed chain of 19 bodies: a free plate that carries a plate body and a test body,
and six legs of two revolute joints and one prismatic joint each, without mass, tied to the plate by six point
constraints. Leg lengths, speeds and accelerations are the prismatic joints' coordinates; the six actuator forces
are solved, together with the 18 constraint forces, from the engine's inverse dynamics. Nothing here knows H, the leg
Jacobian or the vector loop's derivatives.

    pip install pin==4.1.0 numpy
    python platform_dynamics.py > platform_dynamics.json
"""
import json

import numpy as np
import pinocchio as pin

GRAVITY = 9.80665
BASE = [[0.45 * np.cos(d), 0.45 * np.sin(d), 0.0] for d in np.radians([10, 110, 130, 230, 250, 350])]
PLATE = [[0.25 * np.cos(d), 0.25 * np.sin(d), -0.123] for d in np.radians([60, 60, 180, 180, 300, 300])]
# Mass, centre of mass, inertia about it [xx, yy, zz, yz, zx, xy], and the place of the body's frame on the plate.
BODIES = [
    dict(mass_kg=11.0, com_m=[0.004, -0.003, -0.06], inertia_com_kgm2=[0.21, 0.22, 0.4, 0.003, -0.002, 0.001],
         position_m=[0.0, 0.0, 0.0], rotation_wxyz=[1.0, 0.0, 0.0, 0.0]),
    dict(mass_kg=20.0, com_m=[0.012, -0.02, 0.247], inertia_com_kgm2=[0.505, 0.495, 0.0362, 0.011, -0.007, 0.004],
         position_m=[0.03, -0.02, 0.05], rotation_wxyz=[0.92, 0.20, -0.10, 0.32]),
]


def rotation(wxyz):
    w, x, y, z = np.array(wxyz) / np.linalg.norm(wxyz)
    return pin.Quaternion(w, x, y, z).toRotationMatrix()


def tensor(six):
    xx, yy, zz, yz, zx, xy = six
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def build():
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    plate = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "plate")
    for body in BODIES:
        place = pin.SE3(rotation(body["rotation_wxyz"]), np.array(body["position_m"]))
        inertia = pin.Inertia(body["mass_kg"], np.array(body["com_m"]), tensor(body["inertia_com_kgm2"]))
        model.appendBodyToJoint(plate, inertia, place)
    tips, joints, slides = [], [], []
    for i, (a, b) in enumerate(zip(BASE, PLATE)):
        first = model.addJoint(0, pin.JointModelRX(), pin.SE3(np.eye(3), np.array(a)), f"u{i}")
        second = model.addJoint(first, pin.JointModelRY(), pin.SE3.Identity(), f"v{i}")
        slide = model.addJoint(second, pin.JointModelPZ(), pin.SE3.Identity(), f"s{i}")
        tips.append(model.addFrame(pin.Frame(f"tip{i}", slide, pin.SE3.Identity(), pin.FrameType.OP_FRAME)))
        here = pin.SE3(np.eye(3), np.array(b))
        joints.append(model.addFrame(pin.Frame(f"joint{i}", plate, here, pin.FrameType.OP_FRAME)))
        slides.append(slide)
    return model, tips, joints, slides


def solve(model, tips, joints, slides, state):
    data = model.createData()
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    roll, pitch, yaw = state["rpy_rad"]
    r = pin.rpy.rpyToMatrix(roll, pitch, yaw)
    w, dw = np.array(state["angular_rate_radps"]), np.array(state["angular_acceleration_radps2"])
    v_local = r.T @ np.array(state["velocity_mps"])
    a_local = r.T @ np.array(state["acceleration_mps2"]) - np.cross(w, v_local)
    q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    q[:3], q[3:7] = state["position_m"], pin.Quaternion(r).coeffs()
    v[:6], a[:6] = np.r_[v_local, w], np.r_[a_local, dw]
    pin.framesForwardKinematics(model, data, q)
    for i in range(6):
        leg = data.oMf[joints[i]].translation - np.array(BASE[i])
        length = np.linalg.norm(leg)
        n = leg / length
        k = model.joints[slides[i]].idx_q
        q[k - 2: k + 1] = np.arctan2(-n[1], n[2]), np.arcsin(n[0]), length
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    linear = lambda f: pin.getFrameJacobian(model, data, f, world)[:3]
    gaps = [data.oMf[t].translation - data.oMf[j].translation for t, j in zip(tips, joints)]
    assert np.abs(gaps).max() < 1e-14, gaps
    closure = np.vstack([linear(t) - linear(j) for t, j in zip(tips, joints)])
    v[6:] = np.linalg.solve(closure[:, 6:], -closure[:, :6] @ v[:6])
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    drift = lambda f: pin.getFrameClassicalAcceleration(model, data, f, world).linear
    bias = np.concatenate([drift(t) - drift(j) for t, j in zip(tips, joints)])  # with the legs' accelerations at zero
    a[6:] = np.linalg.solve(closure[:, 6:], -bias)
    torque = pin.rnea(model, data, q, v, a)
    select = np.zeros((model.nv, 6))
    index = [model.joints[s].idx_v for s in slides]
    for column, row in enumerate(index):
        select[row, column] = 1.0
    unknown = np.linalg.solve(np.hstack([select, closure.T]), torque)
    return dict(leg_length_m=[q[model.joints[s].idx_q] for s in slides], leg_rate_mps=[v[k] for k in index],
                leg_acceleration_mps2=[a[k] for k in index], leg_force_n=list(unknown[:6]))


def main():
    rng = np.random.default_rng(20100701)
    model, tips, joints, slides = build()
    vectors = []
    while len(vectors) < 60:
        u = lambda scale, n=3: (scale * rng.uniform(-1.0, 1.0, n)).tolist()
        state = dict(position_m=(np.array([0, 0, 0.72]) + u(0.12)).tolist(), rpy_rad=u(0.6), velocity_mps=u(0.5),
                     acceleration_mps2=u(6.0), angular_rate_radps=u(2.0), angular_acceleration_radps2=u(15.0))
        result = solve(model, tips, joints, slides, state)
        if min(result["leg_length_m"]) > 0.55 and max(result["leg_length_m"]) < 0.8548:
            vectors.append({**state, **result})
    head = dict(engine=f"Pinocchio {pin.__version__}", script="platform_dynamics.py", gravity_mps2=GRAVITY,
                base_joints_m=BASE, plate_joints_m=PLATE, bodies=BODIES)
    lines = ",\n".join(json.dumps(v) for v in vectors)
    print(json.dumps(head, indent=1)[:-2] + ',\n "vectors": [\n' + lines + "\n]}")


if __name__ == "__main__":
    main()
