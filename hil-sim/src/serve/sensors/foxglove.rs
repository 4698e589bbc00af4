//! A `foxglove_bridge` with ROS 2 topics (foxglove/ws-protocol, `docs/spec.md`).

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::{Played, Sample};
use crate::serve::listener::Listener;

/// Tells what a topic's messages are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopicKind {
    /// `geometry_msgs/msg/WrenchStamped`
    Wrench,
    /// `sensor_msgs/msg/Imu`
    Imu,
    /// `geometry_msgs/msg/PoseStamped`
    Pose,
}

/// A topic.
#[derive(Clone, Debug)]
pub struct Topic {
    /// The topic's name.
    pub name: String,
    /// The type of the topic.
    pub kind: TopicKind,
    /// The messages of the topic.
    pub played: Played,
}

impl TopicKind {
    fn schema(self) -> &'static str {
        match self {
            Self::Wrench => "geometry_msgs/msg/WrenchStamped",
            Self::Imu => "sensor_msgs/msg/Imu",
            Self::Pose => "geometry_msgs/msg/PoseStamped",
        }
    }
}

/// Serves as the bridge.
pub struct BridgeServer(Listener);

impl BridgeServer {
    /// Listens at an address; speaks the first of these subprotocols that a client offers.
    ///
    /// # Errors
    /// The address is taken.
    pub fn listen(
        address: &str,
        topics: Vec<Topic>,
        subprotocols: &'static [&'static str],
    ) -> io::Result<Self> {
        Ok(Self(Listener::listen(address, move |stream, leave| {
            // A client that breaks off has nobody left to be informed.
            let _ = attend(stream, &topics, subprotocols, leave);
        })?))
    }

    /// Returns where it listens.
    pub fn address(&self) -> SocketAddr {
        self.0.address()
    }
}

fn lost(error: tungstenite::Error) -> io::Error {
    match error {
        tungstenite::Error::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn attend(
    stream: TcpStream,
    topics: &[Topic],
    subprotocols: &[&'static str],
    leave: &AtomicBool,
) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(Duration::from_secs(2)))?;
    // The handshake's error is the library's, large as it is.
    #[allow(clippy::result_large_err)]
    let choose = |request: &Request, mut response: Response| -> Result<Response, ErrorResponse> {
        const NAME: &str = "Sec-WebSocket-Protocol";
        let offered = request.headers().get(NAME).and_then(|v| v.to_str().ok()).unwrap_or_default();
        let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
        match subprotocols.iter().find(|known| offered.contains(known)) {
            Some(known) => {
                response.headers_mut().insert(NAME, HeaderValue::from_static(known));
                Ok(response)
            }
            None => Err(ErrorResponse::new(Some("no such subprotocol".to_owned()))),
        }
    };
    let accepted = tungstenite::accept_hdr(stream, choose);
    let mut socket = accepted.map_err(|e| io::Error::other(e.to_string()))?;
    socket.get_mut().set_read_timeout(Some(Duration::from_millis(1)))?;
    let info = serde_json::json!({ "op": "serverInfo", "name": "simulated", "capabilities": [], "supportedEncodings": ["cdr"] });
    let channels: Vec<serde_json::Value> = topics
        .iter()
        .enumerate()
        .map(|(id, topic)| {
            serde_json::json!({
                "id": id + 10,
                "topic": topic.name,
                "encoding": "cdr",
                "schemaName": topic.kind.schema(),
                "schema": "",
                "schemaEncoding": "ros2msg",
            })
        })
        .collect();
    for said in [info, serde_json::json!({ "op": "advertise", "channels": channels })] {
        socket.send(Message::text(said.to_string())).map_err(lost)?;
    }
    // Subscription, topic, number of the next message.
    let mut subscribed: Vec<(u32, &Topic, u64)> = Vec::new();
    let mut looked = Instant::now();
    while !leave.load(Ordering::Acquire) {
        if subscribed.is_empty() || looked.elapsed() > Duration::from_millis(50) {
            looked = Instant::now();
            listen(&mut socket, topics, &mut subscribed)?;
        }
        let mut next = Instant::now() + Duration::from_millis(5);
        for (id, topic, number) in &mut subscribed {
            if topic.played.is_silent() {
                continue;
            }
            loop {
                match topic.played.due(*number) {
                    None => {}
                    Some(due) if due <= Instant::now() => {
                        let bytes = message(*id, topic, *number, &topic.played.sample(*number));
                        socket.send(Message::binary(bytes)).map_err(lost)?;
                    }
                    Some(due) => {
                        next = next.min(due);
                        break;
                    }
                }
                *number += 1;
            }
        }
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
    }
    Ok(())
}

fn listen<'t>(
    socket: &mut WebSocket<TcpStream>,
    topics: &'t [Topic],
    subscribed: &mut Vec<(u32, &'t Topic, u64)>,
) -> io::Result<()> {
    let text = match socket.read() {
        Ok(Message::Text(text)) => text,
        Ok(_) => return Ok(()),
        Err(tungstenite::Error::Io(e))
            if matches!(e.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) =>
        {
            return Ok(());
        }
        Err(error) => return Err(lost(error)),
    };
    let Ok(said) = serde_json::from_str::<serde_json::Value>(text.as_str()) else { return Ok(()) };
    if said["op"] != "subscribe" {
        return Ok(());
    }
    for wanted in said["subscriptions"].as_array().into_iter().flatten() {
        let channel = wanted["channelId"].as_u64().and_then(|id| usize::try_from(id).ok()?.checked_sub(10));
        let (Some(topic), Some(id)) = (channel.and_then(|k| topics.get(k)), wanted["id"].as_u64()) else {
            continue;
        };
        subscribed.push((id as u32, topic, topic.played.next()));
    }
    Ok(())
}

/// Returns opcode, subscription, time, and the message in little-endian CDR: alignment counts from behind its
/// four-byte header.
fn message(id: u32, topic: &Topic, number: u64, sample: &Sample) -> Vec<u8> {
    let own_ns = (1e9 * topic.played.own_s(number)).round() as u64;
    let mut bytes = vec![1];
    bytes.extend(id.to_le_bytes());
    // When the bridge had it.
    bytes.extend((own_ns + 200_000).to_le_bytes());
    bytes.extend([0, 1, 0, 0]);
    bytes.extend(((own_ns / 1_000_000_000) as i32).to_le_bytes());
    bytes.extend(((own_ns % 1_000_000_000) as u32).to_le_bytes());
    // A frame's name of seven letters and its zero: 4 + 8 bytes, then up to a multiple of eight.
    bytes.extend(8_u32.to_le_bytes());
    bytes.extend(b"ft_link\0");
    bytes.extend([0; 4]);
    let numbers =
        |bytes: &mut Vec<u8>, values: &[f64]| values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    match topic.kind {
        TopicKind::Wrench => numbers(&mut bytes, &sample.wrench),
        TopicKind::Pose => {
            let [x, y, z, qw, qx, qy, qz] = sample.pose;
            numbers(&mut bytes, &[x, y, z, qx, qy, qz, qw]);
        }
        TopicKind::Imu => {
            // No orientation: −1 is its covariance's first number.
            numbers(&mut bytes, &[0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
            numbers(&mut bytes, &sample.gyro);
            numbers(&mut bytes, &[0.0; 9]);
            numbers(&mut bytes, &sample.accel);
            numbers(&mut bytes, &[0.0; 9]);
        }
    }
    bytes
}
