"""Simulates three legged robots in MuJoCo and records what sensors would read: `python record.py URDF_FOLDER [NAME…]`.

Needs the wheels `mujoco` and `pin`; written with MuJoCo 4.0.0, Pinocchio 4.1.0, NumPy 2.4.6. URDF_FOLDER holds
g1_29dof_rev_1_0.urdf, jvrc1.urdf and solo12.urdf (README.md says whose). Every seed is fixed, in robots.py. Writes NAME.csv
and NAME.toml beside this file, so that the tests that read them need no Python, and prints checks against Pinocchio.
`--trace FOLDER` also writes NAME.npz, with the base's pose and all accelerations, to look at.
"""

import argparse
import json
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pinocchio as pin

import check
import truth
from motion import GRAVITY, Plan
from robots import ROBOTS

HERE = Path(__file__).parent
STEP = 0.0005


def description(folder, robot):
    """The URDF without shapes, with its locked joints fixed at zero and its links changed; the true links; pairs."""
    root = ElementTree.parse(folder / robot["urdf"]).getroot()
    for link in root.findall("link"):
        for kind in ("visual", "collision"):
            for shape in link.findall(kind):
                link.remove(shape)
    for joint in root.findall("joint"):
        if joint.get("name") in robot["lock"]:
            joint.set("type", "fixed")
        for kind in ("mimic", "limit") if joint.get("type") == "fixed" else ("mimic",):
            for found in joint.findall(kind):
                joint.remove(found)
    nominal = truth.inertials(root)
    pairs = [(name, robot["pair"](name)) for name in nominal if robot["pair"](name) in nominal]
    links = truth.true_links(root, robot["seed"], pairs, robot["alike"])
    truth.put(root, links)
    return root, links, pairs


def simulated(root, robot, links):
    """MuJoCo's model: a free base, spheres below the feet, a floor; no limits, damping, friction or rotors."""
    root = ElementTree.fromstring(ElementTree.tostring(root))
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(
        extension, "compiler", fusestatic="false", balanceinertia="false", boundmass="0", boundinertia="0",
        discardvisual="false",
    )
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    base = spec.body(robot["base"])
    base.add_freejoint()
    base.add_site(name="imu", pos=robot["imu"])
    for foot in robot["feet"]:
        body = spec.body(foot["link"])
        body.add_site(name=foot["name"], pos=foot["sensor"], quat=foot["turn"])
        for number, at in enumerate(foot["spheres"]):
            body.add_geom(
                name=f"{foot['name']}{number}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[foot["radius"], 0, 0], pos=at,
                mass=0.0, contype=2, conaffinity=1, friction=[0.9, 0.0, 0.0], condim=3, solref=[robot["contact"], 1.0],
                solimp=[0.9, 0.95, 0.001, 0.5, 2.0],
            )
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], contype=1, conaffinity=2,
        friction=[0.9, 0.0, 0.0], condim=3, solref=[robot["contact"], 1.0], solimp=[0.9, 0.95, 0.001, 0.5, 2.0],
    )
    spec.option.timestep = STEP
    spec.option.gravity = [0, 0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = 200
    spec.option.tolerance = 1e-14
    model = spec.compile()
    model.jnt_limited[:] = 0
    model.jnt_actfrclimited[:] = 0
    for array in (model.dof_damping, model.dof_frictionloss, model.dof_armature, model.jnt_stiffness):
        assert not np.any(array)
    # What was compiled is what the file says.
    for body in range(1, model.nbody):
        name = model.body(body).name
        mass, centre, tensor = links.get(name, (0.0, np.zeros(3), np.zeros((3, 3))))
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        turn = turn.reshape(3, 3)
        own = turn @ np.diag(model.body_inertia[body]) @ turn.T
        assert abs(model.body_mass[body] - mass) <= 1e-12 * mass, name
        assert np.allclose(model.body_ipos[body] if mass else 0.0, centre, rtol=0, atol=1e-12), name
        assert np.allclose(own, tensor, rtol=0, atol=1e-9 * np.trace(tensor) + 1e-15), (name, own, tensor)
    total = sum(mass for mass, _, _ in links.values())
    assert abs(model.body_mass.sum() - total) < 1e-9
    return model


def known(root, robot):
    """Pinocchio's model of the same, with frames below the feet to plan with and where their sensors are."""
    model = pin.buildModelFromXML(ElementTree.tostring(root, encoding="unicode"), pin.JointModelFreeFlyer())
    model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    for foot in robot["feet"]:
        frame = model.frames[model.getFrameId(foot["link"])]
        w, x, y, z = foot["turn"]
        for name, place in (
            (foot["name"], pin.SE3(np.eye(3), np.array(foot["centre"]))),
            (f"{foot['name']} sensor", pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), np.array(foot["sensor"]))),
        ):
            model.addFrame(
                pin.Frame(name, frame.parentJoint, model.getFrameId(foot["link"]), frame.placement * place, pin.FrameType.OP_FRAME)
            )
    return model


