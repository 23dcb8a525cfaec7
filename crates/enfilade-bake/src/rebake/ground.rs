//! Decisions of the whole scene: the settings, the frame, the grid, where storeys end. If any of it changed, all rooms may have.

use std::collections::HashSet;

use enfilade_cpg::World;
use enfilade_geom::scene::Scene;
use enfilade_geom::{Aabb, Bvh, Triangle};

use super::diff::{Diff, NEW};
use super::outcome::{RebakeError, WholeBecause};
use crate::decided::in_words;
use crate::rooms::WholeAir;
use crate::simplify::SimplifySettings;
use crate::structure::{Frame, SceneStructure, Site, Structure, bounds_of, sites, slabs_of};
use crate::{BakeConfig, BakeContext, Method, Outdoors, SmallestHole};

/// Greatest turn of the grid that is rounding: few walls of a building that stands askew are exactly parallel. [Units: rad]
const TURN: f64 = 1e-5;
/// … and greatest shift: far less than a voxel. [Units: wu]
const SHIFT: f64 = 1e-3;

/// The new scene as a whole, which the parts of it that are baked share.
pub(super) struct Ground<'a> {
    pub(super) structure: Structure<'a>,
    pub(super) scene: SceneStructure<'a>,
    /// Box of each structural triangle in frame coordinates.
    pub(super) boxes: Vec<Aabb>,
    pub(super) air: WholeAir,
    /// The box that the complex of a whole bake divides, in scene coordinates.
    pub(super) bounds: Aabb,
    pub(super) diff: Diff,
}

/// Checks that a world can be rebaked by these settings.
pub(super) fn check(old: &World, config: &BakeConfig) -> Result<(), RebakeError> {
    let was = &old.graph.provenance;
    let cuts = (!asks_for_costs(config)).then_some(("cost_cuts", "cut to a bound on costs"));
    for (count, by) in [("edits", "edited by hand")].into_iter().chain(cuts) {
        if old
            .graph
            .statistics
            .counts
            .get(count)
            .is_some_and(|n| *n > 0.0)
        {
            return Err(RebakeError::Changed { by });
        }
    }
    if old.batches.iter().all(|b| b.primitive.indices.is_empty()) {
        return Err(RebakeError::NoGeometry);
    }
    if let Some(method) = config.method
        && was.method != method.name()
    {
        return Err(RebakeError::Setting {
            name: "method".to_owned(),
            was: was.method.clone(),
            now: method.name().to_owned(),
        });
    }
    if was.method != Method::Watershed.name() {
        return Ok(());
    }
    let mut now = config.voxel_settings();
    now.insert("noise".to_owned(), config.noise.to_string());
    if config.smallest_hole != SmallestHole::Auto {
        now.insert("smallest_hole".to_owned(), config.smallest_hole.to_string());
    }
    now.insert("decisions".to_owned(), in_words(&config.decisions));
    for (name, now) in now {
        let was = was.settings.get(&name).cloned().unwrap_or_default();
        if was != now {
            return Err(RebakeError::Setting { name, was, now });
        }
    }
    Ok(())
}

/// Returns `true` if cells are to be cut or merged by their costs.
fn asks_for_costs(config: &BakeConfig) -> bool {
    let nothing = SimplifySettings {
        cost: config.costs.cost.clone(),
        outdoors: config.costs.outdoors,
        ..SimplifySettings::default()
    };
    config.costs != nothing
}

/// Returns the reason why parts of a scene cannot be baked on their own, known before any work.
pub(super) fn why_whole(old: &World, scene: &Scene, config: &BakeConfig) -> Option<WholeBecause> {
    let chosen = Method::choose(config.method, scene).0;
    if old.graph.provenance.method != Method::Watershed.name() || chosen != Method::Watershed {
        Some(WholeBecause::Method)
    } else if asks_for_costs(config) {
        Some(WholeBecause::Costs)
    } else if !config.decisions.is_empty() {
        Some(WholeBecause::Decisions)
    } else if !scene.marks.is_empty() || !old.graph.specials.is_empty() {
        Some(WholeBecause::Specials)
    } else if config.outdoors != Outdoors::Whole || old.graph.cells.iter().any(|c| c.is_land) {
        Some(WholeBecause::Land)
    } else if !scene.solids.is_empty() || old.graph.indoor_cells().count() <= 1 {
        Some(WholeBecause::Kind)
    } else {
        None
    }
}

