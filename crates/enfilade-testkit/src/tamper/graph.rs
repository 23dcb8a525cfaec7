//! Claims about cells, portals, counts and the locator.

use std::sync::Arc;

use enfilade_cpg::{CellId, FittingPart, Locator, Portal, PortalKind, World};
use enfilade_geom::{DVec3, poly};

use super::{Tampering, pick, room, stranger};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new("a window that is called a door", |w, at| {
        kind(w, at, PortalKind::Window, PortalKind::Door)
    }),
    Tampering::new("a window with a pane that is called open", |w, at| {
        let has_pane = |i: usize| {
            let mut fittings = w.graph.portals[i].fittings.iter();
            fittings.any(|f| f.part == FittingPart::Pane)
        };
        let i = pick(w.graph.portals.len(), at, has_pane)?;
        w.graph.portals[i].kind = PortalKind::Open;
        Some(())
    }),
    Tampering::new("a door that is called a window", |w, at| {
        kind(w, at, PortalKind::Door, PortalKind::Window)
    }),
    Tampering::new("a door that is called open", |w, at| {
        kind(w, at, PortalKind::Door, PortalKind::Open)
    }),
    Tampering::new(
        "an opening without a sill that is called a window",
        |w, at| {
            let is_low = |i: usize| {
                let p = &w.graph.portals[i];
                p.kind == PortalKind::Open && p.pieces.len() == 1 && p.fittings.is_empty()
            };
            let i = pick(w.graph.portals.len(), at, is_low)?;
            w.graph.portals[i].kind = PortalKind::Window;
            Some(())
        },
    ),
    Tampering::new("a wide crack", |w, at| {
        portal(w, at)?.kind = PortalKind::Crack;
        Some(())
    }),
    Tampering::new("a halved box", |w, at| {
        let i = room(w, at)?;
        let [min, max] = &mut w.graph.cells[i].aabb;
        max[0] = 0.5 * (min[0] + max[0]);
        Some(())
    }),
    Tampering::new("a grown box", |w, at| {
        let i = room(w, at)?;
        w.graph.cells[i].aabb[0][1] -= 0.05;
        Some(())
    }),
    Tampering::new("a huge box", |w, at| {
        w.graph.cells.get_mut(at)?.aabb[1][at] = 1e30;
        Some(())
    }),
    Tampering::new("a wrong volume", |w, at| {
        let i = room(w, at)?;
        w.graph.cells[i].volume *= 1.01;
        Some(())
    }),
    Tampering::new("a wrong area", |w, at| {
        portal(w, at)?.area *= 1.01;
        Some(())
    }),
    Tampering::uncounted("a wrong count of triangles", |w, at| {
        let i = room(w, at)?;
        w.graph.cells[i].n_triangles += 1;
        Some(())
    }),
    Tampering::uncounted("a wrong count of triangles of details", |w, at| {
        let i = room(w, at)?;
        w.graph.cells[i].n_detail_triangles += 1;
        Some(())
    }),
    Tampering::new("names of cells swapped", |w, at| {
        let [i, j] = two_rooms(w, at)?;
        let name = w.graph.cells[i].name.clone();
        w.graph.cells[i].name = std::mem::replace(&mut w.graph.cells[j].name, name);
        Some(())
    }),
    Tampering::new("another outside", |w, at| {
        let outside = [None, Some(CellId(1)), Some(CellId(2))][at];
        let is_other = w.graph.locator.outside != outside;
        Arc::make_mut(&mut w.graph.locator).outside = outside;
        is_other.then_some(())
    }),
    Tampering::new("another outdoors", |w, at| {
        let i = room(w, at)?;
        for (j, cell) in w.graph.cells.iter_mut().enumerate() {
            cell.outdoor = i == j;
        }
        Some(())
    }),
    Tampering::new("a portal moved along its plane", |w, at| {
        moved_portal(w, at, across, 0.05)
    }),
    Tampering::new("a portal moved out of its plane", |w, at| {
        moved_portal(w, at, |n| n, 0.05)
    }),
    Tampering::new("a portal shrunk", |w, at| scaled(portal(w, at)?, 0.9)),
    Tampering::new("a portal grown", |w, at| scaled(portal(w, at)?, 1.1)),
    Tampering::new("a portal flipped", |w, at| {
        portal(w, at)?.cells.reverse();
        Some(())
    }),
    Tampering::new("a portal turned about", |w, at| {
        let p = portal(w, at)?;
        p.normal = p.normal.map(|x| -x);
        p.outline.reverse();
        p.pieces.iter_mut().for_each(|p| p.reverse());
        Some(())
    }),
    Tampering::new("a portal tilted", |w, at| {
        let p = portal(w, at)?;
        let n = DVec3::from(p.normal.map(f64::from));
        let tilted = (n + across(n) * 0.01 + DVec3::Y * 0.01).normalize();
        p.normal = tilted.as_vec3().to_array();
        Some(())
    }),
    Tampering::new("a portal removed", |w, at| {
        let gone = portal(w, at)?.clone();
        w.graph.portals.retain(|p| *p != gone);
        Some(())
    }),
    Tampering::new("a portal twice", |w, at| {
        let mut twice = portal(w, at)?.clone();
        // Its leaves are not those of the other, too.
        twice.fittings.clear();
        w.graph.portals.push(twice);
        Some(())
    }),
    Tampering::new("a polygon of a portal twice", |w, at| {
        let p = portal(w, at)?;
        p.pieces.push(p.pieces[0].clone());
        p.area += area(&p.pieces[0]);
        Some(())
    }),
    Tampering::new("a corner of a portal's polygon lost", |w, at| {
        let p = portal(w, at)?;
        let corner = p.pieces[0][0];
        p.pieces[0].retain(|c| *c != corner);
        p.area = p.pieces.iter().map(|piece| area(piece)).sum();
        Some(())
    }),
    Tampering::new("a portal between other cells", |w, at| {
        let cells = portal(w, at)?.cells;
        let other = stranger(w, &cells)?;
        portal(w, at)?.cells[1] = other;
        Some(())
    }),
    Tampering::new("two cells merged", |w, at| {
        // As one who thinks that the graph is all: whatever named the one names the other.
        let [from, to] = two_rooms(w, at)?.map(|i| CellId(i as u32));
        for list in w.batches.iter_mut().map(|b| &mut b.cells) {
            list.iter_mut()
                .filter(|c| **c == from)
                .for_each(|c| *c = to);
            list.sort();
            list.dedup();
        }
        for p in &mut w.graph.portals {
            p.cells = p.cells.map(|c| if c == from { to } else { c });
        }
        w.graph.portals.retain(|p| p.cells[0] != p.cells[1]);
        Some(())
    }),
    Tampering::new("two cells exchanged", |w, at| {
        let [a, b] = two_rooms(w, at)?.map(|i| CellId(i as u32));
        let swap = |c: CellId| match c {
            _ if c == a => b,
            _ if c == b => a,
            _ => c,
        };
        for p in &mut w.graph.portals {
            p.cells = p.cells.map(swap);
        }
        Some(())
    }),
    Tampering::new("a plane of the locator moved", |w, at| {
        let n = w.graph.locator.planes.len();
        let i = [0, n / 2, n / 3][at];
        Arc::make_mut(&mut w.graph.locator).planes.get_mut(i)?[3] += 0.05;
        Some(())
    }),
    Tampering::new("a plane of the locator moved by 0.3 m", |w, at| {
        let n = w.graph.locator.planes.len();
        // Many divide what is of one cell on both sides.
        let moved = (0..n).map(|i| (i + at * n / 3) % n).find_map(|i| {
            let mut moved = Locator::clone(&w.graph.locator);
            moved.planes[i][3] -= 0.3;
            answers_differ(&w.graph.locator, &moved).then_some(moved)
        });
        w.graph.locator = moved?.into();
        Some(())
    }),
    Tampering::new("a leaf of the locator of another cell", |w, at| {
        let [leaf, other] = two_rooms(w, at)?.map(|i| Locator::leaf(Some(CellId(i as u32))));
        let nodes = Arc::make_mut(&mut w.graph.locator).nodes.iter_mut();
        let mut leaves = nodes.flat_map(|n| &mut n.children).filter(|c| **c == leaf);
        *leaves.next()? = other;
        Some(())
    }),
    Tampering::new("the locator's box halved", |w, at| {
        let b = &mut Arc::make_mut(&mut w.graph.locator).bounds;
        b.max[at] = 0.5 * (b.min[at] + b.max[at]);
        Some(())
    }),
    Tampering::new("a node of the locator that is a child twice", |w, at| {
        let nodes = &mut Arc::make_mut(&mut w.graph.locator).nodes;
        let inner = |i: usize| nodes[i].children.iter().any(|&c| c >= 0);
        let i = pick(nodes.len(), at, inner)?;
        let children = &mut nodes[i].children;
        *children = [children[0].max(children[1]); 2];
        Some(())
    }),
];

