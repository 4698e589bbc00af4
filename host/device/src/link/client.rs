use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use nalgebra::DMatrix;
use rigident_shared::wire::frame::MAX_FRAME;
use rigident_shared::wire::{
    Answer, Command, DecodeError, Decoder, ErrorCode, Identity, Kind, PROTOCOL_VERSION, Reply, SCHEMA_HASH,
    Telemetry, encode, encode_payload,
};

use super::Transport;
use rigident_fit::{Factor, NoiseGram, compensate};

/// A command is sent again after this long without an answer.
const PATIENCE: Duration = Duration::from_millis(700);
/// Tries after which a command is given up: a board answers nothing while it erases three sectors of its
/// flash, of two seconds at most.
const ATTEMPTS: u32 = 10;
/// Channels of a wrench.
const WRENCH: usize = 6;
/// The name of the request in messages.
const FACTOR: &str = "read the factor";

/// The reason why the device did not follow its command.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// The bytes no longer flow.
    #[error("the link to the device is gone ({0}): check cable and power; what was received is kept.")]
    Gone(#[from] io::Error),
    /// No answer.
    #[error(
        "the device does not answer `{0}`: is the right port given, the device powered, no other program on \
         the port?"
    )]
    Silent(&'static str),
    /// The device speaks another protocol version.
    #[error(
        "the device's firmware speaks protocol {device}, this program {PROTOCOL_VERSION}: flash the firmware \
         that belongs to this version of rigident"
    )]
    OtherProtocol {
        /// The device's version.
        device: u8,
    },
    /// The device speaks the same protocol, with other messages.
    #[error(
        "the device's firmware was built with other messages (schema {device:016x}, here \
         {SCHEMA_HASH:016x}): flash the firmware that belongs to this version of rigident"
    )]
    OtherSchema {
        /// The device's hash.
        device: u64,
    },
    /// The device answers, but not in messages that are known here.
    #[error(
        "the device answers `{0}` in messages that this program does not know: its firmware was built from \
         other definitions; flash the firmware that belongs to this version of rigident"
    )]
    OtherMessages(&'static str),
    /// The device refused.
    #[error("the device refuses `{command}`: {} (error {})", explain(.code), .code.number())]
    Refused {
        /// The command.
        command: &'static str,
        /// The reason of the refusal.
        code: ErrorCode,
    },
    /// An answer that makes no sense.
    #[error(
        "the device answered `{0}` with something else: flash the firmware that belongs to this version of \
         rigident"
    )]
    Nonsense(&'static str),
    /// The factor is beyond the range of the device's numbers.
    #[error(
        "the device's factor is not finite: rows divided by their noise are beyond single precision; state a \
         larger noise_n_nm in the rig file, or check the recording for readings far off all others"
    )]
    NotFinite,
}

fn explain(code: &ErrorCode) -> String {
    match code {
        ErrorCode::UnknownCommand => "it does not know the command".to_owned(),
        ErrorCode::WrongProtocol { have, .. } => format!("it speaks protocol {have}"),
        ErrorCode::WrongState(state) => format!("not in state {state:?}"),
        ErrorCode::BadSetting(name) => format!("the setting {name:?} is impossible; nothing was changed"),
        ErrorCode::OutOfOrder { expected } => format!("it expects reading {expected}"),
        ErrorCode::NoEstimate => "nothing has been estimated yet".to_owned(),
        ErrorCode::Sensors => "its sensors do not come up: check their supply and wiring".to_owned(),
        ErrorCode::NotBuiltIn => {
            "its image was built without it: `cargo xtask firmware` builds one that has \
                                  it, given the feature (docs/measuring.md lists them)"
                .to_owned()
        }
        ErrorCode::NotKept => "it keeps no such run in its flash, or cannot read it".to_owned(),
        ErrorCode::Stale => "a late copy of an earlier command came; it was not obeyed".to_owned(),
    }
}

/// A device's factor.
#[derive(Clone, Debug, PartialEq)]
pub struct TakenFactor {
    /// The factor, in the device's order of parameters.
    pub factor: Factor,
    /// The part that noise of the signals has added to its `RᵀR`, N × N; `None`: the device counts none.
    pub gram: Option<DMatrix<f64>>,
}

impl TakenFactor {
    /// Returns a factor to which noise has added nothing.
    pub fn exact(factor: Factor) -> Self {
        Self { factor, gram: None }
    }

