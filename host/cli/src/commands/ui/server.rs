//! A server of a few static files to this computer: it reads requests for them, and nothing else.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// The longest head of a request, bytes.
const MOST_OF_HEAD: usize = 16 << 10;
/// A client that sends or takes nothing for this long is left.
const PATIENCE: Duration = Duration::from_secs(10);
/// Clients at the same time.
const MOST_CLIENTS: usize = 32;
/// Time between two checks whether it is to end.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// The largest file of a page, bytes.
const MOST_OF_FILE: u64 = 64 << 20;
/// Lets a browser run the page's own scripts, and the one that plays motions, by its hash; it talks to nobody
/// else.
const POLICY: &str = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval' \
                      'sha256-0e0lr69b/9ybeOi3nnoA/t9ooQ/KmopSCgJ4Y0nN/5g='; worker-src 'self'; \
                      connect-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
                      frame-src blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// Holds the files of a page.
#[derive(Clone, Debug)]
pub(crate) enum Site {
    /// In this program, by their names.
    #[cfg_attr(
        not(feature = "page"),
        allow(dead_code, reason = "a build without the page has a folder alone")
    )]
    Embedded(&'static [(&'static str, &'static [u8])]),
    /// In a folder.
    Folder(PathBuf),
}

impl Site {
    /// Returns a file by its name relative to the page, `example/bracket.csv`; `None` if there is none, or
    /// the name leads elsewhere.
    pub(crate) fn file(&self, name: &str) -> Option<Vec<u8>> {
        let is_plain = |part: &str| {
            !part.starts_with('.') && part.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b))
        };
        if name.is_empty() || !name.split('/').all(|part| !part.is_empty() && is_plain(part)) {
            return None;
        }
        match self {
            Self::Embedded(files) => {
                files.iter().find(|(own, _)| *own == name).map(|(_, bytes)| bytes.to_vec())
            }
            Self::Folder(folder) => rigident_files::read(&folder.join(name), MOST_OF_FILE).ok(),
        }
    }
}

/// A listener with the page that it serves.
pub(crate) struct Server {
    listener: TcpListener,
    site: Arc<Site>,
    port: u16,
}

impl Server {
    /// Serves a site to whoever comes to the listener.
    ///
    /// # Errors
    /// Returns the error of the system.
    pub(crate) fn new(listener: TcpListener, site: Site) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        Ok(Self { listener, site: Arc::new(site), port })
    }

    /// Returns its address.
    pub(crate) fn url(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Serves until `leave` is true.
    pub(crate) fn serve(&self, leave: &AtomicBool) {
        let clients = Arc::new(());
        while !leave.load(Ordering::Relaxed) {
            let Ok((stream, _)) = self.listener.accept() else {
                thread::sleep(LOOK_EVERY);
                continue;
            };
            if Arc::strong_count(&clients) > MOST_CLIENTS {
                continue;
            }
            let (site, port, client) = (Arc::clone(&self.site), self.port, Arc::clone(&clients));
            // A client that goes, is none, or for whom there is no thread concerns nobody else.
            let _ = thread::Builder::new().spawn(move || {
                let _client = client;
                let _ = attend(stream, &site, port);
            });
        }
    }
}

/// Reads one request and answers it.
fn attend(mut stream: TcpStream, site: &Site, port: u16) -> io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let begun = Instant::now();
    let (mut head, mut piece) = (Vec::new(), [0; 2048]);
    while !head.windows(4).any(|end| end == b"\r\n\r\n") {
        let count = stream.read(&mut piece)?;
        if count == 0 || head.len() + count > MOST_OF_HEAD || begun.elapsed() > PATIENCE {
            return Ok(());
        }
        head.extend_from_slice(piece.get(..count).unwrap_or_default());
    }
    let reply = answer(&String::from_utf8_lossy(&head), site, port);
    stream.write_all(reply.head().as_bytes())?;
    if reply.has_body {
        stream.write_all(&reply.body)?;
    }
    stream.flush()
}