fn kind(w: &mut World, at: usize, from: PortalKind, to: PortalKind) -> Option<()> {
    let i = pick(w.graph.portals.len(), at, |i| {
        w.graph.portals[i].kind == from
    })?;
    w.graph.portals[i].kind = to;
    Some(())
}

fn two_rooms(w: &World, at: usize) -> Option<[usize; 2]> {
    let pair = [room(w, at)?, room(w, (at + 1) % 3)?];
    (pair[0] != pair[1]).then_some(pair)
}

fn portal(w: &mut World, place: usize) -> Option<&mut Portal> {
    let i = pick(w.graph.portals.len(), place, |i| {
        w.graph.portals[i].area > 0.2
    })?;
    Some(&mut w.graph.portals[i])
}

fn corners(p: &mut Portal) -> impl Iterator<Item = &mut [f32; 3]> {
    p.outline.iter_mut().chain(p.pieces.iter_mut().flatten())
}

fn moved_portal(
    w: &mut World,
    place: usize,
    along: impl Fn(DVec3) -> DVec3,
    by: f64,
) -> Option<()> {
    let p = portal(w, place)?;
    let to = along(DVec3::from(p.normal.map(f64::from))) * by;
    for c in corners(p) {
        *c = (DVec3::from(c.map(f64::from)) + to).as_vec3().to_array();
    }
    Some(())
}

