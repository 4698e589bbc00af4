//! ROS 2 topics through `foxglove_bridge`, over a WebSocket.
//!
//! By the published protocol (foxglove/ws-protocol, `docs/spec.md`), of which `foxglove.sdk.v1` is the later
//! name: the server advertises channels in JSON, the client subscribes to one, and messages follow in binary:
//! 1, `u32` subscription, `u64` time in ns, both little-endian, and the payload, here CDR as ROS 2 encodes
//! it.

use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde::Deserialize;
use tungstenite::client::IntoClientRequest;
use tungstenite::http::HeaderValue;
use tungstenite::{Message, WebSocket};

use super::socket::{PATIENCE, is_patience, tcp};
use super::source::{Losses, OwnClock, Role, Row, Source, SourceError};
use super::url::SourceUrl;
use crate::recording::columns::Group;
use crate::recording::mcap::messages::{Stamped, read_imu, read_numbers, read_pose};
use crate::recording::mcap::schemas;

const PORT: u16 = 8765;
const SUBPROTOCOLS: &str = "foxglove.sdk.v1, foxglove.websocket.v1";
const LOOK_AT: &str =
    "does foxglove_bridge run there (`ros2 launch foxglove_bridge foxglove_bridge_launch.xml`)?";
/// Of this subscription messages are.
const SUBSCRIPTION: u32 = 1;
const MESSAGE_DATA: u8 = 1;
/// This many consecutive messages that cannot be read end the stream.
const USELESS: u32 = 20;

/// Describes a channel that a server advertises.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Channel {
    id: u64,
    topic: String,
    #[serde(default)]
    encoding: String,
    #[serde(default)]
    schema_name: String,
}

#[derive(Deserialize)]
struct Said {
    op: String,
    #[serde(default)]
    channels: Vec<serde_json::Value>,
    #[serde(default)]
    message: String,
    #[serde(default)]
    level: u8,
}

/// Tells what is wanted of a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    role: Role,
    topic: Option<String>,
    /// The header's stamp, or that of the bridge.
    by_header: bool,
}

impl Wanted {
    /// Wants a topic, or the only one of the role's type; times by the messages' headers, or by the bridge.
    pub fn new(role: Role, topic: Option<&str>, by_header: bool) -> Self {
        Self { role, topic: topic.map(str::to_owned), by_header }
    }

    fn type_name(&self) -> &'static str {
        match self.role {
            Role::Wrench => schemas::WRENCH_STAMPED.name,
            Role::Imu => schemas::IMU.name,
            Role::Pose => schemas::POSE_STAMPED.name,
        }
    }
}

/// Types are compared without the word in their middle, which ROS 1 does not have.
fn same_type(a: &str, b: &str) -> bool {
    a.replace("/msg/", "/") == b.replace("/msg/", "/")
}

/// Makes samples of texts and bytes of a server.
#[derive(Debug)]
pub struct Decoder {
    wanted: Wanted,
    channels: Vec<Channel>,
    subscribed: bool,
    groups: Vec<Group>,
    last_ns: Option<i64>,
    losses: Losses,
    useless: u32,
    unstamped: bool,
    problem: Option<String>,
}

impl Decoder {
    /// Waits for the server's channels.
    pub fn new(wanted: Wanted) -> Self {
        Self {
            wanted,
            channels: Vec::new(),
            subscribed: false,
            groups: Vec::new(),
            last_ns: None,
            losses: Losses::default(),
            useless: 0,
            unstamped: false,
            problem: None,
        }
    }

