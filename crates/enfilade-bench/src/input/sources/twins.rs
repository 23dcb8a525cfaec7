//! Worlds of a source and of triangles that are the same surface.

use enfilade::cpg::World;

use crate::rows::Figure;

/// Largest difference of the volumes of a cell: what a centimeter makes of the smallest room here.
const MOST_VOLUME: f64 = 0.02;

/// Cells that differ in number, and those whose volumes do.
pub(super) fn cells(source: &World, triangles: &World) -> Figure {
    let volumes = |world: &World| {
        let cells = world.graph.indoor_cells();
        let mut all: Vec<f64> = cells.map(|(_, c)| f64::from(c.volume)).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let [a, b] = [source, triangles].map(volumes);
    let differs = |(a, b): (&f64, &f64)| (a / b - 1.0).abs() > MOST_VOLUME;
    let n = a.iter().zip(&b).filter(|p| differs(*p)).count();
    let note = format!(
        "{} cells, {} of triangles; volumes {a:.1?} and {b:.1?}",
        a.len(),
        b.len()
    );
    Figure::new((a.len().abs_diff(b.len()) + n) as f64, 0.0, note)
}

/// Portals more or fewer than those of the triangles.
pub(super) fn portals(source: &World, triangles: &World) -> Figure {
    let [a, b] = [source, triangles].map(|w| w.graph.portals.len());
    let note = format!("{a} portals, {b} of triangles");
    Figure::new(a.abs_diff(b) as f64, 0.0, note)
}
