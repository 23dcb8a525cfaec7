//! `enfilade serve`: a folder over HTTP, for programs that stream packed worlds.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::time::Duration;

use anyhow::{Context, bail};
use enfilade::geom::shown;
use enfilade::stream::PackedFiles;
use hyper::Method;
use hyper::header::{HeaderName, HeaderValue};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use tokio::net::TcpListener;
use tower_http::compression::Compression;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};
use tower_http::cors::{Any, Cors};
use tower_http::services::ServeDir;
use tower_http::services::fs::{Backend, TokioBackend};
use tower_http::set_header::SetResponseHeader;

use crate::screen::printed;

/// Serves a folder over HTTP until Ctrl-C: files, ranges of them, and whole files compressed, but none that are hidden. Prints the addresses of the
/// packed worlds in it, which all commands take in place of files. Any page of a browser may read it.
#[derive(clap::Args)]
pub(crate) struct Serve {
    /// Folder with packed worlds, or a packed world. Links that lead out of it are not followed, and names that begin with a dot
    /// are not there.
    dir: PathBuf,
    /// Address and port: 0.0.0.0 serves other machines, too; port 0 takes one that is free.
    #[arg(long, value_name = "IP:PORT", default_value = "127.0.0.1:8000")]
    address: SocketAddr,
}

pub(crate) fn run(args: &Serve) -> anyhow::Result<()> {
    let cannot = || format!("cannot serve {}", args.dir.display());
    let root = args.dir.canonicalize().with_context(cannot)?;
    if !root.is_dir() {
        bail!(
            "{} is not a folder; give the one around it",
            args.dir.display()
        );
    }
    check_room(&root).with_context(cannot)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build();
    let runtime = runtime.with_context(cannot)?;
    let served = runtime.block_on(async {
        let listener = TcpListener::bind(args.address).await.with_context(|| {
            format!(
                "cannot listen at {}; choose another one with --address",
                args.address
            )
        })?;
        let end = tokio::spawn(tokio::signal::ctrl_c());
        // It listens for Ctrl-C before anybody is told that it is there.
        tokio::task::yield_now().await;
        tell(args, listener.local_addr()?)?;
        tokio::spawn(serve(listener, root));
        Ok(end.await??)
    });
    // A disk that does not answer holds up nobody.
    runtime.shutdown_background();
    served
}

/// Checks that the process may open what a server needs besides its callers: the runtime panics without.
fn check_room(root: &Path) -> anyhow::Result<()> {
    const NEEDED: usize = 16;
    let open = (0..NEEDED).map(|_| File::open(root));
    // Some systems do not open folders as files, and lack such a limit, too.
    match open.collect::<io::Result<Vec<File>>>() {
        Err(why) if why.kind() != ErrorKind::PermissionDenied => {
            Err(why).context("allow more open files, with `ulimit -n 64` or more")
        }
        _ => Ok(()),
    }
}

/// Letters of names that stand for themselves in addresses.
const PLAIN: &AsciiSet = &NON_ALPHANUMERIC
    .remove(b'.')
    .remove(b'-')
    .remove(b'_')
    .remove(b'~');

/// Returns the packed worlds of a folder as parts of addresses: itself, or what is directly in it.
fn worlds_in(dir: &Path) -> io::Result<Vec<String>> {
    if PackedFiles::is_packed(dir) {
        return Ok(vec![String::new()]);
    }
    let mut worlds = Vec::new();
    for entry in dir.read_dir()? {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        if let Some(name) = name.filter(|_| PackedFiles::is_packed(&path)) {
            let slash = if path.is_dir() { "/" } else { "" };
            worlds.push(format!("{}{slash}", utf8_percent_encode(name, PLAIN)));
        }
    }
    worlds.sort_unstable();
    Ok(worlds)
}

/// Prints the addresses of the folder and of its packed worlds.
fn tell(args: &Serve, address: SocketAddr) -> anyhow::Result<()> {
    let worlds = worlds_in(&args.dir)?;
    let mut out = printed();
    let dir = args.dir.display().to_string();
    writeln!(
        out,
        "serving {} at http://{address}/ until Ctrl-C",
        shown(&dir)
    )?;
    if worlds.is_empty() {
        writeln!(
            out,
            "no packed world is directly in it; `enfilade pack W.glb -o W.enf` makes one"
        )?;
    }
    for world in &worlds {
        writeln!(out, "http://{address}/{world}")?;
    }
    Ok(())
}

/// Answers requests for ever.
async fn serve(listener: TcpListener, root: PathBuf) {
    let files = ServeDir::with_backend(root.clone(), Inside(root));
    // Packed worlds are compressed already.
    let is_loose = NotForContentType::const_new("application/octet-stream");
    let files = Compression::new(files).compress_when(DefaultPredicate::new().and(is_loose));
    let files = Cors::new(files)
        .allow_origin(Any)
        .allow_methods([Method::GET, Method::HEAD])
        .allow_headers(Any)
        .expose_headers(Any);
    // Pages that are isolated from others have threads; these, and pages of others that are isolated, may read all files here.
    let header = HeaderName::from_static;
    let value = HeaderValue::from_static;
    let files = SetResponseHeader::overriding(
        files,
        header("cross-origin-opener-policy"),
        value("same-origin"),
    );
    let files = SetResponseHeader::overriding(
        files,
        header("cross-origin-embedder-policy"),
        value("require-corp"),
    );
    let files = SetResponseHeader::overriding(
        files,
        header("cross-origin-resource-policy"),
        value("cross-origin"),
    );
    let service = TowerToHyperService::new(files);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            // A caller that left again, or too many of them: others may have more luck.
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let service = service.clone();
        tokio::spawn(async move {
            let mut http = hyper::server::conn::http1::Builder::new();
            let http = http.timer(TokioTimer::new());
            // A connection that breaks concerns nobody else.
            let _ = http.serve_connection(TokioIo::new(stream), service).await;
        });
    }
}

/// The files and folders of a folder, without those that links in it lead to outside, hidden ones, and what is neither: a pipe
/// would be waited for.
#[derive(Clone)]
struct Inside(PathBuf);

impl Inside {
    fn check(&self, path: &Path) -> io::Result<()> {
        let found = path.canonicalize().ok().and_then(|found| {
            let inside = found.strip_prefix(&self.0).ok()?;
            let asked = path.strip_prefix(&self.0).ok()?;
            let mut names = inside.components().chain(asked.components());
            let is_hidden = names.any(|n| n.as_os_str().as_encoded_bytes().starts_with(b"."));
            let kind = found.metadata().ok()?.file_type();
            (!is_hidden && (kind.is_file() || kind.is_dir())).then_some(())
        });
        found.ok_or_else(|| ErrorKind::NotFound.into())
    }
}

type Later<T> = Pin<Box<dyn Future<Output = io::Result<T>> + Send>>;

impl Backend for Inside {
    type File = <TokioBackend as Backend>::File;
    type Metadata = std::fs::Metadata;
    type OpenFuture = Later<Self::File>;
    type MetadataFuture = Later<Self::Metadata>;

    fn open(&self, path: PathBuf) -> Self::OpenFuture {
        match self.check(&path) {
            Ok(()) => TokioBackend.open(path),
            Err(e) => Box::pin(async { Err(e) }),
        }
    }

    fn metadata(&self, path: PathBuf) -> Self::MetadataFuture {
        match self.check(&path) {
            Ok(()) => TokioBackend.metadata(path),
            Err(e) => Box::pin(async { Err(e) }),
        }
    }
}