    /// Takes a text; what is to be answered, if anything.
    ///
    /// # Errors
    /// In words: the topic has another type or encoding.
    pub fn text(&mut self, text: &str) -> Result<Option<String>, String> {
        // Other operations have other fields.
        let Ok(said) = serde_json::from_str::<Said>(text) else { return Ok(None) };
        match said.op.as_str() {
            "advertise" => {
                let new = said.channels.into_iter().filter_map(|c| serde_json::from_value(c).ok());
                self.channels.extend(new);
                self.subscribe()
            }
            "status" if said.level > 0 => {
                self.problem = Some(said.message);
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    fn subscribe(&mut self) -> Result<Option<String>, String> {
        if self.subscribed {
            return Ok(None);
        }
        let right = |channel: &&Channel| same_type(&channel.schema_name, self.wanted.type_name());
        let found = match &self.wanted.topic {
            Some(topic) => self.channels.iter().find(|channel| channel.topic == *topic),
            None => {
                let mut fitting = self.channels.iter().filter(right);
                let first = fitting.next();
                // Which of several is asked for when all are known.
                if fitting.next().is_some() { None } else { first }
            }
        };
        let Some(channel) = found else { return Ok(None) };
        if !right(&channel) {
            return Err(format!(
                "topic {} is of {}, and `{}` needs {}{}",
                channel.topic,
                channel.schema_name,
                self.wanted.role,
                self.wanted.type_name(),
                self.of_this_type()
            ));
        }
        if channel.encoding != "cdr" {
            return Err(format!(
                "topic {} is encoded as {}, not in ROS 2's cdr",
                channel.topic, channel.encoding
            ));
        }
        self.subscribed = true;
        let subscribe = serde_json::json!({
            "op": "subscribe",
            "subscriptions": [{ "id": SUBSCRIPTION, "channelId": channel.id }],
        });
        Ok(Some(subscribe.to_string()))
    }

    fn of_this_type(&self) -> String {
        let fitting = self.channels.iter().filter(|c| same_type(&c.schema_name, self.wanted.type_name()));
        let topics: Vec<&str> = fitting.map(|c| c.topic.as_str()).collect();
        if topics.is_empty() {
            String::new()
        } else {
            format!(": of that type there is {}", topics.join(", "))
        }
    }

    /// Says why there is no subscription, with the topics that are there.
    pub fn missing(&self) -> String {
        let wanted = self.wanted.type_name();
        let mut topics: Vec<String> =
            self.channels.iter().map(|c| format!("{} ({})", c.topic, c.schema_name)).collect();
        topics.sort();
        let there = match (self.channels.is_empty(), self.of_this_type()) {
            (true, _) => {
                "the bridge has no topics at all: do the drivers run, and in the same ROS_DOMAIN_ID?"
                    .to_owned()
            }
            (false, of_type) if !of_type.is_empty() => of_type.trim_start_matches(": ").to_owned(),
            (false, _) => format!("there is {}", topics.join(", ")),
        };
        match &self.wanted.topic {
            Some(topic) => format!("the bridge has no topic {topic}; {there}"),
            None => {
                let fitting = self.channels.iter().filter(|c| same_type(&c.schema_name, wanted)).count();
                let count = if fitting > 1 { "several topics" } else { "no topic" };
                format!("the bridge has {count} of {wanted}; {there}. Name one by ?topic=")
            }
        }
    }

    /// Takes binary data, and returns the sample in it.
    ///
    /// # Errors
    /// In words: messages that cannot be read, again and again, or that lack what is needed.
    pub fn binary(&mut self, bytes: &[u8]) -> Result<Option<Row>, String> {
        let Some((MESSAGE_DATA, rest)) = bytes.split_first().map(|(op, rest)| (*op, rest)) else {
            return Ok(None);
        };
        let Some((id, rest)) = rest.split_first_chunk::<4>() else { return self.useless("it is cut off") };
        let Some((stamp, payload)) = rest.split_first_chunk::<8>() else {
            return self.useless("it is cut off");
        };
        if u32::from_le_bytes(*id) != SUBSCRIPTION {
            return Ok(None);
        }
        let bridge_ns = u64::from_le_bytes(*stamp);
        let read = match self.wanted.role {
            Role::Wrench => {
                read_numbers::<6>(payload).map(|m| with(m, |w| Ok((vec![Group::Wrench], w.to_vec()))))
            }
            Role::Pose => read_pose(payload).map(|m| with(m, |p| Ok((vec![Group::Platform], p.to_vec())))),
            Role::Imu => read_imu(payload).map(|m| {
                with(m, |imu| match (imu.accel, imu.gyro) {
                    (Some(accel), Some(gyro)) => {
                        Ok((vec![Group::Accel(0), Group::Gyro(0)], [accel, gyro].concat()))
                    }
                    (Some(accel), None) => Ok((vec![Group::Accel(0)], accel.to_vec())),
                    _ => Err("it says that it measures no acceleration (−1 in its covariance)"),
                })
            }),
        };
        let (header_ns, read) = match read {
            Ok(read) => read,
            Err(why) => return self.useless(&why.to_string()),
        };
        let (groups, values) = match read {
            Ok(read) => read,
            Err(why) => return self.useless(why),
        };
        if values.iter().any(|v| !v.is_finite()) || (!self.groups.is_empty() && self.groups != groups) {
            return self.useless("a number in it is none, or it measures now this and now that");
        }
        self.groups = groups;
        self.useless = 0;
        self.unstamped |= header_ns.is_none();
        let at = if self.wanted.by_header { header_ns.or(Some(bridge_ns)) } else { Some(bridge_ns) };
        let Some(at) = at.and_then(|ns| i64::try_from(ns).ok()).filter(|ns| *ns < 1 << 62) else {
            return self.useless("its time is centuries away");
        };
        if self.last_ns.is_some_and(|last| at <= last) {
            self.losses.late += 1;
            return Ok(None);
        }
        self.last_ns = Some(at);
        Ok(Some(Row { time_ns: Some(at), values }))
    }

    fn useless(&mut self, why: &str) -> Result<Option<Row>, String> {
        self.losses.damaged += 1;
        self.useless += 1;
        if self.useless >= USELESS {
            return Err(format!("{USELESS} messages in a row cannot be read, the last because {why}"));
        }
        Ok(None)
    }
}

/// A message's groups and values.
type Values = Result<(Vec<Group>, Vec<f64>), &'static str>;

fn with<V>(message: Stamped<V>, values: impl FnOnce(V) -> Values) -> (Option<u64>, Values) {
    (message.stamp_ns, values(message.value))
}

/// Reads a topic that streams.
pub struct Bridge {
    url: SourceUrl,
    socket: WebSocket<TcpStream>,
    decoder: Decoder,
    first: Vec<Row>,
}

impl Bridge {
    /// Connects, finds the topic and waits for its first message.
    ///
    /// # Errors
    /// Nobody is there, it is no bridge, or there is no such topic: the existing topics are listed.
    pub fn open(url: &SourceUrl, role: Role) -> Result<Self, SourceError> {
        let by_header = match url.setting("stamp") {
            None | Some("header") => true,
            Some("bridge") => false,
            Some(other) => {
                return Err(url.wrong(format!(
                    "stamp={other}: header, or bridge for the time at which the bridge had it"
                )));
            }
        };
        if let Some(other) = url.setting("clock").filter(|c| !["ros", "own"].contains(c)) {
            return Err(url
                .wrong(format!("clock={other}: ros if other topics are stamped by the same clock, or own")));
        }
        let (host, port) = url.host_and_port(PORT)?;
        let stream = tcp(url, &host, port, LOOK_AT)?;
        // The handshake is written to wait for as long as it takes.
        stream.set_read_timeout(Some(PATIENCE)).map_err(|e| url.unreachable(e.to_string()))?;
        let shown = if host.contains(':') { format!("[{host}]") } else { host };
        let mut request = format!("ws://{shown}:{port}/")
            .into_client_request()
            .map_err(|e| url.wrong(format!("it is no address: {e}")))?;
        request.headers_mut().insert("Sec-WebSocket-Protocol", HeaderValue::from_static(SUBPROTOCOLS));
        let (socket, _) = tungstenite::client(request, stream)
            .map_err(|e| url.protocol(format!("it is no Foxglove bridge ({e}); {LOOK_AT}")))?;
        let wanted = Wanted::new(role, url.setting("topic"), by_header);
        let mut source = Self { url: url.clone(), socket, decoder: Decoder::new(wanted), first: Vec::new() };
        let (begun, mut rows) = (Instant::now(), Vec::new());
        while rows.is_empty() {
            source.read(Duration::from_millis(100), &mut rows)?;
            if begun.elapsed() > PATIENCE && !source.decoder.subscribed {
                return Err(url.protocol(source.decoder.missing()));
            }
            if begun.elapsed() > 2 * PATIENCE {
                return Err(url
                    .protocol(format!("the topic is there, and no message came; {}", source.when_silent())));
            }
        }
        source.first = rows;
        Ok(source)
    }
}

impl Source for Bridge {
    fn groups(&self) -> &[Group] {
        &self.decoder.groups
    }

    fn clock(&self) -> OwnClock {
        let own = self.url.setting("clock") == Some("own");
        // Messages without stamps have the bridge's.
        let stamped = self.decoder.wanted.by_header && !self.decoder.unstamped;
        OwnClock::Seconds(match (own, stamped) {
            (true, _) => self.url.to_string(),
            (false, true) => format!("the ROS stamps at {}", self.url.place),
            (false, false) => format!("the bridge at {}", self.url.place),
        })
    }

    fn read(&mut self, timeout: Duration, rows: &mut Vec<Row>) -> Result<(), SourceError> {
        rows.append(&mut self.first);
        let timed = self.socket.get_mut().set_read_timeout(Some(timeout.max(Duration::from_millis(1))));
        timed.map_err(|e| self.url.unreachable(e.to_string()))?;
        let message = match self.socket.read() {
            Ok(message) => message,
            Err(tungstenite::Error::Io(error)) if is_patience(&error) => return Ok(()),
            Err(error) => {
                let why =
                    self.decoder.problem.take().map_or(String::new(), |said| format!("; it said: {said}"));
                return Err(self.url.unreachable(format!("the bridge is gone ({error}){why}; {LOOK_AT}")));
            }
        };
        let wrong = |why: String| self.url.protocol(why);
        match message {
            Message::Text(text) => {
                if let Some(answer) = self.decoder.text(text.as_str()).map_err(wrong)? {
                    let sent = self.socket.send(Message::text(answer));
                    sent.map_err(|e| self.url.unreachable(e.to_string()))?;
                }
            }
            Message::Binary(bytes) => rows.extend(self.decoder.binary(&bytes).map_err(wrong)?),
            _ => {}
        }
        Ok(())
    }

    fn losses(&self) -> Losses {
        self.decoder.losses
    }

    fn when_silent(&self) -> String {
        let topic = self.decoder.wanted.topic.as_deref().unwrap_or("the topic");
        format!("does `ros2 topic hz {topic}` show messages where the bridge runs?")
    }
}

#[cfg(test)]
#[path = "foxglove_tests.rs"]
mod tests;
