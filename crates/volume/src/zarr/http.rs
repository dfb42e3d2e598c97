//! A store's keys fetched by HTTP: a GET of a value, or of a range of its bytes (<https://www.rfc-editor.org/rfc/rfc9110#name-range-requests>).

use std::collections::HashMap;
use std::fmt::Write;
use std::io::{ErrorKind, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ureq::http::Response;
use ureq::http::header::{ACCEPT_ENCODING, CONTENT_RANGE, RANGE};
use ureq::{Agent, Body, Error};

use super::super::VolumeError;
use super::super::error::volume::{invalid, io_error};
use super::super::source::MAX_HEADER;

/// The maximum number of redirects that a request follows.
const MAX_REDIRECTS: u32 = 5;

/// How often a request is sent at most: servers of many are busy at times.
const ATTEMPTS: u32 = 3;

/// The time before a request is sent again; before each further one it is four times as long.
const PAUSE: Duration = Duration::from_millis(200);

/// The limits for servers on the internet.
const LIMITS: Limits = Limits {
    silence: Duration::from_secs(30),
    whole: Duration::from_secs(300),
    start: Duration::from_secs(30),
    bytes_per_second: 1024,
};

/// How long a server may take. Without a least rate, one that sends a byte now and then would be waited for with every key anew.
#[derive(Clone, Copy)]
struct Limits {
    /// The longest time in which it sends nothing.
    silence: Duration,
    /// The longest time for a request.
    whole: Duration,
    /// The time from which on an answer must have come at the least rate.
    start: Duration,
    bytes_per_second: u64,
}

/// The number of connections that are kept for further requests.
const CONNECTIONS: usize = 16;

/// The maximum number of lengths that are kept.
const MAX_LENGTHS: usize = 1 << 20;

/// A store at an address.
pub(super) struct Http {
    agent: Agent,
    /// The address up to the keys, without a slash at its end.
    root: String,
    /// What follows the keys: a question mark and a query, or nothing.
    query: String,
    limits: Limits,
    /// The lengths of values that are known; `None` for keys that the store does not hold.
    lengths: Mutex<HashMap<String, Option<u64>>>,
    /// The first key that was found, which holds the store's metadata.
    first: OnceLock<String>,
    /// Whether a key was missing since the store was last known to be there.
    has_missed: AtomicBool,
}

/// Why a request failed.
enum Failure {
    /// The next attempt may succeed.
    Passing(VolumeError),
    Lasting(VolumeError),
}

impl From<VolumeError> for Failure {
    fn from(error: VolumeError) -> Self {
        Self::Lasting(error)
    }
}

impl Http {
    /// The store at an address.
    pub(super) fn new(address: &Path) -> Result<Self, VolumeError> {
        Self::within(address, LIMITS)
    }

    fn within(address: &Path, limits: Limits) -> Result<Self, VolumeError> {
        let allowed = "an address without #, in UTF-8";
        let text = address.to_str().filter(|text| !text.contains('#'));
        let text = text.ok_or_else(|| invalid(address, "address", "another one", allowed))?;
        let (root, query) =
            text.split_once('?').map_or((text, String::new()), |(root, query)| (root, format!("?{query}")));
        let config = Agent::config_builder()
            .http_status_as_error(false)
            // What is asked for in secret must not be answered in the open. No other scheme is known to the client.
            .https_only(text.get(..6).is_some_and(|scheme| scheme.eq_ignore_ascii_case("https:")))
            .max_redirects(MAX_REDIRECTS)
            .timeout_global(Some(limits.whole))
            .timeout_per_read(Some(limits.silence))
            .timeout_connect(Some(limits.silence))
            .timeout_recv_response(Some(limits.silence))
            .max_idle_connections(CONNECTIONS)
            .max_idle_connections_per_host(CONNECTIONS)
            .user_agent(concat!("sheetsplat/", env!("CARGO_PKG_VERSION")))
            .build();
        Ok(Self {
            agent: Agent::new_with_config(config),
            root: root.trim_end_matches('/').to_owned(),
            query,
            limits,
            lengths: Mutex::default(),
            first: OnceLock::new(),
            has_missed: AtomicBool::new(false),
        })
    }

    /// The place of a key, for errors: without the query, which may be a secret.
    pub(super) fn place(&self, key: &str) -> PathBuf {
        PathBuf::from(format!("{}/{key}", self.root))
    }

    /// Checks that the store is still there, if a key was missing since that was last known.
    ///
    /// # Errors
    /// If the metadata that the store was opened by are gone: the missing keys then tell nothing about the volume.
    pub(super) fn check_presence(&self) -> Result<(), VolumeError> {
        let Some(first) = self.first.get() else { return Ok(()) };
        if self.has_missed.swap(false, Ordering::SeqCst) && self.whole(first, MAX_HEADER)?.is_none() {
            return Err(io_error(&self.place(first))(ErrorKind::NotFound.into()));
        }
        Ok(())
    }

    /// The length of a key's value; `None` if the store has no such key.
    pub(super) fn length(&self, key: &str) -> Result<Option<u64>, VolumeError> {
        let lengths = || self.lengths.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(length) = lengths().get(key) {
            return Ok(*length);
        }
        let length = self.repeated(|| {
            let Some(mut response) = self.get(key, Some(0..1))? else { return Ok(None) };
            if response.status() == 200 {
                // The whole value follows, of which nothing is read.
                let length = response.body().content_length();
                let none = || invalid(&self.place(key), "Content-Length", "none", "the number of bytes").into();
                return length.ok_or_else(none).map(Some);
            }
            let length = self.content_range(key, &response)?.1;
            if length > 0 {
                // The connection can then be used again.
                self.read(key, &mut response, 1)?;
            }
            Ok(Some(length))
        })?;
        let mut lengths = lengths();
        if lengths.len() >= MAX_LENGTHS {
            lengths.clear();
        }
        lengths.insert(key.to_owned(), length);
        Ok(length)
    }

    /// A key's value, which may have at most `limit` bytes; `None` if the store has no such key.
    pub(super) fn whole(&self, key: &str, limit: u64) -> Result<Option<Vec<u8>>, VolumeError> {
        self.repeated(|| {
            let Some(mut response) = self.get(key, None)? else { return Ok(None) };
            let too_long = |found: String| invalid(&self.place(key), "chunk", found, format!("at most {limit} bytes"));
            let length = response.body().content_length();
            if let Some(length) = length.filter(|&length| length > limit) {
                return Err(too_long(format!("{length} bytes")).into());
            }
            let bytes = self.read(key, &mut response, length.unwrap_or(limit))?;
            match length {
                _ if bytes.len() as u64 > limit => Err(too_long("more".to_owned()).into()),
                Some(length) if length != bytes.len() as u64 => Err(self.mismatch(key, bytes.len(), length)),
                _ => Ok(Some(bytes)),
            }
        })
    }

    /// Some bytes, at least one, of a key's value; `None` if the store has no such key.
    pub(super) fn range(&self, key: &str, range: &Range<u64>) -> Result<Option<Vec<u8>>, VolumeError> {
        self.repeated(|| {
            let Some(mut response) = self.get(key, Some(range.clone()))? else { return Ok(None) };
            let count = range.end - range.start;
            let first = match response.status().as_u16() {
                206 => self.content_range(key, &response)?.0,
                416 => return Err(self.mismatch(key, 0, count)),
                _ => 0,
            };
            if first != range.start {
                let found = format!("bytes from {first}");
                let allowed = format!("bytes from {}, by a server that answers requests for ranges", range.start);
                return Err(invalid(&self.place(key), "range", found, allowed).into());
            }
            let mut bytes = self.read(key, &mut response, count)?;
            if response.status() == 200 {
                bytes.truncate(count as usize);
            }
            if bytes.len() as u64 == count { Ok(Some(bytes)) } else { Err(self.mismatch(key, bytes.len(), count)) }
        })
    }

    /// Sends a request until it succeeds or fails for good.
    fn repeated<T>(&self, request: impl Fn() -> Result<T, Failure>) -> Result<T, VolumeError> {
        let mut pause = PAUSE;
        for _ in 1..ATTEMPTS {
            match request() {
                Ok(answer) => return Ok(answer),
                Err(Failure::Lasting(error)) => return Err(error),
                Err(Failure::Passing(error)) => log::info!("asked again after {pause:?}: {error}"),
            }
            sleep(pause);
            pause *= 4;
        }
        request().map_err(|failure| match failure {
            Failure::Passing(error) | Failure::Lasting(error) => error,
        })
    }

    /// Requests a key's value, or a range of it; `None` if the store has no such key.
    fn get(&self, key: &str, range: Option<Range<u64>>) -> Result<Option<Response<Body>>, Failure> {
        let address = format!("{}/{}{}", self.root, encoded(key), self.query);
        // Bytes are counted as they are stored.
        let mut request = self.agent.get(address).header(ACCEPT_ENCODING, "identity");
        let is_range = range.is_some();
        if let Some(range) = range {
            request = request.header(RANGE, format!("bytes={}-{}", range.start, range.end - 1));
        }
        let response = request.call().map_err(|error| self.failure(key, error))?;
        let status = response.status().as_u16();
        match status {
            200 => {
                self.first.get_or_init(|| key.to_owned());
                Ok(Some(response))
            }
            // An empty value has no range.
            206 | 416 if is_range => Ok(Some(response)),
            // For a key that it does not hold, an object store answers 403 instead of 404 if the keys may not be listed.
            403 | 404 | 410 => {
                self.has_missed.store(true, Ordering::SeqCst);
                Ok(None)
            }
            _ => {
                let allowed = "200 or 206, or 404 or 403 for a key that the store does not hold";
                let error = invalid(&self.place(key), "status", status, allowed);
                let is_passing = status == 429 || status >= 500;
                Err(if is_passing { Failure::Passing(error) } else { Failure::Lasting(error) })
            }
        }
    }

    /// Where a partial answer begins, and the length of the whole value.
    fn content_range<T>(&self, key: &str, response: &Response<T>) -> Result<(u64, u64), VolumeError> {
        let text = response.headers().get(CONTENT_RANGE).and_then(|value| value.to_str().ok()).unwrap_or("none");
        let parse = || {
            let (range, length) = text.strip_prefix("bytes ")?.split_once('/')?;
            let first = if range == "*" { 0 } else { range.split_once('-')?.0.parse().ok()? };
            Some((first, length.parse().ok()?))
        };
        parse().ok_or_else(|| invalid(&self.place(key), "Content-Range", text, "bytes FIRST-LAST/LENGTH"))
    }

    /// Reads `count` bytes, and one more if there is one: at the end of an answer its connection can be used again.
    fn read(&self, key: &str, response: &mut Response<Body>, count: u64) -> Result<Vec<u8>, Failure> {
        let mut bytes = Vec::new();
        let mut reader = response.body_mut().as_reader().take(count.saturating_add(1));
        let (begin, mut piece, Limits { start, bytes_per_second, .. }) = (Instant::now(), [0; 1 << 14], self.limits);
        loop {
            match reader.read(&mut piece) {
                Ok(0) => return Ok(bytes),
                Ok(length) => bytes.extend(&piece[..length]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // ureq's own errors pass through the reader.
                Err(error) => return Err(self.failure(key, Error::from(error))),
            }
            let time = begin.elapsed();
            if time > start && (bytes.len() as f64) < bytes_per_second as f64 * time.as_secs_f64() {
                let found = format!("{} bytes in {time:.0?}", bytes.len());
                let allowed = format!("an answer of at least {bytes_per_second} bytes a second");
                return Err(Failure::Lasting(invalid(&self.place(key), "address", found, allowed)));
            }
        }
    }

    /// The error for an answer of another length than expected.
    fn mismatch(&self, key: &str, found: usize, expected: u64) -> Failure {
        Failure::Passing(invalid(&self.place(key), "chunk", format!("{found} bytes"), format!("{expected} bytes")))
    }

    /// The error for a request without an answer.
    fn failure(&self, key: &str, error: Error) -> Failure {
        let place = self.place(key);
        match error {
            Error::Timeout(_) => {
                let found = format!("no answer in time ({error})");
                let allowed = format!("an answer that stops for at most {:?}", self.limits.silence);
                Failure::Lasting(invalid(&place, "address", found, allowed))
            }
            Error::TooManyRedirects | Error::RedirectFailed | Error::BadUri(_) | Error::RequireHttpsOnly(_) => {
                let allowed = format!(
                    "at most {MAX_REDIRECTS} redirects, to addresses http:// or https://, from https:// to https:// alone"
                );
                Failure::Lasting(invalid(&place, "address", error, allowed))
            }
            Error::Io(error) => Failure::Passing(io_error(&place)(error)),
            Error::ConnectionFailed | Error::HostNotFound => {
                Failure::Passing(invalid(&place, "address", error, "a server that can be reached"))
            }
            error => Failure::Lasting(invalid(&place, "address", error, "an answer by HTTP")),
        }
    }
}

/// A key as it stands in an address: bytes that have no place in one are encoded.
fn encoded(key: &str) -> String {
    let mut text = String::new();
    for byte in key.bytes() {
        if byte.is_ascii_alphanumeric() || b"/-._~!$&'()*+,;=:@".contains(&byte) {
            text.push(byte.into());
        } else {
            // Text takes whatever is written.
            _ = write!(text, "%{byte:02X}");
        }
    }
    text
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "tests")]
mod tests {
    use std::io::Write;
    use std::net::TcpListener;
    use std::thread::spawn;

    use super::*;

    #[test]
    fn servers_that_do_not_answer_are_left() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/store", listener.local_addr().unwrap());
        // One connection is never answered, one stops in its value, and one sends a byte now and then.
        spawn(move || {
            let mut connections = Vec::new();
            for (number, connection) in listener.incoming().enumerate() {
                let mut connection = connection.unwrap();
                if number > 0 {
                    connection.write_all(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nabc").unwrap();
                }
                if number > 1 {
                    spawn(move || {
                        while connection.write_all(b"a").is_ok() {
                            sleep(Duration::from_millis(50));
                        }
                    });
                } else {
                    connections.push(connection);
                }
            }
        });
        // Only one of the limits can be reached, however slow this machine is.
        let (short, long) = (Duration::from_millis(300), Duration::from_secs(3600));
        for ([silence, whole], allowed) in
            [([short, long], "300ms"), ([short, long], "300ms"), ([long, short], "3600s")]
        {
            let store = Http::within(Path::new(&address), Limits { silence, whole, ..LIMITS }).unwrap();
            let message = store.whole("zarr.json", 1000).unwrap_err().to_string();
            let found = format!("{address}/zarr.json: address: found no answer in time");
            assert!(message.starts_with(&found), "{message}");
            let allowed = format!("allowed: an answer that stops for at most {allowed}");
            assert!(message.ends_with(&allowed), "{message}");
        }
        // No server is that fast.
        let limits = Limits { silence: long, whole: long, start: Duration::ZERO, bytes_per_second: u64::MAX };
        let store = Http::within(Path::new(&address), limits).unwrap();
        let message = store.whole("zarr.json", 1000).unwrap_err().to_string();
        assert!(message.starts_with(&format!("{address}/zarr.json: address: found ")), "{message}");
        assert!(message.contains(" bytes in ") && message.contains("bytes a second"), "{message}");
    }

    #[test]
    fn keys_are_encoded_before_a_query() {
        let store = Http::new(Path::new("https://a/b.zarr/?sig=c%20d")).unwrap();
        assert_eq!(store.place("0/c/1").to_str(), Some("https://a/b.zarr/0/c/1"));
        assert_eq!((store.root.as_str(), store.query.as_str()), ("https://a/b.zarr", "?sig=c%20d"));
        assert_eq!(encoded("a b/ü?#%.zarray"), "a%20b/%C3%BC%3F%23%25.zarray");
        assert!(Http::new(Path::new("http://a/b#c")).is_err());
    }
}
