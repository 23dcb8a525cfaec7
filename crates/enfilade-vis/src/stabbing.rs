//! Test whether any line at all passes a chain of openings: a tiny linear program in Plücker coordinates.
//!
//! A line through `x` along `d` is the six numbers `(d, m)` with `m = x × d`. It passes the edge from `p` to `q` of
//! an opening on the inner side if `d · (p × q) + m · (q - p) > 0`, and it crosses the opening in the right direction
//! if `n · d > 0`: half-spaces through the origin of six dimensions, one row each. After Teller 1992 and Gjørup 1999,
//! section 2.2.3.
//!
//! The point nearest to the origin of the hull of all rows (Wolfe, *Finding the nearest point in a polytope*, 1976)
//! gives the answer. If it is the origin itself, the rows' weights prove that no six numbers satisfy all rows
//! (Farkas), so no line does. Otherwise it is the six numbers that satisfy all by the widest margin, and lines are
//! tried near them. Six numbers are a line only if `d · m = 0`, so some chains stay open.
//!
//! Time: six times the number of rows for each step, and about ten steps for each row that matters.

use enfilade_geom::DVec3;

/// A sum of weighted unit rows this short counts as zero. A line may be lost if its distance inside an opening,
/// relative to the chain's size, times the sine of the angle at which it crosses, is less. A checker requires ten
/// times as much.
const ZERO: f64 = 1e-14;

/// Steps of the search; a chain of 50 edges takes a few dozen.
const MAX_STEPS: usize = 500;

/// An opening of the chain.
pub(crate) struct Gate<'a> {
    pub(crate) winding: &'a [DVec3],
    /// Unit normal about which the vertices run counter-clockwise.
    pub(crate) turn: DVec3,
    /// Unit normal in the direction in which it is crossed.
    pub(crate) normal: DVec3,
}

/// Result of the linear program.
#[derive(Debug, PartialEq)]
pub(crate) enum Answer {
    /// No line: weights of rows whose sum is zero.
    Closed(Vec<(u16, f64)>),
    /// The best guess for a line: a point and a direction.
    Guess(DVec3, DVec3),
    /// Rounding prevents an answer.
    Unknown,
}

type Row = [f64; 6];

