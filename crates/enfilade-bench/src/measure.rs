//! What all tables share: names, files of a scene, processor time, quantiles.

use std::path::{Path, PathBuf};

/// Processor seconds that this process has used so far, all threads together; 0 where the system does
/// not say.
pub(crate) fn cpu_seconds() -> f64 {
    let of_task = |entry: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split_ascii_whitespace().next()?.parse::<f64>().ok()
    };
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten();
    tasks.filter_map(of_task).sum::<f64>() * 1e-9
}

/// A file's name without its folder and ending.
pub(crate) fn name(path: &Path) -> String {
    path.file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// A scene file, or a folder with `scene.glb` and, if there is one, `detail.glb`.
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

/// The value that so large a share of `values` does not exceed; sorts them. Not a number where there are none.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values
        .get((last as f64 * share) as usize)
        .copied()
        .unwrap_or(f64::NAN)
}
