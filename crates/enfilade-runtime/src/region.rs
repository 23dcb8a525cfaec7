//! Convex regions of the screen, narrowed by portals.
//!
//! Luebke & Georges, "Portals and Mirrors" (I3D 1995), narrow a rectangle; Gjørup, *Portal techniques*
//! (1999), section 2.3.4, keeps the convex outline and removes edges from it outwards, least area first.
//! Here the outline is clipped in homogeneous coordinates, in `f64`.
//!
//! **Errs to visible.** A stored outline may be off by rounding. It is clipped to a region widened by the
//! world's tolerance, and the result is widened by the tolerance as seen from the eye at the depth of its
//! nearest vertex. Derivation: a point `p` of the true opening has a point `p'` of the outline within the
//! tolerance `d`. For an edge `e` of the clipped outline, `e·q' >= 0`, so `e·q >= -d·stretch` and, on the
//! screen, `e·q/w >= -d·stretch / w(p)`, where `w(p) >= w_min - d`.

use glam::{DVec2, DVec3};

/// Maximum number of vertices of an outline; longer ones are reduced when a world is loaded.
pub(crate) const MAX_CORNERS: usize = 32;
/// Maximum number of edges of a region.
pub(crate) const MAX_EDGES: usize = 16;
/// Capacity for an outline clipped by all edges of a region, its rectangle and a plane.
const BUFFER: usize = MAX_CORNERS + MAX_EDGES + 12;

/// Vertices of a polygon, on the stack.
pub(crate) struct Polygon<T> {
    points: [T; BUFFER],
    len: usize,
}

impl<T: Copy + Default> Polygon<T> {
    pub(crate) fn new() -> Self {
        Self {
            points: [T::default(); BUFFER],
            len: 0,
        }
    }

    #[inline]
    pub(crate) fn push(&mut self, p: T) {
        self.points[self.len] = p;
        self.len += 1;
    }

    #[inline]
    pub(crate) fn as_slice(&self) -> &[T] {
        &self.points[..self.len]
    }

    fn remove(&mut self, i: usize) {
        self.points.copy_within(i + 1..self.len, i);
        self.len -= 1;
    }
}

/// A polygon being clipped, alternating between two buffers.
pub(crate) struct Clipper {
    buffers: [Polygon<DVec3>; 2],
    current: usize,
    /// True if a buffer overflowed. A cut adds at most one vertex, unless rounding bends a sliver.
    is_full: bool,
}

impl Clipper {
    pub(crate) fn new() -> Self {
        Self {
            buffers: [Polygon::new(), Polygon::new()],
            current: 0,
            is_full: false,
        }
    }

    pub(crate) fn clear(&mut self) {
        self.is_full = false;
        self.buffers[self.current].len = 0;
    }

    #[inline]
    pub(crate) fn push(&mut self, q: DVec3) {
        self.buffers[self.current].push(q);
    }

    pub(crate) fn as_slice(&self) -> &[DVec3] {
        self.buffers[self.current].as_slice()
    }

    /// Keeps the part with `plane · q >= least`; returns `true` if any is left.
    #[inline]
    pub(crate) fn cut(&mut self, plane: DVec3, least: f64) -> bool {
        let [a, b] = &mut self.buffers;
        let (from, to) = if self.current == 0 { (a, b) } else { (b, a) };
        let from = from.as_slice();
        let n_in = from.iter().filter(|q| plane.dot(**q) >= least).count();
        if n_in == from.len() || n_in == 0 {
            return n_in > 0;
        }
        to.len = 0;
        let mut p = from[from.len() - 1];
        let mut sp = plane.dot(p) - least;
        for &q in from {
            let sq = plane.dot(q) - least;
            if (sp >= 0.0) != (sq >= 0.0) {
                to.push(p + (q - p) * (sp / (sp - sq)));
            }
            if sq >= 0.0 {
                to.push(q);
            }
            if to.len + 2 > BUFFER {
                self.is_full = true;
                return true;
            }
            (p, sp) = (q, sq);
        }
        self.current = 1 - self.current;
        true
    }
}

/// Method of narrowing the view at a portal. All answers are supersets; tighter ones cost more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Narrowing {
    /// The rectangle around the portal on the screen.
    Rectangle,
    /// The portal's outline, with up to 16 edges.
    Polygon,
    /// An outline of at most this many edges, reduced outwards. [Limit: 3 to 16]
    ///
    /// The rectangle around the portal always bounds the view as well.
    PolygonOf(u8),
}

