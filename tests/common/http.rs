//! A server of files by HTTP, and of the mistakes that servers make.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread::spawn;

/// Serves a folder at `/PREFIX/`, where the prefix says how chunks are sent: `files` as they should be, `query` if the address has `?key=1`, `forbidden`
/// with 403 for files that do not exist, `whole` without regard to ranges, `redirect` to `files`, `loop` to themselves, `elsewhere` to a file of the
/// machine; and wrongly: `busy` with 503 once, `broken` with 500, `short` with fewer bytes than stated, `endless`, `shifted` with another range.
pub(crate) struct Server {
    pub(crate) address: String,
    /// The requests' paths, each with its range after a space.
    requests: Arc<Mutex<Vec<String>>>,
}

impl Server {
    pub(crate) fn new(folder: PathBuf) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let requests = Arc::<Mutex<Vec<String>>>::default();
        let shared = Arc::clone(&requests);
        spawn(move || {
            for connection in listener.incoming() {
                let (folder, requests) = (folder.clone(), Arc::clone(&shared));
                // The client may close a connection at any time.
                spawn(move || _ = answer(&connection.unwrap(), &folder, &requests));
            }
        });
        Self { address, requests }
    }

    /// The requests since this was last asked.
    pub(crate) fn take_requests(&self) -> Vec<String> {
        std::mem::take(&mut self.requests.lock().unwrap())
    }
}

/// Answers the requests of a connection.
fn answer(connection: &TcpStream, folder: &Path, requests: &Mutex<Vec<String>>) -> std::io::Result<()> {
    let mut lines = BufReader::new(connection).lines();
    while let Some(first) = lines.next() {
        let first = first?;
        let address = first.split(' ').nth(1).unwrap_or_default().to_owned();
        let mut range = None;
        for line in lines.by_ref() {
            let line = line?.to_ascii_lowercase();
            if line.is_empty() {
                break;
            }
            range = line.strip_prefix("range: bytes=").map(str::to_owned).or(range);
        }
        let is_repeated = {
            let mut requests = requests.lock().unwrap();
            let request = format!("{address} {}", range.as_deref().unwrap_or_default());
            let is_repeated = requests.contains(&request);
            requests.push(request);
            is_repeated
        };
        let (path, query) = address.split_once('?').unwrap_or((&address, ""));
        let (prefix, path) = path[1..].split_once('/').unwrap_or_default();
        let prefix = if path.contains("/c/") || ["forbidden", "query"].contains(&prefix) { prefix } else { "files" };
        let send = |status: &str, headers: &str, body: &[u8]| {
            let head = format!("HTTP/1.1 {status}\r\n{headers}\r\n");
            (&*connection).write_all(&[head.as_bytes(), body].concat())
        };
        let empty = "Content-Length: 0\r\n";
        let target = match prefix {
            "redirect" => Some(format!("/files/{path}")),
            "loop" => Some(address.clone()),
            "elsewhere" => Some("file:///etc/hostname".to_owned()),
            _ => None,
        };
        if let Some(target) = target {
            send("302 Found", &format!("Location: {target}\r\n{empty}"), &[])?;
            continue;
        }
        let bytes = match fs::read(folder.join(path)) {
            Ok(bytes) if prefix != "query" || query == "key=1" => bytes,
            _ => {
                let status = if prefix == "forbidden" { "403 Forbidden" } else { "404 Not Found" };
                send(status, empty, &[])?;
                continue;
            }
        };
        match (prefix, range.filter(|_| prefix != "whole")) {
            ("broken", _) => send("500 Internal Server Error", empty, &[])?,
            ("busy", _) if !is_repeated => send("503 Service Unavailable", empty, &[])?,
            ("short", _) => {
                send("200 OK", &format!("Content-Length: {}\r\n", bytes.len() + 7), &bytes)?;
                return Ok(());
            }
            ("endless", _) => {
                send("200 OK", "Transfer-Encoding: chunked\r\n", &[])?;
                loop {
                    (&*connection).write_all(&[b"10000\r\n", [7; 0x10000].as_slice(), b"\r\n"].concat())?;
                }
            }
            (_, Some(range)) => {
                let (first, last) = range.split_once('-').unwrap();
                let first: usize = first.parse().unwrap();
                let end = bytes.len().min(last.parse::<usize>().unwrap() + 1);
                let stated = if prefix == "shifted" { first + 1 } else { first };
                let headers = format!(
                    "Content-Range: bytes {stated}-{}/{}\r\nContent-Length: {}\r\n",
                    end - 1,
                    bytes.len(),
                    end - first
                );
                send("206 Partial Content", &headers, &bytes[first..end])?;
            }
            (_, None) => send("200 OK", &format!("Content-Length: {}\r\n", bytes.len()), &bytes)?,
        }
    }
    Ok(())
}
