//! Polygons with more than three vertices: planarity, and ear clipping in their own plane.
//!
//! The `earcut` crate clips ears. It keeps vertices in the middle of a straight edge, as long as the outline does not
//! cross itself; dropping one would tear the surface from its neighbor.

use crate::ImportError;
use crate::builder::Builder;
use earcut::Earcut;
use enfilade_geom::DVec3;

/// Most vertices of one polygon. Ear clipping can take quadratic time.
pub(crate) const MAX_CORNERS: usize = 4096;

/// Largest distance of a vertex from its polygon's plane. [Units: wu]
const PLANAR: f64 = 1e-3;

/// A vertex this far inside the line through its neighbors makes a polygon concave. [Units: wu]
const NOTCH: f64 = 1e-5;

const CROSSES: &str = "a polygon that crosses or touches itself; look at the result";

/// Splits polygons into triangles; reuses its buffers.
pub(crate) struct Splitter {
    earcut: Earcut<f64>,
    flat: Vec<[f64; 2]>,
    triangles: Vec<u32>,
}

impl Splitter {
    pub(crate) fn new() -> Self {
        Self {
            earcut: Earcut::new(),
            flat: Vec::new(),
            triangles: Vec::new(),
        }
    }

    /// Returns the triangles of a polygon as triples of vertex numbers, with the polygon's winding.
    ///
    /// `unit` is meters per unit of the vertices.
    pub(crate) fn split(
        &mut self,
        corners: &[DVec3],
        unit: f64,
        builder: &mut Builder<'_>,
        place: impl Fn() -> String,
    ) -> Result<&[u32], ImportError> {
        self.triangles.clear();
        let n = corners.len();
        if n > MAX_CORNERS {
            return Err(ImportError::TooMuch {
                path: builder.path.clone(),
                place: place(),
                what: "vertices of one polygon",
                n: n as u64,
                limit: MAX_CORNERS as u64,
            });
        }
        if n == 3 {
            self.triangles.extend([0, 1, 2]);
        }
        if n <= 3 {
            return Ok(&self.triangles);
        }
        builder.report.n_polygons += 1;
        let center = corners.iter().sum::<DVec3>() / n as f64;
        let normal = newell_normal(corners, center).normalize_or_zero();
        if normal == DVec3::ZERO || !center.is_finite() {
            // Without a plane any triangles do; the cleaning report shows them as degenerate.
            self.fan(n);
            return Ok(&self.triangles);
        }
        let off = corners
            .iter()
            .map(|&c| (c - center).dot(normal).abs())
            .fold(0.0, f64::max);
        if off * unit > PLANAR {
            let position = builder.base.transform_point3(center);
            builder.report.non_planar_polygons.add(position, &place);
        }
        let (u, v) = normal.any_orthonormal_pair();
        self.flat.clear();
        self.flat.extend(
            corners
                .iter()
                .map(|&c| [(c - center).dot(u), (c - center).dot(v)]),
        );
        let position = || builder.base.transform_point3(center);
        if !self.is_convex(NOTCH / unit) {
            if self.crosses_itself() {
                builder.report.crossing_polygons.add(position(), &place);
            } else if self.is_notched(NOTCH / unit) {
                builder.report.concave_polygons.add(position(), &place);
            }
        }
        // `u, v, normal` is right-handed, so the outline runs counter-clockwise.
        if n == 4 {
            if !self.split_quad() {
                builder.note(place(), CROSSES);
            }
            return Ok(&self.triangles);
        }
        self.earcut.earcut(
            self.flat.iter().copied(),
            &[] as &[u32],
            &mut self.triangles,
        );
        // All results so far are counter-clockwise, but the crate does not promise it.
        let mut triangles = std::mem::take(&mut self.triangles);
        for t in triangles.chunks_exact_mut(3) {
            if self.area([t[0], t[1], t[2]].map(|i| i as usize)) < 0.0 {
                t.swap(1, 2);
            }
        }
        self.triangles = triangles;
        if self.triangles.len() != 3 * (n - 2) {
            builder.note(place(), CROSSES);
        }
        if self.triangles.is_empty() {
            self.fan(n);
        }
        Ok(&self.triangles)
    }

    /// Cuts a quad along the diagonal that gives both halves the quad's winding, from vertex 0 if both diagonals do;
    /// `false` if neither does.
    ///
    /// A bent quad, seen along its mean normal, may touch itself. Two triangles are correct even then, but `earcut`
    /// returns one.
    fn split_quad(&mut self) -> bool {
        let cuts = [[0, 1, 2, 0, 2, 3], [1, 2, 3, 1, 3, 0]];
        let [first, second] = cuts.map(|c| {
            let one = self.area([c[0], c[1], c[2]]);
            one.min(self.area([c[3], c[4], c[5]]))
        });
        let cut = if first > 0.0 || first >= second {
            cuts[0]
        } else {
            cuts[1]
        };
        self.triangles.extend(cut.map(|i| i as u32));
        first.max(second) > 0.0
    }

