"""Reads the state of the simulated hexapod and moves it, by the vendor's own client; prints it, one fact a line."""

import sys

from pipython import GCSDevice, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

host, port = sys.argv[1].rsplit(":", 1)
goal = float(sys.argv[2])


def fact(name, value):
    print(f"{name}: {value}", flush=True)


with GCSDevice(gateway=PISocket(host, int(port))) as device:
    if not all(device.qFRF().values()):
        device.SVO(device.axes, [True] * 6)
        device.FRF()
        pitools.waitonreferencing(device, timeout=20)
        device.VLS(42)
    for parameter in (0x19001900, 0x19001901, 0x19001903):
        fact(hex(parameter), device.qSPA("X", parameter)["X"][parameter])
    fact("interval", device.gcscommands._msgs.read("SCT?").strip())
    fact("velocity", device.qVLS())
    fact("servos", list(device.qSVO().values()))
    fact("pivot", list(device.qSPI().values()))
    fact("systems", list(device.qKEN()))
    device.MOV("Z", goal)
    pitools.waitontarget(device, timeout=20)
    fact("moved", abs(device.qPOS("Z")["Z"] - goal) < 1e-5)
