//! Occluders: large polygons inside cells, and their shadows.
//!
//! A thing entirely in the shadow of one convex polygon is not seen (Hudson et al., "Accelerated
//! Occlusion Culling using Shadow Frusta", 1997; proposed for cells by Dirkse 2002, section 8.4).
//! Rooms gain nothing, since their walls hide nothing in them. Big cells do: the outdoors, halls, open plan.
//!
//! **Errs to visible.** Polygons consist of whole triangles, opaque and seen from their front, and are then
//! shrunk; shadows are not joined.

use std::collections::HashMap;

use enfilade_cpg::World;
use enfilade_geom::scene::Material;
use enfilade_geom::{DVec3, Triangle, triangle_area_normal};
use glam::{Vec3, Vec4};

use crate::options::SightOptions;
use crate::point::point;

/// Maximum number of vertices of an occluder.
pub(crate) const MAX_CORNERS: usize = 8;
/// Maximum number of shadows used in one visit.
const MAX_SHADOWS: usize = 4;
/// Largest distance of a vertex from a triangle's plane at which it still lies in the plane: merged polygons
/// are as flat as the rounding of their vertices. [Units: wu]
const FLAT: f64 = 1e-5;
/// Shift of vertices towards the middle; it outweighs [`FLAT`] and rounding. [Units: wu]
const SHRINK: f64 = 1e-3;
/// Smallest distance behind a polygon at which a thing counts as hidden by it. [Units: wu]
const BEHIND: f64 = 0.5;

#[derive(Clone, Debug)]
pub(crate) struct Occluder {
    pub(crate) normal: DVec3,
    pub(crate) corners: [DVec3; MAX_CORNERS],
    pub(crate) n_corners: usize,
    pub(crate) middle: DVec3,
    pub(crate) area: f64,
    pub(crate) is_two_sided: bool,
}

/// The occluders of all cells, by cell.
#[derive(Clone, Debug, Default)]
pub(crate) struct Occluders {
    /// Those of cell `c` are `all[first[c]..first[c + 1]]`.
    pub(crate) first: Vec<u32>,
    pub(crate) all: Vec<Occluder>,
}

/// Returns `true` if a surface of this material hides everything behind it.
fn is_opaque(material: Option<&Material>) -> bool {
    // Masked materials have holes. The text is not parsed: a name that contains the word only costs an
    // occluder.
    material.is_none_or(|m| !m.transparent && !m.gltf.contains("MASK") && m.base_color[3] >= 1.0)
}

type Key = [u32; 3];

/// Finds the large polygons of each cell with other things of the cell behind them.
pub(crate) fn occluders_of(world: &World, options: &SightOptions, tolerance: f64) -> Occluders {
    let n_cells = world.graph.cells.len();
    let mut out = Occluders {
        first: vec![0; n_cells + 1],
        all: Vec::new(),
    };
    if options.occluders == 0 {
        return out;
    }
    let mut triangles: Vec<(Triangle, [Key; 3], bool)> = Vec::new();
    let mut by_cell: Vec<Vec<u32>> = vec![Vec::new(); n_cells];
    for batch in &world.batches {
        let material = batch
            .primitive
            .material
            .and_then(|m| world.materials.get(m as usize));
        if !is_opaque(material) {
            continue;
        }
        let is_two_sided = material.is_some_and(|m| m.double_sided);
        for t in batch.primitive.triples() {
            let corners = t.map(|i| batch.primitive.positions[i as usize]);
            for c in &batch.cells {
                by_cell[c.0 as usize].push(triangles.len() as u32);
            }
            let keys = corners.map(|p| p.map(|x| (x + 0.0).to_bits()));
            triangles.push((corners.map(point), keys, is_two_sided));
        }
    }
    // Directed edge to triangle; an edge used twice in one direction is left to the first.
    let mut edges: HashMap<(Key, Key), u32> = HashMap::new();
    for (i, (_, k, _)) in triangles.iter().enumerate() {
        for e in 0..3 {
            edges.entry((k[e], k[(e + 1) % 3])).or_insert(i as u32);
        }
    }
    let area_of = |i: u32| triangle_area_normal(&triangles[i as usize].0).length() * 0.5;
    for (c, list) in by_cell.iter_mut().enumerate() {
        list.sort_by(|&a, &b| area_of(b).total_cmp(&area_of(a)).then(a.cmp(&b)));
        // Midpoints of everything that could be hidden: triangles and portals.
        let mut targets: Vec<DVec3> = list
            .iter()
            .map(|&i| {
                let t = &triangles[i as usize].0;
                (t[0] + t[1] + t[2]) / 3.0
            })
            .collect();
        for portal in &world.graph.cells[c].portals {
            let outline = world.graph.portals.get(portal.0 as usize);
            targets.extend(outline.iter().map(|p| {
                p.outline.iter().map(|&p| point(p)).sum::<DVec3>() / p.outline.len().max(1) as f64
            }));
        }
        let mut found: Vec<Occluder> = Vec::new();
        let mut is_used: HashMap<u32, ()> = HashMap::new();
        for &seed in list.iter().take(8 * options.occluders) {
            if is_used.contains_key(&seed) {
                continue;
            }
            let occluder = grow(seed, &triangles, &edges, &mut is_used);
            let Some(occluder) = occluder else { continue };
            if occluder.area < f64::from(options.occluder_area) {
                continue;
            }
            let n_behind = targets
                .iter()
                .filter(|&&p| {
                    let d = occluder.normal.dot(p - occluder.middle);
                    d < -BEHIND || (occluder.is_two_sided && d > BEHIND)
                })
                .count();
            // A few triangles behind a wall are its reveals and window sills.
            if n_behind >= 4 {
                found.push(occluder);
            }
        }
        found.sort_by(|a, b| b.area.total_cmp(&a.area));
        found.truncate(options.occluders);
        for o in &mut found {
            o.shrink(SHRINK.max(4.0 * tolerance));
        }
        out.all.append(&mut found);
        out.first[c + 1] = out.all.len() as u32;
    }
    out
}

