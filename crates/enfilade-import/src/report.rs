//! The report of an import. Every change is recorded here.

use enfilade_geom::{DVec3, shown};
use std::fmt;
use std::path::{Path, PathBuf};

/// Most distinct notes kept; further ones are only counted.
const MAX_NOTES: usize = 500;

/// Most example positions kept per finding.
pub(crate) const MAX_EXAMPLES: usize = 5;

/// Observations and changes of an import.
#[derive(Clone, Debug, Default)]
pub struct ImportReport {
    /// One entry per file, in the order given.
    pub files: Vec<FileReport>,
    /// Everything skipped, assumed or repaired; equal texts of one file are merged.
    pub notes: Vec<Note>,
    /// Notes left out because there were too many distinct ones.
    pub n_notes_dropped: u64,
    /// Vertices with a coordinate that is not finite; their triangles are dropped.
    pub nonfinite_vertices: Finding,
    /// Triangles dropped for such vertices.
    pub n_nonfinite_triangles: u64,
    /// Polygons with more than three vertices, one of them more than 1 mm off their plane.
    pub non_planar_polygons: Finding,
    /// Polygons with a vertex more than 0.01 mm inside the line through its neighbors, except those that cross
    /// themselves.
    pub concave_polygons: Finding,
    /// Polygons whose outline crosses itself, seen along their normal.
    pub crossing_polygons: Finding,
    /// Polygons split into triangles.
    pub n_polygons: u64,
    /// Files read because the scene refers to them: buffers, pictures, materials. Each once.
    pub references: Vec<PathBuf>,
    /// The reason why the numbers are probably not meters, and the remedy; `None` without evidence.
    pub unit_doubt: Option<String>,
    /// Changes of the repair, if one was requested.
    pub repair: Option<crate::RepairReport>,
}

/// One input file.
#[derive(Clone, Debug, Default)]
pub struct FileReport {
    /// The file.
    pub path: PathBuf,
    /// `glTF`, `OBJ`, `PLY`, `STL`, `IFC` or `Quake map`.
    pub format: &'static str,
    /// Objects read from it.
    pub n_objects: u64,
    /// Triangles of these objects.
    pub n_triangles: u64,
}

/// One observation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// The file.
    pub path: PathBuf,
    /// The first place of it.
    pub place: String,
    /// The observation and its consequence.
    pub text: String,
    /// Number of times.
    pub n: u64,
}

/// A count with a few example places.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finding {
    /// Number of occurrences.
    pub n: u64,
    /// The first few, at most five.
    pub examples: Vec<Example>,
}

/// One place in the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Example {
    /// The object or element.
    pub name: String,
    /// Position; in world space unless the finding says otherwise. [Units: wu]
    pub position: DVec3,
}

impl Finding {
    pub(crate) fn add(&mut self, position: DVec3, name: impl FnOnce() -> String) {
        self.n += 1;
        if self.examples.len() < MAX_EXAMPLES {
            self.examples.push(Example {
                name: name(),
                position,
            });
        }
    }
}

impl ImportReport {
    pub(crate) fn note(&mut self, path: &Path, place: impl Into<String>, text: impl Into<String>) {
        let text = text.into();
        if let Some(note) = self
            .notes
            .iter_mut()
            .find(|note| note.text == text && note.path == path)
        {
            note.n += 1;
        } else if self.notes.len() < MAX_NOTES {
            self.notes.push(Note {
                path: path.to_path_buf(),
                place: place.into(),
                text,
                n: 1,
            });
        } else {
            self.n_notes_dropped += 1;
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (path, place) = (shown(self.path.display()), shown(&self.place));
        write!(f, "{path}: {place}: {}", shown(&self.text))?;
        if self.n > 1 {
            write!(f, " ({} times)", self.n)?;
        }
        Ok(())
    }
}

impl fmt::Display for ImportReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for file in &self.files {
            writeln!(
                f,
                "{}: {}, {} objects, {} triangles",
                shown(file.path.display()),
                file.format,
                file.n_objects,
                file.n_triangles
            )?;
        }
        for note in &self.notes {
            writeln!(f, "{note}")?;
        }
        if self.n_notes_dropped > 0 {
            writeln!(f, "... and {} more notes", self.n_notes_dropped)?;
        }
        Ok(())
    }
}