impl Narrowing {
    fn max_edges(self) -> usize {
        match self {
            Self::Rectangle => 0,
            Self::Polygon => MAX_EDGES,
            Self::PolygonOf(k) => usize::from(k).clamp(3, MAX_EDGES),
        }
    }
}

/// A convex part of the screen: a rectangle, and edges that cut off its vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Region {
    /// Minimum of the rectangle, within `[-1, 1]`.
    pub(crate) min: DVec2,
    pub(crate) max: DVec2,
    /// Convex hull of the vertices; grown by `widened`, it holds everything seen through the region.
    corners: [DVec2; MAX_EDGES],
    /// Inside is `e · (x, y, w) >= 0`; `(e.x, e.y)` has unit length.
    edges: [DVec3; MAX_EDGES],
    n_corners: u8,
    n_edges: u8,
    widened: f64,
}

/// Rest of an outline after clipping.
pub(crate) enum Clipped {
    /// Empty: the portal is out of view.
    Out,
    /// So close to the eye that it narrows nothing.
    Near,
    /// A polygon, with depth `w_min` or more.
    Part { w_min: f64 },
}

impl Region {
    /// The whole screen.
    pub(crate) fn screen() -> Self {
        let mut corners = [DVec2::ZERO; MAX_EDGES];
        corners[..4].copy_from_slice(&rectangle(DVec2::NEG_ONE, DVec2::ONE));
        Self {
            min: DVec2::NEG_ONE,
            max: DVec2::ONE,
            corners,
            edges: [DVec3::ZERO; MAX_EDGES],
            n_corners: 4,
            n_edges: 0,
            widened: 0.0,
        }
    }

    pub(crate) fn edges(&self) -> &[DVec3] {
        &self.edges[..usize::from(self.n_edges)]
    }

    pub(crate) fn corners(&self) -> &[DVec2] {
        &self.corners[..usize::from(self.n_corners)]
    }

    /// Returns the distance beyond the hull of the vertices within which something may be seen.
    pub(crate) fn widened(&self) -> f64 {
        self.widened
    }

    /// Returns the four sides of the rectangle, as edges.
    pub(crate) fn sides(&self) -> [DVec3; 4] {
        [
            DVec3::new(1.0, 0.0, -self.min.x),
            DVec3::new(-1.0, 0.0, self.max.x),
            DVec3::new(0.0, 1.0, -self.min.y),
            DVec3::new(0.0, -1.0, self.max.y),
        ]
    }

    fn area(&self) -> f64 {
        let size = self.max - self.min;
        size.x * size.y
    }

    /// Clips the outline in `outline` (clip space) to the region grown by `slack`, and to the half-space
    /// beyond `entry`: `(n, k)` with `n · q >= k`.
    pub(crate) fn clip(
        &self,
        outline: &mut Clipper,
        entry: Option<(DVec3, f64)>,
        slack: f64,
    ) -> Clipped {
        let mut planes = self.sides().into_iter().chain(self.edges().iter().copied());
        if !planes.all(|plane| outline.cut(plane, -slack)) {
            return Clipped::Out;
        }
        if let Some((normal, least)) = entry
            && !outline.cut(normal, least)
        {
            return Clipped::Out;
        }
        let w_min = outline
            .as_slice()
            .iter()
            .fold(f64::INFINITY, |w, q| w.min(q.z));
        // Within the slack of the region's planes, points may even lie a little behind the eye.
        // Twice the slack would suffice for a positive depth; more keeps the widening below 1 / 15.
        if w_min <= 16.0 * slack || outline.is_full {
            return Clipped::Near;
        }
        Clipped::Part { w_min }
    }

    /// Returns the region seen through an outline clipped by [`Region::clip`].
    pub(crate) fn narrowed(
        &self,
        polygon: &[DVec3],
        w_min: f64,
        slack: f64,
        narrowing: Narrowing,
    ) -> Self {
        let mut points = Polygon::new();
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for q in polygon {
            let p = q.truncate() / q.z;
            min = min.min(p);
            max = max.max(p);
            points.push(p);
        }
        // The tolerance itself is at most the slack; 1e-12 covers the rounding of all this.
        let widened = slack / (w_min - slack) + 1e-12;
        self.around(points, min, max, widened, narrowing)
    }