/// Grows a triangle into a polygon by adding coplanar neighbors while it stays convex.
fn grow(
    seed: u32,
    triangles: &[(Triangle, [Key; 3], bool)],
    edges: &HashMap<(Key, Key), u32>,
    is_used: &mut HashMap<u32, ()>,
) -> Option<Occluder> {
    let (first, keys, is_two_sided) = &triangles[seed as usize];
    let normal = triangle_area_normal(first).try_normalize()?;
    let mut ring: Vec<(DVec3, Key)> = (0..3).map(|k| (first[k], keys[k])).collect();
    is_used.insert(seed, ());
    let turn = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - b).dot(normal);
    let mut i = 0;
    let mut n_failed = 0;
    while n_failed < ring.len() {
        let n = ring.len();
        let (a, b) = (ring[i % n], ring[(i + 1) % n]);
        let grown = (|| {
            let &other = edges.get(&(b.1, a.1))?;
            let (t, k, two_sided) = &triangles[other as usize];
            if is_used.contains_key(&other) || two_sided != is_two_sided {
                return None;
            }
            let e = (0..3).find(|&e| k[e] == b.1)?;
            let (tip, key) = (t[(e + 2) % 3], k[(e + 2) % 3]);
            let facing = triangle_area_normal(t).try_normalize()?;
            if normal.dot(tip - first[0]).abs() > FLAT || facing.dot(normal) < 1.0 - 1e-6 {
                return None;
            }
            let before = ring[(i + n - 1) % n].0;
            let after = ring[(i + 2) % n].0;
            // Convex at the old vertices, which may come to lie on a straight edge.
            if turn(before, a.0, tip) < 0.0 || turn(tip, b.0, after) < 0.0 {
                return None;
            }
            Some((other, tip, key))
        })();
        let Some((other, tip, key)) = grown else {
            i = (i + 1) % n;
            n_failed += 1;
            continue;
        };
        is_used.insert(other, ());
        ring.insert(i % n + 1, (tip, key));
        n_failed = 0;
        // Vertices on straight edges would only use up the limit. Dropping them keeps the outline, but its
        // longer edges are not edges of the mesh, so growth past them ends.
        if ring.len() > MAX_CORNERS {
            straighten(&mut ring, normal);
            if ring.len() >= MAX_CORNERS {
                break;
            }
            i = 0;
        }
    }
    straighten(&mut ring, normal);
    if ring.len() > MAX_CORNERS || ring.len() < 3 {
        return None;
    }
    let mut corners = [DVec3::ZERO; MAX_CORNERS];
    for (to, (p, _)) in corners.iter_mut().zip(&ring) {
        *to = *p;
    }
    let middle = ring.iter().map(|r| r.0).sum::<DVec3>() / ring.len() as f64;
    let area = (1..ring.len() - 1)
        .map(|k| triangle_area_normal(&[ring[0].0, ring[k].0, ring[k + 1].0]).dot(normal))
        .sum::<f64>()
        * 0.5;
    Some(Occluder {
        normal,
        corners,
        n_corners: ring.len(),
        middle,
        area,
        is_two_sided: *is_two_sided,
    })
}

/// Drops vertices on straight edges.
fn straighten(ring: &mut Vec<(DVec3, Key)>, normal: DVec3) {
    let mut i = 0;
    while ring.len() > 3 && i < ring.len() {
        let n = ring.len();
        let (a, b, c) = (ring[(i + n - 1) % n].0, ring[i].0, ring[(i + 1) % n].0);
        let bend = (b - a).cross(c - b).dot(normal);
        // The vertex lies within 1e-6 of the line between its neighbors.
        if bend <= 1e-6 * (c - a).length() {
            ring.remove(i);
        } else {
            i += 1;
        }
    }
}

