//! The page and its events over HTTP, on this machine alone and at an address that nobody guesses.

use super::hub::{Hub, Told};
use crate::view::page;
use anyhow::Context;
use std::hash::{BuildHasher, RandomState};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

const TITLE: &str = "Live";
/// Connections at a time; one more is closed at once. A page needs two while it loads, then one.
const MOST_CONNECTIONS: usize = 32;
/// Time in which a peer is to send its request, and to take up what it is sent: the page, and each event from when it was told.
const PATIENCE: Duration = if cfg!(test) {
    Duration::from_secs(1)
} else {
    Duration::from_secs(5)
};
/// Pause after a connection that could not be accepted: the process may have no file left for it.
const PAUSE: Duration = Duration::from_millis(100);
/// Bytes, and lines, of the longest request that is read.
const MOST_REQUEST: usize = 16 * 1024;
const MOST_HEADERS: usize = 64;
const HEAD_OF_EVENTS: &str = "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\
    Cache-Control: no-store\r\nConnection: close\r\n\r\n";

/// Answers pages until the process ends.
pub(super) struct Server {
    address: String,
}

/// What is served, and where.
struct Site {
    /// The path of the page; its events are at `live` in it.
    folder: String,
    page: String,
    hub: Arc<Hub>,
}

impl Server {
    /// Begins to serve at a port; 0: at any free one.
    pub(super) fn start(port: u16, hub: Arc<Hub>) -> anyhow::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let listener = listener.with_context(|| format!("cannot serve at 127.0.0.1:{port}"))?;
        // Other users of the machine reach the port, but do not know the folder: its name has 128 random bits of the system.
        let random = || RandomState::new().hash_one(port);
        let folder = format!("/{:016x}{:016x}/", random(), random());
        let address = format!("http://{}{folder}", listener.local_addr()?);
        let page = page::html(TITLE, None)?;
        let site = Arc::new(Site { folder, page, hub });
        thread::spawn(move || accept(&listener, &site));
        Ok(Self { address })
    }

    pub(super) fn address(&self) -> &str {
        &self.address
    }
}

/// Gives each connection a thread of its own.
fn accept(listener: &TcpListener, site: &Arc<Site>) {
    let mut was_full = false;
    for peer in listener.incoming() {
        let Ok(peer) = peer else {
            thread::sleep(PAUSE);
            continue;
        };
        // Each connection's thread has the site once; this thread has it, too.
        let is_full = Arc::strong_count(site) > MOST_CONNECTIONS;
        if is_full && !was_full {
            say!("{MOST_CONNECTIONS} connections are open: more are closed at once");
        }
        was_full = is_full;
        if !is_full {
            let site = Arc::clone(site);
            // Where the system has no room for a thread the connection is closed.
            let _ = thread::Builder::new().spawn(move || site.answer(&peer));
        }
    }
}

impl Site {
    /// Answers a connection's one request. A peer that asks for nothing, or that goes away, is no error; one that does not read is told of.
    fn answer(&self, peer: &TcpStream) {
        let Ok(path) = requested_path(peer) else {
            return;
        };
        let file = path.as_deref().and_then(|it| it.strip_prefix(&self.folder));
        let sent = match file {
            Some("") => send(peer, &response("200 OK", "text/html", &self.page), PATIENCE),
            Some("live") => self.tell(peer),
            _ => send(
                peer,
                &response("404 Not Found", "text/plain", "not found"),
                PATIENCE,
            ),
        };
        if sent.is_err_and(|error| is_timeout(&error)) {
            say!("a page that does not take up what it is sent is let go of; it may join anew");
        }
    }

    /// Writes events until the page goes away, or is too slow.
    fn tell(&self, peer: &TcpStream) -> io::Result<()> {
        send(peer, HEAD_OF_EVENTS, PATIENCE)?;
        for Told { event, at } in self.hub.join() {
            send(peer, &event, PATIENCE.saturating_sub(at.elapsed()))?;
        }
        // The hub does not wait for it any longer.
        Err(ErrorKind::TimedOut.into())
    }
}