fn across(n: DVec3) -> DVec3 {
    n.cross(DVec3::Y).try_normalize().unwrap_or(DVec3::X)
}

fn scaled(p: &mut Portal, by: f64) -> Option<()> {
    let n = p.outline.len() as f64;
    let points = p.outline.iter().map(|c| DVec3::from(c.map(f64::from)));
    let middle = points.sum::<DVec3>() / n;
    for c in corners(p) {
        let q = middle + (DVec3::from(c.map(f64::from)) - middle) * by;
        *c = q.as_vec3().to_array();
    }
    p.area *= (by * by) as f32;
    Some(())
}

/// Returns `true` if two locators of one box give different cells at one of the points of a grid.
fn answers_differ(one: &Locator, other: &Locator) -> bool {
    const SIDE: usize = 40;
    let share = |k: usize| (k as f64 + 0.5) / SIDE as f64;
    (0..SIDE * SIDE * SIDE).any(|k| {
        let by = DVec3::new(
            share(k % SIDE),
            share(k / SIDE % SIDE),
            share(k / SIDE / SIDE),
        );
        let p = one.bounds.min + one.bounds.size() * by;
        one.locate(p) != other.locate(p)
    })
}

fn area(piece: &[[f32; 3]]) -> f32 {
    let points = piece.iter().map(|c| DVec3::from(c.map(f64::from)));
    poly::area(&points.collect::<Vec<_>>()) as f32
}
