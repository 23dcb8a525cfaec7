//! A bake whose portals are the separators of a tree.

use enfilade_geom::scene::{Role, Scene};
use enfilade_geom::{Bvh, DVec3, Plane, Triangle, Winding};

use crate::assemble::Cut;
use crate::bound::keep_bounds;
use crate::complex::region::Shape;
use crate::complex::{ComplexInput, LabelSettings, Vote, build_complex};
use crate::pipeline::structural_triangles;
use crate::simplify::SimplifySettings;
use crate::watershed::{
    MergeSettings, OUTDOORS, Screen, bounds_of, closure_triangles, find_stairs, slab_heights,
};
use crate::{BakeContext, BakeError, BakeOutput, SmallestHole};

use super::cells::{self, Cells, NO_CELL};
use super::inside::Soup;
use super::rooms::{self, Evidence};
use super::{Bsp, BspInput, Guide, Heuristic, arrange, guided, leak, separator, shape};

/// Settings of a bake by binary space partition.
#[derive(Clone, Debug, Default)]
pub struct BspConfig {
    /// How planes are chosen.
    pub heuristic: Heuristic,
    /// Planes to begin with.
    pub guide: Guide,
    /// Bounds on the cells, and what a cell costs. Cells above the upper bound are cut.
    pub simplify: SimplifySettings,
    /// Whether cells become rooms by the shape of the openings between them.
    pub rooms: Rooms,
    /// What that goes by: the same settings as in the watershed builder.
    pub merge: MergeSettings,
    /// Narrower openings are closed by seals.
    pub smallest_hole: SmallestHole,
}

/// Which separators are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rooms {
    /// Those of [`Rooms::Always`] where structure is triangles, those of [`Rooms::Never`] where it is
    /// brushes: a level is a chain of passages as wide as what they join, and would be one room.
    #[default]
    Auto,
    /// Those that are narrower than what lies beside them.
    Always,
    /// All that cross no other (Lefebvre & Hornus 2003, §2.1 step 2).
    Never,
}

/// Finds rooms and doorways of a scene by binary space partition and separators.
///
/// For levels made of brushes and for clean architectural models. The same promises as
/// [`crate::bake`]: the world comes out of the same cell complex.
///
/// # Errors
/// When nothing is structural, a cost is given for a material that the scene has not, or the caller cancels.
pub fn bake_bsp(
    scene: &Scene,
    config: &BspConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    // 1. Leaves and their portals; separators; cells.
    context.bsp_stage(0)?;
    config.simplify.cost.check(&scene.materials)?;
    let (sources, triangles) = structural_triangles(scene);
    if triangles.is_empty() {
        return Err(BakeError::NothingStructural {
            n_objects: scene.objects.len(),
        });
    }
    let bvh = Bvh::build(&triangles);
    // Stairs stand in rooms and bound none; brushes say by their class what is detail.
    let is_stair = if scene.solids.is_empty() {
        find_stairs(&sources, &triangles)
    } else {
        vec![false; triangles.len()]
    };
    let of_kind = |stairs: bool| -> Vec<Triangle> {
        let all = triangles.iter().zip(&is_stair);
        all.filter(|t| *t.1 == stairs).map(|t| *t.0).collect()
    };
    let (walls, stairs) = (of_kind(false), of_kind(true));
    let objects: Vec<u32> = sources
        .iter()
        .zip(&is_stair)
        .filter(|s| !*s.1)
        .map(|s| s.0.object)
        .collect();
    let inside = leak::inside_of(scene);
    let mut bsp = guided::build(
        &input_of(scene, &walls, &objects, &inside),
        config.heuristic,
        &config.guide,
    );
    let counts = bsp.counts();
    context.bsp_stage(1)?;
    let Parted {
        cells: parted,
        shapes,
        is_narrow,
    } = Parted::of(scene, &mut bsp, &walls, config);
    let screens = screens_of(&bsp, &parted);
    let mut votes = Votes::of(&bsp, &parted, &shapes, &is_narrow);
    if !stairs.is_empty() {
        let matter = Soup::of(&stairs, &[]);
        votes.0.retain(|v| !matter.is_inside(v.point));
    }
    let n_before = parted.n_cells;
    let n_separators = parted.separators.len();

    // 2. The complex makes it exact.
    context.bsp_stage(2)?;
    let windings: Vec<Winding> = screens.iter().map(|s| s.winding.clone()).collect();
    let complex = build_complex(&ComplexInput {
        triangles: &triangles,
        screens: &windings,
        bounds: bounds_of(&triangles).expanded(1.0),
        gap: config.smallest_hole.gap(),
        has_seals: config.smallest_hole.has_seals(),
    });
    context.bsp_stage(3)?;
    let settings = if scene.solids.is_empty() {
        LabelSettings::default()
    } else {
        // A cell of the tree is a cell whatever its size: what is too small is the simplifier's to say.
        LabelSettings {
            min_volume: 0.0,
            min_room: 0.0,
            dominance: 1.0,
            strong_share: 0.2,
            ..LabelSettings::default()
        }
    };
    let partition = complex.partition(&votes.0, &settings);
    let outward = complex.opening_tolerance();
    let statistics = [
        ("bsp_polygons", counts.n_polygons as f64),
        ("bsp_pieces", counts.n_pieces as f64),
        ("bsp_splits", counts.n_splits as f64),
        ("bsp_leaves", counts.n_leaves as f64),
        ("bsp_portals", counts.n_portals as f64),
        ("separators", n_separators as f64),
        ("crossing_separators", parted.n_crossing as f64),
        ("cells_before", n_before as f64),
        ("leaves", complex.n_leaves() as f64),
    ];
    drop(complex);

    // 3. Geometry to the cells that see it, and cells within their bounds.
    context.bsp_stage(4)?;
    let leaks = partition.leaks.clone();
    let world = Cut {
        scene,
        sources: &sources,
        triangles: &triangles,
        bvh: &bvh,
        partition,
        screens: &screens,
        outward,
        closed_share: 1.1,
    }
    .into_world("bsp", config.to_settings(), &statistics);
    let bounded = keep_bounds(&world, &config.simplify);
    context.end_stage();
    Ok(BakeOutput {
        notes: bounded.note().into_iter().collect(),
        world: bounded.world,
        voxel: 0.0,
        dims: [0; 3],
        times: context.times(),
        leaks,
    })
}