/// The path that a connection asks for; none where it sends no GET request.
///
/// # Errors
/// Where it does not send a request in time, or goes away.
fn requested_path(mut peer: &TcpStream) -> io::Result<Option<String>> {
    let until = Instant::now() + PATIENCE;
    let mut sent = Vec::new();
    loop {
        let mut part = [0; 1024];
        peer.set_read_timeout(Some(time_left(until)?))?;
        let count = peer.read(&mut part)?;
        sent.extend_from_slice(&part[..count]);
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(&sent) {
            Ok(httparse::Status::Complete(_)) => {
                let path = request.path.filter(|_| request.method == Some("GET"));
                return Ok(path.map(str::to_owned));
            }
            Ok(httparse::Status::Partial) if count > 0 && sent.len() < MOST_REQUEST => {}
            _ => return Ok(None),
        }
    }
}

fn response(status: &str, kind: &str, body: &str) -> String {
    format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}; charset=utf-8\r\nContent-Length: {}\r\n\
         Cache-Control: no-store\r\nConnection: close\r\n\r\n{body}",
        body.len()
    )
}

/// Sends a text.
///
/// # Errors
/// Where the peer has not taken all of it up within a time, or goes away.
fn send(mut peer: &TcpStream, text: &str, patience: Duration) -> io::Result<()> {
    let until = Instant::now() + patience;
    let mut rest = text.as_bytes();
    while !rest.is_empty() {
        peer.set_write_timeout(Some(time_left(until)?))?;
        let count = peer.write(rest)?;
        rest = &rest[count..];
    }
    Ok(())
}

/// # Errors
/// Where there is none left.
fn time_left(until: Instant) -> io::Result<Duration> {
    let left = until.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(ErrorKind::TimedOut.into());
    }
    Ok(left)
}

/// Linux tells of a socket's timeout as of an operation that would block.
fn is_timeout(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};

    /// More than the system keeps for a connection whose peer does not read.
    const MUCH: usize = 1 << 20;
    const EVENTS: usize = 64;

    fn connect(server: &Server, file: &str) -> TcpStream {
        let rest = server.address().strip_prefix("http://").unwrap();
        let (host, folder) = rest.split_once('/').unwrap();
        let mut peer = TcpStream::connect(host).unwrap();
        // It may be closed already.
        let _ = write!(peer, "GET /{folder}{file} HTTP/1.1\r\nHost: {host}\r\n\r\n");
        peer
    }

    fn is_served(mut peer: &TcpStream) -> bool {
        matches!(peer.read(&mut [0; 16]), Ok(16))
    }

    fn all_of(mut peer: TcpStream) -> String {
        let mut text = String::new();
        peer.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn peers_that_do_not_read_keep_no_page_waiting_and_are_let_go_of() {
        let hub = Arc::<Hub>::default();
        let server = Server::start(0, Arc::clone(&hub)).unwrap();
        let silent: Vec<_> = (0..3).map(|_| connect(&server, "live")).collect();
        assert!(silent.iter().all(is_served));
        let (host, _) = server.address()["http://".len()..].split_once('/').unwrap();
        let mute = TcpStream::connect(host).unwrap();
        let mut reader = BufReader::new(connect(&server, "live"));
        let mut line = String::new();
        while line != "\r\n" {
            line.clear();
            reader.read_line(&mut line).unwrap();
        }
        let much = "x".repeat(MUCH);
        for told in 0..EVENTS {
            // The reader may join after the first.
            hub.tell("frame", &(told, &much)).unwrap();
            thread::sleep(Duration::from_millis(10));
        }
        line.clear();
        reader.read_line(&mut line).unwrap();
        assert_eq!(line, "event: frame\n");
        assert!(all_of(connect(&server, "")).contains("<canvas id=\"scene\""));
        assert_eq!(all_of(mute), "");
        thread::sleep(2 * PATIENCE);
        for peer in silent {
            let mut taken = Vec::new();
            // What the system has kept, and then the end.
            let _ = BufReader::new(peer).read_to_end(&mut taken);
            assert!(taken.len() < EVENTS * MUCH);
        }
    }

    #[test]
    fn who_does_not_know_the_folder_gets_nothing_and_more_than_so_many_are_closed_at_once() {
        let server = Server::start(0, Arc::default()).unwrap();
        assert!(all_of(connect(&server, "x")).starts_with("HTTP/1.1 404"));
        let open: Vec<_> = (0..2 * MOST_CONNECTIONS)
            .map(|_| connect(&server, "live"))
            .collect();
        let served = open.iter().filter(|peer| is_served(peer)).count();
        // The first connection's thread may be there still.
        let expected = MOST_CONNECTIONS - 1..=MOST_CONNECTIONS;
        assert!(expected.contains(&served), "{served}");
    }
}