/// Answers a request.
struct Reply {
    status: &'static str,
    kind: &'static str,
    is_packed: bool,
    has_body: bool,
    body: Vec<u8>,
}

impl Reply {
    fn words(status: &'static str, words: &str) -> Self {
        Self {
            status,
            kind: "text/plain; charset=utf-8",
            is_packed: false,
            has_body: true,
            body: words.into(),
        }
    }

    fn head(&self) -> String {
        let packed = if self.is_packed { "Content-Encoding: gzip\r\n" } else { "" };
        format!(
            "HTTP/1.1 {}\r\nContent-Type: {}\r\nContent-Length: {}\r\n{packed}Connection: \
             close\r\nCache-Control: no-cache\r\n\
             Content-Security-Policy: {POLICY}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: \
             no-referrer\r\n\
             Cross-Origin-Opener-Policy: same-origin\r\nCross-Origin-Resource-Policy: same-origin\r\n\r\n",
            self.status,
            self.kind,
            self.body.len()
        )
    }
}

/// Answers a request by its head.
fn answer(head: &str, site: &Site, port: u16) -> Reply {
    let mut lines = head.lines();
    let mut words = lines.next().unwrap_or_default().split(' ');
    let (method, path) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
    let headers: Vec<(String, &str)> = lines
        .filter_map(|line| line.split_once(':'))
        .map(|(name, value)| (name.trim().to_ascii_lowercase(), value.trim()))
        .collect();
    let all = |wanted: &str| {
        headers.iter().filter(|(name, _)| name == wanted).map(|(_, value)| *value).collect::<Vec<_>>()
    };
    // A name of a stranger's can be made to lead to this computer; its pages would then be of this origin.
    let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let host = all("host");
    if host.len() != 1 || !hosts.iter().any(|own| host.contains(&own.as_str())) {
        return Reply::words(
            "403 Forbidden",
            "this computer is not served by that name: open the address that was printed\n",
        );
    }
    let is_own = |origin: &&str| {
        origin.strip_prefix("http://").is_some_and(|host| hosts.iter().any(|own| own == host))
    };
    if !all("origin").iter().all(is_own) {
        return Reply::words("403 Forbidden", "pages of other origins are not served\n");
    }
    if method != "GET" && method != "HEAD" {
        return Reply::words("405 Method Not Allowed", "only files are served: nothing is taken\n");
    }
    let name = path.split('?').next().unwrap_or_default().trim_start_matches('/');
    let name = if name.is_empty() { "index.html" } else { name };
    let packed = site.file(&format!("{name}.gz"));
    let is_packed = packed.is_some();
    match packed.or_else(|| site.file(name)) {
        None => Reply::words("404 Not Found", "there is no such file\n"),
        Some(body) => {
            Reply { status: "200 OK", kind: kind(name), is_packed, has_body: method == "GET", body }
        }
    }
}

