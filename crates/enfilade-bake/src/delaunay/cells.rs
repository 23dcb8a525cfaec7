//! Cells: parts of the air merged wherever nothing narrows between them, and the portals where cells meet.
//!
//! One sweep over all links, widest first, turns millions of tetrahedra into a few cells per room. Cells are then
//! divided where branches leave them ([`divided_at_mouths`]), since no pinch marks those places. Decimation does the
//! rest.
//!
//! Ties are broken by the ids of parts, which depend on coordinates only. `O(n log n)`.

use std::collections::BTreeMap;

use enfilade_geom::{Aabb, DVec3, Sets};

use super::labels::Branches;
use super::space::Space;

/// Two cells are one bulge if the lesser ball of the two is at most this many times the ball that passes between them.
/// Differences that small come from the sampling of points. A lower bound leaves more cells to decimation, a higher one
/// merges across faint necks.
const FLOWS: f64 = 1.05;

/// The cell around the scene.
pub const OUTDOOR_CELL: u32 = 0;

/// Cells before decimation, and the portals between them.
pub struct Cells {
    /// Cell of each part of the space.
    pub cell_of_part: Vec<u32>,
    /// Radius of the largest ball in each cell. [Units: wu]
    pub radii: Vec<f64>,
    /// Volume of each cell. [Units: wu³]
    pub volumes: Vec<f64>,
    /// Box of each cell. [Units: wu]
    pub boxes: Vec<Aabb>,
    /// Portals between two cells, lesser id first.
    pub portals: BTreeMap<(u32, u32), CellPortal>,
}

/// The portal between two cells.
#[derive(Clone, Debug)]
pub struct CellPortal {
    /// Radius of the widest ball that passes. [Units: wu]
    pub radius: f64,
    /// At the mouth of a branch, the radius of the trunk's ball ÷ that of the branch's; 0 elsewhere.
    pub mouth: f64,
    /// Sum of the facets' area vectors, from the lesser to the greater cell. [Units: wu²]
    pub vector: DVec3,
    /// Mean of the facets' centers. [Units: wu]
    pub center: DVec3,
    /// Indices of its links in the space.
    pub links: Vec<u32>,
}

/// Merges parts between which nothing narrows. Outdoors is [`OUTDOOR_CELL`].
#[must_use]
pub fn flow_together(space: &Space) -> Cells {
    let n = space.radii.len();
    let mut sets = Sets::new(n);
    let mut radius = space.radii.clone();
    let mut outdoors: Option<u32> = None;
    for t in (0..n as u32).filter(|&t| space.radii[t as usize] == f64::INFINITY) {
        let first = *outdoors.get_or_insert(t);
        sets.join(first, t);
    }
    let mut order: Vec<u32> = (0..space.links.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| {
        let [p, q] = [a, b].map(|l| space.links[l as usize].radius);
        q.total_cmp(&p).then(a.cmp(&b))
    });
    for l in order {
        let link = &space.links[l as usize];
        let [a, b] = link.parts.map(|t| sets.find(t));
        let (ra, rb) = (radius[a as usize], radius[b as usize]);
        if a == b || ra.min(rb) > FLOWS * link.radius {
            continue;
        }
        radius[sets.join(a, b) as usize] = ra.max(rb);
    }
    let roots: Vec<u32> = (0..n as u32).map(|t| sets.find(t)).collect();
    gathered(space, |t| (roots[t as usize], 0), &Branches::none(n))
}

/// Returns the cells, divided where a branch leaves its trunk.
pub(super) fn divided_at_mouths(space: &Space, cells: &Cells, branches: &Branches) -> Cells {
    let key = |t: u32| {
        let t = t as usize;
        (cells.cell_of_part[t], branches.label_of_part[t])
    };
    gathered(space, key, branches)
}

/// Returns the cells of parts with equal keys, in the order of their first parts.
fn gathered(space: &Space, key: impl Fn(u32) -> (u32, u32), branches: &Branches) -> Cells {
    let n = space.radii.len() as u32;
    let mut id_of_key: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    if let Some(t) = (0..n).find(|&t| space.radii[t as usize] == f64::INFINITY) {
        id_of_key.insert(key(t), OUTDOOR_CELL);
    }
    let mut cells = Cells {
        cell_of_part: vec![0; n as usize],
        radii: vec![f64::INFINITY],
        volumes: vec![0.0],
        boxes: vec![Aabb::EMPTY],
        portals: BTreeMap::new(),
    };
    for t in 0..n {
        let next = cells.radii.len() as u32;
        let cell = *id_of_key.entry(key(t)).or_insert(next);
        if cell == next {
            cells.radii.push(0.0);
            cells.volumes.push(0.0);
            cells.boxes.push(Aabb::EMPTY);
        }
        let radius = &mut cells.radii[cell as usize];
        *radius = radius.max(space.radii[t as usize]);
        cells.volumes[cell as usize] += space.volumes[t as usize];
        cells.cell_of_part[t as usize] = cell;
        let b = &mut cells.boxes[cell as usize];
        *b = space.corners(t).iter().fold(*b, |b, &p| b.including(p));
    }
    cells.portals = portals(space, &cells.cell_of_part, branches);
    cells
}

/// Returns the portals, made of the links between parts of different cells.
fn portals(
    space: &Space,
    cell_of_part: &[u32],
    branches: &Branches,
) -> BTreeMap<(u32, u32), CellPortal> {
    let mut portals: BTreeMap<(u32, u32), CellPortal> = BTreeMap::new();
    for (l, link) in space.links.iter().enumerate() {
        let [a, b] = link.parts.map(|t| cell_of_part[t as usize]);
        if a == b {
            continue;
        }
        let portal = portals.entry((a.min(b), a.max(b))).or_insert(CellPortal {
            radius: 0.0,
            mouth: 0.0,
            vector: DVec3::ZERO,
            center: DVec3::ZERO,
            links: Vec::new(),
        });
        let mouth = branches.weight(link.parts.map(|t| branches.label_of_part[t as usize]));
        if (link.radius, mouth) > (portal.radius, portal.mouth) {
            (portal.radius, portal.mouth) = (link.radius, mouth);
        }
        let normal = space.area_vector(link);
        portal.vector += if a < b { normal } else { -normal };
        let outline = space.outline(link);
        portal.center += outline.iter().sum::<DVec3>() / outline.len() as f64;
        portal.links.push(l as u32);
    }
    for portal in portals.values_mut() {
        portal.center /= portal.links.len() as f64;
    }
    portals
}