    /// Returns the factor of the compensated estimate.
    pub fn compensated(&self) -> Factor {
        let rounding = f64::from(f32::EPSILON) * self.factor.parameters() as f64;
        let noise = self.gram.as_ref().map(|gram| NoiseGram::in_factor(gram, &self.factor, WRENCH));
        let compensated = noise.and_then(|noise| compensate(&self.factor, &noise, rounding));
        compensated.map_or_else(|| self.factor.clone(), |compensated| compensated.factor)
    }
}

/// One device.
pub struct Client {
    transport: Box<dyn Transport>,
    decoder: Decoder,
    sequence: u16,
    telemetry: VecDeque<Telemetry>,
    telemetry_sequence: Option<u16>,
    heard: Instant,
    /// The number of times that a command is sent before it is given up.
    attempts: u32,
    /// Answers that arrived whole and make no sense.
    unknown_answers: u32,
    /// Frames that arrived damaged.
    pub bad_frames: u32,
    /// Telemetry frames that never arrived.
    pub lost_telemetry: u32,
}

impl Client {
    /// Makes a client over this transport; nothing is sent yet.
    pub fn new(transport: Box<dyn Transport>) -> Self {
        Self {
            transport,
            decoder: Decoder::new(),
            sequence: 0,
            telemetry: VecDeque::new(),
            telemetry_sequence: None,
            heard: Instant::now(),
            attempts: ATTEMPTS,
            unknown_answers: 0,
            bad_frames: 0,
            lost_telemetry: 0,
        }
    }

    /// Says hello, until the device answers, and checks that both speak the same.
    ///
    /// # Errors
    /// No answer, or another protocol.
    pub fn hello(&mut self) -> Result<Identity, LinkError> {
        // Ends whatever half frame is in the device's buffer.
        self.transport.write(&[0])?;
        let Reply::Hello(identity) = self.ask("hello", &Command::Hello)? else {
            return Err(LinkError::Nonsense("hello"));
        };
        if identity.protocol_version != PROTOCOL_VERSION {
            return Err(LinkError::OtherProtocol { device: identity.protocol_version });
        }
        if identity.schema_hash != SCHEMA_HASH {
            return Err(LinkError::OtherSchema { device: identity.schema_hash });
        }
        Ok(identity)
    }

    /// Greets the device, and gives up after `attempts` questions of 0.7 s each: there may be something else
    /// on the port.
    ///
    /// # Errors
    /// No answer, or another protocol.
    pub fn greet(&mut self, attempts: u32) -> Result<Identity, LinkError> {
        self.attempts = attempts;
        let answered = self.hello();
        self.attempts = ATTEMPTS;
        answered
    }

    /// Asks whether the device is there, giving up after `attempts` questions of 0.7 s each.
    ///
    /// # Errors
    /// The link, or silence.
    pub fn is_there(&mut self, attempts: u32) -> Result<(), LinkError> {
        self.attempts = attempts;
        let answered = self.ask("are you there", &Command::Heartbeat);
        self.attempts = ATTEMPTS;
        answered.map(drop)
    }

    /// Changes the rate of this end of the line, baud.
    ///
    /// # Errors
    /// The line has no rate, or not this one.
    pub fn set_baud(&mut self, baud: u32) -> Result<(), LinkError> {
        self.transport.set_baud(baud)?;
        // Ends what the change left in the device's buffer.
        Ok(self.transport.write(&[0])?)
    }

    /// Sends a command and waits for its answer, repeating it if need be. `name` is for messages.
    ///
    /// # Errors
    /// The link, the device's refusal, or silence.
    pub fn ask(&mut self, name: &'static str, command: &Command) -> Result<Reply, LinkError> {
        self.sequence = self.sequence.wrapping_add(1);
        let unknown = self.unknown_answers;
        let mut frame = [0; MAX_FRAME];
        let length = encode(Kind::Command, self.sequence, command, &mut frame)
            .map_err(|_| LinkError::Nonsense(name))?;
        let mut attempts = 0;
        while attempts < self.attempts {
            // While the line is out nobody is asked.
            attempts += u32::from(!self.transport.is_out());
            self.transport.write(frame.get(..length).unwrap_or_default())?;
            let deadline = Instant::now() + PATIENCE;
            while let Some(left) = deadline.checked_duration_since(Instant::now()) {
                for answer in self.receive(left)? {
                    match answer {
                        (sequence, Ok(reply)) if sequence == self.sequence => return Ok(reply),
                        (_, Err(ErrorCode::WrongProtocol { have, .. })) => {
                            return Err(LinkError::OtherProtocol { device: have });
                        }
                        (sequence, Err(code)) if sequence == self.sequence => {
                            return Err(LinkError::Refused { command: name, code });
                        }
                        // An answer to an earlier, repeated command.
                        _ => {}
                    }
                }
            }
        }
        Err(if self.unknown_answers > unknown {
            LinkError::OtherMessages(name)
        } else {
            LinkError::Silent(name)
        })
    }

