//! The least length of a string through convex polygons by `clarabel`, which shares no code with the tested one.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SupportedConeT};
use enfilade_geom::DVec3;

/// Each point of the string is a mean of its polygon's vertices with weights of at least 0 that sum to 1; each leg is at most as
/// long as its own variable; the sum of these is minimal. [Units: wu]
pub(crate) fn least_length(from: DVec3, to: DVec3, polygons: &[Vec<DVec3>]) -> f64 {
    if polygons.is_empty() {
        return from.distance(to);
    }
    let n_legs = polygons.len() + 1;
    let mut first = vec![n_legs];
    for p in polygons {
        first.push(first.last().unwrap() + p.len());
    }
    let n_vars = *first.last().unwrap();
    let (mut rows, mut columns, mut values, mut right) = (vec![], vec![], vec![], vec![]);
    let mut put = |row: usize, column: usize, value: f64| {
        rows.push(row);
        columns.push(column);
        values.push(value);
    };
    // A x + s = b, s in the cones.
    let mut cones = vec![SupportedConeT::ZeroConeT(polygons.len())];
    for i in 0..polygons.len() {
        (first[i]..first[i + 1]).for_each(|v| put(i, v, 1.0));
        right.push(1.0);
    }
    let n_weights = n_vars - n_legs;
    for v in n_legs..n_vars {
        put(right.len(), v, -1.0);
        right.push(0.0);
    }
    cones.push(SupportedConeT::NonnegativeConeT(n_weights));
    for leg in 0..n_legs {
        put(right.len(), leg, -1.0);
        right.push(0.0);
        for axis in 0..3 {
            let mut fixed = 0.0;
            // s = end - start.
            for (at, sign) in [(leg as isize - 1, -1.0), (leg as isize, 1.0)] {
                match usize::try_from(at).ok().filter(|&i| i < polygons.len()) {
                    Some(i) => {
                        for (k, p) in polygons[i].iter().enumerate() {
                            put(right.len(), first[i] + k, -sign * p[axis]);
                        }
                    }
                    None if at < 0 => fixed += sign * from[axis],
                    None => fixed += sign * to[axis],
                }
            }
            right.push(fixed);
        }
        cones.push(SupportedConeT::SecondOrderConeT(4));
    }
    let a = CscMatrix::new_from_triplets(right.len(), n_vars, rows, columns, values);
    let mut costs = vec![0.0; n_vars];
    costs[..n_legs].fill(1.0);
    let p = CscMatrix::zeros((n_vars, n_vars));
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .build()
        .unwrap();
    let mut solver = DefaultSolver::new(&p, &costs, &a, &right, &cones, settings).unwrap();
    solver.solve();
    solver.solution.obj_val
}
