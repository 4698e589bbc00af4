"""`ur_rtde` of PyPI with a controller at the address given: its state, and registers there and back, as JSON."""

import json
import socket
import sys
import time

from rtde_io import RTDEIOInterface
from rtde_receive import RTDEReceiveInterface

HOST = sys.argv[1]
NAMES = ["timestamp", "actual_q", "robot_mode", "safety_mode", "runtime_state"]
OUTPUTS = ["output_int_register_40", "output_double_register_41"]
# From the lower registers, which this client writes, to upper ones, which it reads.
PROGRAM = """def echo():
  while True:
    write_output_integer_register(40, read_input_integer_register(18))
    write_output_float_register(41, read_input_float_register(19))
    sync()
  end
end
"""

robot = RTDEReceiveInterface(HOST, 125.0, NAMES + OUTPUTS, use_upper_range_registers=True)
time.sleep(0.2)
found = {
    "q": robot.getActualQ(),
    "robot_mode": robot.getRobotMode(),
    "safety_mode": robot.getSafetyMode(),
    "runtime_state": robot.getRuntimeState(),
}
with socket.create_connection((HOST, 30002), 5) as line:
    line.sendall(PROGRAM.encode())
    writer = RTDEIOInterface(HOST)
    writer.setInputIntRegister(18, 4321)
    writer.setInputDoubleRegister(19, 0.625)
    time.sleep(0.5)
found["integer"] = robot.getOutputIntRegister(40)
found["double"] = robot.getOutputDoubleRegister(41)
robot.disconnect()
print(json.dumps(found))
