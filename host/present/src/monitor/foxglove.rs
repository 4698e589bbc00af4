//! The view for Foxglove: a WebSocket server of the protocol `foxglove.sdk.v1` with topics in JSON.
//!
//! | topic | content |
//! |---|---|
//! | `/rigident/parameters` | `{NAME: {value, u95, lower, upper}}` of what is identified, SI |
//! | `/rigident/answer` | status, condition number, advice, warnings |
//! | `/rigident/sensors` | readings, rate, what was rejected |
//! | `/rigident/link` | what was lost between device and host |
//!
//! A topic is announced with its first message, whose JSON Schema it has. A client that joins late gets the
//! last message at once; one that is slow misses some, and keeps nobody waiting.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Message, WebSocket};

use super::View;

/// The protocol's names: that of today, and that of older clients, whose messages are the same.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const PROTOCOL_HEADER: &str = "Sec-WebSocket-Protocol";
/// The place where Foxglove searches first.
pub const PORT: u16 = 8765;
/// First byte of a message's data.
const DATA: u8 = 1;
/// The interval at which clients are served.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// A client that does not take its messages for this long is gone; its handshake is whole within the same
/// time.
const PATIENCE: Duration = Duration::from_secs(5);
/// More clients than this are sent away.
const MOST_CLIENTS: usize = 16;
/// The longest message of a client, bytes.
const LONGEST_MESSAGE: usize = 64 << 10;

/// A topic with its last message.
#[derive(Clone, Debug)]
struct Topic {
    /// The number of the topic.
    id: u32,
    schema: String,
    message: String,
    time_ns: u64,
    /// The number of messages.
    count: u64,
}

type Topics = BTreeMap<&'static str, Topic>;

/// Serves Foxglove. Dropping it sends its clients away.
pub struct Server {
    address: SocketAddr,
    topics: Arc<Mutex<Topics>>,
    leave: Arc<AtomicBool>,
}

impl Server {
    /// Waits for clients at an address; port 0 takes any.
    ///
    /// # Errors
    /// The address is taken, or not this machine's.
    pub fn listen(address: SocketAddr) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let server = Self {
            address: listener.local_addr()?,
            topics: Arc::new(Mutex::new(Topics::new())),
            leave: Arc::new(AtomicBool::new(false)),
        };
        let (topics, leave) = (Arc::clone(&server.topics), Arc::clone(&server.leave));
        let clients = Arc::new(());
        thread::Builder::new().spawn(move || {
            while !leave.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => {
                        let (topics, leave, client) =
                            (Arc::clone(&topics), Arc::clone(&leave), Arc::clone(&clients));
                        // This one, the listener's, and one a client.
                        if Arc::strong_count(&clients) > MOST_CLIENTS + 1 {
                            continue;
                        }
                        // A client that goes, is none, or for whom there is no thread concerns nobody else.
                        let _ = thread::Builder::new().spawn(move || {
                            let _client = client;
                            drop(serve(stream, &topics, &leave));
                        });
                    }
                    Err(_) => thread::sleep(LOOK_EVERY),
                }
            }
        })?;
        Ok(server)
    }

    /// Returns where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Sends a view to all clients: of each topic what is new.
    pub fn publish(&self, view: &View) {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let time_ns = u64::try_from(since.as_nanos()).unwrap_or(u64::MAX);
        let mut topics = self.topics.lock().unwrap_or_else(PoisonError::into_inner);
        for (name, value) in messages(view) {
            let (id, schema, message) =
                (topics.len() as u32 + 1, schema(&value).to_string(), value.to_string());
            let topic = topics.entry(name).or_insert_with(|| Topic {
                id,
                schema: schema.clone(),
                message: String::new(),
                time_ns: 0,
                count: 0,
            });
            if topic.message != message {
                (topic.message, topic.time_ns, topic.count) = (message, time_ns, topic.count + 1);
                if topic.schema != schema {
                    // A parameter that was not identified before: the topic is another one for a client, and
                    // announced anew.
                    (topic.id, topic.schema) = (id.max(topic.id + 1_000), schema);
                }
            }
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Relaxed);
    }
}

