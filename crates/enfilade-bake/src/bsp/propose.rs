//! Proposes the separators of a tree as portals.

use std::collections::BTreeMap;

use enfilade_geom::scene::Scene;
use enfilade_geom::{Allowance, Bvh, DVec3, Plane, Purse, Winding};

use crate::complex::region::RegionShape;
use crate::complex::{Label, LabelSettings, Vote};
use crate::config::{BspConfig, Rooms};
use crate::proposal::Proposal;
use crate::structure::{Candidate, OUTDOORS, Structure};
use crate::{BakeConfig, BakeContext, BakeError, Stage};

use super::cells::{self, LeafCells, NO_CELL};
use super::input::input_of;
use super::inside::Soup;
use super::leaves::Bsp;
use super::rooms::{self, Evidence};
use super::{arrange, guided, leak, separator, shape};

/// Finds rooms by binary space partition and separators, for levels made of brushes and for clean architectural models.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    let scene = structure.scene;
    context.begin(Stage::Tree)?;
    let mut bsp = tree_of(structure, &config.bsp, context.allowance().into());
    let counts = bsp.counts();
    context.begin(Stage::Separators)?;
    let parted = Parted::of(structure, &mut bsp, config, context.allowance());
    context.check()?;
    let mut votes = parted.votes(&bsp);
    if !structure.stairs.is_empty() {
        let matter = Soup::of(&structure.stairs, &[]);
        votes.retain(|v| !matter.is_inside(v.point, bsp.purse));
    }
    let cells = &parted.cells;
    let counts = vec![
        ("bsp_polygons", counts.n_polygons as f64),
        ("bsp_pieces", counts.n_pieces as f64),
        ("bsp_splits", counts.n_splits as f64),
        ("bsp_leaves", counts.n_leaves as f64),
        ("bsp_portals", counts.n_portals as f64),
        ("separators", cells.separators.len() as f64),
        ("crossing_separators", cells.n_crossing as f64),
        ("cells_before", cells.n_cells as f64),
    ];
    Ok(Proposal {
        candidates: candidates_of(&bsp, cells),
        label: label_settings(scene),
        joins_unparted: false,
        counts,
        settings: settings_of(config),
        ..Proposal::new(structure.bounds().expanded(1.0), votes)
    })
}

fn tree_of<'a>(structure: &Structure<'_>, config: &BspConfig, purse: Purse<'a>) -> Bsp<'a> {
    let numbers = structure.wall_numbers.iter();
    let objects: Vec<u32> = numbers
        .map(|&t| structure.sources[t as usize].object)
        .collect();
    let inside = leak::inside_of(structure.scene);
    let input = input_of(structure.scene, &structure.walls, &objects, &inside);
    guided::build(&input, config.heuristic, &config.guide, purse)
}

fn label_settings(scene: &Scene) -> LabelSettings {
    if scene.solids.is_empty() {
        return LabelSettings::default();
    }
    // A cell of the tree is a cell whatever its size; the simplifier decides which are too small.
    LabelSettings {
        min_volume: 0.0,
        min_room: 0.0,
        dominance: 1.0,
        strong_share: 0.2,
        ..LabelSettings::default()
    }
}

/// Leaves divided into cells.
struct Parted {
    cells: LeafCells,
    shapes: Vec<Option<RegionShape>>,
    /// `true` for each leaf of a cell too narrow for a room, if shape decides on rooms; a guide may make narrower
    /// cells.
    is_narrow: Vec<bool>,
}

impl Parted {
    fn of(
        structure: &Structure<'_>,
        bsp: &mut Bsp<'_>,
        config: &BakeConfig,
        allowance: &Allowance,
    ) -> Self {
        let by_shape = match config.bsp.rooms {
            Rooms::Auto => structure.scene.solids.is_empty(),
            rooms => rooms == Rooms::Always,
        };
        if !by_shape {
            return Self {
                cells: cells::part(bsp, separator::find(bsp)),
                shapes: shape::shapes(&bsp.tree, &bsp.tolerance, bsp.purse),
                is_narrow: Vec::new(),
            };
        }
        let settings = &config.merge;
        let mut closures = structure.blockers(&Bvh::build(&structure.walls));
        closures.extend(&structure.missing);
        arrange::refine(bsp, settings);
        let shapes = shape::shapes(&bsp.tree, &bsp.tolerance, bsp.purse);
        let evidence = Evidence {
            shapes: &shapes,
            closures: &Bvh::build(&closures),
            slabs: &structure.slabs(),
            allowance,
        };
        let rooms = rooms::part(bsp, separator::find_in_walls(bsp), &evidence, settings);
        let narrow = rooms::narrow_cells(bsp, &rooms, settings);
        let outer = rooms.of_leaf[bsp.outer_leaf() as usize];
        let of_leaf = |&c: &u32| c != outer && narrow.get(c as usize).is_some_and(|n| *n);
        Self {
            is_narrow: rooms.of_leaf.iter().map(of_leaf).collect(),
            cells: guided::part(bsp, rooms),
            shapes,
        }
    }

