//! Definitions of the ROS 2 messages, each with those of the messages inside it, as a bag carries them.

const TIME: &str = "int32 sec\nuint32 nanosec\n";
const HEADER: &str = "builtin_interfaces/Time stamp\nstring frame_id\n";
const VECTOR3: &str = "float64 x\nfloat64 y\nfloat64 z\n";
const POINT: &str = "float64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n";
const WRENCH: &str = "Vector3 force\nVector3 torque\n";
const POSE: &str = "Point position\nQuaternion orientation\n";
const DIMENSION: &str = "string label\nuint32 size\nuint32 stride\n";
const LAYOUT: &str = "MultiArrayDimension[] dim\nuint32 data_offset\n";

/// A message type: its name and the definitions it is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageType {
    /// Name in ROS 2, with package.
    pub name: &'static str,
    definition: &'static str,
    inside: &'static [(&'static str, &'static str)],
}

impl MessageType {
    /// Returns the definition in the form that MCAP calls `ros2msg`.
    pub fn text(&self) -> String {
        let mut text = self.definition.to_owned();
        for (name, definition) in self.inside {
            text += &"=".repeat(80);
            text += &format!("\nMSG: {name}\n{definition}");
        }
        text
    }
}

const STAMP: [(&str, &str); 2] = [("std_msgs/Header", HEADER), ("builtin_interfaces/Time", TIME)];

/// Specific force and angular rate.
pub const IMU: MessageType = MessageType {
    name: "sensor_msgs/msg/Imu",
    definition: "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
                 float64[9] orientation_covariance\ngeometry_msgs/Vector3 angular_velocity\n\
                 float64[9] angular_velocity_covariance\ngeometry_msgs/Vector3 linear_acceleration\n\
                 float64[9] linear_acceleration_covariance\n",
    inside: &[
        STAMP[0],
        STAMP[1],
        ("geometry_msgs/Quaternion", QUATERNION),
        ("geometry_msgs/Vector3", VECTOR3),
    ],
};

/// Force and moment.
pub const WRENCH_STAMPED: MessageType = MessageType {
    name: "geometry_msgs/msg/WrenchStamped",
    definition: "std_msgs/Header header\nWrench wrench\n",
    inside: &[STAMP[0], STAMP[1], ("geometry_msgs/Wrench", WRENCH), ("geometry_msgs/Vector3", VECTOR3)],
};

/// Position and orientation.
pub const POSE_STAMPED: MessageType = MessageType {
    name: "geometry_msgs/msg/PoseStamped",
    definition: "std_msgs/Header header\nPose pose\n",
    inside: &[
        STAMP[0],
        STAMP[1],
        ("geometry_msgs/Pose", POSE),
        ("geometry_msgs/Point", POINT),
        ("geometry_msgs/Quaternion", QUATERNION),
    ],
};

/// A vector.
pub const VECTOR3_STAMPED: MessageType = MessageType {
    name: "geometry_msgs/msg/Vector3Stamped",
    definition: "std_msgs/Header header\nVector3 vector\n",
    inside: &[STAMP[0], STAMP[1], ("geometry_msgs/Vector3", VECTOR3)],
};

/// An orientation.
pub const QUATERNION_STAMPED: MessageType = MessageType {
    name: "geometry_msgs/msg/QuaternionStamped",
    definition: "std_msgs/Header header\nQuaternion quaternion\n",
    inside: &[STAMP[0], STAMP[1], ("geometry_msgs/Quaternion", QUATERNION)],
};

/// Numbers.
pub const FLOAT64_ARRAY: MessageType = MessageType {
    name: "std_msgs/msg/Float64MultiArray",
    definition: "MultiArrayLayout layout\nfloat64[] data\n",
    inside: &[("std_msgs/MultiArrayLayout", LAYOUT), ("std_msgs/MultiArrayDimension", DIMENSION)],
};

/// A text.
pub const STRING: MessageType =
    MessageType { name: "std_msgs/msg/String", definition: "string data\n", inside: &[] };