/// Returns what is sent of a view.
fn messages(view: &View) -> Vec<(&'static str, Value)> {
    let mut messages = vec![("/rigident/sensors", {
        let trouble: serde_json::Map<String, Value> =
            view.sensors.trouble.iter().map(|counted| (counted.what.clone(), counted.count.into())).collect();
        json!({
            "elapsed_s": view.elapsed_s, "readings": view.sensors.readings, "rate_hz": view.sensors.rate_hz.unwrap_or(0.0),
            "phase": view.phase, "trouble": trouble,
        })
    })];
    if let Some(link) = &view.link {
        messages.push(("/rigident/link", serde_json::to_value(link).unwrap_or_default()));
    }
    if let Some(answer) = &view.answer {
        let identified = answer.parameters.iter().filter_map(|parameter| {
            let now = parameter.now?;
            let [lower, upper] = now.ends();
            let value = json!({ "value": now.value, "u95": now.u95, "lower": lower, "upper": upper, "unit": parameter.unit });
            Some((parameter.name.replace('.', "_"), value))
        });
        messages.push(("/rigident/parameters", Value::Object(identified.collect())));
        let worst = answer.worst();
        messages.push((
            "/rigident/answer",
            json!({
                "status": answer.status, "readings": answer.readings, "condition_number": answer.condition_number.unwrap_or(0.0),
                "weakest": worst.map_or("", |(name, _)| name), "advice": answer.advice, "warnings": answer.warnings,
            }),
        ));
    }
    messages
}

/// Returns the JSON Schema of values like this one.
fn schema(value: &Value) -> Value {
    match value {
        Value::Object(map) => {
            let properties: serde_json::Map<String, Value> =
                map.iter().map(|(name, value)| (name.clone(), schema(value))).collect();
            json!({ "type": "object", "properties": properties })
        }
        // Of words alone here.
        Value::Array(_) => json!({ "type": "array", "items": { "type": "string" } }),
        Value::String(_) => json!({ "type": "string" }),
        Value::Bool(_) => json!({ "type": "boolean" }),
        Value::Number(_) | Value::Null => json!({ "type": "number" }),
    }
}

/// Why a client is left.
type Left = Box<dyn std::error::Error + Send + Sync>;

/// Returns true where a page of this origin may read the experiment: Foxglove's own, this computer's, and
/// programs that are no web pages. Any page that somebody has open could connect to this computer otherwise.
fn is_known_origin(origin: &str) -> bool {
    let Some((scheme, host)) = origin.split_once("://") else { return false };
    let host = name_of(host);
    match scheme {
        "http" => is_this_computer(host),
        "https" => is_this_computer(host) || host == "foxglove.dev" || host.ends_with(".foxglove.dev"),
        // Of a program's own window.
        "file" | "app" | "vscode-webview" => true,
        _ => false,
    }
}

/// Returns true for a host as this computer is called: a name of a stranger's could be made to lead here,
/// too.
fn is_own_host(host: &str) -> bool {
    let name = name_of(host);
    let is_address = name.trim_matches(['[', ']']).parse::<std::net::IpAddr>().is_ok();
    is_address
        || is_this_computer(name)
        || (!name.is_empty() && !name.contains('.'))
        || name.ends_with(".local")
}

fn is_this_computer(name: &str) -> bool {
    ["localhost", "127.0.0.1", "[::1]"].contains(&name)
}

/// Returns a host without its port.
fn name_of(host: &str) -> &str {
    match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|b| b.is_ascii_digit()) && !name.ends_with(':') => name,
        _ => host,
    }
}

#[expect(clippy::result_large_err, reason = "the type of the handshake's callback")]
fn refused(status: StatusCode, why: &str) -> Result<Response, ErrorResponse> {
    let mut refused = ErrorResponse::new(Some(why.to_owned()));
    *refused.status_mut() = status;
    Err(refused)
}

