//! Bakes: arrays or files in, a world and warnings out.

use std::path::PathBuf;
use std::time::Duration;

use enfilade::bake::{BakeConfig, BakeContext, Method, Progress, Stage, bake};
use enfilade::cpg::wire::{decode_glb, encode_glb};
use enfilade::geom::DMat4;
use enfilade::geom::scene::Scene;
use enfilade::import::{
    ArrayMesh, IfcConverter, ImportOptions, ImportReport, Imported, import, import_arrays,
};
use enfilade::internals::bake::bsp::find_leak;
use enfilade_report::{InputDoubt, Verdict, is_empty, measured_room_facts, why_empty};
use enfilade_settings::{Resolved, Settings, parse_toml};
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;

use crate::arrays::{Faces, Points};
use crate::errors::{BakeError, SceneError, of_bake, of_import};
use crate::watch::{Watcher, run};
use crate::world::World;

/// Options of both functions, by name.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    /// A settings file as TOML.
    toml: Option<String>,
    /// Settings as JSON, with the names of the settings file.
    json: Option<String>,
    /// Those given as arguments, as JSON: they take precedence.
    arguments: String,
    method: String,
    threads: Option<usize>,
    max_memory: Option<u64>,
    max_time: Option<f64>,
    allow_empty: bool,
    allow_leak: bool,
    allow_outside: bool,
}

/// Worlds that are made although they are probably not wanted.
struct Allowed {
    empty: bool,
    leak: bool,
}

/// A mesh: two names, vertices, faces, a transform of four rows, `true` if it is detail.
type MeshArrays<'py> = (
    [String; 2],
    Points<'py>,
    Faces<'py>,
    Option<[[f64; 4]; 4]>,
    bool,
);

