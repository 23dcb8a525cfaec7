//! Packed worlds over HTTP, from servers good and bad.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use enfilade_cpg::wire::encode_glb;
use enfilade_stream::{
    Fetch, PackedHead, PackedHttp, PackedPlace, PackedWorld, PieceId, Reply, Source, ThreadSource,
};
use enfilade_testkit::{GridParams, Rng, room_grid};

/// A fault of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Status500,
    /// The body ends early, and the connection with it.
    Short,
    WrongByte,
    IgnoresRange,
    OtherRange,
    HangsUp,
    /// More than was asked for, without an end.
    Endless,
    /// A byte now and then.
    Dribbles,
}

use Fault::{Dribbles, Endless, HangsUp, IgnoresRange, OtherRange, Short, Status500, WrongByte};

/// A server of files in memory, at a free port.
struct Server {
    files: BTreeMap<String, Vec<u8>>,
    /// The faults, and how many of 100 answers have one of them.
    faults: (Vec<Fault>, usize),
    rng: Mutex<Rng>,
    is_down: AtomicBool,
    n_connections: AtomicUsize,
    n_answers: AtomicUsize,
}

impl Server {
    /// Starts it with a packed world as the folder `w.enf` and the file `one.enf`; returns its address, too.
    fn start(packed: &PackedWorld, faults: &[Fault], percent: usize) -> (Arc<Self>, String) {
        let mut files = BTreeMap::from([("/one.enf".to_owned(), packed.one_file().unwrap())]);
        for (name, bytes) in packed.files().unwrap() {
            files.insert(format!("/w.enf/{name}"), bytes);
        }
        let server = Arc::new(Self {
            files,
            faults: (faults.to_vec(), percent),
            rng: Mutex::new(Rng::new(7)),
            is_down: AtomicBool::new(false),
            n_connections: AtomicUsize::new(0),
            n_answers: AtomicUsize::new(0),
        });
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let shared = Arc::clone(&server);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let server = Arc::clone(&shared);
                server.n_connections.fetch_add(1, Ordering::Relaxed);
                std::thread::spawn(move || server.answer_all(&stream));
            }
        });
        (server, url)
    }

    /// Answers one request after the other, until somebody hangs up.
    fn answer_all(&self, stream: &TcpStream) -> Option<()> {
        let mut lines = BufReader::new(stream).lines();
        loop {
            let line = lines.next()?.ok()?;
            let path = line.split(' ').nth(1)?.to_owned();
            let mut range = None;
            loop {
                let line = lines.next()?.ok()?.to_ascii_lowercase();
                if let Some(text) = line.strip_prefix("range: bytes=") {
                    let (a, b) = text.split_once('-')?;
                    range = Some((a.parse().ok()?, b.parse().ok()?));
                } else if line.is_empty() {
                    break;
                }
            }
            if self.is_down.load(Ordering::Relaxed) {
                return None;
            }
            self.n_answers.fetch_add(1, Ordering::Relaxed);
            self.answer(stream, &path, range?)?;
        }
    }

    fn fault(&self) -> Option<Fault> {
        let mut rng = self.rng.lock().unwrap();
        (rng.below(100) < self.faults.1).then(|| self.faults.0[rng.below(self.faults.0.len())])
    }

    fn answer(&self, mut stream: &TcpStream, path: &str, range: (usize, usize)) -> Option<()> {
        let mut send = |status: &str, n: usize, head: &str, body: &[u8]| {
            let head = format!("HTTP/1.1 {status}\r\nContent-Length: {n}\r\n{head}\r\n");
            stream.write_all(&[head.as_bytes(), body].concat()).ok()
        };
        let Some(file) = self.files.get(path) else {
            return send("404 Not Found", 0, "", &[]);
        };
        let (a, b) = (range.0, range.1.min(file.len() - 1));
        if a > b {
            return send("416 Range Not Satisfiable", 0, "", &[]);
        }
        let mut body = file[a..=b].to_vec();
        let n = body.len();
        let part = |a: usize| format!("Content-Range: bytes {a}-{b}/{}\r\n", file.len());
        match self.fault() {
            Some(Status500) => return send("500 Internal Server Error", 0, "", &[]),
            Some(Short) => {
                send("206 Partial Content", n, &part(a), &body[..n / 2])?;
                let _ = stream.shutdown(std::net::Shutdown::Both);
                return None;
            }
            Some(WrongByte) => body[n / 2] ^= 1,
            Some(IgnoresRange) => return send("200 OK", file.len(), "", file),
            Some(OtherRange) => return send("206 Partial Content", n, &part(a + 1), &body),
            Some(HangsUp) => {
                let _ = stream.shutdown(std::net::Shutdown::Both);
                return None;
            }
            Some(Endless) => {
                let head = format!("HTTP/1.1 206 Partial Content\r\n{}\r\n", part(a));
                stream.write_all(head.as_bytes()).ok()?;
                loop {
                    stream.write_all(&body).ok()?;
                }
            }
            Some(Dribbles) => {
                send("206 Partial Content", n, &part(a), &[])?;
                for byte in &body {
                    stream.write_all(&[*byte]).ok()?;
                    std::thread::sleep(Duration::from_millis(500));
                }
                return None;
            }
            None => {}
        }
        send("206 Partial Content", n, &part(a), &body)
    }
}