#[expect(clippy::result_large_err, reason = "the type of the handshake's callback")]
fn answer_handshake(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let header = |name: &str| request.headers().get(name).map(|value| value.to_str().unwrap_or("?"));
    if !header("Origin").is_none_or(is_known_origin) {
        return refused(StatusCode::FORBIDDEN, "pages of this origin are not served: open it in Foxglove");
    }
    if !header("Host").is_some_and(is_own_host) {
        return refused(
            StatusCode::FORBIDDEN,
            "this computer is not served by that name: connect to its address, or to a name that ends in \
             .local",
        );
    }
    let offered =
        request.headers().get(PROTOCOL_HEADER).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
    match PROTOCOLS.into_iter().find(|protocol| offered.contains(protocol)) {
        Some(protocol) => {
            response.headers_mut().insert(PROTOCOL_HEADER, HeaderValue::from_static(protocol));
            Ok(response)
        }
        None => refused(StatusCode::BAD_REQUEST, "this server speaks foxglove.sdk.v1: open it in Foxglove"),
    }
}

/// Serves one client to its end.
fn serve(stream: TcpStream, topics: &Mutex<Topics>, leave: &AtomicBool) -> Result<(), Left> {
    stream.set_nonblocking(false)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let limits = WebSocketConfig::default()
        .read_buffer_size(4 << 10)
        .max_message_size(Some(LONGEST_MESSAGE))
        .max_frame_size(Some(LONGEST_MESSAGE));
    let timed = Timed { stream, until: Some(Instant::now() + PATIENCE) };
    let socket = tungstenite::accept_hdr_with_config(timed, answer_handshake, Some(limits));
    let mut socket = socket.map_err(|e| e.to_string())?;
    socket.get_mut().until = None;
    socket.get_ref().stream.set_read_timeout(Some(LOOK_EVERY))?;
    let hello = json!({
        "op": "serverInfo", "name": concat!("rigident ", env!("CARGO_PKG_VERSION")), "capabilities": [], "supportedEncodings": [],
        "metadata": {}, "sessionId": std::process::id().to_string(),
    });
    socket.send(Message::text(hello.to_string()))?;
    let mut client = Client::default();
    while !leave.load(Ordering::Relaxed) {
        match socket.read() {
            Ok(Message::Text(text)) => client.receive(&text),
            Ok(Message::Close(_)) => break,
            Ok(_) => {}
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.into()),
        }
        client.send_new(&mut socket, topics)?;
    }
    // It may be gone already.
    let _ = socket.close(None);
    Ok(())
}

/// A stream that is read until a time, however little comes at once.
struct Timed {
    stream: TcpStream,
    until: Option<Instant>,
}

impl io::Read for Timed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if let Some(until) = self.until {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(ErrorKind::TimedOut.into());
            }
            self.stream.set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
        }
        self.stream.read(buffer)
    }
}

impl io::Write for Timed {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// The state and the subscriptions of a client.
#[derive(Debug, Default)]
struct Client {
    /// Topics that it was informed of, by number.
    announced: Vec<u32>,
    /// The client's number of each subscription, the number of its topic, and the number of its messages that
    /// the client has.
    wanted: Vec<(u32, u32, u64)>,
}

impl Client {
    /// Takes what the client says; what is not understood is left.
    fn receive(&mut self, text: &str) {
        let said: Value = serde_json::from_str(text).unwrap_or_default();
        let number = |value: &Value| value.as_u64().and_then(|n| u32::try_from(n).ok());
        match said["op"].as_str() {
            Some("subscribe") => {
                let asked = said["subscriptions"].as_array().into_iter().flatten();
                let asked =
                    asked.filter_map(|one| Some((number(&one["id"])?, number(&one["channelId"])?, 0)));
                // No client has more topics than there are.
                self.wanted.extend(asked.take(64));
                self.wanted.truncate(64);
            }
            Some("unsubscribe") => {
                let ended: Vec<u32> =
                    said["subscriptionIds"].as_array().into_iter().flatten().filter_map(number).collect();
                self.wanted.retain(|(id, ..)| !ended.contains(id));
            }
            _ => {}
        }
    }

