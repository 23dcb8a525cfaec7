//! The last stage: builds a world from the partition of space.
//!
//! Structural triangles go to batches by the set of cells that see them and by material, so that
//! each is stored, and drawn, once. Detail objects keep their identity and list the cells they touch.

mod bays;
mod fillers;
mod fittings;
mod kinds;
mod seals;
mod weighed;

pub(crate) use seals::{SealPart, batches_of};

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, DetailObject, Locator, Portal, PortalId, PortalKind,
    Provenance, Reason, SourceRuns, Statistics, Why, World,
};
use enfilade_geom::scene::{Mesh, Primitive, Role, Scene};
use enfilade_geom::{Aabb, Allowance, DMat3, DVec3, Plane, Winding};
use rayon::prelude::*;

use crate::budget::WORK_A_LOOK;
use crate::complex::{Label, Partition, PartitionPortal};
use crate::layout::{Layout, layout_of};
use crate::structure::{Candidate, SceneStructure, plates};

/// A scene divided into cells: input of the last stage, which all builders share.
pub(crate) struct Cut<'a> {
    pub(crate) structure: &'a SceneStructure<'a>,
    pub(crate) partition: Partition,
    /// Why each cell is there.
    pub(crate) whys: &'a [Vec<Why>],
    pub(crate) candidates: &'a [Candidate],
    /// Regions that are open land.
    pub(crate) land: Range<u32>,
    /// Distance by which outlines grow, so that rounding never cuts into an opening. [Units: wu]
    pub(crate) outward: f64,
    /// Share of an opening that a leaf or pane must fill to make a door of it.
    pub(crate) closed_share: f64,
    /// Allowance of work for this stage.
    pub(crate) allowance: &'a Allowance,
}

impl Cut<'_> {
    /// Returns `true` for an area of open land.
    fn is_land(&self, cell: u32) -> bool {
        let region = self.partition.label_of_cell[cell as usize].region();
        region.is_some_and(|r| self.land.contains(&r))
    }

    /// Returns why there are two cells at a portal.
    fn why(&self, portal: &PartitionPortal) -> Why {
        let candidate = portal.candidate.map(|c| &self.candidates[c as usize]);
        candidate.map_or_else(|| Why::given(Reason::Gap), |c| c.why.clone())
    }

    /// Returns `true` for the outdoors and for open land.
    fn is_outdoors(&self, cell: u32) -> bool {
        self.partition.outside == Some(cell) || self.is_land(cell)
    }
}

/// A portal and its classification.
struct KnownPortal {
    portal: PartitionPortal,
    kind: PortalKind,
    /// Its lower edge is at a floor, with no sill below it.
    is_on_floor: bool,
    /// A leaf or pane fills it.
    is_filled: bool,
    /// It may be one pane of several.
    is_pane: bool,
}

pub(crate) fn assemble(cut: &Cut<'_>, provenance: Provenance, statistics: Statistics) -> World {
    let partition = &cut.partition;
    let cells: Vec<Cell> = (0..partition.label_of_cell.len())
        .map(|i| {
            let outdoor = partition.outside == Some(i as u32);
            let is_void = !outdoor && matches!(partition.label_of_cell[i], Label::Void(_));
            let b = partition.aabbs[i];
            Cell {
                name: if outdoor {
                    "outdoors".to_owned()
                } else {
                    format!("cell-{i}")
                },
                aabb: [b.min.as_vec3().to_array(), b.max.as_vec3().to_array()],
                volume: partition.volumes[i] as f32,
                outdoor,
                is_void,
                is_land: !outdoor && !is_void && cut.is_land(i as u32),
                why: cut.whys.get(i).cloned().unwrap_or_default(),
                ..Cell::default()
            }
        })
        .collect();
    let portals = portals_of(cut, &|c| cells[c as usize].is_void);
    let graph = CellPortalGraph {
        specials: Vec::new(),
        cells,
        portals,
        locator: partition.locator.clone().into(),
        provenance,
        statistics,
        places: Vec::new(),
    };
    let seals = seals::batches(cut);
    let seen_from = |t: usize| partition.triangle_cells.both(t);
    dressed(
        cut.structure,
        graph,
        &seen_from,
        &|_| None,
        seals,
        cut.allowance,
    )
}