/// Bakes meshes; returns the world and warnings.
#[pyfunction]
pub(crate) fn bake_arrays(
    py: Python<'_>,
    meshes: Vec<MeshArrays<'_>>,
    options: Options,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(World, Vec<String>)> {
    let mut arrays = Vec::new();
    let is_alone = meshes.len() == 1;
    for (i, (names, vertices, faces, transform, is_detail)) in meshes.into_iter().enumerate() {
        let name = names.iter().find(|name| !name.is_empty());
        let of = match name {
            _ if is_alone => String::new(),
            Some(name) => format!("mesh '{name}': "),
            None => format!("mesh {i}: "),
        };
        let positions = vertices.rows(&format!("{of}vertices"))?;
        let triangles = faces.rows(&format!("{of}faces"), positions.len())?;
        let rows = transform.map(|rows| DMat4::from_cols_array_2d(&rows).transpose());
        arrays.push(ArrayMesh {
            names,
            positions,
            triangles,
            transform: rows.unwrap_or(DMat4::IDENTITY),
            is_detail,
        });
    }
    baked(py, options, progress, move |import_options| {
        import_arrays("arrays", arrays, import_options).map_err(|e| of_import(&e))
    })
}

/// Bakes files; returns the world and warnings.
#[pyfunction]
pub(crate) fn bake_files(
    py: Python<'_>,
    files: Vec<PathBuf>,
    detail: Vec<PathBuf>,
    options: Options,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(World, Vec<String>)> {
    baked(py, options, progress, move |import_options| {
        import(&files, &detail, import_options).map_err(|e| of_import(&e))
    })
}

fn baked(
    py: Python<'_>,
    options: Options,
    progress: Option<Bound<'_, PyAny>>,
    read: impl FnOnce(&ImportOptions) -> PyResult<Imported> + Send + 'static,
) -> PyResult<(World, Vec<String>)> {
    let allow = Allowed {
        empty: options.allow_empty,
        leak: options.allow_leak,
    };
    let (import_options, resolved) = options.resolve()?;
    let threads = options.threads;
    run(py, threads, progress.as_ref(), move |watcher| {
        work(&watcher, || read(&import_options), resolved, allow)
    })?
}

/// Reads and bakes. Errors are made here, and raised by the caller's thread.
fn work(
    watcher: &Watcher,
    read: impl FnOnce() -> PyResult<Imported>,
    resolved: Resolved,
    allow: Allowed,
) -> PyResult<(World, Vec<String>)> {
    let mut imported = read()?;
    imported.scene.rooms.extend_from_slice(&resolved.names);
    if let Some(why) = imported.report.refusal() {
        return Err(SceneError::new_err(why));
    }
    let config = resolved.config_for(&imported.scene);
    let leak = if allow.leak {
        None
    } else {
        leak_of_open_world(&imported.scene, &config, watcher)?
    };
    imported.scene.is_open_world |= leak.is_some();
    let config = resolved.config_for(&imported.scene);
    let report = &imported.report;
    let said = report.doubts();
    let mut warnings = said.clone();
    warnings.extend(leak);
    let unclear = report.up_doubt.as_ref().filter(|doubt| !doubt.is_clear);
    warnings.extend(unclear.map(|doubt| doubt.text.clone()));
    let told = Told::new(watcher, &config);
    let context = BakeContext::new(&told, Some(watcher.cancel.clone()));
    let mut baked = bake(&imported.scene, &config, &context).map_err(|e| match e {
        enfilade::bake::BakeError::Cancelled => PyKeyboardInterrupt::new_err(()),
        other => of_bake(&other),
    })?;
    let told = &mut baked.world.graph.provenance.settings;
    told.extend(report.settings.clone());
    warnings.extend(baked.notes);
    if is_empty(&baked.world) {
        let why = format!("no room was found: {}", why_empty(&baked.world));
        if !allow.empty {
            return Err(BakeError::new_err(format!(
                "{why}; --allow-empty returns the world all the same"
            )));
        }
        warnings.push(why);
    } else if !baked.world.doubts().is_empty() {
        let verdict = Verdict::of(&baked.world, &doubted(&said, report)).untried();
        warnings.push(verdict.to_string());
    }
    // As readers of its file get it: rounded.
    let bug = |e| BakeError::new_err(format!("the baked world breaks an invariant (a bug): {e}"));
    baked.world.room_facts = Some(measured_room_facts(&baked.world));
    let bytes = encode_glb(&baked.world).map_err(bug)?;
    drop(baked.world);
    Ok((World::new(decode_glb(&bytes).map_err(bug)?), warnings))
}

/// Returns the leak of a map whose world is open to the sky; ends the bake of one whose inside is open to the void through a gap.
fn leak_of_open_world(
    scene: &Scene,
    config: &BakeConfig,
    watcher: &Watcher,
) -> PyResult<Option<String>> {
    let n_faces = scene.solids.iter().map(|s| s.faces.len()).sum();
    let allowance = config.budget.allowance(n_faces, None);
    let allowance = allowance.unless(Some(watcher.cancel.clone()));
    let leak = find_leak(scene, (&allowance).into());
    // An exhausted allowance makes the search incomplete; the bake then ends with its own error at once.
    match leak.filter(|_| !allowance.is_over()) {
        None => Ok(None),
        Some(leak) if leak.is_open_world() => Ok(Some(format!(
            "{}; it is read as an open world",
            leak.says(scene)
        ))),
        Some(leak) => Err(BakeError::new_err(format!(
            "{}; close the gap, or go on with --allow-leak",
            leak.says(scene)
        ))),
    }
}

impl Options {
    fn resolve(&self) -> PyResult<(ImportOptions, Resolved)> {
        let bad = |e: String| PyValueError::new_err(format!("settings: {e}"));
        let of_json = |text: &str| {
            serde_json::from_str::<Settings>(text).map_err(|e| {
                // The place in a text that the user never saw.
                let text = e.to_string();
                bad(text
                    .split(" at line ")
                    .next()
                    .unwrap_or_default()
                    .to_owned())
            })
        };
        let mut settings = match (&self.toml, &self.json) {
            (Some(toml), _) => parse_toml(toml).map_err(|e| bad(e.to_string()))?,
            (None, Some(json)) => of_json(json)?,
            (None, None) => Settings::default(),
        };
        let given = of_json(&self.arguments)?;
        settings.unit = given.unit.or(settings.unit);
        settings.up = given.up.or(settings.up);
        settings.scene = given.scene.or(settings.scene);
        settings.min_opening = given.min_opening.or(settings.min_opening);
        settings.smallest_hole = given.smallest_hole.or(settings.smallest_hole);
        settings.voxel = given.voxel.or(settings.voxel);
        settings.detail_names.extend(given.detail_names);
        settings.structural_names.extend(given.structural_names);
        let mut import_options = ImportOptions {
            allow_outside: self.allow_outside,
            ..settings.import_options()
        };
        let mut resolved = settings.resolve().map_err(|e| bad(e.to_string()))?;
        resolved.config.method = match self.method.as_str() {
            "auto" => None,
            "watershed" => Some(Method::Watershed),
            "bsp" => Some(Method::Bsp),
            "delaunay" => Some(Method::Delaunay),
            other => {
                return Err(PyValueError::new_err(format!(
                    "method is {other:?}, must be 'auto', 'watershed', 'bsp' or 'delaunay'"
                )));
            }
        };
        let time = match self.max_time.map(Duration::try_from_secs_f64) {
            Some(Err(_)) => {
                let text = "max_time must be a number of seconds of at least 0";
                return Err(PyValueError::new_err(text));
            }
            Some(Ok(time)) => Some(time),
            None => None,
        };
        resolved.config.budget.time = time;
        resolved.config.budget.memory = self.max_memory;
        let mut ifc = IfcConverter::installed(std::env::temp_dir());
        ifc.max_time = time.unwrap_or(ifc.max_time);
        ifc.max_memory = self.max_memory;
        import_options.ifc = Some(ifc);
        Ok((import_options, resolved))
    }
}

/// Returns doubts about the input, as the verdict takes them.
fn doubted(said: &[String], report: &ImportReport) -> Vec<InputDoubt> {
    let up = report.up_doubt.as_ref().map(|doubt| &doubt.text);
    let doubt = |text: &String| InputDoubt {
        text: text.clone(),
        is_about_up: Some(text) == up,
    };
    said.iter().map(doubt).collect()
}

/// Hands on the stages of a bake.
struct Told<'a> {
    watcher: &'a Watcher,
    stages: std::sync::Mutex<&'static [Stage]>,
}

impl<'a> Told<'a> {
    fn new(watcher: &'a Watcher, config: &BakeConfig) -> Self {
        let method = config.method.unwrap_or(Method::Watershed);
        Self {
            watcher,
            stages: std::sync::Mutex::new(method.stages()),
        }
    }
}

impl Progress for Told<'_> {
    fn method(&self, method: Method, _reason: &str) {
        if let Ok(mut stages) = self.stages.lock() {
            *stages = method.stages();
        }
    }

    fn stage(&self, stage: Stage) {
        let (index, count) = self.stages.lock().map_or((0, 0), |stages| {
            let index = stages.iter().position(|s| *s == stage).unwrap_or(0);
            (index, stages.len())
        });
        self.watcher.begin((stage.name(), index + 1, count));
    }
}
