//! Proposes the separators of a tree as portals.

use std::collections::BTreeMap;

use enfilade_cpg::{Reason, Why};
use enfilade_geom::scene::Scene;
use enfilade_geom::{DVec3, Purse, Triangle, Winding};
use rayon::prelude::*;

use crate::complex::region::RegionShape;
use crate::complex::{Label, LabelSettings, Vote};
use crate::config::BspConfig;
use crate::proposal::Proposal;
use crate::rooms::{self, Basins, Division, DivisionNode, ROOT};
use crate::structure::{Candidate, Frame, OUTDOORS, Structure, grown};
use crate::{BakeConfig, BakeContext, BakeError, Stage};

use super::cells::{self, LeafCells, NO_CELL};
use super::input::input_of;
use super::inside::Soup;
use super::leaves::Bsp;
use super::separator::{self, Separator};
use super::tree::{Tree, leaf_index};
use super::{arrange, guided, lattice, leak, shape};

/// Finds rooms by binary space partition and separators, for levels made of brushes and for clean architectural models.
///
/// # Errors
/// If a setting is invalid, the scene is too large for the voxel budget, or the caller cancels.
pub(crate) fn propose(
    structure: &Structure<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    context.begin(Stage::Tree)?;
    let mut bsp = tree_of(structure, &config.bsp, context.allowance().into());
    let of_tree = bsp.counts();
    context.begin(Stage::Separators)?;
    let mut proposal = if config.bsp.rooms.are_wanted(structure.scene) {
        rooms_of(structure, &mut bsp, config, context)?
    } else {
        cells_of(structure, &bsp)
    };
    context.check()?;
    proposal.counts.extend([
        ("bsp_polygons", of_tree.n_polygons as f64),
        ("bsp_pieces", of_tree.n_pieces as f64),
        ("bsp_splits", of_tree.n_splits as f64),
        ("bsp_leaves", of_tree.n_leaves as f64),
        ("bsp_portals", of_tree.n_portals as f64),
    ]);
    proposal.settings.extend(settings_of(config));
    Ok(proposal)
}

/// Proposes the rooms of a building. The separators that may be a pinch divide the air; which of these parts are one room
/// is decided as for all builders.
fn rooms_of(
    structure: &Structure<'_>,
    bsp: &mut Bsp<'_>,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<Proposal, BakeError> {
    arrange::refine(bsp, &config.merge);
    let found = separator::find_in_walls(bsp).into_par_iter();
    let kept = found.filter(|s| lattice::may_be_pinch(bsp, s, &config.merge));
    let kept: Vec<Separator> = kept.collect();
    let (cell_of_leaf, n_cells) = cells::components(bsp, &kept);
    let guides = guided::separators(bsp);
    let air = rooms::prepare(structure, config, context)?;
    let parts = TreeParts {
        tree: &bsp.tree,
        cell_of_leaf: &cell_of_leaf,
        frame: &structure.frame,
    };
    let basins = Basins::of_parts(&air, &parts, context.allowance());
    let mut proposal = rooms::propose(structure, air, basins, config, context)?;
    proposal.label = label_settings(structure.scene);
    if !bsp.is_open[bsp.outer_leaf() as usize] {
        // The void around a level.
        proposal
            .votes
            .retain(|v| v.label != Label::Region(OUTDOORS));
    }
    proposal.counts.extend([
        ("separators", kept.len() as f64),
        ("cells_before", n_cells as f64),
    ]);
    if !guides.is_empty() {
        guided::divide(bsp, &guides, kept, &mut proposal);
        // At a curved wall a plane leaves slits, through which the votes of its two sides meet.
        proposal.joins_unparted = false;
        proposal.candidates.extend(candidates_of(bsp, &guides));
    }
    Ok(proposal)
}

/// The cells of a tree, in the axes of the grid. Nodes are children as in a [`Node`](super::tree::Node).
struct TreeParts<'a> {
    tree: &'a Tree,
    cell_of_leaf: &'a [u32],
    frame: &'a Frame,
}

impl Division for TreeParts<'_> {
    fn around(&self, node: DivisionNode, center: DVec3, radius: f64) -> DivisionNode {
        let from = if node == ROOT { self.tree.root } else { node };
        self.tree.around(from, self.frame.to_scene(center), radius)
    }

    fn is_part(&self, node: DivisionNode) -> bool {
        node < 0
    }

    fn part_at(&self, node: DivisionNode, p: DVec3) -> Option<u32> {
        // A point is a ball that no plane cuts.
        let leaf = self.around(node, p, 0.0);
        let cell = self.cell_of_leaf[leaf_index(leaf) as usize];
        Some(cell).filter(|&cell| cell != NO_CELL)
    }
}

/// Proposes all cells between separators that cross no other.
fn cells_of(structure: &Structure<'_>, bsp: &Bsp<'_>) -> Proposal {
    let cells = cells::part(bsp, separator::find(bsp));
    let mut votes = votes_of(bsp, &cells);
    if !structure.stairs.is_empty() {
        let matter = Soup::of(&structure.stairs, &[]);
        votes.retain(|v| !matter.is_inside(v.point, bsp.purse));
    }
    Proposal {
        candidates: candidates_of(bsp, &cells.separators),
        label: label_settings(structure.scene),
        joins_unparted: false,
        counts: vec![
            ("separators", cells.separators.len() as f64),
            ("crossing_separators", cells.n_crossing as f64),
            ("cells_before", cells.n_cells as f64),
        ],
        ..Proposal::new(structure.bounds().expanded(1.0), votes)
    }
}

fn tree_of<'a>(structure: &Structure<'_>, config: &BspConfig, purse: Purse<'a>) -> Bsp<'a> {
    let numbers = structure.wall_numbers.iter();
    let objects: Vec<u32> = numbers
        .map(|&t| structure.sources[t as usize].object)
        .collect();
    let inside = leak::inside_of(structure.scene);
    // In scene coordinates, exact.
    let numbers = structure.wall_numbers.iter();
    let walls: Vec<Triangle> = numbers.map(|&t| structure.triangles[t as usize]).collect();
    let input = input_of(structure.scene, &walls, &objects, &inside);
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

/// Returns a vote of each leaf for its cell.
fn votes_of(bsp: &Bsp<'_>, cells: &LeafCells) -> Vec<Vote> {
    // With triangles, the air around everything is a cell, and is labeled as such.
    let outer = cells.of_leaf[bsp.outer_leaf() as usize];
    let label = |cell: u32| {
        if cell == outer {
            OUTDOORS
        } else {
            OUTDOORS + 1 + cell
        }
    };
    let shapes = shape::shapes(&bsp.tree, &bsp.tolerance, bsp.purse);
    let of_leaf = |(&cell, shape): (&u32, Option<RegionShape>)| {
        let shape = shape.filter(|_| cell != NO_CELL)?;
        Some(Vote {
            point: shape.middle,
            label: Label::Region(label(cell)),
            weight: shape.volume as f32,
        })
    };
    cells
        .of_leaf
        .iter()
        .zip(shapes)
        .filter_map(of_leaf)
        .collect()
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
fn candidates_of(bsp: &Bsp<'_>, separators: &[Separator]) -> Vec<Candidate> {
    let mut out = Vec::new();
    for s in separators {
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
            // A candidate must reach past the rim of its opening.
            winding: grown(&w, &plane, 4.0 * bsp.tolerance.plane),
            closed: 0.0,
            why: Why::given(Reason::Plane),
        }));
    }
    out
}
