"""Clients and a server of other makers: `netft HOST PORT`, `rtde HOST`, `foxglove PORT`."""

import struct
import sys
import time


def netft(host, port):
    """What the NetFT package of PyPI reads of a Net F/T, one sample after the other, in counts."""
    from NetFT import Sensor

    sensor = Sensor(host)
    sensor.sock.settimeout(5)
    sensor.sock.connect((host, int(port)))
    for _ in range(5):
        print(*sensor.getMeasurement())


def rtde(host):
    """What ur_rtde reads of a controller: time, wrench, accelerometer, pose."""
    from rtde_receive import RTDEReceiveInterface

    variables = ["timestamp", "ft_raw_wrench", "actual_tool_accelerometer", "actual_TCP_pose"]
    robot = RTDEReceiveInterface(host, 125.0, variables)
    for _ in range(5):
        time.sleep(0.1)
        now = robot.getTimestamp()
        parts = [robot.getFtRawWrench(), robot.getActualToolAccelerometer(), robot.getActualTCPPose()]
        # All of one package, or once more.
        while robot.getTimestamp() != now:
            now = robot.getTimestamp()
            parts = [robot.getFtRawWrench(), robot.getActualToolAccelerometer(), robot.getActualTCPPose()]
        print(now, *[v for part in parts for v in part])
    robot.disconnect()


def foxglove(port):
    """Serves a wrench that counts, by Foxglove's own SDK, until the input ends."""
    import threading

    import foxglove
    from foxglove import Channel, Schema

    server = foxglove.start_server(name="sdk", host="127.0.0.1", port=int(port))
    schema = Schema(name="geometry_msgs/msg/WrenchStamped", encoding="ros2msg", data=b"")
    channel = Channel("/ft/wrench", message_encoding="cdr", schema=schema)
    other = Channel("/chatter", message_encoding="json", schema={"type": "object"})
    print("serving", flush=True)
    over = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    count = 0
    while not over.is_set():
        # Little-endian CDR: a stamp of 5 ms more each time, and the frame S.
        ns = count * 5_000_000
        header = bytes([0, 1, 0, 0]) + struct.pack("<iII", 1000 + ns // 10**9, ns % 10**9, 2) + b"S\0\0\0"
        payload = header + struct.pack("<6d", *[count + 0.125 * k for k in range(6)])
        channel.log(payload)
        other.log({"count": count})
        count += 1
        time.sleep(0.005)
    server.stop()


if __name__ == "__main__":
    {"netft": netft, "rtde": rtde, "foxglove": foxglove}[sys.argv[1]](*sys.argv[2:])
