//! Native answers to random views of a world, to compare those of other programs with.
//!
//! `oracle WORLD.glb OUT N SEED` writes `N` views and their answers as little-endian words of four bytes, in the order of
//! [`answer`]. It uses the Rust library directly and none of the code behind the C functions.

use std::process::ExitCode;

use enfilade_cpg::wire::decode_glb;
use enfilade_cpg::{PortalId, World};
use enfilade_geom::{DMat4, DVec3};
use enfilade_runtime::{Sight, SightState, Sightlines, Target, View, Viewer};

const NO_ID: u32 = u32::MAX;

/// Random numbers: splitmix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// From `low` to `high`.
    fn within(&mut self, low: f32, high: f32) -> f32 {
        let unit = (self.next() >> 40) as f32 / (1_u32 << 24) as f32;
        low + (high - low) * unit
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn point(&mut self, [low, high]: [[f32; 3]; 2]) -> [f32; 3] {
        [0, 1, 2].map(|k| self.within(low[k], high[k]))
    }
}

/// Words of the file.
#[derive(Default)]
struct Words(Vec<u8>);

impl Words {
    fn word(&mut self, word: u32) {
        self.0.extend(word.to_le_bytes());
    }

    fn numbers(&mut self, numbers: &[f32]) {
        for n in numbers {
            self.word(n.to_bits());
        }
    }

    fn list(&mut self, ids: impl ExactSizeIterator<Item = u32>) {
        self.word(ids.len() as u32);
        for id in ids {
            self.word(id);
        }
    }
}

/// An eye in a random cell, or, one time in sixteen, anywhere.
fn eye(world: &World, sight: &Sight, random: &mut Random) -> [f32; 3] {
    let cells = &world.graph.cells;
    let all = cells.iter().fold([[f32::MAX; 3], [f32::MIN; 3]], |b, c| {
        let [low, high] = c.aabb;
        [
            [0, 1, 2].map(|k| b[0][k].min(low[k])),
            [0, 1, 2].map(|k| b[1][k].max(high[k])),
        ]
    });
    if random.below(16) > 0 && !cells.is_empty() {
        let cell = random.below(cells.len());
        for _ in 0..40 {
            let p = random.point(cells[cell].aabb);
            if sight.locate(p).is_some_and(|c| c.idx() == cell) {
                return p;
            }
        }
    }
    random.point(all)
}

fn matrix(eye: [f32; 3], random: &mut Random) -> [f32; 16] {
    loop {
        let toward = DVec3::from(random.point([[-1.0; 3], [1.0; 3]]).map(f64::from));
        let (fov, aspect) = (random.within(0.4, 2.2), random.within(0.5, 2.5));
        if toward.length() < 0.1 || toward.cross(DVec3::Y).length() < 0.01 {
            continue;
        }
        let look = DMat4::look_to_rh(
            DVec3::from(eye.map(f64::from)),
            toward.normalize(),
            DVec3::Y,
        );
        let lens = DMat4::perspective_rh_gl(fov.into(), aspect.into(), 0.05, 500.0);
        return (lens * look).as_mat4().to_cols_array();
    }
}

/// Writes one view and its answer: a door that moves before, eye, matrix; cells, portals, chunks, batches and details; the
/// eye's cell; the end of a segment from the eye, whether it is clear, and its hit: parameter, kind, index.
fn answer(parts: &mut Parts, random: &mut Random, out: &mut Words) -> Result<(), String> {
    let n_portals = parts.world.graph.portals.len();
    let (mut door, mut share) = (NO_ID, 0.0);
    if random.below(4) == 0 && n_portals > 0 {
        door = random.below(n_portals) as u32;
        share = [0.0, 0.3, 1.0, 1.0][random.below(4)];
        let id = PortalId(door);
        match (parts.sight.leaves(id).is_empty(), share > 0.0) {
            (false, _) => parts.state.set_leaves(id, share),
            (true, true) => parts.state.open(id),
            (true, false) => parts.state.close(id),
        }
    }
    let at = eye(&parts.world, &parts.sight, random);
    let m = matrix(at, random);
    let columns = [0, 4, 8, 12].map(|c| [m[c], m[c + 1], m[c + 2], m[c + 3]]);
    let view = View::from_view_projection(at, columns).map_err(|e| e.to_string())?;
    let seen = parts.viewer.see(&parts.sight, &parts.state, &view);
    out.word(door);
    out.numbers(&[share]);
    out.numbers(&at);
    out.numbers(&m);
    out.list(seen.cells().iter().map(|c| c.0));
    out.list(seen.portals().iter().map(|p| p.0));
    out.list(seen.chunks().iter().map(|c| c.0));
    let mut batches: Vec<u32> = Vec::new();
    for &chunk in seen.chunks() {
        let batch = parts.sight[chunk].batch;
        if !batches.contains(&batch) {
            batches.push(batch);
        }
    }
    out.list(batches.into_iter());
    out.list(seen.details().iter().map(|d| d.0));
    out.word(parts.sight.locate(at).map_or(NO_ID, |c| c.0));
    let end = eye(&parts.world, &parts.sight, random);
    out.numbers(&end);
    out.word(parts.lines.is_clear(&parts.state, at, end).into());
    let hit = parts
        .lines
        .pick(&parts.state, at, end)
        .map_err(|e| e.to_string())?;
    let (t, kind, index) = hit.map_or((0.0, NO_ID, NO_ID), |hit| match hit.target {
        Target::Wall { batch, .. } => (hit.t as f32, 0, batch),
        Target::Detail { detail, .. } => (hit.t as f32, 1, detail.0),
        Target::Portal(p) => (hit.t as f32, 2, p.0),
    });
    out.numbers(&[t]);
    out.word(kind);
    out.word(index);
    Ok(())
}

struct Parts {
    world: World,
    sight: Sight,
    state: SightState,
    viewer: Viewer,
    lines: Sightlines,
}

fn run() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [world, to, n, seed] = &arguments[..] else {
        return Err("usage: oracle WORLD.glb OUT N SEED".into());
    };
    let n: u32 = n.parse().map_err(|e| format!("{n}: {e}"))?;
    let seed: u64 = seed.parse().map_err(|e| format!("{seed}: {e}"))?;
    let bytes = std::fs::read(world).map_err(|e| format!("{world}: {e}"))?;
    let world = decode_glb(&bytes).map_err(|e| e.to_string())?;
    let sight = Sight::build(&world).map_err(|e| e.to_string())?;
    let mut parts = Parts {
        state: SightState::new(&sight),
        viewer: Viewer::new(&sight),
        lines: Sightlines::build(&world),
        sight,
        world,
    };
    let (mut random, mut out) = (Random(seed), Words::default());
    out.word(n);
    for _ in 0..n {
        answer(&mut parts, &mut random, &mut out)?;
    }
    std::fs::write(to, out.0).map_err(|e| format!("{to}: {e}"))
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}