    /// Sends a command whose answer nobody waits for.
    ///
    /// # Errors
    /// The link is gone.
    pub fn tell(&mut self, name: &'static str, command: &Command) -> Result<(), LinkError> {
        self.sequence = self.sequence.wrapping_add(1);
        let mut frame = [0; MAX_FRAME];
        let length = encode(Kind::Command, self.sequence, command, &mut frame)
            .map_err(|_| LinkError::Nonsense(name))?;
        Ok(self.transport.write(frame.get(..length).unwrap_or_default())?)
    }

    /// Sends a frame of a robot that is watched, which is never answered. They count by themselves.
    ///
    /// # Errors
    /// The link is gone; or there is no room for the frame.
    pub fn stream(&mut self, sequence: u16, payload: &[u8]) -> Result<(), LinkError> {
        let mut frame = [0; MAX_FRAME];
        let length = encode_payload(Kind::Stream, sequence, payload, &mut frame)
            .map_err(|_| LinkError::Nonsense("stream a frame"))?;
        Ok(self.transport.write(frame.get(..length).unwrap_or_default())?)
    }

    /// Returns whether the line is out, so that what is sent is lost.
    pub fn is_out(&self) -> bool {
        self.transport.is_out()
    }

    /// Counts silence from now on: nobody has listened until now.
    pub fn listen_anew(&mut self) {
        self.heard = Instant::now();
    }

    /// Returns how long the device has said nothing.
    pub fn silence(&self) -> Duration {
        self.heard.elapsed()
    }

    /// Takes what has come, waiting up to `timeout` for the first byte.
    ///
    /// # Errors
    /// The link is gone.
    pub fn listen(&mut self, timeout: Duration) -> Result<(), LinkError> {
        self.receive(timeout).map(drop)
    }

    /// Returns the next telemetry message, oldest first.
    pub fn next_telemetry(&mut self) -> Option<Telemetry> {
        self.telemetry.pop_front()
    }

    fn receive(&mut self, timeout: Duration) -> Result<Vec<(u16, Answer)>, LinkError> {
        let mut bytes = [0; 4096];
        let count = self.transport.read(&mut bytes, timeout)?;
        if count > 0 {
            self.heard = Instant::now();
        }
        let mut answers = Vec::new();
        for byte in bytes.iter().take(count) {
            match self.decoder.push(*byte) {
                None => {}
                Some(Ok(frame)) => match frame.kind {
                    Kind::Answer => match frame.message() {
                        Ok(answer) => answers.push((frame.sequence, answer)),
                        // Its check sum fits: it was meant so.
                        Err(_) => {
                            self.bad_frames += 1;
                            self.unknown_answers += 1;
                        }
                    },
                    Kind::Telemetry => match frame.message() {
                        Ok(message) => {
                            if let Some(last) = self.telemetry_sequence.replace(frame.sequence) {
                                let missing = frame.sequence.wrapping_sub(last).wrapping_sub(1);
                                self.lost_telemetry += u32::from(missing);
                            }
                            self.telemetry.push_back(message);
                        }
                        Err(_) => self.bad_frames += 1,
                    },
                    Kind::Command | Kind::Stream => {}
                },
                Some(Err(DecodeError::Version(device))) => return Err(LinkError::OtherProtocol { device }),
                Some(Err(_)) => self.bad_frames += 1,
            }
        }
        Ok(answers)
    }

    /// Fetches the factor of one body, row by row.
    ///
    /// # Errors
    /// The link, or nothing absorbed yet.
    pub fn factor(&mut self) -> Result<TakenFactor, LinkError> {
        let taken = self.any_factor()?;
        if matches!(taken.factor.parameters(), 10 | 16) {
            Ok(taken)
        } else {
            Err(LinkError::Nonsense(FACTOR))
        }
    }

