//! Walk maps kept beside their worlds: `world.walk` beside `world.glb`.
//!
//! A file of its own: the world stays the same to the byte, and its readers need not know of it. It can be deleted at any time.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use enfilade::geom::shown;
use enfilade::whole;
use enfilade::world::{Agent, PartId, Space, WalkMap, WalkMapKey};

use crate::output::write_whole;
use crate::screen::Told;
use enfilade_cli::input::is_stream;

/// Largest map read: of more floors than a map has. [Units: bytes]
const MOST: u64 = 2 << 30;

/// The file of a world, and its hash.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldFile<'a> {
    pub(crate) path: &'a Path,
    pub(crate) hash: u64,
}

#[cfg(feature = "render")]
impl<'a> WorldFile<'a> {
    /// Reads the file of a world for its hash; `None` if that is not possible, or useless without a map beside it.
    pub(crate) fn of(path: &'a Path) -> Option<Self> {
        let is_of_use = !is_stream(path) && beside(path).is_file();
        let bytes = is_of_use.then(|| enfilade_cli::input::read_glb(path).ok())?;
        let hash = WalkMapKey::hash(&bytes?);
        Some(Self { path, hash })
    }
}

/// The kind of walker of a map, and its obstacles.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walks {
    pub(crate) agent: Agent,
    /// `true` if objects are in its way.
    pub(crate) objects: bool,
}

impl Walks {
    /// An adult among furniture.
    pub(crate) fn usual() -> Self {
        Self {
            agent: Agent::default(),
            objects: true,
        }
    }

    /// Makes the map.
    pub(crate) fn map(&self, space: &Space) -> WalkMap {
        WalkMap::with_objects(space, self.agent, |_, _| self.objects)
    }

    fn key(&self, world: u64) -> WalkMapKey {
        WalkMapKey {
            world,
            objects: self.objects.into(),
            walker: self.agent,
        }
    }
}

/// Returns the name of the map kept beside a world.
pub(crate) fn beside(world: &Path) -> PathBuf {
    world.with_extension("walk")
}

/// Returns the map kept beside a world if it fits, or else makes it, and says why.
pub(crate) fn kept_or_made(file: Option<WorldFile<'_>>, space: &Space, walks: &Walks) -> WalkMap {
    let Some(file) = file.filter(|f| !is_stream(f.path)) else {
        return walks.map(space);
    };
    let path = beside(file.path);
    let is_there = fs::metadata(&path).is_ok_and(|m| m.is_file());
    if !is_there {
        return walks.map(space);
    }
    let is_small = fs::metadata(&path).is_ok_and(|m| m.len() <= MOST);
    let bytes = if is_small {
        fs::read(&path).map_err(|e| e.to_string())
    } else {
        Err("it is larger than 2 GiB".to_owned())
    };
    let key = walks.key(file.hash);
    let map = bytes.and_then(|b| {
        WalkMap::restored(&b, space, &key, |_, _| walks.objects).map_err(|e| e.to_string())
    });
    map.unwrap_or_else(|why| {
        // A message that cannot be shown changes nothing.
        let name = path.display().to_string();
        let _ = writeln!(
            Told,
            "{} is not used: {why}; the map is made anew",
            shown(&name)
        );
        walks.map(space)
    })
}

/// Writes a map beside its world.
///
/// # Errors
///
/// If the file cannot be written.
pub(crate) fn keep(
    file: WorldFile<'_>,
    space: &Space,
    walks: &Walks,
    map: &WalkMap,
) -> anyhow::Result<()> {
    let path = beside(file.path);
    let bytes = map.kept(space, &walks.key(file.hash));
    write_whole(&path, &bytes)?;
    whole::remove_left(&[&path]);
    let n = map.floors(PartId::ROOT).n_floors();
    writeln!(
        Told,
        "wrote {}: {n} floors, {:.1} MB",
        path.display(),
        bytes.len() as f64 / 1e6
    )?;
    Ok(())
}