/// Tests whether a line passes all gates inside their edges.
pub(crate) fn stabbed(gates: &[Gate<'_>]) -> Answer {
    // An opening without area hides nothing: its edges run back and forth, and would prove that no line passes it.
    if gates.iter().any(|gate| gate.normal == DVec3::ZERO) {
        return Answer::Unknown;
    }
    let (center, size) = frame(gates);
    let rows = rows(gates, center, size);
    if rows.len() > usize::from(u16::MAX) || rows.iter().flatten().any(|x| !x.is_finite()) {
        return Answer::Unknown;
    }
    let Some((nearest, weights)) = nearest(&rows) else {
        return Answer::Unknown;
    };
    if length(&nearest) <= ZERO {
        return Answer::Closed(weights.into_iter().map(|(i, w)| (i as u16, w)).collect());
    }
    let [a, b, c, d, e, f] = nearest;
    let (direction, moment) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
    if direction == DVec3::ZERO {
        return Answer::Unknown;
    }
    // The nearest six numbers that are a line.
    let through = direction.cross(moment) / direction.length_squared();
    Answer::Guess(center + through * size, direction)
}

/// Returns the mean of all vertices, and their greatest distance from it along an axis.
fn frame(gates: &[Gate<'_>]) -> (DVec3, f64) {
    let corners = || gates.iter().flat_map(|g| g.winding);
    let center = corners().sum::<DVec3>() / corners().count().max(1) as f64;
    let reach = corners().map(|&p| (p - center).abs().max_element());
    (center, reach.fold(f64::MIN_POSITIVE, f64::max))
}

/// Returns the rows of each gate in turn: a unit row for each edge, in order, then one for the crossing direction.
/// The rows of edges without length are zero.
fn rows(gates: &[Gate<'_>], center: DVec3, size: f64) -> Vec<Row> {
    let mut rows = Vec::new();
    for gate in gates {
        let side = if gate.turn.dot(gate.normal) < 0.0 {
            -1.0
        } else {
            1.0
        };
        let n = gate.winding.len();
        for i in 0..n {
            let [p, q] = [i, (i + 1) % n].map(|k| (gate.winding[k] - center) / size);
            let (along, turned) = ((q - p) * side, p.cross(q) * side);
            let scale = 1.0 / (along.length_squared() + turned.length_squared()).sqrt();
            let scale = if p == q { 0.0 } else { scale };
            let (d, m) = (turned * scale, along * scale);
            rows.push([d.x, d.y, d.z, m.x, m.y, m.z]);
        }
        let n = gate.normal;
        rows.push([n.x, n.y, n.z, 0.0, 0.0, 0.0]);
    }
    rows
}

fn dot(a: &Row, b: &Row) -> f64 {
    (0..6).map(|k| a[k] * b[k]).sum()
}

fn length(a: &Row) -> f64 {
    dot(a, a).sqrt()
}

fn sum(rows: &[Row], weights: &[(usize, f64)]) -> Row {
    let mut out = [0.0; 6];
    for &(i, w) in weights {
        for k in 0..6 {
            out[k] += rows[i][k] * w;
        }
    }
    out
}

/// Returns the point of the hull of the rows nearest to the origin, and the weighted rows that give it. Ignores zero
/// rows.
fn nearest(rows: &[Row]) -> Option<(Row, Vec<(usize, f64)>)> {
    let first = rows.iter().position(|r| length(r) > 0.0)?;
    let mut weights = vec![(first, 1.0)];
    for _ in 0..MAX_STEPS {
        let x = sum(rows, &weights);
        let x2 = dot(&x, &x);
        if x2.sqrt() <= ZERO {
            return Some((x, weights));
        }
        let (next, least) = rows
            .iter()
            .enumerate()
            .filter(|(_, r)| length(r) > 0.0)
            .map(|(i, r)| (i, dot(&x, r)))
            .min_by(|a, b| a.1.total_cmp(&b.1))?;
        // Allows for the rounding of products, which may exceed the margin itself.
        if least >= x2 - 1e-15 * x2.sqrt() || weights.iter().any(|&(i, _)| i == next) {
            return Some((x, weights));
        }
        let kept = weights.clone();
        weights.push((next, 0.0));
        loop {
            let Some(wanted) = affine(rows, &weights) else {
                return Some((x, kept));
            };
            if wanted.iter().all(|&w| w > 0.0) {
                for (to, w) in weights.iter_mut().zip(wanted) {
                    to.1 = w;
                }
                break;
            }
            // Moves towards it as far as all weights stay positive; weights that reach zero are dropped.
            let mut step = 1.0_f64;
            for (&(_, w), &goal) in weights.iter().zip(&wanted) {
                if goal <= 0.0 {
                    step = step.min(w / (w - goal));
                }
            }
            let mut least = (f64::INFINITY, 0);
            for (k, (to, goal)) in weights.iter_mut().zip(wanted).enumerate() {
                to.1 += (goal - to.1) * step;
                if goal <= 0.0 && to.1 < least.0 {
                    least = (to.1, k);
                }
            }
            weights.remove(least.1);
            weights.retain(|&(_, w)| w > 0.0);
            if weights.is_empty() {
                return None;
            }
        }
    }
    None
}

/// Returns the weights, of sum 1 and any sign, of the point nearest to the origin in the affine hull of the rows.
/// Orthogonalizes from the first row, as products of rows would lose half of the digits.
fn affine(rows: &[Row], weights: &[(usize, f64)]) -> Option<Vec<f64>> {
    let base = rows[weights[0].0];
    let n = weights.len() - 1;
    let mut axes: Vec<Row> = Vec::with_capacity(n);
    // Upper triangle: column j of differences in terms of the axes.
    let mut triangle = vec![[0.0; 7]; n];
    for j in 0..n {
        let mut v = rows[weights[j + 1].0];
        for k in 0..6 {
            v[k] -= base[k];
        }
        let before = length(&v);
        // Two passes are enough.
        for _ in 0..2 {
            for (i, axis) in axes.iter().enumerate() {
                let c = dot(axis, &v);
                triangle[j][i] += c;
                for k in 0..6 {
                    v[k] -= c * axis[k];
                }
            }
        }
        let left = length(&v);
        if j >= 6 || left <= 1e-14 * before {
            return None;
        }
        triangle[j][j] = left;
        axes.push(v.map(|x| x / left));
    }
    let mut rest = base;
    let mut along = vec![0.0; n];
    for _ in 0..2 {
        for (i, axis) in axes.iter().enumerate() {
            let c = dot(axis, &rest);
            along[i] -= c;
            for k in 0..6 {
                rest[k] -= c * axis[k];
            }
        }
    }
    let mut out = vec![0.0; n + 1];
    for j in (0..n).rev() {
        let above: f64 = (j + 1..n).map(|i| triangle[i][j] * out[i + 1]).sum();
        out[j + 1] = (along[j] - above) / triangle[j][j];
    }
    out[0] = 1.0 - out[1..].iter().sum::<f64>();
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    /// A convex polygon around a point of its plane, and unit normals: for its vertex order, and as crossed.
    struct Made(Vec<DVec3>, DVec3, DVec3);

    fn gate(made: &Made) -> Gate<'_> {
        Gate {
            winding: &made.0,
            turn: made.1,
            normal: made.2,
        }
    }

    fn ask(made: &[Made]) -> Answer {
        stabbed(&made.iter().map(gate).collect::<Vec<_>>())
    }

    /// A polygon of 3 to 6 vertices with the point `inside` it by at least a tenth, crossed along `ahead`.
    fn around(rng: &mut Rng, inside: DVec3, ahead: DVec3) -> Made {
        let mut unit = || 2.0 * rng.unit() - 1.0;
        let mut normal = DVec3::new(unit(), unit(), unit()).normalize();
        // At least 6 degrees off its plane.
        if normal.dot(ahead).abs() < 0.1 {
            normal = ahead;
        }
        let across = normal.any_orthonormal_vector();
        let along = normal.cross(across);
        let n = 3 + rng.below(4);
        let shift = across * (0.3 * rng.unit()) + along * (0.3 * rng.unit());
        let corner = |k: usize| {
            let angle = k as f64 / n as f64 * std::f64::consts::TAU;
            inside + shift + (across * angle.cos() + along * angle.sin()) * 1.2
        };
        let winding = (0..n).map(corner).collect();
        let crossed = normal * normal.dot(ahead).signum();
        Made(winding, normal, crossed)
    }

    fn margin(made: &Made, [origin, direction]: [DVec3; 2]) -> f64 {
        let speed = made.2.dot(direction);
        let y = origin + direction * (made.2.dot(made.0[0] - origin) / speed);
        let n = made.0.len();
        let sides = (0..n).map(|i| {
            let (p, q) = (made.0[i], made.0[(i + 1) % n]);
            made.1.cross(q - p).normalize().dot(y - p)
        });
        sides.fold(speed, f64::min)
    }

    #[test]
    fn a_chain_around_a_line_is_never_closed_and_mostly_found() {
        let (mut n_found, mut n_chains) = (0, 0);
        for seed in 0..2000 {
            let mut rng = Rng::new(seed);
            let mut unit = || 2.0 * rng.unit() - 1.0;
            let origin = DVec3::new(unit(), unit(), unit()) * 100.0;
            let ahead = DVec3::new(unit(), unit(), unit()).normalize();
            let n = 2 + rng.below(7);
            let made: Vec<Made> = (0..n)
                .map(|k| around(&mut rng, origin + ahead * (3.0 * k as f64), ahead))
                .collect();
            let truth = made.iter().map(|m| margin(m, [origin, ahead]));
            assert!(truth.fold(f64::INFINITY, f64::min) > 0.0, "{seed}");
            n_chains += 1;
            match ask(&made) {
                Answer::Closed(weights) => panic!("{seed}: {weights:?}"),
                Answer::Guess(o, d) => {
                    let worst = made.iter().map(|m| margin(m, [o, d.normalize()]));
                    n_found += usize::from(worst.fold(f64::INFINITY, f64::min) > 0.0);
                }
                Answer::Unknown => {}
            }
        }
        // Otherwise the six numbers are far from any line; a single guess is enough here.
        assert!(n_found * 100 > n_chains * 85, "{n_found} of {n_chains}");
    }

    fn square(x: f64, y: f64, z: f64, normal: DVec3) -> Made {
        let p = |dx, dy| DVec3::new(x + dx, y + dy, z);
        let winding = vec![p(0.0, 0.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)];
        Made(winding, DVec3::Z, normal)
    }

    #[test]
    fn what_only_lines_along_edges_or_planes_would_pass_is_closed() {
        // Back and forth through one plane.
        let back = [
            square(0.0, 0.0, 0.0, DVec3::Z),
            square(4.0, 0.0, 0.0, -DVec3::Z),
        ];
        assert!(matches!(ask(&back), Answer::Closed(_)));
        // Three in a row; the outer ones touch the middle one's edge from opposite sides.
        let edge = [
            square(1.0, 0.0, 0.0, DVec3::Z),
            square(0.0, 0.0, 1.0, DVec3::Z),
            square(1.0, 0.0, 2.0, DVec3::Z),
        ];
        let Answer::Closed(weights) = ask(&edge) else {
            panic!("{:?}", ask(&edge));
        };
        let total: f64 = weights.iter().map(|&(_, w)| w).sum();
        assert!((total - 1.0).abs() < 1e-12 && weights.iter().all(|&(_, w)| w > 0.0));
        // Moved by a thousandth, a line passes.
        let open = [
            square(0.999, 0.0, 0.0, DVec3::Z),
            square(0.0, 0.0, 1.0, DVec3::Z),
            square(0.999, 0.0, 2.0, DVec3::Z),
        ];
        let Answer::Guess(o, d) = ask(&open) else {
            panic!("{:?}", ask(&open));
        };
        assert!(open.iter().all(|m| margin(m, [o, d.normalize()]) > 1e-4));
    }

    #[test]
    fn openings_without_area_say_nothing() {
        for corners in [
            vec![DVec3::ZERO; 3],
            vec![DVec3::ZERO, DVec3::X, DVec3::ZERO, DVec3::Y],
        ] {
            let flat = Made(corners, DVec3::ZERO, DVec3::ZERO);
            let answer = ask(&[flat, square(0.0, 0.0, 1.0, DVec3::Z)]);
            assert!(!matches!(answer, Answer::Closed(_)), "{answer:?}");
        }
        assert_eq!(ask(&[]), Answer::Unknown);
    }
}