    /// Returns a vote of each leaf for its cell.
    fn votes(&self, bsp: &Bsp<'_>) -> Vec<Vote> {
        let cells = &self.cells;
        // With triangles, the air around everything is a cell, and is labeled as such.
        let outer = cells.of_leaf[bsp.outer_leaf() as usize];
        let label = |cell: u32| {
            if cell == outer {
                OUTDOORS
            } else {
                OUTDOORS + 1 + cell
            }
        };
        let of_leaf = |(leaf, shape): (usize, &Option<RegionShape>)| {
            let (cell, shape) = (cells.of_leaf[leaf], (*shape)?);
            // A narrow cell that leaks into a room is part of that room; the complex sees to it.
            let counts = cell != NO_CELL && !self.is_narrow.get(leaf).is_some_and(|n| *n);
            counts.then(|| Vote {
                point: shape.middle,
                label: Label::Region(label(cell)),
                weight: shape.volume as f32,
            })
        };
        self.shapes.iter().enumerate().filter_map(of_leaf).collect()
    }
}

/// Returns the settings of the partition as text, by name, for the provenance of the file.
fn settings_of(config: &BakeConfig) -> BTreeMap<String, String> {
    let BspConfig {
        heuristic,
        guide,
        rooms,
    } = &config.bsp;
    let number = |v: Option<f64>| v.map_or_else(|| "none".to_owned(), |v| v.to_string());
    let own = [
        ("bsp.heuristic", format!("{heuristic:?}").to_lowercase()),
        ("bsp.rooms", format!("{rooms:?}").to_lowercase()),
        ("bsp.grid", number(guide.grid)),
        ("bsp.tetrahedra", number(guide.tetrahedra)),
        ("bsp.planes", guide.planes.len().to_string()),
        ("bsp.boxes", guide.boxes.len().to_string()),
    ];
    let mut out = config.costs.to_settings();
    out.extend(config.merge.to_settings());
    out.extend(own.map(|(k, v)| (k.to_owned(), v)));
    out
}

/// Returns one candidate for each separator whose portals fill their hull, else one for each of its portals.
fn candidates_of(bsp: &Bsp<'_>, cells: &LeafCells) -> Vec<Candidate> {
    let mut out = Vec::new();
    for s in &cells.separators {
        let plane = bsp.tree.planes[s.plane as usize];
        let all: Vec<DVec3> = s
            .portals
            .iter()
            .flat_map(|&p| bsp.portals[p as usize].points.iter().copied())
            .collect();
        let hull = Winding::hull_in_plane(&plane, &all);
        let windings = if hull.area() <= s.area * 1.001 {
            vec![hull]
        } else {
            s.portals
                .iter()
                .map(|&p| Winding::new(bsp.portals[p as usize].points.to_vec()))
                .collect()
        };
        out.extend(windings.into_iter().map(|w| Candidate {
            winding: grown(&w, &plane, 4.0 * bsp.tolerance.plane),
            closed: 0.0,
        }));
    }
    out
}

/// Returns the polygon with each vertex moved out: a candidate must reach past the rim of its opening.
fn grown(w: &Winding, plane: &Plane, by: f64) -> Winding {
    let n = w.points.len();
    let moved = (0..n).map(|i| {
        let (a, p, b) = (
            w.points[(i + n - 1) % n],
            w.points[i],
            w.points[(i + 1) % n],
        );
        let out = |e: DVec3| e.normalize_or_zero().cross(plane.normal);
        let (m, k) = (out(p - a), out(b - p));
        // Sharp vertices would move too far.
        p + (m + k) * (by / (1.0 + m.dot(k)).max(0.1))
    });
    Winding::new(moved.collect())
}