impl Occluder {
    fn shrink(&mut self, by: f64) {
        // Each vertex moves towards the middle, so an edge moves inwards by that distance times the sine of the
        // angle between them. The sine is small only in slivers, which are small occluders.
        for p in &mut self.corners[..self.n_corners] {
            let d = self.middle - *p;
            *p += d * (4.0 * by / d.length()).min(0.5);
        }
    }
}

/// The shadow of one occluder: an intersection of half-spaces `n · p + d >= 0`.
#[derive(Clone, Copy, Debug)]
struct Shadow {
    planes: [Vec4; MAX_CORNERS + 1],
    n_planes: usize,
}

/// The shadows used in one visit.
#[derive(Clone, Debug)]
pub(crate) struct Shadows {
    shadows: [Shadow; MAX_SHADOWS],
    len: usize,
}

impl Shadows {
    pub(crate) fn new() -> Self {
        let none = Shadow {
            planes: [Vec4::ZERO; MAX_CORNERS + 1],
            n_planes: 0,
        };
        Self {
            shadows: [none; MAX_SHADOWS],
            len: 0,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// Sets up the shadows of those occluders of `cell` that look largest from `eye`.
    ///
    /// `margin` is the largest shift of a plane by rounding. Occluders must lie `beyond` a plane, given by its normal and its
    /// distance from the eye.
    pub(crate) fn cast(
        &mut self,
        occluders: &Occluders,
        cell: u32,
        eye: DVec3,
        margin: f64,
        beyond: Option<(DVec3, f64)>,
    ) {
        self.len = 0;
        let c = cell as usize;
        if occluders.all.is_empty() || occluders.first[c] == occluders.first[c + 1] {
            return;
        }
        let all = &occluders.all[occluders.first[c] as usize..occluders.first[c + 1] as usize];
        let mut best = [(0.0, 0); MAX_SHADOWS];
        for (i, o) in all.iter().enumerate() {
            let to_eye = eye - o.middle;
            let height = o.normal.dot(to_eye);
            if height < 0.05 && !(o.is_two_sided && height < -0.05) {
                continue;
            }
            let is_before = |(n, least): (DVec3, f64)| {
                let mut corners = o.corners[..o.n_corners].iter();
                corners.any(|c| n.dot(c - eye) < least + margin)
            };
            if beyond.is_some_and(is_before) {
                continue;
            }
            let d2 = to_eye.length_squared();
            // Approximate solid angle.
            let size = o.area * height.abs() / (d2 * d2.sqrt());
            if size > best[MAX_SHADOWS - 1].0 {
                best[MAX_SHADOWS - 1] = (size, i);
                best.sort_by(|a, b| b.0.total_cmp(&a.0));
            }
        }
        for &(size, i) in &best {
            if size > 1e-3 {
                self.add(&all[i], eye, margin);
            }
        }
    }

    fn add(&mut self, o: &Occluder, eye: DVec3, margin: f64) {
        let height = o.normal.dot(eye - o.middle);
        let away = -o.normal * height.signum();
        let mut shadow = Shadow {
            planes: [Vec4::ZERO; MAX_CORNERS + 1],
            n_planes: 0,
        };
        let mut add = |n: DVec3, through: DVec3, margin: f64| {
            let d = -n.dot(through) - margin;
            shadow.planes[shadow.n_planes] = n.extend(d).as_vec4();
            shadow.n_planes += 1;
        };
        add(away, o.middle, margin + FLAT * 4.0);
        let n = o.n_corners;
        for k in 0..n {
            let (a, b) = (o.corners[k], o.corners[(k + 1) % n]);
            let normal = (a - eye).cross(b - eye);
            let Some(normal) = normal.try_normalize() else {
                return;
            };
            let inward = if normal.dot(o.middle - eye) < 0.0 {
                -normal
            } else {
                normal
            };
            add(inward, eye, margin);
        }
        self.shadows[self.len] = shadow;
        self.len += 1;
    }

    /// Returns `true` if a box lies in one of the shadows.
    #[inline]
    pub(crate) fn hide_box(&self, min: Vec3, max: Vec3) -> bool {
        self.shadows[..self.len].iter().any(|shadow| {
            shadow.planes[..shadow.n_planes].iter().all(|plane| {
                let n = plane.truncate();
                let near = Vec3::select(n.cmpge(Vec3::ZERO), min, max);
                n.dot(near) + plane.w >= 0.0
            })
        })
    }

    /// Returns `true` if all points, each grown by `tolerance`, lie in one of the shadows.
    #[inline]
    pub(crate) fn hide_points(&self, points: &[[f32; 3]], tolerance: f32) -> bool {
        self.shadows[..self.len].iter().any(|shadow| {
            shadow.planes[..shadow.n_planes].iter().all(|plane| {
                let n = plane.truncate();
                points
                    .iter()
                    .all(|&p| n.dot(p.into()) + plane.w >= tolerance)
            })
        })
    }
}