impl<'a> Ground<'a> {
    /// Prepares the new scene, and compares it with the old world.
    ///
    /// # Errors
    /// As those of a bake; if nothing of the scene is in the old world.
    pub(super) fn of(
        old: &World,
        scene: &'a Scene,
        config: &BakeConfig,
        context: &'a BakeContext<'_>,
    ) -> Result<Result<Self, WholeBecause>, RebakeError> {
        let allowance = context.allowance();
        let (structure, tree) = Structure::with_tree(scene, Method::Watershed, config, allowance)?;
        let frame = structure.frame;
        let of_scene = SceneStructure {
            scene,
            sources: structure.sources.clone(),
            triangles: structure.triangles.clone(),
            bvh: match tree {
                Some(tree) => tree,
                None if frame.is_scene() => structure.bvh.clone(),
                None => Bvh::build(&structure.triangles),
            },
            missing: structure
                .missing
                .iter()
                .map(|t| t.map(|p| frame.to_scene(p)))
                .collect(),
            hole: structure.hole,
        };
        let sites = structure.sites(config.min_opening);
        let (diff, air) = rayon::join(
            || Diff::of(old, &of_scene),
            || WholeAir::of(&structure, &sites, config, context),
        );
        if diff.n_common() == 0 {
            return Err(RebakeError::Stranger);
        }
        let hole = structure.hole.to_string();
        if old.graph.provenance.settings.get("smallest_hole") != Some(&hole) {
            return Ok(Err(WholeBecause::Misfit));
        }
        let Some(air) = air? else {
            return Ok(Err(WholeBecause::Site));
        };
        context.check()?;
        if let Some(why) = why_other(old, &structure, &sites, &air, &diff, config) {
            return Ok(Err(why));
        }
        let inner = Aabb::of_points(structure.triangles.as_flattened());
        // As the complex does.
        let inner = inner.expanded(0.05 + 0.001 * inner.size().max_element());
        let boxes = structure.triangles.iter().map(|t| {
            let points = t.map(|p| frame.to_grid(p));
            Aabb::of_points(&points)
        });
        Ok(Ok(Self {
            bounds: frame.aabb_to_scene(&air.grid.aabb()).union(inner),
            boxes: boxes.collect(),
            scene: of_scene,
            structure,
            air,
            diff,
        }))
    }

    /// Returns the box, in frame coordinates, around a box in scene coordinates.
    pub(super) fn to_frame(&self, b: &Aabb) -> Aabb {
        let corners = b.corners().map(|p| self.structure.frame.to_grid(p));
        Aabb::of_points(&corners)
    }
}

/// Returns what differs between the whole old scene and the whole new one, so that rooms far from the change may differ, too.
fn why_other(
    old: &World,
    structure: &Structure<'_>,
    now: &[Site],
    air: &WholeAir,
    diff: &Diff,
    config: &BakeConfig,
) -> Option<WholeBecause> {
    let kept = structure.triangles.iter().zip(&diff.batch_of);
    let kept: Vec<Triangle> = kept.filter(|t| *t.1 != NEW).map(|t| *t.0).collect();
    let all: Vec<Triangle> = kept.iter().chain(&diff.removed).copied().collect();
    let frame = structure.frame;
    if !frame.is_near(Frame::of(&all), TURN) {
        return Some(WholeBecause::Frame);
    }
    let framed = frame.triangles_to_grid(&all);
    if !are_near(&bounds_of(&framed), &structure.bounds()) {
        return Some(WholeBecause::Bounds);
    }
    let bits = |t: &Triangle| t.map(|p| p.to_array().map(f64::to_bits));
    let stairs: HashSet<_> = structure.stairs.iter().map(bits).collect();
    let mut walls = framed.into_owned();
    walls.retain(|t| !stairs.contains(&bits(t)));
    let before = sites(
        &walls,
        &structure.bounds(),
        config.min_opening,
        structure.allowance,
    );
    let mut pairs = before.iter().zip(now);
    if before.len() != now.len() || !pairs.all(|(a, b)| are_near(&a.bounds, &b.bounds)) {
        return Some(WholeBecause::Site);
    }
    let counts = &old.graph.statistics.counts;
    let count = |name: &str| counts.get(name).copied().unwrap_or(0.0);
    let is_same = count("voxels") == air.grid.n_voxels() as f64;
    if !is_same || (count("voxel_size") - air.grid.voxel).abs() > 1e-9 * air.grid.voxel {
        return Some(WholeBecause::Grid);
    }
    let slabs = slabs_of(&walls, &now[0].core);
    if slabs != air.slabs {
        return Some(WholeBecause::Storeys);
    }
    None
}

/// Returns `true` if two boxes are the same up to rounding, so that voxels are where they were.
fn are_near(a: &Aabb, b: &Aabb) -> bool {
    let off = (a.min - b.min).abs().max((a.max - b.max).abs());
    off.max_element() <= SHIFT
}
