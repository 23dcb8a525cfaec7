//! Fittings of openings: which objects, as what, and how leaves move.

use std::f32::consts::FRAC_PI_2;

use enfilade_cpg::{Fitting, FittingPart, Motion, MotionKind, PortalKind, World};

use super::geometry::loose_detail;
use super::{Tampering, pick};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new("a hinge at the leaf's middle", |w, at| {
        let (middle, _) = leaf_box(w, turning(w, at)?);
        turned(w, at, |through, _| {
            *through = [middle[0], through[1], middle[2]];
        })
    }),
    Tampering::new("a hinge two meters off", |w, at| {
        turned(w, at, |through, _| through[0] += 2.0)
    }),
    Tampering::new("a hinge a hand's breadth beside the leaf", |w, at| {
        let [p, f] = turning(w, at)?;
        let normal = w.graph.portals[p].normal;
        let (middle, _) = leaf_box(w, [p, f]);
        turned(w, at, |through, _| {
            // Along the wall, away from the leaf.
            let along = [normal[2], 0.0, -normal[0]];
            let side: f32 = (0..3).map(|k| along[k] * (through[k] - middle[k])).sum();
            for k in 0..3 {
                through[k] += along[k] * 0.25_f32.copysign(side);
            }
        })
    }),
    Tampering::new("a hinge two meters above", |w, at| {
        turned(w, at, |through, _| through[1] += 4.0)
    }),
    Tampering::new("an axis that lies flat", |w, at| {
        turned(w, at, |_, axis| *axis = [1.0, 0.0, 0.0])
    }),
    Tampering::new("a leaf that turns the other way", |w, at| {
        let [p, f] = thick_turning(w, at)?;
        let motion = w.graph.portals[p].fittings[f].motion.as_mut()?;
        motion.open = 2.0 * motion.shut - motion.open;
        alike(w, p, f)
    }),
    Tampering::new("an axis turned about", |w, at| {
        let [p, f] = thick_turning(w, at)?;
        let motion = w.graph.portals[p].fittings[f].motion.as_mut()?;
        if let MotionKind::Turn { axis, .. } = &mut motion.kind {
            *axis = axis.map(|x| -x);
        }
        alike(w, p, f)
    }),
    Tampering::new("a leaf that is shut where it is ajar", |w, at| {
        moved(w, at, |m| m.shut += 0.3 * (m.open - m.shut))
    }),
    Tampering::new("a leaf that hardly opens", |w, at| {
        moved(w, at, |m| {
            m.open = m.shut + 0.02_f32.copysign(m.open - m.shut);
        })
    }),
    Tampering::new("a leaf that is open where it is shut", |w, at| {
        moved(w, at, |m| std::mem::swap(&mut m.shut, &mut m.open))
    }),
    Tampering::new("a leaf that turns by half a turn more", |w, at| {
        let [p, f] = turning(w, at)?;
        let motion = w.graph.portals[p].fittings[f].motion.as_mut()?;
        motion.open += 2.0 * FRAC_PI_2.copysign(motion.open - motion.shut);
        alike(w, p, f)
    }),
    Tampering::new("a leaf that slides into the room", |w, at| {
        let i = leaf(w, at, |m| matches!(m.kind, MotionKind::Slide { .. }))?;
        let normal = w.graph.portals[i[0]].normal;
        let motion = w.graph.portals[i[0]].fittings[i[1]].motion.as_mut()?;
        motion.kind = MotionKind::Slide { along: normal };
        alike(w, i[0], i[1])
    }),
    Tampering::new("leaves of two doors swapped", |w, at| {
        let [a, b] = two_leaves(w, at)?;
        let [x, y] = [a, b].map(|[p, f]| w.graph.portals[p].fittings[f].clone());
        w.graph.portals[a[0]].fittings[a[1]] = y;
        w.graph.portals[b[0]].fittings[b[1]] = x;
        sort(w)
    }),
    Tampering::new(
        "leaves of two doors swapped, each with the other's motion",
        |w, at| {
            let [a, b] = two_leaves(w, at)?;
            let [x, y] = [a, b].map(|[p, f]| w.graph.portals[p].fittings[f].detail);
            w.graph.portals[a[0]].fittings[a[1]].detail = y;
            w.graph.portals[b[0]].fittings[b[1]].detail = x;
            sort(w)
        },
    ),
    Tampering::new("a leaf that is called a frame", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        let fitting = &mut w.graph.portals[p].fittings[f];
        (fitting.part, fitting.motion) = (FittingPart::Frame, None);
        Some(())
    }),
    Tampering::new("a leaf that is called a pane", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        let fitting = &mut w.graph.portals[p].fittings[f];
        (fitting.part, fitting.motion) = (FittingPart::Pane, None);
        Some(())
    }),
    Tampering::new("a frame that turns", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        w.graph.portals[p].fittings[f].part = FittingPart::Frame;
        Some(())
    }),
    Tampering::new("a leaf that does not move", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        w.graph.portals[p].fittings[f].motion = None;
        Some(())
    }),
    Tampering::new("a leaf that no door has", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        w.graph.portals[p].fittings.remove(f);
        Some(())
    }),
    Tampering::new("a pane that is called a leaf", |w, at| {
        let [p, f] = part(w, at, FittingPart::Pane)?;
        let motion = hung(w, p);
        let fitting = &mut w.graph.portals[p].fittings[f];
        (fitting.part, fitting.motion) = (FittingPart::Leaf, Some(motion));
        Some(())
    }),
    Tampering::new("a pane that is called a frame", |w, at| {
        let [p, f] = part(w, at, FittingPart::Pane)?;
        w.graph.portals[p].fittings[f].part = FittingPart::Frame;
        Some(())
    }),
    Tampering::new("furniture that is called a leaf", |w, at| {
        furniture(w, at, FittingPart::Leaf)
    }),
    Tampering::new("furniture that is called a frame", |w, at| {
        furniture(w, at, FittingPart::Frame)
    }),
    Tampering::new("furniture that is called a pane", |w, at| {
        furniture(w, at, FittingPart::Pane)
    }),
    Tampering::new("a leaf in two doors with two motions", |w, at| {
        let [a, b] = two_leaves(w, at)?;
        let mut own = w.graph.portals[a[0]].fittings[a[1]].clone();
        own.motion = w.graph.portals[b[0]].fittings[b[1]].motion;
        w.graph.portals[b[0]].fittings.push(own);
        sort(w)
    }),
    Tampering::new("a leaf in two doors with one motion", |w, at| {
        let [a, b] = two_leaves(w, at)?;
        let own = w.graph.portals[a[0]].fittings[a[1]].clone();
        w.graph.portals[b[0]].fittings.push(own);
        sort(w)
    }),
    Tampering::new("a hinge a thousand kilometers away", |w, at| {
        turned(w, at, |through, _| through[at] = 1e6)
    }),
    Tampering::new("a hinge at a huge number", |w, at| {
        turned(w, at, |through, _| through[at] = 1e38)
    }),
    Tampering::new("a leaf moved within its room", |w, at| {
        let [p, f] = leaf(w, at, |_| true)?;
        let detail = w.graph.portals[p].fittings[f].detail as usize;
        let normal = w.graph.portals[p].normal;
        let place = &mut w.details[detail].transform[12..15];
        place
            .iter_mut()
            .zip(normal)
            .for_each(|(x, n)| *x += n * 0.8);
        Some(())
    }),
];