/// Returns the type of a file by its ending.
fn kind(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("wasm") => "application/wasm",
        Some("csv" | "toml") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SITE: Site = Site::Embedded(&[
        ("index.html", b"<p>"),
        ("rigident.wasm.gz", b"packed"),
        ("example/a.csv", b"t_s\n"),
    ]);

    fn status(request: &str) -> String {
        let head = request.replace('\n', "\r\n");
        answer(&head, &SITE, 4000).status.to_owned()
    }

    #[test]
    fn files_are_served_to_pages_of_its_own_and_to_no_other_name() {
        let host = "Host: 127.0.0.1:4000\n";
        assert_eq!(status(&format!("GET / HTTP/1.1\n{host}\n")), "200 OK");
        assert_eq!(status(&format!("GET /example/a.csv?x HTTP/1.1\n{host}\n")), "200 OK");
        let packed = answer(&format!("GET /rigident.wasm HTTP/1.1\r\n{host}\r\n"), &SITE, 4000);
        assert!(packed.is_packed && packed.kind == "application/wasm" && packed.body == b"packed");
        assert!(packed.head().contains("Content-Encoding: gzip\r\n"));
        assert!(!answer(&format!("HEAD / HTTP/1.1\r\n{host}\r\n"), &SITE, 4000).has_body);
        for (request, refused) in [
            ("GET / HTTP/1.1\n\n".to_owned(), "403"),
            ("GET / HTTP/1.1\nHost: evil.example\n\n".to_owned(), "403"),
            ("GET / HTTP/1.1\nHost: evil.example:4000\n\n".to_owned(), "403"),
            ("GET / HTTP/1.1\nHost: 127.0.0.1:4001\n\n".to_owned(), "403"),
            (format!("GET / HTTP/1.1\n{host}Host: evil.example\n\n"), "403"),
            (format!("GET / HTTP/1.1\n{host}Origin: http://evil.example\n\n"), "403"),
            (format!("GET / HTTP/1.1\n{host}Origin: null\n\n"), "403"),
            (format!("POST / HTTP/1.1\n{host}\n\n"), "405"),
            (format!("GET /../Cargo.toml HTTP/1.1\n{host}\n"), "404"),
            (format!("GET /%2e%2e/Cargo.toml HTTP/1.1\n{host}\n"), "404"),
            (format!("GET //etc/passwd HTTP/1.1\n{host}\n"), "404"),
            ("\n\n".to_owned(), "403"),
        ] {
            assert!(status(&request).starts_with(refused), "{request:?}: {}", status(&request));
        }
    }

    /// The frame of a motion has the page's policy: its script runs by its hash alone, which is that of FIPS
    /// 180-4 in Base64.
    #[test]
    fn the_script_that_plays_motions_is_allowed_by_its_hash() {
        use sha2::{Digest, Sha256};
        const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let hash = Sha256::digest(rigident::present::motion::MotionPage::player());
        let digit = |bits: u32, k: u32| char::from(DIGITS[(bits >> (18 - 6 * k)) as usize & 63]);
        let mut text = String::new();
        for three in hash.chunks(3) {
            let byte = |k: usize| u32::from(three.get(k).copied().unwrap_or(0));
            let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
            (0..4).for_each(|k| text.push(if k as usize > three.len() { '=' } else { digit(bits, k) }));
        }
        let source = format!("'sha256-{text}'");
        assert!(POLICY.contains(&source), "POLICY is to allow {source}");
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../web/page/index.html");
        let page = std::fs::read_to_string(page).unwrap();
        assert!(page.contains(&source), "the policy in web/page/index.html is to allow {source}");
    }

    #[test]
    fn a_folder_gives_its_own_files_only() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("site");
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("a.js"), "1").unwrap();
        std::fs::write(outer.path().join("secret"), "2").unwrap();
        std::fs::write(folder.join(".hidden"), "3").unwrap();
        let site = Site::Folder(folder);
        assert_eq!(site.file("a.js"), Some(b"1".to_vec()));
        for name in ["../secret", "/secret", ".hidden", "", "b.js", "a.js/", "..", "./a.js", "a\\b"] {
            assert_eq!(site.file(name), None, "{name}");
        }
    }

    #[test]
    fn it_answers_over_a_socket_until_it_is_to_leave() {
        static LEAVE: AtomicBool = AtomicBool::new(false);
        let server = Server::new(TcpListener::bind("127.0.0.1:0").unwrap(), SITE).unwrap();
        let port = server.port;
        assert_eq!(server.url(), format!("http://127.0.0.1:{port}/"));
        let serving = thread::spawn(move || server.serve(&LEAVE));
        let mut client = TcpStream::connect(("127.0.0.1", port)).unwrap();
        // In two pieces, as a network may bring them.
        client.write_all(b"GET / HTTP/1.1\r\nHo").unwrap();
        thread::sleep(Duration::from_millis(30));
        client.write_all(format!("st: localhost:{port}\r\n\r\n").as_bytes()).unwrap();
        let mut text = String::new();
        client.read_to_string(&mut text).unwrap();
        assert!(text.starts_with("HTTP/1.1 200 OK\r\n") && text.ends_with("\r\n\r\n<p>"), "{text}");
        LEAVE.store(true, Ordering::Relaxed);
        serving.join().unwrap();
    }
}
