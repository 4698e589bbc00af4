use std::io::{BufRead, BufReader, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use rigident_sim::platform::MotionProgram;
use serde::{Deserialize, Serialize};

use super::{Motion, Platform, PlatformError};

/// How long a controller may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// A controller that speaks one JSON object per line over TCP: `load`, `start`, `stop`, `state`.
pub struct NetworkPlatform {
    address: String,
    stream: BufReader<TcpStream>,
}

#[derive(Serialize)]
#[serde(tag = "cmd", rename_all = "lowercase")]
enum Request<'a> {
    Load { program: &'a MotionProgram },
    Start,
    Stop,
    State,
}

#[derive(Deserialize)]
struct Answer {
    ok: bool,
    #[serde(default)]
    state: String,
    #[serde(default)]
    error: String,
}

impl NetworkPlatform {
    /// Connects to `tcp://HOST:PORT`.
    ///
    /// # Errors
    /// The address is not one, or nobody answers.
    pub fn connect(address: &str) -> Result<Self, PlatformError> {
        let unreachable = |reason: String| PlatformError::Unreachable { address: address.to_owned(), reason };
        let host = address
            .strip_prefix("tcp://")
            .ok_or_else(|| unreachable("an address looks like tcp://127.0.0.1:7447".to_owned()))?;
        let mut last = "the name has no address".to_owned();
        for socket in host.to_socket_addrs().map_err(|e| unreachable(e.to_string()))? {
            match TcpStream::connect_timeout(&socket, PATIENCE) {
                Ok(stream) => {
                    stream
                        .set_read_timeout(Some(PATIENCE))
                        .and_then(|()| stream.set_write_timeout(Some(PATIENCE)))
                        .and_then(|()| stream.set_nodelay(true))
                        .map_err(|e| unreachable(e.to_string()))?;
                    return Ok(Self { address: address.to_owned(), stream: BufReader::new(stream) });
                }
                Err(error) => last = error.to_string(),
            }
        }
        Err(unreachable(last))
    }

    fn ask(&mut self, request: &Request) -> Result<Answer, PlatformError> {
        let unreachable =
            |reason: String| PlatformError::Unreachable { address: self.address.clone(), reason };
        let mut line = serde_json::to_string(request).map_err(|e| unreachable(e.to_string()))?;
        line.push('\n');
        self.stream.get_mut().write_all(line.as_bytes()).map_err(|e| unreachable(e.to_string()))?;
        let mut reply = String::new();
        match self.stream.read_line(&mut reply) {
            Ok(0) => Err(unreachable("it closed the connection".to_owned())),
            Ok(_) => {
                let answer: Answer = serde_json::from_str(&reply)
                    .map_err(|e| unreachable(format!("its answer is not understood: {e}")))?;
                if answer.ok { Ok(answer) } else { Err(PlatformError::Refused(answer.error)) }
            }
            Err(error) => Err(unreachable(error.to_string())),
        }
    }
}

impl Platform for NetworkPlatform {
    fn load(&mut self, program: &MotionProgram) -> Result<(), PlatformError> {
        self.ask(&Request::Load { program }).map(drop)
    }

    fn start(&mut self) -> Result<(), PlatformError> {
        self.ask(&Request::Start).map(drop)
    }

    fn stop(&mut self) -> Result<(), PlatformError> {
        self.ask(&Request::Stop).map(drop)
    }

    fn motion(&mut self) -> Result<Motion, PlatformError> {
        match self.ask(&Request::State)?.state.as_str() {
            "holding" => Ok(Motion::Holding),
            "moving" => Ok(Motion::Moving),
            "done" => Ok(Motion::Done),
            other => Err(PlatformError::Refused(format!("it reports an unknown state, {other:?}"))),
        }
    }
}