class Simulation:
    def __init__(self, robot, model, other, plan):
        self.robot, self.model, self.plan = robot, model, plan
        self.data = mujoco.MjData(model)
        self.names = [model.joint(j).name for j in range(1, model.njnt)]
        own = [other.joints[other.getJointId(name)] for name in self.names]
        self.order_q = np.array([j.idx_q for j in own])
        self.order = np.array([j.idx_v - 6 for j in own])
        self.q = plan.q[:, self.order_q]
        self.v = plan.v[:, 6:][:, self.order]
        self.torque = plan.torque[:, self.order]
        self.full = np.zeros((model.nv, model.nv))
        self.lever = plan.lever[:, self.order]
        self.stiff = robot["stiff"]
        self.spring, self.damper = np.array(
            [robot["ankle" if "ankle" in name.lower() else "leg"] if name in robot["legs"] else (0.0, 0.0) for name in self.names]
        ).T

    def drive(self, model, data):
        """Feed-forward, and what brings base and joints back to the plan: accelerations, made torques by the inertia; what the
        base needs comes through the feet that stand, and in flight it is left alone."""
        k = min(int(round(data.time / (0.5 * STEP))), len(self.q) - 1)
        plan = self.plan
        at, turn = data.qpos[:3], data.xmat[1].reshape(3, 3)
        wanted = pin.Quaternion(plan.q[k, 3:7]).toRotationMatrix()
        rate = wanted @ plan.v[k, 3:6]
        velocity = wanted @ plan.v[k, :3]
        wanted_base = np.concatenate(
            [
                self.stiff**2 * (plan.q[k, :3] - at) + 2 * self.stiff * (velocity - data.qvel[:3]),
                turn.T @ (self.stiff**2 * pin.log3(wanted @ turn.T) + 2 * self.stiff * (rate - turn @ data.qvel[3:6])),
            ]
        )
        joints = self.stiff**2 * (self.q[k] - data.qpos[7:]) + 2 * self.stiff * (self.v[k] - data.qvel[6:])
        mujoco.mj_fullM(model, data, self.full)
        m = self.full
        gate = plan.gate[k]
        base = gate * wanted_base - (1.0 - gate) * np.linalg.solve(m[:6, :6], m[:6, 6:] @ joints)
        wrench = m[:6, :6] @ base + m[:6, 6:] @ joints
        wrench[:3] = turn.T @ wrench[:3]
        data.qfrc_applied[6:] = self.torque[k] + m[6:, :6] @ base + m[6:, 6:] @ joints + self.lever[k] @ wrench
        data.qfrc_applied[6:] += self.spring * (self.q[k] - data.qpos[7:]) + self.damper * (self.v[k] - data.qvel[6:])

    def run(self, seconds, every):
        model, data, plan = self.model, self.data, self.plan
        data.qpos[:3] = plan.q[0, :3]
        x, y, z, w = plan.q[0, 3:7]
        data.qpos[3:7] = [w, x, y, z]
        data.qpos[7:] = self.q[0]
        turn = pin.Quaternion(plan.q[0, 3:7]).toRotationMatrix()
        data.qvel[:3] = turn @ plan.v[0, :3]
        data.qvel[3:6] = plan.v[0, 3:6]
        data.qvel[6:] = self.v[0]
        imu = model.site("imu").id
        sites = [model.site(foot["name"]).id for foot in self.robot["feet"]]
        foot_of = {model.geom(f"{f['name']}{n}").id: i for i, f in enumerate(self.robot["feet"]) for n in range(f["points"])}
        rows, trace, touching = [], [], []
        mujoco.set_mjcb_control(self.drive)
        six, wrench = np.zeros(6), np.zeros(6)
        try:
            for number in range(int(round(seconds / STEP)) + 1):
                mujoco.mj_forward(model, data)
                feet = np.zeros((len(sites), 6))
                held = [0] * len(sites)
                for c in range(data.ncon):
                    contact = data.contact[c]
                    mujoco.mj_contactForce(model, data, c, wrench)
                    axes = contact.frame.reshape(3, 3)
                    force = axes.T @ wrench[:3]
                    geom = contact.geom2 if contact.geom2 in foot_of else contact.geom1
                    if geom == contact.geom1:
                        force = -force
                    i = foot_of[geom]
                    if np.any(wrench):
                        held[i] = 1
                    axes = data.site_xmat[sites[i]].reshape(3, 3)
                    lever = contact.pos - data.site_xpos[sites[i]]
                    feet[i] += np.concatenate([axes.T @ force, axes.T @ np.cross(lever, force)])
                touching.append(held)
                if number % every == 0:
                    mujoco.mj_rnePostConstraint(model, data)
                    mujoco.mj_objectAcceleration(model, data, mujoco.mjtObj.mjOBJ_SITE, imu, six, 1)
                    rows.append(
                        np.concatenate(
                            [
                                [data.time], six[3:], data.qvel[3:6],
                                np.column_stack([data.qpos[7:], data.qvel[6:], data.qfrc_applied[6:]]).ravel(), feet.ravel(),
                            ]
                        )
                    )
                    trace.append(np.concatenate([data.qpos, data.qvel, data.qacc, data.qfrc_applied[6:]]))
                    if not np.all(np.isfinite(rows[-1])) or data.qpos[2] < 0.3 * plan.q[0, 2]:
                        print(f"{self.robot['name']} falls at {data.time:.2f} s")
                        break
                mujoco.mj_step(model, data)
        finally:
            mujoco.set_mjcb_control(None)
        return np.array(rows), np.array(trace), np.array(touching)

    def columns(self):
        names = ["t_s"] + [f"imu_a{a}_mps2" for a in "xyz"] + [f"imu_g{a}_radps" for a in "xyz"]
        names += [f"{joint}_{unit}" for joint in self.names for unit in ("rad", "radps", "nm")]
        names += [f"{foot['name']}_{c}" for foot in self.robot["feet"] for c in WRENCH]
        return names