    /// Returns `true` if a vertex lies more than `depth` inside the line through its neighbors.
    fn is_notched(&self, depth: f64) -> bool {
        let n = self.flat.len();
        (0..n).any(|i| {
            let (before, after) = ((i + n - 1) % n, (i + 1) % n);
            let [a, b] = [before, after].map(|k| self.flat[k]);
            let width = (b[0] - a[0]).hypot(b[1] - a[1]);
            self.area([before, i, after]) < -depth * width
        })
    }

    /// Returns `true` without reflex vertices and with a single turn: the outline then cannot cross itself.
    fn is_convex(&self, depth: f64) -> bool {
        let n = self.flat.len();
        let turns = (0..n).map(|i| {
            let [a, b, c] = [i, (i + 1) % n, (i + 2) % n].map(|k| self.flat[k]);
            let (p, q) = ([b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]);
            (p[0] * q[1] - p[1] * q[0]).atan2(p[0] * q[0] + p[1] * q[1])
        });
        // A single turn is `TAU`, two are twice that.
        !self.is_notched(depth) && turns.sum::<f64>() < 1.5 * std::f64::consts::TAU
    }

    /// Returns `true` if two edges without a common vertex cross. Time: `n log n`, plus the pairs of edges that
    /// overlap along the first axis.
    fn crosses_itself(&self) -> bool {
        let n = self.flat.len();
        let ends = |i: usize| [self.flat[i], self.flat[(i + 1) % n]];
        let low = |i: usize| ends(i)[0][0].min(ends(i)[1][0]);
        let high = |i: usize| ends(i)[0][0].max(ends(i)[1][0]);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&i, &j| low(i).total_cmp(&low(j)));
        order.iter().enumerate().any(|(k, &i)| {
            let beside = order[k + 1..].iter().take_while(|&&j| low(j) < high(i));
            beside.into_iter().any(|&j| {
                let is_next = (i + 1) % n == j || (j + 1) % n == i;
                let (i1, j1) = ((i + 1) % n, (j + 1) % n);
                !is_next
                    && self.area([i, i1, j]) * self.area([i, i1, j1]) < 0.0
                    && self.area([j, j1, i]) * self.area([j, j1, i1]) < 0.0
            })
        })
    }

    fn fan(&mut self, n: usize) {
        self.triangles
            .extend((1..n as u32 - 1).flat_map(|i| [0, i, i + 1]));
    }

    /// Returns twice the signed area.
    fn area(&self, t: [usize; 3]) -> f64 {
        let [a, b, c] = t.map(|i| self.flat[i]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    }
}

