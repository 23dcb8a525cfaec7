//! Packed worlds on servers, over HTTP and HTTPS.

use std::io::{self, ErrorKind, Read, copy, sink};
use std::sync::Arc;
use std::time::{Duration, Instant};

use ureq::Agent;
use ureq::http::HeaderMap;
use ureq::http::header::{ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_RANGE, RANGE};

use crate::files::{HEAD, PIECES};
use crate::head::{PackError, PackedHead, PieceAt, damaged, hash_of};
use crate::threads::tries;
use crate::{Fetch, PackedWorld, ThreadSource};

/// Threads of a source, each with a connection of its own.
const CONNECTIONS: usize = 3;
/// Longest wait for a connection, for the next bytes, and for a whole answer of no length.
const MOST_WAIT: Duration = Duration::from_secs(10);
/// Slowest pace at which an answer may come, beyond [`MOST_WAIT`]: a minute for a megabyte. [Units: bytes per second]
const LEAST_PACE: u64 = 16 << 10;
/// Most bytes that are read from the beginning of a file to the end of a range, if a server ignores ranges. [Units: bytes]
const MOST_WHOLE: u64 = 64 << 20;
/// Bytes of the first request for a head: most heads are smaller. [Units: bytes]
const FIRST: u64 = 64 << 10;
/// Pieces asked for at once when all are read. [Units: bytes]
const AT_ONCE: u64 = 16 << 20;
/// Most bytes of all pieces when all are read. [Units: bytes]
const MOST_PIECES: u64 = 8 << 30;

/// Place of a packed world on a server: a folder with a head and pieces, or one file with both.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PackedHttp {
    /// Address of the file with the pieces.
    pub pieces: String,
    /// Offset of the first piece there. [Units: bytes]
    pub offset: u64,
}

impl PackedHttp {
    /// Opens a packed world: reads its head, and finds its pieces. The address is that of a folder, with or without a slash at
    /// its end, or of one file; what follows a `?` is kept for all requests. Blocks; a failure is tried again, four times in
    /// all, after 50, 100 and 200 ms. Takes the memory of the head.
    ///
    /// # Errors
    ///
    /// An address without a packed world, a server that cannot be reached, damage.
    pub fn open(url: &str) -> Result<(PackedHead, Self), PackError> {
        let agent = agent();
        tried(|| Self::open_once(&agent, url))
    }

    fn open_once(agent: &Agent, url: &str) -> Result<(PackedHead, Self), PackError> {
        let is_folder = split(url).0.ends_with('/');
        if !is_folder && let Some((head, offset)) = head_at(agent, url)? {
            let pieces = url.to_owned();
            return Ok((head, Self { pieces, offset }));
        }
        if let Some((head, _)) = head_at(agent, &inside(url, HEAD))? {
            let pieces = inside(url, PIECES);
            return Ok((head, Self { pieces, offset: 0 }));
        }
        let problem = "the server has no packed world at this address; check the address, or make one with `enfilade pack`";
        Err(at(url, problem))
    }

    /// Reads a packed world whole, with as many tries as [`PackedHttp::open`] for every 16 MiB. Blocks. Takes the memory of the
    /// packed world, at most 8 GiB.
    ///
    /// # Errors
    ///
    /// As [`PackedHttp::open`].
    #[doc(hidden)]
    pub fn read_all(url: &str) -> Result<PackedWorld, PackError> {
        let (head, place) = Self::open(url)?;
        let mut parts: Vec<(PieceAt, u64)> = (head.places.iter().copied())
            .zip(head.catalog.pieces().iter().map(|p| p.n_packed))
            .chain([(head.rest, head.rest_packed)])
            .collect();
        parts.sort_by_key(|(at, _)| at.offset);
        let end_of = |(at, n): &(PieceAt, u64)| at.offset.saturating_add(*n);
        if parts.iter().any(|part| end_of(part) > MOST_PIECES) {
            return Err(damaged("its pieces take more than 8 GiB"));
        }
        let mut fetch = place.fetch();
        let mut body = Vec::new();
        let mut left = &parts[..];
        while !left.is_empty() {
            let start = body.len() as u64;
            let fits = |part: &&(PieceAt, u64)| end_of(part) <= start + AT_ONCE;
            let n = left.iter().take_while(fits).count().max(1);
            let (now, later) = left.split_at(n);
            let end = now.iter().map(end_of).fold(start, u64::max);
            let bytes = tried(|| {
                let bytes = fetch.fetch(start, end - start);
                let bytes = bytes.map_err(|problem| at(&place.pieces, &problem))?;
                is_whole(&bytes, start, now)
                    .then_some(bytes)
                    .ok_or_else(|| {
                        damaged(format!("{} has other bytes than were packed", place.pieces))
                    })
            })?;
            body.extend(bytes);
            left = later;
        }
        Ok(PackedWorld { head, body })
    }

