//! Merges the panes of a glazed bay into one window portal, and slits in one plane into one portal.
//!
//! In a glazed wall, vertical mullions separate the bays, and horizontal transoms divide each bay into panes. Panes
//! above each other, the lowest on the floor, become one portal with several pieces. Windows above a sill stay
//! separate, and so does what is a window by itself: by its name, or as high as a person from the floor on.
//! Slits, too narrow to climb through, are one portal for each plane between two cells: the gaps between the tops of walls
//! and a ribbed roof. So are all openings of a void: the lamps, grilles and missing panels of a ceiling.
//! **Limit:** panes and slits whose planes differ by more than `ONE_PLANE` stay separate, as in models with moved vertices.
//!
//! Time `O(p log p)` in windows, as long as few lie in one column of one plane.

use std::collections::BTreeMap;

use enfilade_cpg::PortalKind;
use enfilade_geom::{DVec3, Sets, Winding, is_rather_level};

use super::KnownPortal;
use super::kinds::SLIT;
use crate::complex::PartitionPortal;

/// Greatest height of a transom, and greatest offset between the sides of two panes of one bay. [Units: wu]
const BAR: f64 = 0.15;
/// Greatest distance between the planes of two windows that count as coplanar. [Units: wu]
const ONE_PLANE: f64 = 1e-6;

/// Where a window lies in its facade. [Units: wu]
struct Extent {
    /// Horizontal range along the plane.
    across: [f64; 2],
    up: [f64; 2],
}

impl Extent {
    fn of(p: &PartitionPortal) -> Self {
        let along = along(p);
        let range = |d: DVec3| {
            let at = p.outline.points.iter().map(|q| d.dot(*q));
            at.fold([f64::MAX, f64::MIN], |[lo, hi], t| [lo.min(t), hi.max(t)])
        };
        Self {
            across: range(along),
            up: range(DVec3::Y),
        }
    }

    /// Returns `true` if `above` stands on it with only a transom between.
    fn carries(&self, above: &Self) -> bool {
        let is_flush = |k: usize| (self.across[k] - above.across[k]).abs() <= BAR;
        let gap = above.up[0] - self.up[1];
        is_flush(0) && is_flush(1) && (-ONE_PLANE..=BAR).contains(&gap)
    }
}

fn along(p: &PartitionPortal) -> DVec3 {
    DVec3::Y.cross(p.plane.normal).normalize_or_zero()
}

/// Joins windows between the same two cells that stand above each other in one upright plane, the lowest on a floor.
/// Each bay becomes one portal with all its pieces, in place of its first window; the order is kept.
pub(super) fn join_bays(portals: Vec<KnownPortal>) -> Vec<KnownPortal> {
    let mut sets = Sets::new(portals.len());
    let mut facades: BTreeMap<[u32; 2], Vec<(usize, Extent)>> = BTreeMap::new();
    for (i, known) in portals.iter().enumerate() {
        let p = &known.portal;
        if known.kind == PortalKind::Window && known.is_pane && !is_rather_level(p.plane.normal) {
            facades.entry(p.cells).or_default().push((i, Extent::of(p)));
        }
    }
    for windows in facades.values_mut() {
        windows.sort_by(|a, b| a.1.across[0].total_cmp(&b.1.across[0]).then(a.0.cmp(&b.0)));
        for (k, (i, a)) in windows.iter().enumerate() {
            let is_near = |w: &&(usize, Extent)| w.1.across[0] - a.across[0] <= BAR;
            for (j, b) in windows[k + 1..].iter().take_while(is_near) {
                let [p, q] = [&portals[*i].portal, &portals[*j].portal];
                if is_coplanar(p, q) && (a.carries(b) || b.carries(a)) {
                    sets.join(*i as u32, *j as u32);
                }
            }
        }
    }
    let roots: Vec<u32> = (0..portals.len() as u32).map(|i| sets.find(i)).collect();
    let mut on_floor: Vec<bool> = vec![false; portals.len()];
    for (known, &root) in portals.iter().zip(&roots) {
        on_floor[root as usize] |= known.is_on_floor;
    }
    let mut out: Vec<KnownPortal> = Vec::with_capacity(portals.len());
    let mut place: BTreeMap<u32, usize> = BTreeMap::new();
    for (known, root) in portals.into_iter().zip(roots) {
        match place.get(&root) {
            Some(&at) if on_floor[root as usize] => out[at].take_in(known.portal),
            _ => {
                place.insert(root, out.len());
                out.push(known);
            }
        }
    }
    out
}

/// Joins slits of one kind, and openings of voids of any kind, between the same two cells in one plane: each plane has one
/// portal with all its pieces, in place of the first. It is a crack if the widest is one, otherwise `kind_of` judges it
/// as a whole.
///
/// Time: quadratic in the planes between two cells.
pub(super) fn join_slits(
    portals: Vec<KnownPortal>,
    is_void: impl Fn(u32) -> bool,
    kind_of: impl Fn(&PartitionPortal) -> PortalKind,
) -> Vec<KnownPortal> {
    let mut out: Vec<KnownPortal> = Vec::with_capacity(portals.len());
    let mut slits: BTreeMap<([u32; 2], Option<PortalKind>), Vec<usize>> = BTreeMap::new();
    for known in portals {
        let cells = known.portal.cells;
        let leads_to_void = cells.into_iter().any(&is_void);
        if (known.portal.width < SLIT || leads_to_void) && !known.is_filled {
            // Kinds tell who passes, and nobody passes into a void.
            let kind = (!leads_to_void).then_some(known.kind);
            let planes = slits.entry((cells, kind)).or_default();
            let home = planes
                .iter()
                .find(|&&at| is_coplanar(&out[at].portal, &known.portal));
            if let Some(&at) = home {
                let whole = &mut out[at];
                if known.portal.width > whole.portal.width {
                    whole.portal.kind = known.portal.kind;
                }
                whole.take_in(known.portal);
                whole.kind = kind_of(&whole.portal);
                continue;
            }
            planes.push(out.len());
        }
        out.push(known);
    }
    out
}

