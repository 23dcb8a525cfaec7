//! The hourglass of a sequence of portals: the bounds of all lines that pass them in order.
//!
//! After Gjørup 1999, section 2.2.2, who builds it portal by portal, and Dirkse 2002, section 7.4, who clips source
//! and destination along the sequence. Here the waist consists of two polygons, the remaining parts of the first and
//! the last portal, and the planes that separate them; each pushed portal clips both. The space behind the last
//! portal and in front of all these planes is convex, and is exactly the space that lines through the two polygons
//! reach. Portals between them narrow the polygons, and so the planes.
//!
//! Errs outwards: a line that passes all portals at least the clearance inside their edges is never lost.

use enfilade_cpg::{SightGraph, SightGraphError};
use enfilade_geom::{DVec3, Plane};

use crate::clip::{Arena, Poly};
use crate::config::KEPT;
use crate::dirs::Dirs;
use crate::flow::{back_of, facing, front_of};
use crate::planes::{FacedOutline, Four, LANES, Side, pack, separators};
use crate::tolerance::{HalfSpace, Tolerance};

/// Builds the hourglasses of one graph.
pub struct Hourglasses {
    dirs: Dirs,
    tolerance: Tolerance,
    /// For each direction in the graph's numbers, its index in `dirs`.
    place: Vec<u32>,
}

/// Bounds of all lines through a sequence of portals.
#[derive(Clone, Debug, PartialEq)]
pub struct Hourglass {
    sequence: Vec<u32>,
    first: Vec<DVec3>,
    last: Vec<DVec3>,
    planes: Vec<Plane>,
}

impl Hourglass {
    /// Returns the portals, as directions of [`SightGraph`], in the order in which lines pass them.
    #[must_use]
    pub fn sequence(&self) -> &[u32] {
        &self.sequence
    }

    /// Returns the convex part of the first portal that lines through all portals may pass.
    #[must_use]
    pub fn first(&self) -> &[DVec3] {
        &self.first
    }

    /// Returns the convex part of the last portal that lines through all portals may pass.
    #[must_use]
    pub fn last(&self) -> &[DVec3] {
        &self.last
    }

    /// Returns the planes that bound the space that lines reach behind the last portal. It lies in front of each.
    #[must_use]
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Returns `true` if a line through the portals may reach a point behind the last, within `slack`. [Units: wu]
    #[must_use]
    pub fn reaches(&self, p: DVec3, slack: f64) -> bool {
        self.planes
            .iter()
            .all(|plane| plane.signed_distance(p) >= -slack)
    }
}

impl Hourglasses {
    /// Takes each portal of a graph as its convex winding. Lines that pass nearer to an edge than 1e-8 of the largest
    /// coordinate may be lost, as in [`see_all`](crate::see_all).
    ///
    /// # Errors
    ///
    /// A broken graph.
    pub fn new(graph: &SightGraph) -> Result<Self, SightGraphError> {
        graph.validate()?;
        let dirs = Dirs::new(graph);
        let mut place = vec![0; dirs.len()];
        for (k, dir) in dirs.all.iter().enumerate() {
            place[dir.id as usize] = k as u32;
        }
        Ok(Self {
            tolerance: Tolerance::new(dirs.scale, KEPT * 1e-8 * dirs.scale),
            dirs,
            place,
        })
    }

    pub(crate) fn dirs(&self) -> &Dirs {
        &self.dirs
    }

    /// Returns the index in [`Hourglasses::dirs`] of a direction of the graph.
    pub(crate) fn place(&self, direction: u32) -> usize {
        self.place[direction as usize] as usize
    }

    pub(crate) fn clearance(&self) -> f64 {
        self.tolerance.clearance
    }

    pub(crate) fn tolerance(&self) -> &Tolerance {
        &self.tolerance
    }

    /// Returns the hourglass of a single portal: the whole space in front of it. `None` if the graph does not have
    /// the direction, or the portal has no area.
    #[must_use]
    pub fn of_portal(&self, direction: u32) -> Option<Hourglass> {
        let at = *self.place.get(direction as usize)?;
        if self.dirs.all[at as usize].normal == DVec3::ZERO {
            return None;
        }
        let winding = self.dirs.winding(at as usize).to_vec();
        Some(Hourglass {
            sequence: vec![direction],
            first: winding.clone(),
            last: winding,
            planes: vec![plane_of(front_of(&self.dirs, at))],
        })
    }