/// The leaves by cell.
struct Parted {
    cells: Cells,
    shapes: Vec<Option<Shape>>,
    /// Whether each leaf is of what is too narrow for a room, where shape tells rooms; a guide's cells are as narrow as it
    /// says.
    is_narrow: Vec<bool>,
}

impl Parted {
    fn of(scene: &Scene, bsp: &mut Bsp, walls: &[Triangle], config: &BspConfig) -> Self {
        let by_shape = match config.rooms {
            Rooms::Auto => scene.solids.is_empty(),
            rooms => rooms == Rooms::Always,
        };
        if !by_shape {
            return Self {
                cells: cells::part(bsp, separator::find(bsp)),
                shapes: shape::shapes(&bsp.tree, &bsp.tolerance),
                is_narrow: Vec::new(),
            };
        }
        let settings = &config.merge;
        arrange::refine(bsp, settings);
        let shapes = shape::shapes(&bsp.tree, &bsp.tolerance);
        let evidence = Evidence {
            shapes: &shapes,
            closures: &Bvh::build(&closure_triangles(scene, &Bvh::build(walls))),
            slabs: &slab_heights(walls),
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
}

impl BspConfig {
    fn to_settings(&self) -> std::collections::BTreeMap<String, String> {
        let mut out = self.simplify.to_settings();
        out.insert(
            "bsp.heuristic".to_owned(),
            format!("{:?}", self.heuristic).to_lowercase(),
        );
        out.insert(
            "bsp.rooms".to_owned(),
            format!("{:?}", self.rooms).to_lowercase(),
        );
        out.insert("smallest_hole".to_owned(), self.smallest_hole.to_string());
        let number = |v: Option<f64>| v.map_or_else(|| "none".to_owned(), |v| v.to_string());
        out.insert("bsp.grid".to_owned(), number(self.guide.grid));
        out.insert("bsp.tetrahedra".to_owned(), number(self.guide.tetrahedra));
        out.insert("bsp.planes".to_owned(), self.guide.planes.len().to_string());
        out.insert("bsp.boxes".to_owned(), self.guide.boxes.len().to_string());
        out
    }
}

/// Brushes where the whole structure is made of them, its triangles where not.
pub(super) fn input_of<'a>(
    scene: &'a Scene,
    triangles: &'a [Triangle],
    objects: &'a [u32],
    inside: &'a [DVec3],
) -> BspInput<'a> {
    let is_brushes = !scene.solids.is_empty()
        && scene
            .objects
            .iter()
            .filter(|o| o.role == Role::Structural)
            .all(|o| o.reason.starts_with("map: "));
    BspInput {
        triangles,
        objects,
        solids: if is_brushes { &scene.solids } else { &[] },
        inside: if is_brushes { inside } else { &[] },
    }
}

/// A screen for each separator whose portals fill their hull, for each portal otherwise.
fn screens_of(bsp: &Bsp, cells: &Cells) -> Vec<Screen> {
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
        let leaves = bsp.portals[s.portals[0] as usize].leaves;
        let regions = leaves.map(|l| cells.of_leaf[l as usize]);
        out.extend(
            windings
                .into_iter()
                .map(|w| screen(&grown(&w, &plane, 4.0 * bsp.tolerance.plane), regions)),
        );
    }
    out
}

fn screen(winding: &Winding, regions: [u32; 2]) -> Screen {
    Screen {
        regions,
        winding: winding.clone(),
        area: winding.area(),
        bounded: true,
        closed: 0.0,
    }
}

/// The polygon with each corner moved out: a screen must reach past the rim of its opening.
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
        // Sharp corners would run far off.
        p + (m + k) * (by / (1.0 + m.dot(k)).max(0.1))
    });
    Winding::new(moved.collect())
}

/// A vote of each leaf for its cell.
struct Votes(Vec<Vote>);

impl Votes {
    fn of(bsp: &Bsp, cells: &Cells, shapes: &[Option<Shape>], is_narrow: &[bool]) -> Self {
        // With triangles the air around everything is a cell; its label says so.
        let outer = cells.of_leaf[bsp.outer_leaf() as usize];
        let label = |cell: u32| {
            if cell == outer {
                OUTDOORS
            } else {
                OUTDOORS + 1 + cell
            }
        };
        let of_leaf = |(leaf, shape): (usize, &Option<Shape>)| {
            let (cell, shape) = (cells.of_leaf[leaf], (*shape)?);
            // What leaks from a narrow one into a room is part of that room; the complex sees to it.
            let counts = cell != NO_CELL && !is_narrow.get(leaf).is_some_and(|n| *n);
            counts.then(|| Vote {
                point: shape.middle,
                label: label(cell),
                weight: shape.volume as f32,
            })
        };
        Self(shapes.iter().enumerate().filter_map(of_leaf).collect())
    }
}
