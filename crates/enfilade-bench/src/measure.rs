//! Helpers of all tables: names, files of a scene, processor time, quantiles.

use std::path::{Path, PathBuf};

use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade::import::{ImportOptions, import};

/// Returns the processor seconds that this process has used so far, all threads together; 0 if the system does not
/// provide them.
pub(crate) fn cpu_seconds() -> f64 {
    let of_task = |entry: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split_ascii_whitespace().next()?.parse::<f64>().ok()
    };
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten();
    tasks.filter_map(of_task).sum::<f64>() * 1e-9
}

/// Returns a size of this process by its name in the system's list; 0 if the system does not have it. [Units: bytes]
pub(crate) fn memory(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix(name));
    let kilobytes = line.and_then(|l| l.split_ascii_whitespace().nth(1)?.parse::<u64>().ok());
    kilobytes.unwrap_or(0) * 1024
}

/// Returns a file's name without folder and extension.
pub(crate) fn name(path: &Path) -> String {
    path.file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// Returns a file's or folder's name with its extension.
pub(crate) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns a stored point.
pub(crate) fn point(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

/// Returns the structure and detail files of a scene: a file, or a folder with `scene.glb` and optionally `detail.glb`.
pub(crate) fn files_of(path: &Path) -> (Vec<PathBuf>, Vec<PathBuf>) {
    if !path.is_dir() {
        return (vec![path.to_owned()], Vec::new());
    }
    let detail = path.join("detail.glb");
    let detail = if detail.exists() {
        vec![detail]
    } else {
        Vec::new()
    };
    (vec![path.join("scene.glb")], detail)
}

/// Returns the scene of a file or folder.
pub(crate) fn imported(path: &Path) -> anyhow::Result<Scene> {
    let (files, detail) = files_of(path);
    Ok(import(&files, &detail, &ImportOptions::default())?.scene)
}

/// Returns the middle of the values, the upper of two; sorts them. Not a number if there are none.
pub(crate) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Returns the value that this share of `values` does not exceed; sorts them. Not a number if there are none.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values
        .get((last as f64 * share) as usize)
        .copied()
        .unwrap_or(f64::NAN)
}