/// Returns `true` if two portals lie in one plane and lead the same way.
fn is_coplanar(p: &PartitionPortal, q: &PartitionPortal) -> bool {
    let is_near = |x: &DVec3| p.plane.signed_distance(*x).abs() <= ONE_PLANE;
    p.plane.normal.dot(q.plane.normal) > 0.0 && q.outline.points.iter().all(is_near)
}

impl KnownPortal {
    /// Adds the pieces of a coplanar portal.
    fn take_in(&mut self, other: PartitionPortal) {
        let whole = &mut self.portal;
        whole.pieces.extend(other.pieces);
        whole.area += other.area;
        whole.width = whole.width.max(other.width);
        // Largest first, as in every portal.
        whole.pieces.sort_by(|a, b| b.area().total_cmp(&a.area()));
        let corners = whole.pieces.iter().flat_map(|w| w.points.iter().copied());
        let corners: Vec<DVec3> = corners.collect();
        whole.outline = Winding::hull_in_plane(&whole.plane, &corners);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_geom::Plane;

    /// A slit 1 m long across `x`, at the heights given, between cells 1 and 2.
    fn slit(x: f64, up: [f64; 2]) -> KnownPortal {
        let plane = Plane::through(DVec3::X * x, DVec3::X);
        let corners = [(up[0], 0.0), (up[1], 0.0), (up[1], 1.0), (up[0], 1.0)];
        let corners = corners.map(|(y, z)| DVec3::new(x, y, z));
        let outline = Winding::hull_in_plane(&plane, &corners);
        KnownPortal {
            portal: PartitionPortal {
                cells: [1, 2],
                plane,
                pieces: vec![outline.clone()],
                area: outline.area(),
                outline,
                candidate: None,
                width: up[1] - up[0],
                kind: PortalKind::Open,
                is_leak: false,
            },
            kind: PortalKind::Open,
            is_on_floor: false,
            is_filled: false,
            is_pane: true,
        }
    }

    /// Returns the number of pieces of each portal once slits are joined.
    fn n_pieces(portals: Vec<KnownPortal>) -> Vec<usize> {
        let joined = join_slits(portals, |cell| cell == 3, |p| p.kind);
        joined.iter().map(|j| j.portal.pieces.len()).collect()
    }

    #[test]
    fn slits_in_one_plane_are_one_portal() {
        let joined = join_slits(
            vec![
                slit(0.0, [2.0, 2.1]),
                slit(0.0, [2.5, 2.7]),
                slit(0.0, [3.0, 3.05]),
            ],
            |_| false,
            |p| p.kind,
        );
        let [KnownPortal { portal, .. }] = &joined[..] else {
            panic!("{} portals", joined.len());
        };
        let areas: Vec<f64> = portal.pieces.iter().map(Winding::area).collect();
        assert_eq!(areas.len(), 3);
        assert!(areas.is_sorted_by(|a, b| a >= b), "{areas:?}");
        assert!((portal.area - 0.35).abs() < 1e-9 && (portal.width - 0.2).abs() < 1e-9);
        assert!((portal.outline.area() - 1.05).abs() < 1e-9);
    }

    #[test]
    fn slits_of_other_planes_cells_and_fillings_stay() {
        let first = || slit(0.0, [2.0, 2.1]);
        let second = || slit(0.0, [2.5, 2.7]);
        assert_eq!(n_pieces(vec![first(), slit(0.2, [2.5, 2.7])]), [1, 1]);
        let filled = KnownPortal {
            is_filled: true,
            ..second()
        };
        assert_eq!(n_pieces(vec![first(), filled]), [1, 1]);
        let window = KnownPortal {
            kind: PortalKind::Window,
            ..second()
        };
        assert_eq!(n_pieces(vec![first(), window]), [1, 1]);
        let mut elsewhere = second();
        elsewhere.portal.cells = [1, 3];
        assert_eq!(n_pieces(vec![first(), elsewhere]), [1, 1]);
        // Wide enough to climb through.
        let wide = || vec![slit(0.0, [2.0, 2.4]), slit(0.0, [2.5, 2.9])];
        assert_eq!(n_pieces(wide()), [1, 1]);
        // Nobody climbs into a void.
        let mut of_void = wide();
        of_void.iter_mut().for_each(|j| j.portal.cells = [1, 3]);
        assert_eq!(n_pieces(of_void), [2]);
        // Together with a crack, however long, the opening is one that somebody looks through.
        let mut crack = slit(0.0, [2.0, 2.02]);
        let mut lamp = slit(0.0, [2.5, 2.6]);
        (crack.kind, crack.portal.area) = (PortalKind::Crack, 1.0);
        crack.portal.kind = PortalKind::Crack;
        for j in [&mut crack, &mut lamp] {
            j.portal.cells = [1, 3];
        }
        // A kinds of the whole may find a sill that its pieces do not have.
        let kinds = |p: &PartitionPortal| match p.kind {
            PortalKind::Open if p.pieces.len() == 2 => PortalKind::Window,
            kind => kind,
        };
        let joined = join_slits(vec![crack, lamp], |cell| cell == 3, kinds);
        assert_eq!((joined.len(), joined[0].kind), (1, PortalKind::Window));
        // One between two others in another plane does not keep them apart.
        let between = slit(0.2, [2.5, 2.7]);
        assert_eq!(n_pieces(vec![first(), between, second()]), [2, 1]);
    }
}