/// Portal and fitting of the leaf at a place whose motion fits.
fn leaf(w: &World, place: usize, is_fit: impl Fn(&Motion) -> bool) -> Option<[usize; 2]> {
    let portals = w.graph.portals.iter().enumerate();
    let all: Vec<[usize; 2]> = portals
        .flat_map(|(p, portal)| (0..portal.fittings.len()).map(move |f| [p, f]))
        .filter(|&[p, f]| {
            let own = &w.graph.portals[p].fittings;
            // The first of those that move alike is the leaf, the others its handles.
            let is_first = own[..f].iter().all(|o| o.motion != own[f].motion);
            let is_leaf = own[f].part == FittingPart::Leaf && is_first;
            is_leaf && own[f].motion.as_ref().is_some_and(&is_fit)
        })
        .collect();
    pick(all.len(), place, |_| true).map(|i| all[i])
}

fn turning(w: &World, place: usize) -> Option<[usize; 2]> {
    leaf(w, place, |m| matches!(m.kind, MotionKind::Turn { .. }))
}

/// A leaf that is hung at one of its faces, which shows to which side it opens.
fn thick_turning(w: &World, place: usize) -> Option<[usize; 2]> {
    let all: Vec<[usize; 2]> = (0..w.graph.portals.len())
        .flat_map(|p| (0..w.graph.portals[p].fittings.len()).map(move |f| [p, f]))
        .filter(|&[p, f]| {
            let fitting = &w.graph.portals[p].fittings[f];
            let Some(motion) = fitting.motion else {
                return false;
            };
            let MotionKind::Turn { through, .. } = motion.kind else {
                return false;
            };
            let (middle, _) = leaf_box(w, [p, f]);
            let normal = w.graph.portals[p].normal;
            let off: f32 = (0..3).map(|k| (through[k] - middle[k]) * normal[k]).sum();
            motion.shut == 0.0 && off.abs() > 0.015
        })
        .collect();
    pick(all.len(), place, |_| true).map(|i| all[i])
}