    /// Returns a source of its pieces, which reads on three threads, each with a connection of its own that is kept.
    #[must_use]
    pub fn source(&self, head: &Arc<PackedHead>) -> ThreadSource {
        let fetches = (0..CONNECTIONS).map(|_| self.fetch()).collect();
        ThreadSource::new(head, &self.pieces, fetches)
    }

    /// Returns what fetches ranges of its pieces, over one connection that is kept.
    #[must_use]
    #[doc(hidden)]
    pub fn fetch(&self) -> HttpFetch {
        HttpFetch {
            place: self.clone(),
            agent: agent(),
        }
    }
}

/// Fetches over HTTP by requests for ranges. An answer is given up if no connection or no bytes come for 10 s, or its bytes come
/// more slowly than 16 KiB a second after the first 10 s. If the server ignores ranges, the part is taken out of its answer, up to 64 MiB into the
/// file.
#[derive(Debug)]
pub struct HttpFetch {
    place: PackedHttp,
    agent: Agent,
}

impl Fetch for HttpFetch {
    fn fetch(&mut self, offset: u64, n: u64) -> Result<Vec<u8>, String> {
        let start = self.place.offset.saturating_add(offset);
        range(&self.agent, &self.place.pieces, start, n).map_err(|why| why.to_string())
    }
}

/// The reasons why a range does not come.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error("the server has nothing at this address (status {0}); check the address")]
    Absent(u16),
    #[error("{0}")]
    Other(String),
}

impl From<ureq::Error> for Failure {
    fn from(error: ureq::Error) -> Self {
        use std::io::ErrorKind::ConnectionRefused;
        Self::Other(match error {
            ureq::Error::BadUri(_) | ureq::Error::Http(_) => {
                "this is not an address; write it as http://HOST/PATH".into()
            }
            ureq::Error::HostNotFound => {
                "no server of this name was found; check the address and the network".into()
            }
            ureq::Error::Io(e) if e.kind() == ConnectionRefused => {
                "no server answers there; check the address, and start the server".into()
            }
            ureq::Error::Io(e) => format!("{e}; check the address and the network"),
            ureq::Error::Timeout(_) => "the server takes too long; try again later".into(),
            other => other.to_string(),
        })
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        ureq::Error::from(error).into()
    }
}

fn agent() -> Agent {
    let config = Agent::config_builder()
        .http_status_as_error(false)
        .max_idle_connections(1)
        .timeout_connect(Some(MOST_WAIT))
        .timeout_recv_response(Some(MOST_WAIT))
        .timeout_per_read(Some(MOST_WAIT))
        .user_agent(concat!("enfilade/", env!("CARGO_PKG_VERSION")));
    config.build().into()
}

fn at(url: &str, problem: &str) -> PackError {
    PackError::File {
        path: url.to_owned(),
        problem: problem.to_owned(),
    }
}

/// Tries until it succeeds, or for the last time; what fails after a long wait is not tried again.
fn tried<T>(mut work: impl FnMut() -> Result<T, PackError>) -> Result<T, PackError> {
    let start = Instant::now();
    let mut last = Err(PackError::NotPacked);
    for _ in tries() {
        last = work();
        if last.is_ok() || start.elapsed() >= MOST_WAIT {
            break;
        }
    }
    last
}

/// Splits an address behind its path.
fn split(url: &str) -> (&str, &str) {
    url.split_at(url.find(['?', '#']).unwrap_or(url.len()))
}

/// Returns the address of a file in a folder.
fn inside(url: &str, name: &str) -> String {
    let (path, query) = split(url);
    format!("{}/{name}{query}", path.trim_end_matches('/'))
}

/// Reads a head and returns its size; `None` if there is something else, or nothing.
fn head_at(agent: &Agent, url: &str) -> Result<Option<(PackedHead, u64)>, PackError> {
    let told = |why: Failure| at(url, &why.to_string());
    let mut bytes = match range(agent, url, 0, FIRST) {
        Err(Failure::Absent(_)) => return Ok(None),
        answer => answer.map_err(told)?,
    };
    let n = match PackedHead::size(&bytes) {
        Err(PackError::NotPacked) => return Ok(None),
        n => n?,
    };
    let n_read = bytes.len() as u64;
    bytes.extend(range(agent, url, n_read, n.saturating_sub(n_read)).map_err(told)?);
    Ok(Some((PackedHead::decode(&bytes)?, n)))
}