/// Returns the portals of a cut, divided between the objects that fill them.
pub(crate) fn portals_of(cut: &Cut<'_>, is_void: &dyn Fn(u32) -> bool) -> Vec<Portal> {
    let plates = plates(cut.structure.scene);
    let in_turn = cut.partition.portals.par_iter();
    let in_turn = in_turn.filter(cut.allowance.each(WORK_A_LOOK));
    let kinds = kinds::PortalKinds::new(cut);
    let kinds = &kinds;
    let known = in_turn.filter_map(storable).flat_map_iter(|p| {
        let is_whole_filled = kinds.is_filled(&p);
        let parts = fillers::divided(&p, kinds.is_on_floor(&p), &plates, cut.allowance);
        let is_filled = is_whole_filled || parts.len() > 1;
        parts.into_iter().map(move |portal| KnownPortal {
            kind: kinds.kind(&portal, is_filled),
            is_on_floor: kinds.is_on_floor(&portal),
            is_filled,
            is_pane: kinds.is_pane(&portal),
            portal,
        })
    });
    let bays = bays::join_bays(known.collect());
    let mut portals: Vec<Portal> = bays::join_slits(bays, is_void, |p| kinds.kind(p, false))
        .iter()
        .filter_map(|j| portal(cut, j))
        .collect();
    weighed::tell_unweighed(&mut portals);
    portals
}

/// Returns a world of a graph whose cells have neither geometry nor portals yet, and whose portals have no fittings.
/// `seen_from` returns the cells that see a structural triangle, `touched_by` those that an object touches, if known.
pub(crate) fn dressed(
    structure: &SceneStructure<'_>,
    mut graph: CellPortalGraph,
    seen_from: &dyn Fn(usize) -> Vec<u32>,
    touched_by: &(dyn Fn(usize) -> Option<Vec<CellId>> + Sync),
    seals: Vec<Batch>,
    allowance: &Allowance,
) -> World {
    let scene = structure.scene;
    for (i, p) in graph.portals.iter().enumerate() {
        for c in p.cells {
            graph.cells[c.0 as usize].portals.push(PortalId(i as u32));
        }
    }
    let mut batches = batches(structure, seen_from, &mut graph.cells);
    batches.extend(seals);
    let locator = &graph.locator;
    let cells_of = |i: usize| {
        let known = touched_by(i);
        known.unwrap_or_else(|| cells_of_object(scene, i, locator, allowance))
    };
    let (details, detail_meshes) = details(scene, &cells_of, &mut graph.cells);
    let mut world = World {
        graph,
        batches,
        details,
        detail_meshes,
        materials: scene.materials.clone(),
        textures: scene.textures.clone(),
        images: scene.images.clone(),
        leak_path: Vec::new(),
        sources: scene.nodes.clone(),
        fixtures: scene.fixtures.clone(),
        about: scene.about.clone(),
        pvs: None,
        room_facts: None,
    };
    fittings::fit(&mut world, &structure.bvh, allowance);
    world
}

/// Pieces narrower than this vanish when their vertices are rounded to `f32`. [Units: wu]
const HAIR: f64 = 1e-5;

fn to_f32(w: &Winding) -> Vec<[f32; 3]> {
    w.points.iter().map(|p| p.as_vec3().to_array()).collect()
}

fn to_f64(piece: &[[f32; 3]]) -> Winding {
    let point = |&p: &[f32; 3]| DVec3::from(p.map(f64::from));
    Winding::new(piece.iter().map(point).collect())
}

/// Returns `true` if a rounded piece is wider than the rounding.
fn is_there(piece: &[[f32; 3]], normal: DVec3) -> bool {
    let w = to_f64(piece);
    let n = w.points.len();
    let rim: f64 = (0..n)
        .map(|i| w.points[i].distance(w.points[(i + 1) % n]))
        .sum();
    w.area_normal().dot(normal) > HAIR * rim
}

/// Returns the part of a portal that a file can hold, which alone decides on its kind; `None` if there is none.
fn storable(portal: &PartitionPortal) -> Option<PartitionPortal> {
    let mut p = portal.clone();
    p.pieces
        .retain(|w| is_there(&to_f32(w), portal.plane.normal));
    if p.pieces.len() < portal.pieces.len() {
        let points = p.pieces.iter().flat_map(|w| w.points.iter().copied());
        p.outline = Winding::hull_in_plane(&p.plane, &points.collect::<Vec<_>>());
        p.area = p.pieces.iter().map(Winding::area).sum();
    }
    (!p.pieces.is_empty()).then_some(p)
}