/// Returns twice the area vector (Newell's method), about `center` for precision.
fn newell_normal(corners: &[DVec3], center: DVec3) -> DVec3 {
    let n = corners.len();
    (0..n)
        .map(|i| (corners[i] - center).cross(corners[(i + 1) % n] - center))
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ImportOptions;
    use proptest::prelude::*;

    fn split(corners: &[DVec3]) -> (Vec<u32>, u64, usize) {
        let options = ImportOptions::default();
        let mut builder = Builder::new(&options).unwrap();
        let mut splitter = Splitter::new();
        let triangles = splitter
            .split(corners, 1.0, &mut builder, || "here".into())
            .unwrap()
            .to_vec();
        let report = &builder.report;
        (triangles, report.non_planar_polygons.n, report.notes.len())
    }

    /// Returns the area vector of the triangles and the sum of their areas, both doubled.
    fn areas(corners: &[DVec3], triangles: &[u32]) -> (DVec3, f64) {
        triangles
            .chunks_exact(3)
            .fold((DVec3::ZERO, 0.0), |(vector, sum), t| {
                let [a, b, c] = [t[0], t[1], t[2]].map(|i| corners[i as usize]);
                let normal = (b - a).cross(c - a);
                (vector + normal, sum + normal.length())
            })
    }

    fn on_plane(outline: &[[f64; 2]]) -> Vec<DVec3> {
        outline
            .iter()
            .map(|p| DVec3::new(p[0], 2.0, -p[1]))
            .collect()
    }

    #[test]
    fn a_concave_polygon_with_a_corner_mid_edge_is_covered_exactly_once() {
        // An L of area 3 with one vertex in the middle of its longest edge.
        let outline = [
            [0., 0.],
            [1., 0.],
            [2., 0.],
            [2., 1.],
            [1., 1.],
            [1., 2.],
            [0., 2.],
        ];
        let corners = on_plane(&outline);
        let (triangles, n_bent, n_notes) = split(&corners);
        let (vector, sum) = areas(&corners, &triangles);
        assert_eq!((triangles.len(), n_bent, n_notes), (15, 0, 0));
        assert_eq!(vector, DVec3::new(0.0, 6.0, 0.0));
        assert_eq!(sum, 6.0);
    }

    #[test]
    fn a_bent_quad_is_reported_and_a_flat_one_is_not() {
        let flat = on_plane(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
        assert_eq!(split(&flat).1, 0);
        let mut bent = flat;
        bent[2].y += 0.01;
        assert_eq!(split(&bent).1, 1);
    }

    #[test]
    fn quads_give_two_triangles_whatever_their_shape() {
        // Concave at vertex 1: only the cut from there stays inside.
        let arrow = on_plane(&[[0., 0.], [1., 0.5], [2., 0.], [1., 3.]]);
        let (triangles, _, n_notes) = split(&arrow);
        let (vector, sum) = areas(&arrow, &triangles);
        assert_eq!((vector.length(), sum, n_notes), (5.0, 5.0, 0));
        // Found by `obj_and_ply_agree`: bent so much that it touches itself, seen from above.
        for height in 0..9 {
            let bent = [(0, 0, 0), (0, height, 1), (1, 0, 1), (1, 4, 0)];
            let bent = bent.map(|(x, y, z)| DVec3::new(x.into(), y.into(), z.into()));
            assert_eq!(split(&bent).0.len(), 6, "{height}");
        }
    }

    #[test]
    fn concave_and_crossing_outlines_are_counted() {
        let count = |outline: &[[f64; 2]]| {
            let options = ImportOptions::default();
            let mut builder = Builder::new(&options).unwrap();
            let corners = on_plane(outline);
            let mut splitter = Splitter::new();
            let split = splitter.split(&corners, 1.0, &mut builder, || "here".into());
            assert!(!split.unwrap().is_empty());
            let report = &builder.report;
            (report.concave_polygons.n, report.crossing_polygons.n)
        };
        let square = [[0., 0.], [1., 0.], [1., 1.], [0., 1.]];
        assert_eq!(count(&square), (0, 0));
        assert_eq!(count(&[[0., 0.], [1., 0.5], [2., 0.], [1., 3.]]), (1, 0));
        assert_eq!(count(&[[0., 0.], [2., 2.], [2., 0.], [0., 3.]]), (0, 1));
        // A vertex in the middle of an edge, up to rounding.
        let straight = [[0., 0.], [0.5, 1e-7], [1., 0.], [1., 1.], [0., 1.]];
        assert_eq!(count(&straight), (0, 0));
        // A five-pointed star, drawn without lifting the pen: every vertex turns the same way.
        let star: Vec<[f64; 2]> = (0..5)
            .map(|i| f64::from(i) * 0.4 * std::f64::consts::TAU)
            .map(|a| [a.cos(), a.sin()])
            .collect();
        assert_eq!(count(&star), (0, 1));
    }

    #[test]
    fn polygons_without_a_plane_still_give_triangles() {
        assert_eq!(split(&[DVec3::ONE; 5]).0.len(), 9);
        let line: Vec<DVec3> = (0..4).map(|i| DVec3::X * f64::from(i)).collect();
        assert_eq!(split(&line).0.len(), 6);
        // A bow tie crosses itself.
        let bow = on_plane(&[[0., 0.], [2., 2.], [2., 0.], [0., 3.]]);
        assert!(!split(&bow).0.is_empty());
    }

    proptest! {
        /// Star-shaped outlines are simple, so the triangles cover them once, all with the same winding.
        #[test]
        fn star_outlines_are_covered_once(
            radii in prop::collection::vec(0.1f64..10.0, 4..40),
            turn in prop::array::uniform3(-1.0f64..1.0),
        ) {
            let n = radii.len() as f64;
            let axis = DVec3::from_array(turn).try_normalize().unwrap_or(DVec3::Z);
            let (u, v) = axis.any_orthonormal_pair();
            let corners: Vec<DVec3> = radii.iter().enumerate().map(|(i, r)| {
                let angle = i as f64 / n * std::f64::consts::TAU;
                (u * angle.cos() + v * angle.sin()) * *r
            }).collect();
            let (triangles, n_bent, _) = split(&corners);
            let (vector, sum) = areas(&corners, &triangles);
            // The outline's own area, by sectors.
            let m = radii.len();
            let sector = (std::f64::consts::TAU / n).sin();
            let area: f64 = (0..m).map(|i| radii[i] * radii[(i + 1) % m] * sector).sum();
            // 1e-9: forty additions of numbers up to 100 in f64.
            prop_assert!((sum - area).abs() < 1e-9 * area.max(1.0));
            prop_assert!((vector - axis * area).length() < 1e-9 * area.max(1.0));
            prop_assert_eq!(n_bent, 0);
            prop_assert_eq!(triangles.len(), 3 * (m - 2));
        }
    }
}
