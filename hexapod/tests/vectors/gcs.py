"""Recorded vectors for PI's General Command Set 2.0, from what the vendor publishes.

Axes: the kinematic chain of the vendor's own ROS driver (github.com/PI-PhysikInstrumente/PI_ROS_Driver, version 1.0.2,
pi_hexapod_description/urdf/pi_hexapod.macro.xacro: base, prismatic x, y, z, then revolute u, v, w about x, y, z of the
link before), which sends X, Y, Z in mm and U, V, W in degrees (pi_driver.cpp, writeControllerCommand); anchors of the
struts are those of its H-811.I2 (cfg/H-811.i2.yaml). The chain is evaluated by a multibody engine, Pinocchio.

Lines: what the vendor's Python client pipython puts on the line, and what it reads from answers; numbers of errors are
those of its module gcserror.

    pip install pin==4.1.0 numpy pipython==2.11.0.6
    python gcs.py > gcs.json
"""
import json
import random

import numpy as np
import pinocchio as pin
from pipython.pidevice import GCSError, gcserror
from pipython.pidevice.common.gcscommands_helpers import getdict_oneitem
from pipython.pidevice.gcs2.gcs2commands import GCS2Commands
from pipython.pidevice.gcsmessages import GCSMessages
from pipython.pidevice.interfaces.pigateway import PIGateway

HEIGHT = 0.088326097
BASE = [[0.055773843, 0.012801635], [-0.016800381, 0.054702383], [-0.038973463, 0.041900747],
        [-0.038973463, -0.041900748], [-0.016800381, -0.054702383], [0.055773843, -0.012801635]]
PLATFORM = [[0.029355221, 0.025682309], [0.007563921, 0.038263522], [-0.036919143, 0.012581213],
            [-0.036919143, -0.012581213], [0.007563922, -0.038263522], [0.029355222, -0.025682309]]
# Travel of the H-811.I2 in mm and degrees.
TRAVEL = [17.0, 16.0, 6.5, 10.0, 10.0, 21.0]
AXES = ["X", "Y", "Z", "U", "V", "W"]
ERRORS = ["PARAM_SYNTAX", "UNKNOWN_COMMAND", "COMMAND_TOO_LONG", "MOVE_WITHOUT_REF_OR_NO_SERVO", "POS_OUT_OF_LIMITS",
          "VEL_OUT_OF_LIMITS", "STOP", "INVALID_AXIS_IDENTIFIER", "PARAM_OUT_OF_RANGE", "PARAM_NR", "INVALID_REAL_NR",
          "DYNAMIC_MOVE_IN_PROCESS", "UNKNOWN_PARAMETER", "READ_ONLY_PARAMETER", "INTERPOLATION_FIFO_UNDERRUN"]


class Tap(PIGateway):
    """Keeps the lines that are sent; answers from a table."""

    timeout, connected, connectionid = 1000, True, 1

    ANSWERS = {"*IDN?\n": "PI, C-887, 0, 1.0.0.0\n", "SAI? ALL\n": "X \nY \nZ \nU \nV \nW\n", "ERR?\n": "0\n",
               chr(5): "0\n", chr(7): "\xb1\n"}

    def __init__(self):
        self.sent, self.answer = [], ""

    def __str__(self):
        return "Tap"

    def settimeout(self, value):
        pass

    def send(self, msg):
        self.sent.append(msg)
        self.answer = self.ANSWERS.get(msg, "")

    def read(self):
        answer, self.answer = self.answer, ""
        return answer

    def flush(self):
        pass

    def close(self):
        pass


def chain():
    model = pin.Model()
    at = 0
    kinds = [pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ(),
             pin.JointModelRX(), pin.JointModelRY(), pin.JointModelRZ()]
    for axis, kind in zip(AXES, kinds):
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, HEIGHT])) if at == 0 else pin.SE3.Identity()
        at = model.addJoint(at, kind, place, axis)
    return model


