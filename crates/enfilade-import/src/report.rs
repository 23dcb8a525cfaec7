//! The report of an import. Every change is recorded here.

use enfilade_geom::scene::Scene;
use enfilade_geom::shown;
use enfilade_prepare::{BadOption, CleaningOptions, CleaningReport, Finding, RepairReport};
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::Up;

/// Most distinct notes kept; further ones are only counted.
const MAX_NOTES: usize = 500;

/// Observations and changes of an import.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ImportReport {
    /// One entry per file, in the order given.
    pub files: Vec<FileReport>,
    /// Everything skipped, assumed or repaired; equal texts of one file are merged.
    pub notes: Vec<Note>,
    /// Objects left out, by reason: helpers of engines, skies, coarser levels of detail. Those without matter by their format are
    /// only notes.
    pub left_out: Vec<LeftOut>,
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
    /// The reason why the numbers may be feet, and the remedy; `None` without evidence.
    pub feet_hint: Option<String>,
    /// The reason why the axis taken for up probably is not, and the remedy; `None` without evidence, and if the options
    /// give an axis.
    pub up_doubt: Option<UpDoubt>,
    /// Places where a single missing triangle was put back, the largest first.
    pub put_back: Finding,
    /// Changes of the repair, if one was requested.
    pub repair: Option<RepairReport>,
    /// Facts of the input that a world tells, as settings by name: of surfaces that were extracted, the largest step and the largest
    /// distance from the source; the repair; and the point that became the origin, unless it was that before.
    pub settings: BTreeMap<String, String>,
}

/// Evidence that another axis points up than the one that was taken to.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct UpDoubt {
    /// The reason and the remedy.
    pub text: String,
    /// The axis that seems to point up, as the scene was read: 0 is x.
    pub axis: usize,
    /// The axis to give in the options, if one turns the scene.
    pub up: Option<Up>,
    /// The evidence is strong.
    pub is_clear: bool,
}

/// One input file.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct FileReport {
    /// The file.
    pub path: PathBuf,
    /// `glTF`, `OBJ`, `PLY`, `STL`, `IFC`, `gbXML`, `HBJSON`, `Quake map`, `VMF`, `MagicaVoxel`, `implicit`, `patches`, `NIfTI`, `NRRD`, `raw volume`, `E57` or `LAS`.
    pub format: &'static str,
    /// Objects read from it.
    pub n_objects: u64,
    /// Triangles of these objects.
    pub n_triangles: u64,
    /// The surface made of it, or of its patches, if it has more than triangles of its own.
    pub surface: Option<SurfaceReport>,
}

impl FileReport {
    /// Returns `true` for a format with a unit that all its writers know, and with Z up.
    #[must_use]
    #[doc(hidden)]
    pub fn tells_unit(&self) -> bool {
        matches!(self.format, "Quake map" | "VMF" | "gbXML" | "HBJSON")
    }
}

/// A surface made of a source that is not triangles. All promises hold for the surface.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SurfaceReport {
    /// Distance between the points at which the source was evaluated; details thinner than this may be lost. Patches have none, and lose
    /// none. [Units: wu]
    pub step: Option<f64>,
    /// Largest distance found between surface and source. [Units: wu]
    pub distance: f64,
    /// Points at which the source was evaluated.
    pub n_samples: u64,
    /// Factor by which it was enlarged beyond its unit, if it was.
    pub enlarged: Option<f64>,
    /// Further assumptions, for people; may be empty.
    pub text: String,
}

/// Objects left out for one reason.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct LeftOut {
    /// The reason.
    pub reason: String,
    /// The first few distinct names; a mesh placed many times has one.
    pub names: Vec<String>,
    /// Number of objects.
    pub n: u64,
}

/// Most names kept of objects left out for one reason, and most reasons.
const MAX_LEFT_OUT: usize = 5;
const MAX_REASONS: usize = 100;

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<String> = self.names.iter().map(|n| format!("'{n}'")).collect();
        let more = if self.n as usize > names.len() {
            ", …"
        } else {
            ""
        };
        let names = names.join(", ");
        write!(
            f,
            "left out: {}{more}: {}",
            shown(names),
            shown(&self.reason)
        )
    }
}

/// One observation.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
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

impl ImportReport {
    /// Returns `true` if all input states neither a unit nor an axis that points up: arrays, and files of some formats.
    #[must_use]
    #[doc(hidden)]
    pub fn is_bare(&self) -> bool {
        let is_bare = |f: &FileReport| matches!(f.format, "OBJ" | "PLY" | "STL" | "arrays");
        self.files.iter().all(is_bare)
    }

    /// Returns the doubts about unit and axis that lower the trust in a world.
    #[must_use]
    pub fn doubts(&self) -> Vec<String> {
        let mut said = self.grave_doubts();
        said.extend(self.feet_hint.clone());
        said
    }

    fn grave_doubts(&self) -> Vec<String> {
        let clear = self.up_doubt.as_ref().filter(|doubt| doubt.is_clear);
        let texts = [self.unit_doubt.clone(), clear.map(|d| d.text.clone())];
        texts.into_iter().flatten().collect()
    }

    /// Returns the reason to bake nothing, with the remedy: the input states neither unit nor axis, so that its numbers
    /// alone speak, and they speak against what was assumed.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        // Not for feet: high halls with high steps exist.
        let said = self.grave_doubts();
        if !self.is_bare() || said.is_empty() {
            return None;
        }
        let unit = self.unit_doubt.as_ref().map(|_| "--unit m");
        let up = self.up_doubt.as_ref().filter(|doubt| doubt.is_clear);
        let as_is: Vec<&str> = unit.into_iter().chain(up.map(|_| "--up y")).collect();
        Some(format!(
            "{}; if it is right as it is, {}",
            said.join("; and "),
            as_is.join(" ")
        ))
    }

    /// Counts `n` objects of one name that are left out.
    pub(crate) fn leave_out(&mut self, reason: &str, name: &str, n: u64) {
        let known = self.left_out.iter().position(|l| l.reason == reason);
        if known.is_none() && self.left_out.len() == MAX_REASONS {
            return;
        }
        let at = known.unwrap_or(self.left_out.len());
        if known.is_none() {
            self.left_out.push(LeftOut {
                reason: reason.to_owned(),
                ..LeftOut::default()
            });
        }
        let own = &mut self.left_out[at];
        own.n += n;
        if own.names.len() < MAX_LEFT_OUT && !own.names.iter().any(|known| known == name) {
            own.names.push(name.to_owned());
        }
    }

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

/// Finds defects in a scene and adds those that `import` found while reading it.
///
/// Takes as long as [`enfilade_prepare::cleaning_report`], and panics where it does.
///
/// # Errors
///
/// When an option is out of range.
pub fn cleaning_report(
    scene: &Scene,
    import: Option<&ImportReport>,
    options: &CleaningOptions,
) -> Result<CleaningReport, BadOption> {
    let mut report = enfilade_prepare::cleaning_report(scene, options)?;
    if let Some(import) = import {
        report.non_planar_polygons = import.non_planar_polygons.clone();
        report.concave_polygons = import.concave_polygons.clone();
        report.crossing_polygons = import.crossing_polygons.clone();
        report.nonfinite_vertices = import.nonfinite_vertices.clone();
    }
    Ok(report)
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