WRENCH = ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"]


def phases(touching, names):
    """Which feet touch the ground from when to when, where that stays so for 20 ms; between, feet come and go."""
    found, start = [], 0
    for k in range(1, len(touching) + 1):
        if k == len(touching) or np.any(touching[k] != touching[start]):
            if k - start >= 0.02 / STEP:
                found.append((start * STEP, (k - 1) * STEP, [n for n, on in zip(names, touching[start]) if on]))
            start = k
    return found


def number(value, digits):
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


DIGITS = {"s": 4, "mps2": 5, "radps": 5, "rad": 6, "nm": 5, "n": 4}


def write_csv(path, columns, rows):
    digits = [DIGITS[name.rsplit("_", 1)[1]] for name in columns]
    with open(path, "w") as out:
        out.write(",".join(columns) + "\n")
        for row in rows:
            out.write(",".join(number(v, d) for v, d in zip(row, digits)) + "\n")


def listed(values):
    return "[" + ", ".join(f"{float(v):.12g}" for v in values) + "]"


def write_truth(path, robot, root, links, pairs, spans, names):
    out = [
        f"# How {robot['name']}.csv came about: written by record.py.",
        f'model = "{robot["urdf"]}"',
        f'base = "{robot["base"]}"',
        f"gravity_mps2 = {GRAVITY}",
        f"imu_position_m = {listed(robot['imu'])}  # in the base's frame; its axes are the base's",
        f"joints = {json.dumps(names)}",
        f"locked = {json.dumps(robot['lock'])}  # at zero; not in the recording",
        f"mirror_alike = {'true' if robot['alike'] else 'false'}  # whether the links of a pair are images, y to −y",
        f"mirror_pairs = {json.dumps([list(p) for p in pairs])}",
        "",
    ]
    for foot in robot["feet"]:
        out += [
            "[[foot]]", f'name = "{foot["name"]}"', f'link = "{foot["link"]}"', f"position_m = {listed(foot['sensor'])}",
            f"rotation_wxyz = {listed(foot['turn'])}", "",
        ]
    for start, end, feet in spans:
        out += ["[[phase]]", f"start_s = {start:.4f}", f"end_s = {end:.4f}", f"feet = {json.dumps(feet)}", ""]

    def body(kind, name, inertial, more=()):
        mass, centre, tensor = inertial
        return [
            f"[[{kind}]]", f'name = "{name}"', *more, f"mass_kg = {float(mass):.12g}", f"com_m = {listed(centre)}",
            f"tensor_kgm2 = {listed(truth.elements(tensor))}", "",
        ]

    out += ["# Every link by itself: centre of mass in its frame; Ixx Iyy Izz Ixy Ixz Iyz about it, in the link's axes.", ""]
    for name, inertial in links.items():
        out += body("link", name, inertial)
    out += ["# What moves as one: a link and what hangs on it by fixed or locked joints.", ""]
    for name, (*inertial, of) in truth.bodies(root, links).items():
        out += body("body", name, inertial, [f"of = {json.dumps(of)}"])
    path.write_text("\n".join(out).rstrip() + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("urdfs", type=Path)
    parser.add_argument("names", nargs="*", default=list(ROBOTS))
    parser.add_argument("--trace", type=Path)
    options = parser.parse_args()
    for name in options.names or ROBOTS:
        robot = ROBOTS[name]
        root, links, pairs = description(options.urdfs, robot)
        model, other = simulated(root, robot, links), known(root, robot)
        t = np.arange(int(round((robot["seconds"] + 0.05) / (0.5 * STEP)))) * 0.5 * STEP
        q0, *course = robot["plan"](model=other, robot=robot, t=t)
        plan = Plan(other, robot["feet"], robot["legs"], t, q0, *course)
        simulation = Simulation(robot, model, other, plan)
        rows, trace, touching = simulation.run(robot["seconds"], int(round(1 / (robot["rate"] * STEP))))
        columns = simulation.columns()
        spans = phases(touching, [foot["name"] for foot in robot["feet"]])
        write_csv(HERE / f"{name}.csv", columns, rows)
        write_truth(HERE / f"{name}.toml", robot, root, links, pairs, spans, simulation.names)
        if options.trace:
            np.savez(options.trace / f"{name}.npz", columns=columns, rows=rows, trace=trace, plan_t=plan.t,
                     plan_q=plan.q, plan_forces=plan.forces)
        print(f"{name}: {len(columns)} columns, {len(rows)} rows, {(HERE / f'{name}.csv').stat().st_size} bytes")
        for start, end, feet in spans:
            print(f"  {start:7.4f} to {end:7.4f} s: {', '.join(feet) or 'flight'}")
        print(" ", check.at_instants(other, robot, simulation.names, rows, trace))
        print(" ", check.of_file(HERE / f"{name}.csv", other, robot, simulation.names))


if __name__ == "__main__":
    main()