/// Returns the portal in its final form; `None` if no piece is wider than the rounding.
fn portal(cut: &Cut<'_>, known: &KnownPortal) -> Option<Portal> {
    let p = &known.portal;
    Some(Portal {
        cells: p.cells.map(CellId),
        kind: known.kind,
        why: vec![cut.why(p)],
        ..rounded_portal(&p.plane, &p.outline, &p.pieces, cut.outward)?
    })
}

/// Returns an open portal as a file stores it, its outline grown by `outward`; the caller sets `cells`.
///
/// `None` if no piece is wider than the rounding.
pub(crate) fn rounded_portal(
    plane: &Plane,
    outline: &Winding,
    pieces: &[Winding],
    outward: f64,
) -> Option<Portal> {
    let mut pieces: Vec<Vec<[f32; 3]>> = pieces.iter().map(to_f32).collect();
    pieces.retain(|piece| is_there(piece, plane.normal));
    if pieces.is_empty() {
        return None;
    }
    Some(Portal {
        cells: [CellId(0); 2],
        kind: PortalKind::Open,
        normal: plane.normal.as_vec3().to_array(),
        outline: to_f32(&grown(outline, plane, outward)),
        area: pieces.iter().map(|piece| to_f64(piece).area()).sum::<f64>() as f32,
        pieces,
        fittings: Vec::new(),
        why: Vec::new(),
    })
}

/// Vertices nearer than this to the line between their neighbors are dropped from outlines, and
/// narrower outlines become rectangles: rounding to `f32` turns short edges arbitrarily, and a
/// turned edge makes a long outline concave. [Units: wu]
const STRAIGHT: f64 = 2e-4;

