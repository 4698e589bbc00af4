"""Drives the simulated hexapod by the vendor's own client; prints what it met, one fact a line."""

import sys
import time

from pipython import GCSDevice, GCSError, gcserror, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

host, port = sys.argv[1].rsplit(":", 1)


def fact(name, value):
    print(f"{name}: {value}", flush=True)


def error_of(act):
    try:
        act()
    except GCSError as error:
        return error.val
    return 0


with GCSDevice(gateway=PISocket(host, int(port))) as device:
    fact("kind", type(device.gcsdevice).__name__)
    fact("idn", device.qIDN().strip())
    fact("axes", "".join(device.axes))
    fact("move before referencing", error_of(lambda: device.MOV("X", 1.0)))
    device.SVO(device.axes, [True] * 6)
    device.FRF()
    fact("ready while referencing", device.IsControllerReady())
    pitools.waitonreferencing(device, timeout=20)
    fact("referenced", all(device.qFRF().values()))

    low, high = device.qTMN(), device.qTMX()
    fact("limits around zero", all(low[a] < 0 < high[a] for a in device.axes))
    fact("VMO near", device.qVMO(["X", "U"], [5.0, 2.0]))
    fact("VMO far", device.qVMO("Z", high["Z"] + 1.0))

    device.VLS(200)
    fact("velocity", device.qVLS())
    goal = {"X": 12.5, "Y": -7.25, "Z": 20.0, "U": 3.0, "V": -4.0, "W": 5.5}
    device.MOV(goal)
    fact("moves", all(device.IsMoving().values()))
    pitools.waitontarget(device, timeout=20)
    there = device.qPOS()
    fact("arrived", all(abs(there[a] - goal[a]) < 1e-5 for a in goal))
    fact("commanded", all(abs(device.qMOV()[a] - goal[a]) < 1e-9 for a in goal))

    fact("out of limits", error_of(lambda: device.MOV("Z", high["Z"] + 1.0)))
    fact("unknown axis", error_of(lambda: device.gcscommands._msgs.send("MOV A 1")))
    fact("unknown command", error_of(lambda: device.gcscommands._msgs.send("XYZZY")))
    fact("still there", device.qPOS() == there)

    device.VLS(10)
    device.MOV("Z", -20.0)
    time.sleep(0.5)
    fact("stop", error_of(device.STP))
    while any(device.IsMoving().values()):
        time.sleep(0.02)
    rest = device.qPOS("Z")["Z"]
    fact("stopped on the way", -20.0 < rest < 20.0)
    device.MOV("Z", -20.0)
    device.StopAll(noraise=True)
    fact("parameter", device.qSPA("X", 0x19001900)["X"][0x19001900])

    # A circle by consecutive MOV, as the vendor's examples stream one.
    device.VLS(200)
    device.MOV(device.axes, [0.0] * 6)
    pitools.waitontarget(device, timeout=20)
    for parameter, value in ((0x19001900, 1), (0x19001901, 1), (0x19001903, 20)):
        device.SPA("X", parameter, value)
    device.SCT(20)
    device.errcheck = False
    import math

    began = time.time()
    for k in range(151):
        angle = 2 * math.pi * min(k, 100) / 100
        while time.time() < began + 0.02 * (k - 30):
            time.sleep(0.002)
        device.MOV(["X", "U"], [4.0 * (1 - math.cos(angle)), 2.0 * (1 - math.cos(angle))])
        if k == 75:
            fact("moves in the stream", all(device.IsMoving().values()))
    while any(device.IsMoving().values()):
        time.sleep(0.02)
    fact("error after the stream", device.qERR())
    fact("back", all(abs(v) < 1e-5 for v in device.qPOS().values()))