    /// Returns the part of `self` around a convex polygon, widened.
    fn around(
        &self,
        mut points: Polygon<DVec2>,
        min: DVec2,
        max: DVec2,
        widened: f64,
        narrowing: Narrowing,
    ) -> Self {
        let mut out = Self {
            min: (min - widened).max(self.min),
            max: (max + widened).min(self.max),
            n_edges: 0,
            n_corners: 4,
            widened,
            ..Self::screen()
        };
        let area = tidy(&mut points);
        let is_flat = |area: f64| area.abs() <= 1e-9 * (max - min).length_squared();
        let max_edges = narrowing.max_edges();
        if max_edges == 0 || points.len < 3 || is_flat(area) {
            // Seen edge-on, its orientation is rounding noise: use the rectangle.
            out.corners[..4].copy_from_slice(&rectangle(out.min, out.max));
            out.widened = 0.0;
            if max_edges > 0 {
                out.keep_edges_of(self);
            }
            return out;
        }
        if area < 0.0 {
            points.points[..points.len].reverse();
        }
        reduce(&mut points, max_edges);
        let n = points.len;
        if n > MAX_EDGES {
            out.corners[..4].copy_from_slice(&rectangle(out.min, out.max));
            out.widened = 0.0;
            return out;
        }
        for i in 0..n {
            let (a, b) = (points.points[i], points.points[(i + 1) % n]);
            out.corners[i] = a;
            let d = b - a;
            let length = d.length();
            // Redundant with a side of the rectangle.
            let on_side = |at: f64, a: f64, b: f64| (a - at).abs() + (b - at).abs() < 1e-9;
            if length < 1e-9
                || on_side(min.x, a.x, b.x)
                || on_side(max.x, a.x, b.x)
                || on_side(min.y, a.y, b.y)
                || on_side(max.y, a.y, b.y)
            {
                continue;
            }
            let normal = DVec2::new(-d.y, d.x) / length;
            out.edges[usize::from(out.n_edges)] = normal.extend(widened - normal.dot(a));
            out.n_edges += 1;
        }
        out.n_corners = n as u8;
        out
    }

    fn keep_edges_of(&mut self, other: &Self) {
        self.edges = other.edges;
        self.n_edges = other.n_edges;
    }

    /// Returns `true` if everything visible through `self` lies in `other`.
    pub(crate) fn is_within(&self, other: &Self) -> bool {
        let (mut least, mut greatest) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &c in self.corners() {
            least = least.min(c);
            greatest = greatest.max(c);
        }
        // Two bounds hold: the widened vertices, and the rectangle.
        let least = (least - self.widened).max(self.min);
        let greatest = (greatest + self.widened).min(self.max);
        // Nothing is seen beyond the screen, so its own sides need no margin.
        let low = other.min.cmple(DVec2::NEG_ONE) | other.min.cmple(least);
        let high = other.max.cmpge(DVec2::ONE) | other.max.cmpge(greatest);
        (low & high).all()
            && other.edges().iter().all(|e| {
                self.corners()
                    .iter()
                    .all(|c| e.dot(c.extend(1.0)) >= self.widened)
            })
    }

    /// Returns a region that contains both.
    pub(crate) fn joined(&self, other: &Self, narrowing: Narrowing) -> Self {
        let whole = self.rectangle_around(other);
        if narrowing == Narrowing::Rectangle {
            return whole;
        }
        let mut points = Polygon::new();
        let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for &c in self.corners().iter().chain(other.corners()) {
            (min, max) = (min.min(c), max.max(c));
            points.push(c);
        }
        let widened = self.widened.max(other.widened);
        whole.around(hull(&points), min, max, widened, narrowing)
    }

    /// Returns the area of the rectangle around both in excess of their own areas, as a fraction of those.
    pub(crate) fn waste_of_joining(&self, other: &Self) -> f64 {
        let size = self.max.max(other.max) - self.min.min(other.min);
        let own = self.area() + other.area();
        size.x * size.y / own.max(1e-12) - 1.0
    }

    /// Returns the area of its rectangle as a fraction of the screen.
    pub(crate) fn share(&self) -> f64 {
        let size = (self.max.min(DVec2::ONE) - self.min.max(DVec2::NEG_ONE)).max(DVec2::ZERO);
        size.x * size.y * 0.25
    }

    /// Returns the rectangle around both, without edges.
    pub(crate) fn rectangle_around(&self, other: &Self) -> Self {
        let (min, max) = (self.min.min(other.min), self.max.max(other.max));
        let mut out = Self {
            min,
            max,
            ..Self::screen()
        };
        out.corners[..4].copy_from_slice(&rectangle(min, max));
        out
    }
}

fn rectangle(min: DVec2, max: DVec2) -> [DVec2; 4] {
    [min, DVec2::new(max.x, min.y), max, DVec2::new(min.x, max.y)]
}