    /// Announces what is new, and sends what is wanted of it.
    fn send_new(&mut self, socket: &mut WebSocket<Timed>, topics: &Mutex<Topics>) -> Result<(), Left> {
        let topics = topics.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let gone: Vec<u32> = self
            .announced
            .iter()
            .copied()
            .filter(|id| topics.values().all(|topic| topic.id != *id))
            .collect();
        if !gone.is_empty() {
            self.announced.retain(|id| !gone.contains(id));
            self.wanted.retain(|(_, id, _)| !gone.contains(id));
            socket.send(Message::text(json!({ "op": "unadvertise", "channelIds": gone }).to_string()))?;
        }
        let fresh = topics.iter().filter(|(_, topic)| !self.announced.contains(&topic.id));
        let channels: Vec<Value> = fresh
            .map(|(name, topic)| {
                json!({
                    "id": topic.id, "topic": name, "encoding": "json", "schemaName": name.trim_start_matches('/').replace('/', "."),
                    "schema": topic.schema, "schemaEncoding": "jsonschema",
                })
            })
            .collect();
        if !channels.is_empty() {
            self.announced = topics.values().map(|topic| topic.id).collect();
            socket.send(Message::text(json!({ "op": "advertise", "channels": channels }).to_string()))?;
        }
        for (subscription, id, have) in &mut self.wanted {
            let Some(topic) = topics.values().find(|topic| topic.id == *id && topic.count > *have) else {
                continue;
            };
            *have = topic.count;
            let mut data = vec![DATA];
            data.extend(subscription.to_le_bytes());
            data.extend(topic.time_ns.to_le_bytes());
            data.extend(topic.message.as_bytes());
            socket.send(Message::binary(data))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::monitor::{Answered, Band, ParameterView};
    use rigident_identify::answer::Status;

    fn view(mass: f64) -> View {
        let now = Some(Band { time_s: 1.0, value: mass, u95: 0.5 });
        let parameters = vec![
            ParameterView { name: "m".to_owned(), unit: "kg".to_owned(), now, history: Vec::new() },
            ParameterView { name: "arm.MSx".to_owned(), unit: "kg m".to_owned(), ..ParameterView::default() },
        ];
        let answer = Answered { status: Status::PartlyIdentified, parameters, ..Answered::default() };
        View { phase: "running".to_owned(), answer: Some(answer), ..View::default() }
    }

    #[test]
    fn unidentified_parameters_are_not_sent_and_a_schema_names_every_number() {
        let messages = messages(&view(3.0));
        let (_, parameters) = messages.iter().find(|(topic, _)| *topic == "/rigident/parameters").unwrap();
        assert_eq!(
            *parameters,
            json!({"m": {"value": 3.0, "u95": 0.5, "lower": 2.5, "upper": 3.5, "unit": "kg"}})
        );
        let schema = schema(parameters);
        assert_eq!(schema["properties"]["m"]["properties"]["lower"]["type"], "number");
        assert!(messages.iter().all(|(topic, _)| *topic != "/rigident/link"));
    }

    #[test]
    fn a_client_receives_the_topics_and_its_subscriptions_until_it_ends_them() {
        let server = Server::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        server.publish(&view(3.0));
        let request =
            tungstenite::ClientRequestBuilder::new(format!("ws://{}", server.address()).parse().unwrap())
                .with_sub_protocol("foxglove.sdk.v1");
        let stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let (mut client, response) = tungstenite::client(request, stream).unwrap();
        assert_eq!(response.headers()[PROTOCOL_HEADER], "foxglove.sdk.v1");
        let mut text =
            || -> Value { serde_json::from_str(client.read().unwrap().to_text().unwrap()).unwrap() };
        assert_eq!(text()["op"], "serverInfo");
        let advertised = text();
        let channels = advertised["channels"].as_array().unwrap();
        let channel = channels.iter().find(|channel| channel["topic"] == "/rigident/parameters").unwrap();
        let subscribe = json!({"op": "subscribe", "subscriptions": [{"id": 7, "channelId": channel["id"]}]});
        // What makes no sense is left.
        for sent in [
            "{",
            "{\"op\": 3}",
            "{\"op\": \"subscribe\", \"subscriptions\": [{\"id\": -1}]}",
            &subscribe.to_string(),
        ] {
            client.send(Message::text(sent)).unwrap();
        }
        let mut value = || {
            let data = client.read().unwrap().into_data();
            assert_eq!((data[0], u32::from_le_bytes(data[1..5].try_into().unwrap())), (DATA, 7));
            let message: Value = serde_json::from_slice(&data[13..]).unwrap();
            message["m"]["value"].as_f64().unwrap()
        };
        assert!((value() - 3.0).abs() < 1e-12);
        server.publish(&view(4.0));
        assert!((value() - 4.0).abs() < 1e-12);
        drop(server);
        let mut last = client.read();
        while matches!(last, Ok(ref message) if !message.is_close()) {
            last = client.read();
        }
    }

    #[test]
    fn a_client_of_another_protocol_is_refused() {
        let server = Server::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let stream = TcpStream::connect(server.address()).unwrap();
        assert!(tungstenite::client(format!("ws://{}", server.address()), stream).is_err());
    }

    /// Returns the first line that the server says to a handshake.
    fn said(server: &Server, host: &str, origin: Option<&str>) -> String {
        use std::io::{BufRead, BufReader, Write};
        let mut stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let origin = origin.map_or_else(String::new, |origin| format!("Origin: {origin}\r\n"));
        write!(
            stream,
            "GET / HTTP/1.1\r\nHost: {host}\r\n{origin}Connection: Upgrade\r\nUpgrade: websocket\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
             Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
        )
        .unwrap();
        let mut line = String::new();
        BufReader::new(stream).read_line(&mut line).unwrap();
        line
    }

    #[test]
    fn pages_of_strangers_and_names_that_were_made_to_lead_here_are_refused() {
        let server = Server::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        let own = server.address().to_string();
        for (host, origin, status) in [
            (own.as_str(), None, "101"),
            ("localhost:8765", Some("https://app.foxglove.dev"), "101"),
            ("[::1]:8765", Some("http://localhost:8080"), "101"),
            ("lab-pc", Some("file://"), "101"),
            (own.as_str(), Some("https://evil.example"), "403"),
            (own.as_str(), Some("https://foxglove.dev.evil.example"), "403"),
            (own.as_str(), Some("http://127.0.0.1.evil.example"), "403"),
            (own.as_str(), Some("null"), "403"),
            ("evil.example:8765", None, "403"),
            ("evil.example", Some("https://app.foxglove.dev"), "403"),
        ] {
            let line = said(&server, host, origin);
            assert_eq!(line.split(' ').nth(1), Some(status), "{host} {origin:?}: {line}");
        }
    }

    #[test]
    fn clients_are_few_their_messages_short_and_their_handshakes_quick() {
        use std::io::{Read, Write};
        let server = Server::listen("127.0.0.1:0".parse().unwrap()).unwrap();
        // Idle ones take the places; one too many is sent away at once.
        let connect = || {
            let stream = TcpStream::connect(server.address()).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
            stream
        };
        let idle: Vec<TcpStream> = (0..MOST_CLIENTS).map(|_| connect()).collect();
        thread::sleep(Duration::from_millis(200));
        let begun = Instant::now();
        assert!(!matches!(connect().read(&mut [0; 1]), Ok(1..)));
        assert!(begun.elapsed() < PATIENCE / 2);
        drop(idle);
        thread::sleep(Duration::from_millis(200));
        // A handshake of a byte now and then.
        let mut slow = connect();
        let begun = Instant::now();
        while slow.write_all(b"G").is_ok() && begun.elapsed() < 3 * PATIENCE {
            thread::sleep(Duration::from_millis(100));
        }
        assert!(begun.elapsed() < 2 * PATIENCE, "{:?}", begun.elapsed());
        // A long message.
        let url = format!("ws://{}", server.address());
        let request =
            tungstenite::ClientRequestBuilder::new(url.parse().unwrap()).with_sub_protocol("foxglove.sdk.v1");
        let (mut client, _) = tungstenite::client(request, connect()).unwrap();
        // It may be left before all is said.
        let _ = client.send(Message::text("x".repeat(2 * LONGEST_MESSAGE)));
        assert!((0..100).map(|_| client.read()).any(|read| read.is_err()));
    }
}
