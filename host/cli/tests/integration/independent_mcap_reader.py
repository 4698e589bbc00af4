"""Reads and writes MCAP files by packages that share no code with this project.

    independent_mcap_reader.py check           says whether the packages are there
    independent_mcap_reader.py read FILE       prints what is in FILE as JSON, numbers as their 64 bits in hex
    independent_mcap_reader.py write FILE zstd|lz4|none ROWS
                                               writes a bag as a robot would: wrench and IMU on clocks of their own
"""

import json
import math
import struct
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

SECOND = 1_000_000_000
EPOCH = 1_700_000_000 * SECOND


def bits(number):
    return struct.pack(">d", number).hex()


def vector(v):
    return [v.x, v.y, v.z]


def quaternion(q):
    return [q.w, q.x, q.y, q.z]


def values(schema, message):
    """The numbers of a message in the order of the recording's columns, or its text."""
    if schema == "geometry_msgs/msg/WrenchStamped":
        return vector(message.wrench.force) + vector(message.wrench.torque)
    if schema == "sensor_msgs/msg/Imu":
        return vector(message.linear_acceleration) + vector(message.angular_velocity)
    if schema == "geometry_msgs/msg/PoseStamped":
        return vector(message.pose.position) + quaternion(message.pose.orientation)
    if schema == "geometry_msgs/msg/Vector3Stamped":
        return vector(message.vector)
    if schema == "geometry_msgs/msg/QuaternionStamped":
        return quaternion(message.quaternion)
    if schema == "std_msgs/msg/Float64MultiArray":
        return list(message.data)
    if schema == "std_msgs/msg/String":
        return message.data
    raise SystemExit(f"unexpected message type {schema}")


def read(path):
    topics = {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header = reader.get_header()
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = topics.setdefault(
                channel.topic,
                {"type": schema.name, "encoding": channel.message_encoding, "count": 0, "rows": []},
            )
            topic["count"] += 1
            content = values(schema.name, decoded)
            row = {"log_time": message.log_time}
            if hasattr(decoded, "header"):
                row["stamp"] = decoded.header.stamp.sec * SECOND + decoded.header.stamp.nanosec
            if isinstance(content, str):
                row["text"] = content
            else:
                row["bits"] = [bits(number) for number in content]
            topic["rows"].append(row)
        attachments = {a.name: a.data.decode() for a in reader.iter_attachments()}
        statistics = reader.get_summary().statistics
    result = {
        "profile": header.profile,
        "messages": statistics.message_count,
        "topics": topics,
        "attachments": attachments,
    }
    json.dump(result, sys.stdout)


HEADER = "std_msgs/Header header\n"
RULE = "=" * 80 + "\n"
STAMPED = (
    f"{RULE}MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{RULE}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    f"{RULE}MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
)
WRENCH = (
    f"{HEADER}geometry_msgs/Wrench wrench\n{STAMPED}"
    f"{RULE}MSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"
)
IMU = (
    f"{HEADER}geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"
    f"{STAMPED}{RULE}MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
)


def stamped(time_ns):
    return {"stamp": {"sec": time_ns // SECOND, "nanosec": time_ns % SECOND}, "frame_id": "ft"}


def xyz(x, y, z):
    return {"x": x, "y": y, "z": z}


def write(path, compression, rows):
    """Wrench at 100/s: fx = row. IMU at 400/s, 1 ms later: slow sines that the test knows."""
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType[compression.upper()])
        wrench = writer.register_msgdef("geometry_msgs/msg/WrenchStamped", WRENCH)
        imu = writer.register_msgdef("sensor_msgs/msg/Imu", IMU)
        for n in range(4 * rows):
            time = EPOCH + n * SECOND // 400 + 1_000_000
            t = (time - EPOCH) / SECOND
            message = {
                "header": stamped(time),
                "orientation": {**xyz(0.0, 0.0, 0.0), "w": 1.0},
                "orientation_covariance": [0.0] * 9,
                "angular_velocity": xyz(0.5 * math.cos(t), 0.0, 0.25),
                "angular_velocity_covariance": [0.0] * 9,
                "linear_acceleration": xyz(math.sin(2.0 * t), 0.0, 9.8),
                "linear_acceleration_covariance": [0.0] * 9,
            }
            # A bag's log time is when the message came in, not when it was measured.
            writer.write_message("/camera/imu", imu, message, log_time=time + 7_000_000)
            if n % 4 == 0:
                time = EPOCH + n * SECOND // 400
                message = {
                    "header": stamped(time),
                    "wrench": {"force": xyz(float(n // 4), -2.0, 3.0), "torque": xyz(0.1, 0.2, 0.3)},
                }
                writer.write_message("/ft_sensor/raw", wrench, message, log_time=time + 3_000_000)
        writer.finish()


if __name__ == "__main__":
    if sys.argv[1] == "read":
        read(sys.argv[2])
    elif sys.argv[1] == "write":
        write(sys.argv[2], sys.argv[3], int(sys.argv[4]))