/// Drops vertices that repeat their neighbor; returns twice the signed area.
fn tidy(points: &mut Polygon<DVec2>) -> f64 {
    let mut n = 0;
    for i in 0..points.len {
        let p = points.points[i];
        if n == 0 || points.points[n - 1].distance_squared(p) > 1e-24 {
            points.points[n] = p;
            n += 1;
        }
    }
    if n > 1 && points.points[0].distance_squared(points.points[n - 1]) <= 1e-24 {
        n -= 1;
    }
    points.len = n;
    let at = points.as_slice();
    (2..n)
        .map(|i| (at[i - 1] - at[0]).perp_dot(at[i] - at[0]))
        .sum()
}

/// Removes edges from a counter-clockwise convex polygon until `max_edges` are left, each time the
/// one whose removal adds the least area (Gjørup 1999, section 2.3.4). Stops early if the neighbors of
/// no edge intersect; a triangle has no edge to spare.
fn reduce(points: &mut Polygon<DVec2>, max_edges: usize) {
    while points.len > max_edges.max(3) {
        let n = points.len;
        let mut best: Option<(f64, usize, DVec2)> = None;
        for i in 0..n {
            let at = |k: usize| points.points[(i + k) % n];
            let (before, a, b, after) = (at(n - 1), at(0), at(1), at(2));
            let (u, v) = (a - before, b - after);
            // The neighbors of edge a b, extended over it, meet where a + s u = b + t v.
            let turn = u.perp_dot(v);
            if turn <= 0.0 {
                continue; // They diverge, or are parallel.
            }
            let s = (b - a).perp_dot(v) / turn;
            let meet = a + u * s;
            let added = (b - a).perp_dot(meet - a).abs();
            if meet.is_finite() && s >= 0.0 && best.is_none_or(|(least, ..)| added < least) {
                best = Some((added, i, meet));
            }
        }
        let Some((_, i, meet)) = best else {
            return;
        };
        points.points[i] = meet;
        points.remove((i + 1) % n);
    }
}

/// Convex hull, counter-clockwise (Andrew's monotone chain).
fn hull(points: &Polygon<DVec2>) -> Polygon<DVec2> {
    let mut sorted = [DVec2::ZERO; BUFFER];
    let sorted = &mut sorted[..points.len];
    sorted.copy_from_slice(points.as_slice());
    sorted.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut out = Polygon::new();
    let add = |base: usize, p: DVec2, out: &mut Polygon<DVec2>| {
        while out.len >= base + 2
            && (out.points[out.len - 1] - out.points[out.len - 2])
                .perp_dot(p - out.points[out.len - 1])
                <= 0.0
        {
            out.len -= 1;
        }
        out.push(p);
    };
    for &p in sorted.iter() {
        add(0, p, &mut out);
    }
    let base = out.len.saturating_sub(1);
    for &p in sorted.iter().rev().skip(1) {
        add(base, p, &mut out);
    }
    out.len = out.len.saturating_sub(1);
    out
}

/// Returns a convex polygon of at most `max_corners` vertices around a convex polygon, in its order.
///
/// Used for outlines when a world is loaded; allocates.
pub(crate) fn reduced_around(points: &[DVec2], max_corners: usize) -> Vec<DVec2> {
    let mut at = points.to_vec();
    // Reduce groups of neighbors, so that the buffer above is always large enough.
    while at.len() > max_corners {
        let mut part = Polygon::new();
        if at.len() <= BUFFER {
            for &p in &at {
                part.push(p);
            }
            let before = part.len;
            reduce(&mut part, max_corners);
            if part.len == before {
                break;
            }
            at = part.as_slice().to_vec();
            continue;
        }
        // Too many for the buffer: keep one edge in four, evenly spaced. The lines of the kept edges
        // bound a polygon that contains the given one.
        let n = at.len();
        let step = n.div_ceil(MAX_CORNERS);
        let chosen: Vec<usize> = (0..n).step_by(step).collect();
        let mut next = Vec::new();
        for (k, &i) in chosen.iter().enumerate() {
            let j = chosen[(k + 1) % chosen.len()];
            let (p, u) = (at[i], at[(i + 1) % n] - at[i]);
            let (q, v) = (at[j], at[(j + 1) % n] - at[j]);
            let turn = u.perp_dot(v);
            let s = (q - p).perp_dot(v) / turn;
            if !(turn > 0.0 && s.is_finite()) {
                // Parallel: return the box instead.
                let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
                for &p in &at {
                    (min, max) = (min.min(p), max.max(p));
                }
                return rectangle(min, max).to_vec();
            }
            next.push(p + u * s);
        }
        at = next;
    }
    if at.len() <= max_corners {
        return at;
    }
    let (mut min, mut max) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for &p in points {
        (min, max) = (min.min(p), max.max(p));
    }
    rectangle(min, max).to_vec()
}