MODEL = chain()
DATA = MODEL.createData()


def pose(position):
    q = np.array([1e-3 * v for v in position[:3]] + [np.radians(v) for v in position[3:]])
    pin.forwardKinematics(MODEL, DATA, q)
    platform = DATA.oMi[6]
    anchors = [platform.act(np.array([x, y, 0.0])) for x, y in PLATFORM]
    legs = [np.linalg.norm(a - np.array([x, y, 0.0])) for a, (x, y) in zip(anchors, BASE)]
    return platform, [float(leg) for leg in legs]


def vectors():
    random.seed(811)
    positions = [[0.0] * 6] + [[t if i == k else 0.0 for i in range(6)] for k, t in enumerate(TRAVEL)]
    positions += [[0.0, 0.0, 0.0, 10.0, -10.0, 20.0], [1.5, -2.25, 3.125, -7.0, 9.5, -13.0]]
    positions += [[round(random.uniform(-t, t), 4) for t in TRAVEL] for _ in range(12)]
    # Steeper than any hexapod: the order of the rotations shows.
    positions += [[4.0, 5.0, 6.0, 50.0, -40.0, 120.0], [0.0, 0.0, 0.0, -35.0, 65.0, -80.0]]
    for position in positions:
        platform, legs = pose(position)
        tap = Tap()
        commands = GCS2Commands(GCSMessages(tap))
        commands.errcheck = False
        commands.MOV(AXES, position)
        yield dict(position_mm_deg=position, line=tap.sent[-1], origin_m=list(map(float, platform.translation)),
                   rotation=[[float(v) for v in row] for row in platform.rotation], leg_length_m=legs)


def lines():
    tap = Tap()
    commands = GCS2Commands(GCSMessages(tap))
    commands.errcheck = False

    def sent(act):
        """All that is sent but the questions who the device is and what axes it has."""
        tap.sent = []
        act()
        own = [line for line in tap.sent if line not in ("*IDN?\n", "SAI? ALL\n")]
        assert len(own) == 1, own
        return own[0]

    return {
        "servo": sent(lambda: commands.SVO(AXES, [True] * 6)),
        "reference": sent(commands.FRF),
        "source": sent(lambda: commands.SPA("X", 0x19001900, 1)),
        "threshold": sent(lambda: commands.SPA("X", 0x19001903, 20)),
        "interval": sent(lambda: commands.SCT(20)),
        "reachable": sent(lambda: unanswered(lambda: commands.qVMO(["X", "U"], [5.0, 2.0]))),
        "stop": sent(lambda: commands.StopAll(noraise=True)),
        "error": sent(commands.qERR),
        "moving": sent(commands.IsMoving),
        "ready": sent(commands.IsControllerReady),
    }


def unanswered(ask):
    try:
        ask()
    except GCSError:
        pass


def answers():
    texts = ["X=1.500000 \nY=-2.250000 \nZ=3.125000 \nU=-7.000000 \nV=9.500000 \nW=-13.000000\n",
             "X=1.5 \nY=0 \nZ=-0.000001 \nU=1e-3 \nV=+4 \nW=5\n"]
    for text in texts:
        yield dict(text=text, values=list(getdict_oneitem(text, AXES, valueconv=(float,)).values()))


def error(name):
    found = [getattr(gcserror, n) for n in dir(gcserror) if n.startswith("E") and n.endswith(f"_PI_CNTR_{name}")]
    assert len(found) == 1, (name, found)
    return found[0]


print(json.dumps(dict(
    base_joints_m=[[x, y, 0.0] for x, y in BASE],
    platform_joints_m=[[x, y, 0.0] for x, y in PLATFORM],
    reference_m=[0.0, 0.0, HEIGHT],
    vectors=list(vectors()),
    lines=lines(),
    answers=list(answers()),
    errors={name: error(name) for name in ERRORS},
), indent=1))