    /// Fetches the factor of any model, row by row.
    ///
    /// # Errors
    /// The link, or nothing absorbed yet.
    pub fn any_factor(&mut self) -> Result<TakenFactor, LinkError> {
        let (mut rows, mut z, mut noise) = (Vec::new(), Vec::new(), Vec::new());
        let (mut residual, mut count) = (0.0, 0);
        for row in 0..=u8::MAX {
            let Reply::Row(mut taken) = self.ask(FACTOR, &Command::TakeRow { row })? else {
                return Err(LinkError::Nonsense(FACTOR));
            };
            let left = taken.parameters.checked_sub(row).filter(|left| *left > 0);
            if taken.row != row || left.is_none_or(|left| usize::from(left) + 1 != taken.entries.len()) {
                return Err(LinkError::Nonsense(FACTOR));
            }
            if !taken.gram.is_empty() && taken.gram.len() + 1 != taken.entries.len() {
                return Err(LinkError::Nonsense(FACTOR));
            }
            let numbers = taken.entries.iter().chain(&taken.gram).chain([&taken.residual_sum_of_squares]);
            if !numbers.copied().all(f32::is_finite) {
                return Err(LinkError::NotFinite);
            }
            noise.push(std::mem::take(&mut taken.gram));
            if row == 0 {
                (residual, count) = (taken.residual_sum_of_squares, taken.rows);
            }
            z.extend(taken.entries.pop());
            rows.extend(taken.entries);
            if left == Some(1) {
                let entries: Vec<f64> = rows.into_iter().chain(z).chain([residual]).map(f64::from).collect();
                let n = usize::from(taken.parameters);
                let factor = Factor::from_entries(n, &entries, u64::from(count));
                let factor = factor.ok_or(LinkError::Nonsense(FACTOR))?;
                let upper = |i: usize, j: usize| noise.get(i).and_then(|row| row.get(j - i)).copied();
                let noisy = noise.iter().any(|row| !row.is_empty());
                let entry = |i: usize, j: usize| upper(i.min(j), i.max(j)).map_or(0.0, f64::from);
                let gram = noisy.then(|| DMatrix::from_fn(n, n, entry));
                return Ok(TakenFactor { factor, gram });
            }
        }
        Err(LinkError::Nonsense(FACTOR))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives the same bytes after every write.
    struct Canned(Vec<u8>, bool);

    impl Transport for Canned {
        fn write(&mut self, _: &[u8]) -> io::Result<()> {
            self.1 = true;
            Ok(())
        }
        fn read(&mut self, buffer: &mut [u8], _: Duration) -> io::Result<usize> {
            if !std::mem::take(&mut self.1) {
                return Ok(0);
            }
            buffer[..self.0.len()].copy_from_slice(&self.0);
            Ok(self.0.len())
        }
    }

    /// Returns a frame as firmware of protocol `version` would send it, whose answer holds `payload`.
    fn frame_of_version(version: u8, payload: u8) -> Vec<u8> {
        let raw = [version, 1, 1, 0, payload];
        let check = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&raw);
        let body = [raw.as_slice(), &check.to_le_bytes()].concat();
        let mut line = vec![0];
        // COBS by hand: runs between zeros, each with its length in front.
        for run in body.split(|b| *b == 0) {
            line.push(run.len() as u8 + 1);
            line.extend(run);
        }
        line.push(0);
        line
    }

    #[test]
    fn firmware_of_another_protocol_is_distinguished_from_silence() {
        let mut client = Client::new(Box::new(Canned(frame_of_version(PROTOCOL_VERSION + 1, 0), false)));
        let error = client.hello().unwrap_err();
        assert!(
            matches!(error, LinkError::OtherProtocol { device } if device == PROTOCOL_VERSION + 1),
            "{error}"
        );
        assert!(error.to_string().contains("flash"));
    }

    #[test]
    fn firmware_whose_hello_is_not_known_is_distinguished_from_silence() {
        // No result has this many variants.
        let mut client = Client::new(Box::new(Canned(frame_of_version(PROTOCOL_VERSION, 0x77), false)));
        let error = client.greet(1).unwrap_err();
        assert!(matches!(error, LinkError::OtherMessages("hello")), "{error}");
        assert!(error.to_string().contains("flash"));
    }

    #[test]
    fn a_device_that_says_nothing_is_given_up() {
        let mut client = Client::new(Box::new(Canned(Vec::new(), false)));
        assert!(matches!(client.hello(), Err(LinkError::Silent("hello"))));
    }
}
