//! The page of a walk in the browser, written beside a world: `--walk` of `pack` and `report`.

use std::fmt::Write;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context, bail};
use enfilade::runtime::Start;
use enfilade::{Sight, SightState, World};
use enfilade_report::{WalkPage, WalkStorey, find_storeys};

use crate::output::write_whole;
use enfilade_cli::input::is_stream;

/// Returns the path of the walk that belongs to a page or a packed file: `NAME-walk.html` beside it.
pub(crate) fn beside(path: &Path) -> anyhow::Result<PathBuf> {
    if is_stream(path) {
        bail!("--walk writes a page beside that of -o, so -o cannot be '-'; give a file's name");
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok(path.with_file_name(format!("{name}-walk.html")))
}

/// Returns the address of a page from one beside it.
pub(crate) fn address_of_page(page: &Path) -> String {
    encoded(&page.file_name().unwrap_or_default().to_string_lossy())
}

/// Writes the page of a walk through a world file, with all parts inside.
pub(crate) fn write(page: &Path, at: &Path, title: String, world: &World) -> anyhow::Result<()> {
    let walk = of(address(page, at)?, title, world)?;
    write_whole(page, walk.html().as_bytes())
}

/// Returns the walk through a world at an address, with a place on each storey to choose.
pub(crate) fn of(address: String, title: String, world: &World) -> anyhow::Result<WalkPage> {
    let sight = Sight::build(world)?;
    let state = SightState::as_modeled(&sight);
    let storeys = find_storeys(world).into_iter().filter(|s| !s.is_between);
    let storeys = storeys.filter_map(|storey| {
        let floor = Some(storey.floor as f32);
        let start = Start::among(world, &sight, &state, &storey.cells, floor)?;
        Some(WalkStorey {
            name: storey.name,
            eye: start.eye,
            yaw: start.yaw,
        })
    });
    Ok(WalkPage {
        world: address,
        title,
        storeys: storeys.collect(),
        first: None,
    })
}

/// Returns the address of a world, relative to a page: of a file or a folder, or as it is if it is on a server.
pub(crate) fn address(page: &Path, world: &Path) -> anyhow::Result<String> {
    if is_stream(world) {
        bail!(
            "--walk opens the world again in the browser, so it cannot be '-'; give a file's name"
        );
    }
    let text = world.to_string_lossy();
    if text.starts_with("http://") || text.starts_with("https://") {
        return Ok(text.into_owned());
    }
    let folder = match page.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    let absolute = |path: &Path| {
        std::fs::canonicalize(path).with_context(|| format!("cannot find {}", path.display()))
    };
    Ok(relative(&absolute(folder)?, &absolute(world)?))
}

/// Returns the way from one folder to a file as an address: `../worlds/my%20house.glb`.
fn relative(from: &Path, to: &Path) -> String {
    let names = |path: &Path| {
        let each = path.components().filter_map(|c| match c {
            Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
            _ => None,
        });
        each.collect::<Vec<String>>()
    };
    let (from, to) = (names(from), names(to));
    let n_shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n("..".to_owned(), from.len() - n_shared);
    let down = to[n_shared..].iter().map(|name| encoded(name));
    up.chain(down).collect::<Vec<String>>().join("/")
}

/// Returns a name as a part of an address (RFC 3986, section 2).
fn encoded(name: &str) -> String {
    let mut out = String::new();
    for byte in name.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            out.push(char::from(byte));
        } else {
            let _ = write!(out, "%{byte:02X}");
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_lead_from_the_page_to_the_world() {
        for (from, to, address) in [
            ("/a/b", "/a/b/w.glb", "w.glb"),
            (
                "/a/b",
                "/a/worlds/my house #2.glb",
                "../worlds/my%20house%20%232.glb",
            ),
            ("/a/b/c", "/d/wäre.enf", "../../../d/w%C3%A4re.enf"),
        ] {
            assert_eq!(relative(Path::new(from), Path::new(to)), address);
        }
    }

    #[test]
    fn worlds_on_servers_keep_their_addresses() {
        let world = Path::new("https://example.org/w.enf");
        assert_eq!(
            address(Path::new("x.html"), world).unwrap(),
            "https://example.org/w.enf"
        );
        assert!(address(Path::new("x.html"), Path::new("-")).is_err());
    }
}