fn packed() -> (Vec<u8>, PackedWorld) {
    let grid = GridParams {
        furniture: 4,
        ..GridParams::offices(12, 2)
    };
    let file = encode_glb(&room_grid(&grid)).unwrap();
    let packed = PackedWorld::pack(&file).unwrap();
    (file, packed)
}

fn next(source: &mut ThreadSource) -> Reply {
    let start = Instant::now();
    let mut out = Vec::new();
    while out.is_empty() {
        assert!(start.elapsed() < Duration::from_secs(60), "it hangs");
        source.poll(&mut out);
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(out.len() == 1 || out.iter().all(|r| r.bytes.is_ok()));
    out.remove(0)
}

/// Fetches all pieces, those that fail again, and compares them; returns the errors.
fn all_come(head: PackedHead, place: &PackedPlace, packed: &PackedWorld) -> Vec<String> {
    let head = Arc::new(head);
    let mut source = place.source(&head);
    let mut errors = Vec::new();
    for piece in (0..head.places.len() as u32).map(PieceId) {
        source.request(piece);
        loop {
            match next(&mut source).bytes {
                Ok(bytes) => {
                    let expected = head.expand(piece, packed.packed(piece).unwrap());
                    assert_eq!(bytes, expected.unwrap());
                    break;
                }
                Err(why) => errors.push(why.to_string()),
            }
            source.request(piece);
        }
    }
    errors
}

#[test]
fn a_server_gives_the_same_pieces_as_files_over_few_connections() {
    let (file, packed) = packed();
    let (server, url) = Server::start(&packed, &[], 0);
    for name in ["w.enf", "w.enf/", "one.enf"] {
        let url = format!("{url}/{name}");
        let (head, place) = PackedPlace::open(&url).unwrap();
        assert_eq!(all_come(head, &place, &packed), [""; 0]);
        assert!(PackedPlace::read_all(&url).unwrap().unpack().unwrap() == file);
    }
    let [n_connections, n_answers] =
        [&server.n_connections, &server.n_answers].map(|n| n.load(Ordering::Relaxed));
    // Two to open, one to read all, three for a source; three times.
    assert!(
        n_connections <= 18 && n_answers > 50,
        "{n_connections} {n_answers}"
    );
}

#[test]
fn a_bad_server_gives_the_same_world_in_the_end() {
    let (file, packed) = packed();
    let faults = [
        Status500,
        Short,
        WrongByte,
        IgnoresRange,
        OtherRange,
        HangsUp,
        Endless,
    ];
    let (_server, url) = Server::start(&packed, &faults, 40);
    for name in ["w.enf/", "one.enf"] {
        let url = format!("{url}/{name}");
        let open = || (0..5).find_map(|_| PackedPlace::open(&url).ok());
        let (head, place) = open().unwrap();
        for error in all_come(head, &place, &packed) {
            assert!(error.contains(&url), "{error}");
        }
        let mut all = (0..5).filter_map(|_| PackedPlace::read_all(&url).ok());
        assert!(all.next().unwrap().unpack().unwrap() == file);
    }
}

#[test]
fn a_server_without_ranges_is_read_from_the_beginning_within_bounds() {
    let (_, packed) = packed();
    let (_server, url) = Server::start(&packed, &[IgnoresRange], 100);
    let url = format!("{url}/one.enf");
    let (head, place) = PackedPlace::open(&url).unwrap();
    assert_eq!(all_come(head, &place, &packed), [""; 0]);
    let far = PackedHttp {
        pieces: url,
        offset: 64 << 20,
    };
    assert_eq!(far.fetch().fetch(0, 0), Ok(Vec::new()));
    // The server of the test knows that this is behind the end; others send all.
    assert_eq!(far.fetch().fetch(0, 9), Ok(Vec::new()));
}

#[test]
fn each_fault_is_told_in_words() {
    let (_, packed) = packed();
    for (fault, words) in [
        (Status500, "status 500"),
        (OtherRange, "instead of bytes 8-17"),
        (Short, ""),
        (HangsUp, ""),
    ] {
        let (_server, url) = Server::start(&packed, &[fault], 100);
        let pieces = format!("{url}/one.enf");
        let mut fetch = PackedHttp { pieces, offset: 8 }.fetch();
        let told = fetch.fetch(0, 10).unwrap_err();
        assert!(told.contains(words) && told.len() > 9, "{fault:?}: {told}");
    }
    // No more is read than was asked for.
    let (_server, url) = Server::start(&packed, &[Endless], 100);
    let pieces = format!("{url}/one.enf");
    let mut fetch = PackedHttp { pieces, offset: 0 }.fetch();
    assert_eq!(
        fetch.fetch(3, 10).unwrap(),
        packed.one_file().unwrap()[3..13]
    );
}

#[test]
fn a_server_that_sends_a_byte_now_and_then_is_given_up_soon() {
    let (_, packed) = packed();
    let (_server, url) = Server::start(&packed, &[Dribbles], 100);
    let start = Instant::now();
    let why = PackedPlace::open(format!("{url}/one.enf")).unwrap_err();
    assert!(why.to_string().contains("16 KiB a second"), "{why}");
    assert!(start.elapsed() < Duration::from_secs(20));
}

#[test]
fn addresses_of_nothing_are_told() {
    let (_, packed) = packed();
    let (server, url) = Server::start(&packed, &[], 0);
    for (url, words) in [
        (format!("{url}/none.enf"), "no packed world at this address"),
        (
            format!("{url}/w.enf/pieces.enfp"),
            "no packed world at this address",
        ),
        ("http://127.0.0.1:1/w.enf".into(), "start the server"),
        ("http://a b/w.enf".into(), "this is not an address"),
    ] {
        let why = PackedPlace::open(&url).unwrap_err().to_string();
        assert!(why.starts_with(&url) && why.contains(words), "{why}");
    }
    let (head, place) = PackedPlace::open(format!("{url}/w.enf")).unwrap();
    assert!(matches!(&place, PackedPlace::Http(http) if http.pieces.ends_with("/pieces.enfp")));
    // It is killed, and comes back.
    let head = Arc::new(head);
    let mut source = place.source(&head);
    server.is_down.store(true, Ordering::Relaxed);
    source.request(PieceId(0));
    let why = next(&mut source).bytes.unwrap_err().to_string();
    assert!(why.contains(&url), "{why}");
    server.is_down.store(false, Ordering::Relaxed);
    source.request(PieceId(0));
    assert!(next(&mut source).bytes.is_ok());
}
