//! The page and its events over HTTP, on this machine alone and at an address that nobody guesses.

use super::hub::Hub;
use crate::view::page;
use anyhow::anyhow;
use std::hash::{BuildHasher, RandomState};
use std::io::Write;
use std::net::Ipv4Addr;
use std::sync::Arc;
use std::thread;
use tiny_http::{Header, Request, Response};

const TITLE: &str = "Live";
const HEAD_OF_EVENTS: &[u8] = b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n\
    Cache-Control: no-store\r\nConnection: close\r\n\r\n";

/// Answers pages until it is dropped.
pub(super) struct Server {
    http: Arc<tiny_http::Server>,
    address: String,
}

impl Server {
    /// Begins to serve at a port; 0: at any free one.
    pub(super) fn start(port: u16, hub: Arc<Hub>) -> anyhow::Result<Self> {
        let http = tiny_http::Server::http((Ipv4Addr::LOCALHOST, port));
        let http = http.map_err(|error| anyhow!("cannot serve at 127.0.0.1:{port}: {error}"))?;
        let http = Arc::new(http);
        // Other users of the machine reach the port, but do not know the folder: its name has 128 random bits of the system.
        let random = || RandomState::new().hash_one(port);
        let folder = format!("/{:016x}{:016x}/", random(), random());
        let address = format!("http://{}{folder}", http.server_addr());
        let page = page::html(TITLE, None)?;
        let serving = Arc::clone(&http);
        thread::spawn(move || {
            for request in serving.incoming_requests() {
                answer(request, &folder, &page, &hub);
            }
        });
        Ok(Self { http, address })
    }

    pub(super) fn address(&self) -> &str {
        &self.address
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.http.unblock();
    }
}

/// Answers a request; whoever asked may be gone, which is no error.
fn answer(request: Request, folder: &str, page: &str, hub: &Arc<Hub>) {
    match request.url().strip_prefix(folder) {
        Some("") => {
            let html = Header::from_bytes("Content-Type", "text/html; charset=utf-8");
            let mut response = Response::from_string(page);
            if let Ok(header) = html {
                response.add_header(header);
            }
            let _ = request.respond(response);
        }
        Some("live") => {
            let hub = Arc::clone(hub);
            thread::spawn(move || {
                let _ = stream(request.into_writer(), &hub);
            });
        }
        _ => {
            let _ = request.respond(Response::from_string("not found").with_status_code(404));
        }
    }
}

/// Writes events until the page goes away.
fn stream(mut page: impl Write, hub: &Hub) -> std::io::Result<()> {
    page.write_all(HEAD_OF_EVENTS)?;
    for event in hub.join() {
        page.write_all(event.as_bytes())?;
        page.flush()?;
    }
    Ok(())
}
