//! Times the Delaunay tetrahedra of points in a raw file (three little-endian `f64` a point) and
//! prints a JSON line; `scripts/bench_delaunay.sh` runs it beside CGAL and TetGen.
//!
//! ```text
//! delaunay_bench POINTS REPEATS NAME
//! ```
#![expect(clippy::print_stdout, reason = "a command-line tool")]

use enfilade_bake::delaunay::tetrahedralize;
use enfilade_geom::DVec3;

/// User time of this process so far. [Units: s]
#[cfg(unix)]
fn user_seconds() -> f64 {
    use nix::sys::resource::{UsageWho, getrusage};
    let t = getrusage(UsageWho::RUSAGE_SELF)
        .expect("own usage is always known")
        .user_time();
    t.tv_sec() as f64 + t.tv_usec() as f64 * 1e-6
}

/// Unknown on this platform.
#[cfg(not(unix))]
fn user_seconds() -> f64 {
    f64::NAN
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [file, repeats, name] = &args[..] else {
        panic!("usage: delaunay_bench POINTS REPEATS NAME");
    };
    let bytes = std::fs::read(file).expect("the points can be read");
    let numbers: Vec<f64> = bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| f64::from_le_bytes(*b))
        .collect();
    let points: Vec<DVec3> = numbers
        .as_chunks()
        .0
        .iter()
        .map(|p| DVec3::from_array(*p))
        .collect();
    let mut seconds = Vec::new();
    let (mut n_tetrahedra, mut n_vertices) = (0, 0);
    for _ in 0..repeats.parse().expect("a number of repeats") {
        let start = user_seconds();
        let d = tetrahedralize(&points).expect("the points span a volume");
        seconds.push(user_seconds() - start);
        (n_tetrahedra, n_vertices) = (d.n_finite, d.vertices.len());
    }
    seconds.sort_by(f64::total_cmp);
    let median = seconds[seconds.len() / 2];
    println!(
        "{{\"kernel\": \"delaunay3d\", \"peer\": \"enfilade\", \"case\": \"{name}\", \"n\": {}, \
         \"user_s\": {median:.4}, \"us_per_point\": {:.3}, \"tets\": {n_tetrahedra}, \
         \"vertices\": {n_vertices}}}",
        points.len(),
        median * 1e6 / points.len() as f64
    );
}
