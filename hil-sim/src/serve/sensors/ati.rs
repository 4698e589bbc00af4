//! A Net F/T box of ATI: records over UDP, its page, its calibration over TCP (manual 9620-05-NET FT).

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;

use super::{Played, Sample};
use crate::serve::listener::{LOOK_AGAIN, Listener};

/// Counts per N and per N m.
const COUNTS: [u32; 2] = [1_000_000, 1_000_000];
const HEADER: [u8; 2] = [0x12, 0x34];

/// Serves as the box. Dropping it switches it off.
pub struct AtiServer {
    udp: SocketAddr,
    page: Listener,
    port: Listener,
    leave: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl AtiServer {
    /// Listens at an address for requests of records, with the page and the port beside it on free ones. The
    /// sensor reads what the body does to it: the reaction.
    ///
    /// # Errors
    /// An address is taken.
    pub fn listen(address: &str, played: Played) -> io::Result<Self> {
        let socket = UdpSocket::bind(address)?;
        socket.set_read_timeout(Some(LOOK_AGAIN))?;
        let udp = socket.local_addr()?;
        let host = udp.ip();
        let rate_hz = played.rate_hz;
        let page = Listener::listen((host, 0), move |stream, _| {
            let _ = answer_page(stream, rate_hz);
        })?;
        let port = Listener::listen((host, 0), move |stream, _| {
            let _ = answer_calibration(stream);
        })?;
        let leave = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&leave);
        let thread = std::thread::spawn(move || serve(&socket, &played, &stop));
        Ok(Self { udp, page, port, leave, threads: vec![thread] })
    }

    /// Returns where records are asked for.
    pub fn address(&self) -> SocketAddr {
        self.udp
    }

    /// Returns what a client is to be given: the address with the ports of page and calibration.
    pub fn url(&self) -> String {
        let (page, port) = (self.page.address().port(), self.port.address().port());
        format!("ati+udp://{}?http_port={page}&tcp_port={port}", self.udp)
    }
}

impl Drop for AtiServer {
    fn drop(&mut self) {
        self.leave.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            // A panic there has printed itself.
            let _ = thread.join();
        }
    }
}

/// Streams to whoever asked last, until asked to stop or to end.
fn serve(socket: &UdpSocket, played: &Played, leave: &AtomicBool) {
    let mut buffer = [0; 64];
    while !leave.load(Ordering::Acquire) {
        let Ok((n, client)) = socket.recv_from(&mut buffer) else { continue };
        let Some((2, mut left)) = request(&buffer[..n]) else { continue };
        let endless = left == 0;
        let (first, mut sent) = (played.next(), 0_u32);
        if socket.set_nonblocking(true).is_err() {
            return;
        }
        played.play(leave, |number, sample| {
            let mut asked = [0; 64];
            if let Ok((n, from)) = socket.recv_from(&mut asked)
                && from == client
                && request(&asked[..n]).is_some_and(|(command, _)| command == 0)
            {
                return false;
            }
            // Numbers of records begin with the request; those that are lost count.
            sent = u32::try_from(number - first).unwrap_or(u32::MAX).wrapping_add(1);
            let _ = socket.send_to(&record(sent, number, sample), client);
            left = left.saturating_sub(1);
            endless || left > 0
        });
        if socket.set_nonblocking(false).is_err() {
            return;
        }
    }
}

/// Returns command and count of a request.
fn request(bytes: &[u8]) -> Option<(u16, u32)> {
    let [a, b, c, d, e, f, g, h] = bytes.try_into().ok()?;
    ([a, b] == HEADER).then(|| (u16::from_be_bytes([c, d]), u32::from_be_bytes([e, f, g, h])))
}

fn record(sequence: u32, number: u64, sample: &Sample) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(36);
    for word in [sequence, number as u32, 0] {
        bytes.extend(word.to_be_bytes());
    }
    for (k, value) in sample.wrench.iter().enumerate() {
        let counts = -value * f64::from(COUNTS[usize::from(k >= 3)]);
        bytes.extend((counts.round() as i32).to_be_bytes());
    }
    bytes
}

fn answer_page(mut stream: TcpStream, rate_hz: f64) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(20 * LOOK_AGAIN))?;
    let mut request = Vec::new();
    let mut buffer = [0; 512];
    while !request.windows(4).any(|w| w == b"\r\n\r\n") && request.len() < 8192 {
        match stream.read(&mut buffer)? {
            0 => return Ok(()),
            n => request.extend_from_slice(&buffer[..n]),
        }
    }
    if !request.starts_with(b"GET /netftapi2.xml ") {
        return stream.write_all(b"HTTP/1.0 404 Not Found\r\n\r\n");
    }
    let [force, torque] = COUNTS;
    let body = format!(
        "<?xml version=\"1.0\" \
         encoding=\"UTF-8\"?>\r\n<netFTApi>\r\n<runstat>0x00000000</runstat>\r\n<comrdte>Enabled</comrdte>\r\n\
         <comrdtrate>{rate_hz}</comrdtrate>\r\n<scfgfu>N</scfgfu>\r\n<scfgtu>Nm</scfgtu>\r\n<cfgcpf>{force}</cfgcpf>\r\n\
         <cfgcpt>{torque}</cfgcpt>\r\n</netFTApi>\r\n"
    );
    let head = format!("HTTP/1.0 200 OK\r\nContent-Type: text/xml\r\nContent-Length: {}\r\n\r\n", body.len());
    stream.write_all((head + &body).as_bytes())
}

fn answer_calibration(mut stream: TcpStream) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(20 * LOOK_AGAIN))?;
    let mut request = [0; 20];
    stream.read_exact(&mut request)?;
    if request[0] != 1 {
        return Ok(());
    }
    let mut answer = HEADER.to_vec();
    // N and N m.
    answer.extend([2, 3]);
    for counts in COUNTS {
        answer.extend(counts.to_be_bytes());
    }
    answer.extend([0; 12]);
    stream.write_all(&answer)
}
