//! Incoherent rays against a building-like scene, in millions per second on one thread.
//!
//! Prints one CSV line per query, with the fraction of rays that hit, so that a change of answers shows
//! beside a change of speed.
#![allow(clippy::print_stdout, reason = "a benchmark's result is its output")]

use std::time::Instant;

use enfilade_geom::{Bvh, DVec3, Ray, Triangle};

struct Rng(u64);

impl Rng {
    /// SplitMix64 (Steele, Lea and Flood 2014), as a fraction in `[0, 1)`.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self, size: DVec3) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * size
    }
}

/// A quad from `o` along `u` and `v`, in `n × n` cells of two triangles.
fn add_quad(out: &mut Vec<Triangle>, o: DVec3, u: DVec3, v: DVec3, n: usize) {
    let at = |i: usize, j: usize| o + u * (i as f64 / n as f64) + v * (j as f64 / n as f64);
    for i in 0..n {
        for j in 0..n {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            out.extend([[a, b, c], [a, c, d]]);
        }
    }
}

/// Rooms of 5 × 3 × 5 m with a doorway in two of their walls, and clutter on the floor.
fn building(rooms: [usize; 3], rng: &mut Rng) -> Vec<Triangle> {
    let mut out = Vec::new();
    for x in 0..rooms[0] {
        for y in 0..rooms[1] {
            for z in 0..rooms[2] {
                let o = DVec3::new(x as f64 * 5.0, y as f64 * 3.0, z as f64 * 5.0);
                add_quad(&mut out, o, DVec3::X * 5.0, DVec3::Z * 5.0, 6);
                for (along, across) in [(DVec3::X, DVec3::Z), (DVec3::Z, DVec3::X)] {
                    add_quad(&mut out, o, along * 2.0, DVec3::Y * 3.0, 4);
                    add_quad(&mut out, o + along * 3.0, along * 2.0, DVec3::Y * 3.0, 4);
                    let lintel = o + along * 2.0 + DVec3::Y * 2.1;
                    add_quad(&mut out, lintel, along, DVec3::Y * 0.9, 2);
                    add_quad(&mut out, lintel, along, across * 0.2, 1);
                }
                for _ in 0..30 {
                    let p = o + rng.point(DVec3::new(4.5, 1.0, 4.5));
                    let s = rng.point(DVec3::splat(0.6));
                    add_quad(&mut out, p, DVec3::X * s.x, DVec3::Z * s.z, 1);
                    add_quad(&mut out, p, DVec3::X * s.x, DVec3::Y * s.y, 1);
                    add_quad(&mut out, p, DVec3::Z * s.z, DVec3::Y * s.y, 1);
                }
            }
        }
    }
    out
}

fn main() {
    let mut rng = Rng(7);
    let triangles = building([12, 4, 10], &mut rng);
    let started = Instant::now();
    let bvh = Bvh::build(&triangles);
    println!(
        "triangles,{},build_ms,{:.1}",
        triangles.len(),
        started.elapsed().as_secs_f64() * 1e3
    );
    let size = bvh.bounds().size();
    let n = 1_000_000;
    let pairs: Vec<(DVec3, DVec3)> = (0..n).map(|_| (rng.point(size), rng.point(size))).collect();
    let report = |name: &str, hits: usize, started: Instant| {
        let rate = n as f64 / started.elapsed().as_secs_f64() / 1e6;
        println!("{name},{rate:.2} M/s,hits,{hits}");
    };
    let started = Instant::now();
    let hits = pairs
        .iter()
        .filter(|(a, b)| {
            let ray = Ray {
                origin: *a,
                direction: *b - *a,
                t_max: f64::INFINITY,
            };
            bvh.closest_hit(&ray, |_| false).is_some()
        })
        .count();
    report("closest_hit", hits, started);
    let started = Instant::now();
    let hits = pairs
        .iter()
        .filter(|(a, b)| bvh.any_hit(*a, *b, |_| false))
        .count();
    report("any_hit", hits, started);
    let started = Instant::now();
    let hits = pairs
        .iter()
        .filter(|(a, _)| bvh.nearest(*a, 0.1).is_some())
        .count();
    report("nearest_within_0.1", hits, started);
}