    /// Returns the hourglass of a sequence extended by one portal. `None` if no line passes all of them, or if the
    /// portal does not lead out of the cell that the sequence leads into, or leads straight back.
    ///
    /// Time: the product of the vertex counts of two polygons.
    #[must_use]
    pub fn push(&self, through: &Hourglass, direction: u32) -> Option<Hourglass> {
        let dirs = &self.dirs;
        let q = *self.place.get(direction as usize)?;
        let pass = self.place[through.sequence[through.sequence.len() - 1] as usize];
        let follows = dirs.all[pass as usize].to == dirs.all[q as usize].from;
        if !follows || q == dirs.reverse[pass as usize] {
            return None;
        }
        self.narrow(through, q)
    }

    /// Returns the hourglass of two portals, regardless of those between: it encloses that of each sequence that
    /// joins them.
    pub(crate) fn between(&self, first: u32, last: u32) -> Option<Hourglass> {
        self.narrow(&self.of_portal(first)?, self.place[last as usize])
    }

    fn narrow(&self, through: &Hourglass, q: u32) -> Option<Hourglass> {
        let (dirs, tolerance) = (&self.dirs, &self.tolerance);
        let [source_dir, pass_dir] =
            [0, through.sequence.len() - 1].map(|k| self.place[through.sequence[k] as usize]);
        let (turn, source_turn) = (
            dirs.all[q as usize].turn,
            dirs.all[source_dir as usize].turn,
        );
        if dirs.all[q as usize].normal == DVec3::ZERO {
            return None;
        }
        let mut arena = Arena::default();
        let mut target = arena.push(dirs.winding(q as usize), q);
        for front in [source_dir, pass_dir].map(|d| front_of(dirs, d)) {
            target = arena.clip(target, front, turn, tolerance)?;
        }
        for plane in &through.planes {
            target = arena.clip(target, half_space_of(plane), turn, tolerance)?;
        }
        let mut source = arena.push(&through.first, source_dir);
        source = arena.clip(source, back_of(dirs, q as usize), source_turn, tolerance)?;
        let mut planes = Vec::new();
        if pass_dir != source_dir {
            let pass = arena.push(&through.last, pass_dir);
            self.separate(&arena, pass, target, &mut planes);
            for half_space in half_spaces(&planes, Side::Before) {
                source = arena.clip(source, half_space, source_turn, tolerance)?;
            }
            // The remaining part of the source narrows the last portal in turn.
            planes.clear();
            self.separate(&arena, source, pass, &mut planes);
            for half_space in half_spaces(&planes, Side::After) {
                target = arena.clip(target, half_space, turn, tolerance)?;
            }
            planes.clear();
        }
        self.separate(&arena, source, target, &mut planes);
        pack(&mut planes, tolerance);
        let separators = half_spaces(&planes, Side::After).map(plane_of);
        let front = plane_of(front_of(dirs, q));
        let mut sequence = through.sequence.clone();
        sequence.push(dirs.all[q as usize].id);
        Some(Hourglass {
            sequence,
            first: arena.get(source).to_vec(),
            last: arena.get(target).to_vec(),
            planes: [front].into_iter().chain(separators).collect(),
        })
    }

    fn separate(&self, arena: &Arena, a: Poly, b: Poly, out: &mut Vec<Four>) {
        separators(
            FacedOutline::new(arena.get(a), facing(&self.dirs, a.dir)),
            FacedOutline::new(arena.get(b), facing(&self.dirs, b.dir)),
            &self.tolerance,
            out,
        );
    }
}

/// Returns the actual planes, each as the half-space on one side of it.
fn half_spaces(planes: &[Four], side: Side) -> impl Iterator<Item = HalfSpace> + '_ {
    let lanes = planes
        .iter()
        .flat_map(move |four| (0..LANES).map(move |lane| four.half_space(side, lane)));
    lanes.filter(|half_space| half_space.normal != DVec3::ZERO)
}

fn plane_of(half_space: HalfSpace) -> Plane {
    Plane {
        normal: half_space.normal,
        d: -half_space.offset,
    }
}

fn half_space_of(plane: &Plane) -> HalfSpace {
    HalfSpace {
        normal: plane.normal,
        offset: -plane.d,
    }
}
