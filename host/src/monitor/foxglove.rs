//! The view for Foxglove: a WebSocket server of the protocol `foxglove.sdk.v1` with topics in JSON.
//!
//! | topic | content |
//! |---|---|
//! | `/rigident/parameters` | `{NAME: {value, u95, lower, upper}}` of what is identified, SI |
//! | `/rigident/answer` | status, condition number, advice, warnings |
//! | `/rigident/sensors` | readings, rate, what was rejected |
//! | `/rigident/link` | what was lost between device and host |
//!
//! A topic is announced with its first message, whose JSON Schema it has. A client that joins late gets the last message at once; one that
//! is slow misses some, and keeps nobody waiting.

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::{HeaderValue, StatusCode};
use tungstenite::{Message, WebSocket};

use super::View;

/// The protocol's names: that of today, and that of older clients, whose messages are the same.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const PROTOCOL_HEADER: &str = "Sec-WebSocket-Protocol";
/// Where Foxglove looks first.
pub const PORT: u16 = 8765;
/// First byte of a message's data.
const DATA: u8 = 1;
/// Clients are looked after so often.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// A client that does not take its messages for so long is gone.
const PATIENCE: Duration = Duration::from_secs(5);

/// A topic with its last message.
#[derive(Clone, Debug)]
struct Topic {
    /// Its number.
    id: u32,
    schema: String,
    message: String,
    time_ns: u64,
    /// How many messages there were.
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
        thread::spawn(move || {
            while !leave.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok((stream, _)) => {
                        let (topics, leave) = (Arc::clone(&topics), Arc::clone(&leave));
                        // A client that goes, or is none, concerns nobody else.
                        thread::spawn(move || drop(serve(stream, &topics, &leave)));
                    }
                    Err(_) => thread::sleep(LOOK_EVERY),
                }
            }
        });
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
                    // A parameter that was not identified before: the topic is another one for a client, and announced anew.
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

/// What is sent of a view.
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

/// The JSON Schema of values like this one.
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

#[expect(clippy::result_large_err, reason = "the type of the handshake's callback")]
fn answer_handshake(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let offered =
        request.headers().get(PROTOCOL_HEADER).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let offered: Vec<&str> = offered.split(',').map(str::trim).collect();
    match PROTOCOLS.into_iter().find(|protocol| offered.contains(protocol)) {
        Some(protocol) => {
            response.headers_mut().insert(PROTOCOL_HEADER, HeaderValue::from_static(protocol));
            Ok(response)
        }
        None => {
            let mut refused = ErrorResponse::new(Some(
                "this server speaks foxglove.sdk.v1: open it in Foxglove".to_owned(),
            ));
            *refused.status_mut() = StatusCode::BAD_REQUEST;
            Err(refused)
        }
    }
}

/// Serves one client to its end.
fn serve(stream: TcpStream, topics: &Mutex<Topics>, leave: &AtomicBool) -> Result<(), Left> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut socket = tungstenite::accept_hdr(stream, answer_handshake).map_err(|e| e.to_string())?;
    socket.get_ref().set_read_timeout(Some(LOOK_EVERY))?;
    let hello = json!({
        "op": "serverInfo", "name": concat!("rigident ", env!("CARGO_PKG_VERSION")), "capabilities": [], "supportedEncodings": [],
        "metadata": {}, "sessionId": std::process::id().to_string(),
    });
    socket.send(Message::text(hello.to_string()))?;
    let mut client = Client::default();
    while !leave.load(Ordering::Relaxed) {
        match socket.read() {
            Ok(Message::Text(text)) => client.told(&text),
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

/// What a client knows and wants.
#[derive(Debug, Default)]
struct Client {
    /// Topics that it was told of, by number.
    announced: Vec<u32>,
    /// Its own number of a subscription, that of the topic, and how many of its messages it has.
    wanted: Vec<(u32, u32, u64)>,
}

impl Client {
    /// Takes what the client says; what is not understood is left.
    fn told(&mut self, text: &str) {
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
    fn send_new(&mut self, socket: &mut WebSocket<TcpStream>, topics: &Mutex<Topics>) -> Result<(), Left> {
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
    use crate::answer::Status;
    use crate::monitor::{Answered, Band, ParameterView};

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
    fn what_is_not_identified_is_not_sent_and_a_schema_names_every_number() {
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
    fn a_client_is_told_topics_and_gets_what_it_subscribes_to_until_it_does_no_more() {
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
}