fn part(w: &World, place: usize, part: FittingPart) -> Option<[usize; 2]> {
    let all: Vec<[usize; 2]> = (0..w.graph.portals.len())
        .flat_map(|p| (0..w.graph.portals[p].fittings.len()).map(move |f| [p, f]))
        .filter(|&[p, f]| w.graph.portals[p].fittings[f].part == part)
        .collect();
    pick(all.len(), place, |_| true).map(|i| all[i])
}

fn two_leaves(w: &World, at: usize) -> Option<[[usize; 2]; 2]> {
    let pair = [leaf(w, at, |_| true)?, leaf(w, (at + 1) % 3, |_| true)?];
    (pair[0][0] != pair[1][0]).then_some(pair)
}

/// Middle and half size of a leaf where the file has it.
fn leaf_box(w: &World, [p, f]: [usize; 2]) -> ([f32; 3], [f32; 3]) {
    let detail = &w.details[w.graph.portals[p].fittings[f].detail as usize];
    let by = detail.placement();
    let primitives = &w.detail_meshes[detail.mesh as usize].primitives;
    let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
    for q in primitives.iter().flat_map(|q| &q.positions) {
        let q = by.transform_point3((*q).map(f64::from).into()).as_vec3();
        for k in 0..3 {
            low[k] = low[k].min(q[k]);
            high[k] = high[k].max(q[k]);
        }
    }
    let half = |sign: f32| [0, 1, 2].map(|k| 0.5 * (high[k] + sign * low[k]));
    (half(1.0), half(-1.0))
}

fn turned(w: &mut World, at: usize, change: impl Fn(&mut [f32; 3], &mut [f32; 3])) -> Option<()> {
    let [p, f] = turning(w, at)?;
    let motion = w.graph.portals[p].fittings[f].motion.as_mut()?;
    if let MotionKind::Turn { through, axis } = &mut motion.kind {
        change(through, axis);
    }
    alike(w, p, f)
}

fn moved(w: &mut World, at: usize, change: impl Fn(&mut Motion)) -> Option<()> {
    let [p, f] = leaf(w, at, |_| true)?;
    change(w.graph.portals[p].fittings[f].motion.as_mut()?);
    alike(w, p, f)
}

/// Gives the motion of a leaf to it in other doors, too.
fn alike(w: &mut World, p: usize, f: usize) -> Option<()> {
    let fitting = w.graph.portals[p].fittings[f].clone();
    let all = w.graph.portals.iter_mut().flat_map(|p| &mut p.fittings);
    for other in all.filter(|o| o.detail == fitting.detail) {
        other.motion = fitting.motion;
    }
    Some(())
}

fn sort(w: &mut World) -> Option<()> {
    for portal in &mut w.graph.portals {
        portal.fittings.sort_by_key(|f| f.detail);
    }
    Some(())
}

/// The motion of a leaf hung at the side of an opening.
fn hung(w: &World, portal: usize) -> Motion {
    let corners = &w.graph.portals[portal].outline;
    let through =
        corners.iter().copied().fold(
            corners[0],
            |a, b| {
                if (b[0], b[2]) < (a[0], a[2]) { b } else { a }
            },
        );
    Motion {
        kind: MotionKind::Turn {
            through,
            axis: [0.0, 1.0, 0.0],
        },
        shut: 0.0,
        open: FRAC_PI_2,
    }
}

fn furniture(w: &mut World, at: usize, part: FittingPart) -> Option<()> {
    let detail = loose_detail(w, at)? as u32;
    let p = pick(w.graph.portals.len(), at, |i| {
        let kind = w.graph.portals[i].kind;
        matches!(kind, PortalKind::Door | PortalKind::Window)
            && (part == FittingPart::Pane) == (kind == PortalKind::Window)
    })?;
    let motion = (part == FittingPart::Leaf).then(|| hung(w, p));
    let fitting = Fitting {
        detail,
        part,
        motion,
    };
    w.graph.portals[p].fittings.push(fitting);
    sort(w)
}