/// Returns `true` if `bytes`, from offset `start` on, hold these parts.
fn is_whole(bytes: &[u8], start: u64, parts: &[(PieceAt, u64)]) -> bool {
    parts.iter().all(|(at, n)| {
        let Some(offset) = at.offset.checked_sub(start) else {
            // It overlaps with an earlier one; unpacking checks it.
            return true;
        };
        let part = bytes.get(offset as usize..(offset + n) as usize);
        part.is_some_and(|part| hash_of(part) == at.hash)
    })
}

/// Returns `n` bytes from `start` on, or fewer if there are no more; never reads more of the range.
fn range(agent: &Agent, url: &str, start: u64, n: u64) -> Result<Vec<u8>, Failure> {
    if n == 0 {
        return Ok(Vec::new());
    }
    let (first, last) = (start, start.saturating_add(n) - 1);
    let answer = agent
        .get(url)
        .header(RANGE, format!("bytes={first}-{last}"))
        .header(ACCEPT_ENCODING, "identity")
        .config()
        .timeout_global(Some(MOST_WAIT + Duration::from_secs(n / LEAST_PACE)))
        .build()
        .call()?;
    let text = |headers: &HeaderMap, name| Some(headers.get(name)?.to_str().ok()?.to_owned());
    let headers = answer.headers();
    let skip = match answer.status().as_u16() {
        206 => {
            let got = text(headers, CONTENT_RANGE).unwrap_or_default();
            if !range_of(&got).is_some_and(|(a, b)| a == first && (a..=last).contains(&b)) {
                return Err(Failure::Other(format!(
                    "the server sends the range \"{got}\" instead of bytes {first}-{last}; use another server"
                )));
            }
            0
        }
        200 if start.saturating_add(n) > MOST_WHOLE => {
            return Err(Failure::Other(format!(
                "the server ignores ranges, and bytes {first}-{last} are not in the first 64 MiB; use a server of ranges, such as `enfilade serve`"
            )));
        }
        200 => start,
        416 => return Ok(Vec::new()),
        status @ (403 | 404 | 410) => return Err(Failure::Absent(status)),
        status => {
            let why = format!("the server answers with status {status}; try again later");
            return Err(Failure::Other(why));
        }
    };
    if let Some(encoding) = text(headers, CONTENT_ENCODING).filter(|e| e != "identity") {
        let why = format!("the server sends encoding {encoding}, which was not asked for");
        return Err(Failure::Other(why));
    }
    let length = text(headers, CONTENT_LENGTH).and_then(|n| n.parse().ok());
    let mut body = Paced {
        from: answer.into_body().into_reader(),
        start: Instant::now(),
        n: 0,
    };
    copy(&mut (&mut body).take(skip), &mut sink())?;
    let mut out = Vec::new();
    (&mut body).take(n).read_to_end(&mut out)?;
    if length == Some(skip + out.len() as u64) {
        // Nothing is left to read, but the connection is only kept once the end was seen.
        let _ = body.read(&mut [0]);
    }
    Ok(out)
}

/// A reader that gives up once its bytes come more slowly than [`LEAST_PACE`] allows.
struct Paced<R> {
    from: R,
    start: Instant,
    n: u64,
}

impl<R: Read> Read for Paced<R> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        let n = self.from.read(to)?;
        self.n += n as u64;
        if n > 0 && self.start.elapsed() > MOST_WAIT + Duration::from_secs(self.n / LEAST_PACE) {
            let text = "the server sends less than 16 KiB a second";
            return Err(io::Error::new(ErrorKind::TimedOut, text));
        }
        Ok(n)
    }
}

/// Returns the first and the last byte of a `Content-Range`.
fn range_of(text: &str) -> Option<(u64, u64)> {
    let (range, _size) = text.strip_prefix("bytes ")?.split_once('/')?;
    let (first, last) = range.split_once('-')?;
    Some((first.parse().ok()?, last.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_keep_what_follows_their_path() {
        for (url, expected) in [
            ("http://h/w.enf", "http://h/w.enf/head.enfp"),
            ("http://h/w.enf/", "http://h/w.enf/head.enfp"),
            (
                "https://h/w.enf/?key=a/b",
                "https://h/w.enf/head.enfp?key=a/b",
            ),
        ] {
            assert_eq!(inside(url, HEAD), expected);
        }
    }

    #[test]
    fn ranges_are_read_strictly() {
        assert_eq!(range_of("bytes 3-9/200"), Some((3, 9)));
        assert_eq!(range_of("bytes 3-9/*"), Some((3, 9)));
        for text in [
            "",
            "bytes */200",
            "bytes 3-9",
            "items 3-9/10",
            "bytes -9/10",
        ] {
            assert_eq!(range_of(text), None, "{text}");
        }
    }
}