/// Returns `outline` with its rim moved outward by at least `by`: convex, in the plane, and with
/// edges long enough to keep their directions in `f32`.
fn grown(outline: &Winding, plane: &Plane, by: f64) -> Winding {
    let mut points = outline.points.clone();
    let along = |points: &[DVec3]| {
        let n = points.len();
        (0..n)
            .map(|i| points[(i + 1) % n] - points[i])
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
            .and_then(DVec3::try_normalize)
            .unwrap_or_else(|| plane.basis().0)
    };
    let mut i = 0;
    while points.len() > 3 && i < points.len() {
        let n = points.len();
        let (a, p, b) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
        let off = (b - a).cross(p - a).length() / (b - a).length().max(1e-12);
        if off < STRAIGHT {
            points.remove(i);
            i = i.saturating_sub(1);
        } else {
            i += 1;
        }
    }
    // Each dropped vertex was near the edge that replaced it. But a round outline loses one vertex after
    // another, and the remaining edges pass the first ones farther off.
    let n = points.len();
    let cut_off = (0..n)
        .filter_map(|i| {
            let (a, b) = (points[i], points[(i + 1) % n]);
            let out = (b - a).try_normalize()?.cross(plane.normal);
            outline
                .points
                .iter()
                .map(|p| out.dot(*p - a))
                .max_by(f64::total_cmp)
        })
        .fold(0.0_f64, f64::max);
    let by = by + cut_off;
    let u = along(&points);
    let v = plane.normal.cross(u);
    let range = |d: DVec3| {
        outline
            .points
            .iter()
            .fold((f64::MAX, f64::MIN), |(lo, hi), p| {
                (lo.min(d.dot(*p)), hi.max(d.dot(*p)))
            })
    };
    let ((u0, u1), (v0, v1)) = (range(u), range(v));
    // Each edge moves out along its own normal; vertices move to where the moved edges meet.
    let moved: Option<Vec<DVec3>> = (0..n)
        .map(|i| {
            let (a, p, b) = (points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
            let (e, f) = ((p - a).try_normalize()?, (b - p).try_normalize()?);
            let (m, n) = (e.cross(plane.normal), f.cross(plane.normal));
            let cos_half_squared = (1.0 + m.dot(n)) * 0.5;
            // Vertices sharper than 20 degrees would move too far.
            (cos_half_squared > 0.03).then(|| p + (m + n) * (by * 0.5 / cos_half_squared))
        })
        .collect();
    match moved {
        Some(moved) if n > 3 && v1 - v0 > 100.0 * STRAIGHT => Winding::new(moved),
        _ => {
            let origin = plane.normal * -plane.d;
            let corner = |s: f64, t: f64| origin + u * s + v * t;
            Winding::new(vec![
                corner(u0 - by, v0 - by),
                corner(u1 + by, v0 - by),
                corner(u1 + by, v1 + by),
                corner(u0 - by, v1 + by),
            ])
        }
    }
}

#[derive(Default)]
struct BatchBuilder {
    primitive: Primitive,
    vertices: HashMap<(u32, u32, u32), u32>,
    /// Sources of its triangles, where known.
    sources: SourceRuns,
}

fn batches(
    structure: &SceneStructure<'_>,
    seen_from: &dyn Fn(usize) -> Vec<u32>,
    cells: &mut [Cell],
) -> Vec<Batch> {
    let scene = structure.scene;
    let mut builders: BTreeMap<(Vec<u32>, Option<u32>, Layout), BatchBuilder> = BTreeMap::new();
    let mut normal_matrix: Option<(u32, DMat3)> = None;
    for (t, source) in structure.sources.iter().enumerate() {
        let seen_from = seen_from(t);
        for &c in &seen_from {
            cells[c as usize].n_triangles += 1;
        }
        let object = &scene.objects[source.object as usize];
        let from = &scene.meshes[object.mesh as usize].primitives[source.primitive as usize];
        if normal_matrix.is_none_or(|(o, _)| o != source.object) {
            let m = DMat3::from_mat4(object.transform);
            normal_matrix = Some((source.object, m.inverse().transpose()));
        }
        let normals = normal_matrix.map_or(DMat3::IDENTITY, |(_, m)| m);
        let layout = layout_of(from);
        let builder = builders
            .entry((seen_from, from.material, layout))
            .or_default();
        if let Some(node) = object.node {
            builder.sources.push(node, 1);
        }
        let to = &mut builder.primitive;
        to.material = from.material;
        to.uvs.resize(from.uvs.len(), Vec::new());
        for (corner, position) in structure.triangles[t].iter().enumerate() {
            let v = from.indices[source.triangle as usize * 3 + corner];
            let key = (source.object, source.primitive, v);
            let index = *builder.vertices.entry(key).or_insert_with(|| {
                let i = v as usize;
                to.positions.push(position.as_vec3().to_array());
                if layout.0 {
                    to.normals.push(turned(from.normals[i], |n| normals * n));
                }
                if layout.1 {
                    let [x, y, z, w] = from.tangents[i];
                    let [x, y, z] = turned([x, y, z], |n| object.transform.transform_vector3(n));
                    to.tangents.push([x, y, z, w]);
                }
                for (set, uvs) in to.uvs.iter_mut().zip(&from.uvs) {
                    set.push(uvs[i]);
                }
                if layout.3 {
                    to.colors.push(from.colors[i]);
                }
                to.positions.len() as u32 - 1
            });
            to.indices.push(index);
        }
    }
    builders
        .into_iter()
        .map(|((cells, _, _), b)| Batch {
            cells: cells.into_iter().map(CellId).collect(),
            sources: b.sources.of_all(b.primitive.indices.len() / 3),
            primitive: b.primitive,
            is_seal: false,
        })
        .collect()
}

/// Returns a direction moved by `by` and normalized; unchanged if that fails.
fn turned(n: [f32; 3], by: impl Fn(DVec3) -> DVec3) -> [f32; 3] {
    let v = DVec3::new(n[0].into(), n[1].into(), n[2].into());
    by(v).try_normalize().map_or(n, |v| v.as_vec3().to_array())
}

fn details(
    scene: &Scene,
    cells_of: &(dyn Fn(usize) -> Vec<CellId> + Sync),
    cells: &mut [Cell],
) -> (Vec<DetailObject>, Vec<Mesh>) {
    let ids: Vec<usize> = (0..scene.objects.len())
        .filter(|&i| scene.objects[i].role == Role::Detail)
        .collect();
    let touched: Vec<Vec<CellId>> = ids.par_iter().map(|&i| cells_of(i)).collect();
    let mut meshes = Vec::new();
    let mut new_index: HashMap<u32, u32> = HashMap::new();
    let mut out = Vec::new();
    for (&i, touched) in ids.iter().zip(touched) {
        let object = &scene.objects[i];
        let mesh = &scene.meshes[object.mesh as usize];
        let n: usize = mesh.primitives.iter().map(|p| p.indices.len() / 3).sum();
        for c in &touched {
            cells[c.0 as usize].n_detail_triangles += n as u32;
        }
        let mesh = *new_index.entry(object.mesh).or_insert_with(|| {
            meshes.push(mesh.clone());
            meshes.len() as u32 - 1
        });
        out.push(DetailObject {
            name: object.name.clone(),
            mesh,
            transform: object.transform.to_cols_array().map(|v| v as f32),
            cells: touched,
            source: object.node,
            part_of: None,
        });
    }
    (out, meshes)
}

/// Returns the cells that an object's triangles touch; for an object buried in solid matter (a door
/// frame in its wall), the cells around it.
fn cells_of_object(
    scene: &Scene,
    object: usize,
    locator: &Locator,
    allowance: &Allowance,
) -> Vec<CellId> {
    let o = &scene.objects[object];
    let mut cells = Vec::new();
    for p in &scene.meshes[o.mesh as usize].primitives {
        let triangles = p.placed_triangles(o.transform);
        for triangle in triangles.filter(allowance.each(WORK_A_LOOK)) {
            locator.cells_touching(&triangle, &mut cells);
        }
    }
    if cells.is_empty() {
        let b: Aabb = scene.object_aabb(object);
        for margin in [0.05, 0.2, 0.5] {
            let around = b.expanded(margin);
            let corners: Vec<DVec3> = (0..8)
                .map(|k| {
                    let pick = |bit: i32, lo: f64, hi: f64| if k & bit == 0 { lo } else { hi };
                    DVec3::new(
                        pick(1, around.min.x, around.max.x),
                        pick(2, around.min.y, around.max.y),
                        pick(4, around.min.z, around.max.z),
                    )
                })
                .collect();
            locator.cells_touching(&corners, &mut cells);
            if !cells.is_empty() {
                break;
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A slit above a sill, and a hair beside it as high as a door.
    #[test]
    fn pieces_that_a_file_cannot_hold_have_no_say() {
        let plane = Plane::through(DVec3::ZERO, DVec3::X);
        let piece = |[z0, z1]: [f64; 2], high: f64| {
            let points = [(0.0, z0), (high, z0), (high, z1), (0.0, z1)];
            Winding::hull_in_plane(&plane, &points.map(|(y, z)| DVec3::new(0.0, y, z)))
        };
        let (slit, hair) = (piece([0.0, 0.01], 0.5), piece([1.0, 1.000_004], 2.0));
        let both: Vec<DVec3> = slit.points.iter().chain(&hair.points).copied().collect();
        let portal = |pieces: Vec<Winding>| PartitionPortal {
            cells: [0, 1],
            plane,
            outline: Winding::hull_in_plane(&plane, &both),
            area: pieces.iter().map(Winding::area).sum(),
            pieces,
            candidate: None,
            width: 0.01,
            kind: PortalKind::Open,
            is_leak: false,
        };
        let held = storable(&portal(vec![slit.clone(), hair.clone()])).expect("a slit");
        assert_eq!(held.pieces, [slit]);
        assert!(held.outline.points.iter().all(|p| p.y <= 0.5));
        assert!((held.area - 0.005).abs() < 1e-9);
        assert!(storable(&portal(vec![hair])).is_none());
    }

    proptest! {
        /// Vertices on an arc all lie near the lines between their neighbors.
        #[test]
        fn a_grown_outline_goes_around_the_outline(
            n in 3..200_usize,
            size in (0.001..5.0, 0.001..5.0_f64),
            arc in 0.01..std::f64::consts::TAU,
            by in 0.0..1e-3,
        ) {
            let plane = Plane::through(DVec3::new(1.0, 2.0, 3.0), DVec3::new(0.6, 0.0, 0.8));
            let (u, v) = plane.basis();
            let origin = plane.normal * -plane.d;
            let outline = Winding::new(
                (0..n)
                    .map(|i| (i as f64 * arc / n as f64).sin_cos())
                    .map(|(sin, cos)| origin + u * (size.0 * cos) + v * (size.1 * sin))
                    .collect(),
            );
            let grown = grown(&outline, &plane, by).points;
            for i in 0..grown.len() {
                let (a, b) = (grown[i], grown[(i + 1) % grown.len()]);
                let out = (b - a).normalize().cross(plane.normal);
                for p in &outline.points {
                    // Rounding of coordinates up to 10 in `f64`.
                    prop_assert!(out.dot(*p - a) <= 1e-12 - by, "{} at {p}", out.dot(*p - a) + by);
                }
            }
        }
    }
}
