//! Precomputed visibility of random grids of rooms, compared with lines followed by other means.

use crate::common;

use std::io::Read;
use std::ops::Range;
use std::time::Duration;

use common::pack;
use enfilade_cpg::{CellId, Pvs, SightGraph, SightGraphError, SightPortal};
use enfilade_geom::DVec3;
use enfilade_testkit::Rng;
use enfilade_verify::verify_evidence;
use enfilade_vis::{VisCheckpoint, VisConfig, VisContext, VisError, VisMode, VisOutput, see_all};
use proptest::prelude::*;

/// Rooms of one unit on a grid of `n` by `n`, with a window in most walls between neighbors.
struct Grid {
    n: usize,
    /// For each room and axis (x, z): the least and greatest coordinates of the window to the next room, across and up.
    windows: Vec<[Option<[f64; 4]>; 2]>,
}

impl Grid {
    fn new(n: usize, seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let mut window = |is_wall: bool| {
            let mut span = || {
                let (a, b) = (rng.range(0.05, 0.95), rng.range(0.05, 0.95));
                (a.min(b), a.max(b))
            };
            let ((a, b), (c, d)) = (span(), span());
            (is_wall && b - a > 0.05 && d - c > 0.05).then_some([a, b, c, d])
        };
        let windows = (0..n * n)
            .map(|i| [window(i % n + 1 < n), window(i / n + 1 < n)])
            .collect();
        Self { n, windows }
    }

    fn graph(&self) -> SightGraph {
        let mut portals = Vec::new();
        for (i, windows) in self.windows.iter().enumerate() {
            let (x, z) = ((i % self.n) as f64, (i / self.n) as f64);
            if let Some([a, b, c, d]) = windows[0] {
                let at = |u: f64, v: f64| DVec3::new(x + 1.0, v, z + u);
                portals.push(SightPortal {
                    cells: [i as u32, i as u32 + 1],
                    winding: vec![at(a, c), at(a, d), at(b, d), at(b, c)],
                    pieces: Vec::new(),
                });
            }
            if let Some([a, b, c, d]) = windows[1] {
                let at = |u: f64, v: f64| DVec3::new(x + u, v, z + 1.0);
                portals.push(SightPortal {
                    cells: [i as u32, (i + self.n) as u32],
                    winding: vec![at(a, c), at(b, c), at(b, d), at(a, d)],
                    pieces: Vec::new(),
                });
            }
        }
        // Normals point from the first cell to the second.
        SightGraph {
            n_cells: (self.n * self.n) as u32,
            portals,
        }
    }

    /// Returns `true` if the segment passes only through windows; steps over the grid's planes.
    fn is_open(&self, p: DVec3, q: DVec3) -> bool {
        [(0, 2), (2, 0)]
            .into_iter()
            .enumerate()
            .all(|(axis, (along, across))| {
                let (a, b) = (p[along], q[along]);
                let (low, high) = (a.min(b), a.max(b));
                (low.ceil() as i64..=high.floor() as i64).all(|wall| {
                    let t = (wall as f64 - a) / (b - a);
                    let at = p + (q - p) * t;
                    let cell = at[across].floor();
                    let (this, other) = ((wall - 1) as usize, cell as usize);
                    let room = if axis == 0 {
                        other * self.n + this
                    } else {
                        this * self.n + other
                    };
                    self.windows[room][axis].is_some_and(|[a, b, c, d]| {
                        let u = at[across] - cell;
                        u > a && u < b && at.y > c && at.y < d
                    })
                })
            })
    }

    fn room(&self, p: DVec3) -> usize {
        p.z as usize * self.n + p.x as usize
    }
}

fn see(graph: &SightGraph, config: &VisConfig) -> VisOutput {
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: None,
        checkpoint: None,
    };
    see_all(graph, config, &mut context).unwrap()
}

/// Returns `true` if one answer is a subset of another.
fn is_subset(one: &VisOutput, other: &VisOutput) -> bool {
    let mut cells = (0..one.cells.n_cells() as u32).map(CellId);
    cells.all(|a| one.cells.visible_from(a).all(|b| other.cells.sees(a, b)))
}

fn with_evidence() -> VisConfig {
    VisConfig {
        has_evidence: true,
        ..VisConfig::default()
    }
}

fn sees(vis: &VisOutput, a: usize, b: usize) -> bool {
    vis.cells.sees(CellId(a as u32), CellId(b as u32))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    // Covers Q1.
    #[test]
    fn no_line_that_passes_is_lost_and_the_evidence_is_accepted(seed in 0u64..1 << 32, n in 2usize..7) {
        let grid = Grid::new(n, seed);
        let graph = grid.graph();
        let exact = see(&graph, &with_evidence());
        let fast = see(&graph, &VisConfig { mode: VisMode::Fast, ..VisConfig::default() });
        let mut rng = Rng::new(seed ^ 7);
        let side = n as f64;
        let mut point = || DVec3::new(rng.range(0.0, side), rng.range(0.0, 1.0), rng.range(0.0, side));
        for _ in 0..20_000 {
            let (p, q) = (point(), point());
            if grid.is_open(p, q) {
                let (a, b) = (grid.room(p), grid.room(q));
                prop_assert!(sees(&exact, a, b) && sees(&exact, b, a), "{} {}", p, q);
            }
        }
        prop_assert!(is_subset(&exact, &fast));
        let report = verify_evidence(&graph, exact.evidence.as_deref().unwrap(), None).unwrap();
        prop_assert_eq!(Pvs::of_rows(&report.cells), exact.cells);
    }
}

// Covers Q2 and Q3.
#[test]
fn windows_in_line_are_seen_through_and_windows_out_of_line_are_not() {
    let window = |x: f64, z: f64| SightPortal {
        cells: [x as u32 - 1, x as u32],
        winding: [(0.0, z), (1.0, z), (1.0, z + 1.0), (0.0, z + 1.0)]
            .map(|(y, z)| DVec3::new(x, y, z))
            .to_vec(),
        pieces: Vec::new(),
    };
    let mut graph = SightGraph {
        n_cells: 4,
        portals: vec![window(1.0, 0.0), window(2.0, 0.0), window(3.0, 0.0)],
    };
    assert!(sees(&see(&graph, &VisConfig::default()), 0, 3));
    graph.portals[2] = window(3.0, 2.5);
    let vis = see(&graph, &VisConfig::default());
    assert!(!sees(&vis, 0, 3) && !sees(&vis, 3, 0) && sees(&vis, 1, 3));
    let near = see(
        &graph,
        &VisConfig {
            far: Some(0.0),
            ..VisConfig::default()
        },
    );
    // Neighbors share an opening, so they are never too far apart.
    assert!(sees(&near, 0, 1) && near.cells.n_pairs() <= vis.cells.n_pairs());
}

#[test]
fn threads_and_an_early_stop_change_what_they_should() {
    let graph = Grid::new(8, 5).graph();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| see(&graph, &with_evidence()))
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(8));
    let mut context = VisContext {
        on_round: &mut |_, _| false,
        walls: None,
        checkpoint: None,
    };
    let stopped = see_all(&graph, &with_evidence(), &mut context).unwrap();
    assert!(!stopped.is_complete && one.is_complete);
    assert!(is_subset(&one, &stopped));
    verify_evidence(&graph, &stopped.evidence.unwrap(), None).unwrap();
}

/// Searches for `rounds`; returns the result and the last saved state.
fn see_in_parts(
    graph: &SightGraph,
    config: &VisConfig,
    resume: Option<Vec<u8>>,
    rounds: usize,
) -> (Result<VisOutput, VisError>, Vec<u8>) {
    let mut saved = Vec::new();
    let mut n = 0;
    let mut context = VisContext {
        on_round: &mut |_, _| {
            n += 1;
            n <= rounds
        },
        walls: None,
        checkpoint: Some(VisCheckpoint {
            blocks: None,
            resume,
            salt: 7,
            every: Duration::from_secs(3600),
            save: &mut |bytes| saved = bytes,
        }),
    };
    let vis = see_all(graph, config, &mut context);
    (vis, saved)
}

#[test]
fn a_search_in_parts_finds_what_one_in_one_go_finds() {
    let graph = Grid::new(8, 5).graph();
    let config = with_evidence();
    let whole = see(&graph, &config);
    let (part, mut saved) = see_in_parts(&graph, &config, None, 1);
    assert!(!part.unwrap().is_complete);
    // One round at a time, to the end.
    let done = (0..100).find_map(|_| {
        let (part, next) = see_in_parts(&graph, &config, Some(saved.clone()), 1);
        saved = next;
        part.ok().filter(|vis| vis.is_complete)
    });
    assert_eq!(done, Some(whole));
}

#[test]
fn checkpoints_that_do_not_fit_are_refused() {
    let graph = Grid::new(6, 5).graph();
    let config = VisConfig::default();
    let (_, saved) = see_in_parts(&graph, &config, None, 1);
    let refused = |graph: &SightGraph, config: &VisConfig, bytes: &[u8]| {
        let (vis, _) = see_in_parts(graph, config, Some(bytes.to_vec()), 100);
        matches!(vis, Err(VisError::Checkpoint { .. }))
    };
    assert!(!refused(&graph, &config, &saved));
    let far = VisConfig {
        far: Some(3.0),
        ..config.clone()
    };
    assert!(refused(&graph, &far, &saved));
    let other = Grid::new(6, 6).graph();
    assert!(refused(&other, &config, &saved));
    // Also if it is called that of the other graph or settings.
    for (graph, config) in [(&other, &config), (&graph, &far)] {
        let (_, own) = see_in_parts(graph, config, None, 1);
        let renamed = [&saved[..8], &own[8..16], &saved[16..]].concat();
        assert!(!refused(graph, config, &own) && refused(graph, config, &renamed));
    }
    for end in (0..saved.len()).step_by(7) {
        assert!(refused(&graph, &config, &saved[..end]), "{end} bytes");
    }
    for at in (0..saved.len()).step_by(11) {
        let mut bytes = saved.clone();
        bytes[at] ^= 0x10;
        assert!(refused(&graph, &config, &bytes), "byte {at}");
    }
}

/// Changes a checkpoint's body, and corrects its checksum.
fn tampered(saved: &[u8], change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    use std::io::{Read, Write};
    let mut body = Vec::new();
    let mut decoder = flate2::read::ZlibDecoder::new(&saved[24..]);
    decoder.read_to_end(&mut body).unwrap();
    change(&mut body);
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&body).unwrap();
    let packed = encoder.finish().unwrap();
    let summed = saved[..16].iter().chain(&packed);
    let sum = summed.fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    [&saved[..16], &sum.to_le_bytes(), &packed].concat()
}

#[test]
fn a_checkpoint_that_lies_never_hides_what_is_seen() {
    let graph = Grid::new(6, 5).graph();
    let config = with_evidence();
    let whole = see(&graph, &config);
    let (_, saved) = see_in_parts(&graph, &config, None, 1);
    let resumed = |bytes: Vec<u8>| see_in_parts(&graph, &config, Some(bytes), 100).0;
    assert_eq!(resumed(tampered(&saved, |_| ())), Ok(whole.clone()));
    let mut n_body = 0;
    tampered(&saved, |body| n_body = body.len());
    let (mut n_refused, mut n_harmless) = (0, 0);
    for bit in (0..8 * n_body).step_by(8 * n_body / 400 + 1) {
        match resumed(tampered(&saved, |body| body[bit / 8] ^= 1 << (bit % 8))) {
            Err(VisError::Checkpoint { .. }) => n_refused += 1,
            Err(error) => panic!("bit {bit}: {error}"),
            Ok(vis) => {
                n_harmless += 1;
                // The work count is wrong, or an opening was not searched: that never hides what is visible.
                verify_evidence(&graph, &vis.evidence.unwrap(), None).unwrap();
                let mut cells = (0..whole.cells.n_cells() as u32).map(CellId);
                let is_seen = cells.all(|from| {
                    let is_kept = |to| whole.undecided.sees(from, to) || vis.cells.sees(from, to);
                    whole.cells.visible_from(from).all(is_kept)
                });
                assert!(is_seen, "bit {bit}");
            }
        }
    }
    assert!(
        n_refused > 100 && n_harmless > 0,
        "{n_refused} {n_harmless}"
    );
}

#[test]
fn broken_graphs_are_named_and_odd_ones_are_answered() {
    let good = Grid::new(3, 1).graph();
    let broken = |change: &dyn Fn(&mut SightPortal)| {
        let mut graph = good.clone();
        change(&mut graph.portals[1]);
        let mut context = VisContext {
            on_round: &mut |_, _| true,
            walls: None,
            checkpoint: None,
        };
        see_all(&graph, &VisConfig::default(), &mut context).unwrap_err()
    };
    let graph_error = |error| matches!(error, VisError::Graph(_));
    assert!(graph_error(broken(&|p| p.winding[0].x = f64::NAN)));
    assert!(graph_error(broken(&|p| p.winding[0].x = 1e300)));
    assert!(graph_error(broken(&|p| p.cells[1] = 99)));
    assert_eq!(
        broken(&|p| p.cells[1] = p.cells[0]),
        VisError::Graph(SightGraphError::SelfLoop {
            portal: 1,
            cell: good.portals[1].cells[0]
        })
    );
    for n in 0..3 {
        assert_eq!(
            broken(&|p| p.winding.truncate(n)),
            VisError::Graph(SightGraphError::TooFewCorners { portal: 1, n })
        );
    }
    // No portals, no cells, portals without area.
    for n_cells in [0, 3] {
        let graph = SightGraph {
            n_cells,
            portals: Vec::new(),
        };
        let vis = see(&graph, &with_evidence());
        assert!(vis.cells.n_pairs() == n_cells as usize);
        verify_evidence(&graph, &vis.evidence.unwrap(), None).unwrap();
    }
    let mut flat = good.clone();
    for portal in &mut flat.portals {
        portal.winding = vec![portal.winding[0]; 3];
    }
    let vis = see(&flat, &VisConfig::default());
    assert!(
        flat.portals
            .iter()
            .all(|p| sees(&vis, p.cells[0] as usize, p.cells[1] as usize))
    );
}

#[test]
fn settings_that_are_no_distance_are_refused() {
    let graph = Grid::new(2, 1).graph();
    for bad in [f64::NAN, -1.0, f64::NEG_INFINITY] {
        for (far, clearance) in [(Some(bad), None), (None, Some(bad))] {
            let config = VisConfig {
                far,
                clearance,
                ..VisConfig::default()
            };
            let mut context = VisContext {
                on_round: &mut |_, _| true,
                walls: None,
                checkpoint: None,
            };
            let refused = see_all(&graph, &config, &mut context);
            assert!(matches!(refused, Err(VisError::Setting { .. })), "{bad}");
        }
    }
}

#[test]
fn a_thousand_tampered_files_are_rejected() {
    let graph = Grid::new(6, 11).graph();
    let vis = see(&graph, &with_evidence());
    let bytes = vis.evidence.unwrap();
    verify_evidence(&graph, &bytes, None).unwrap();
    let mut rng = Rng::new(3);
    for _ in 0..500 {
        let mut bad = bytes.clone();
        let at = rng.below(bad.len());
        bad[at] ^= 1 << rng.below(8);
        assert!(verify_evidence(&graph, &bad, None).is_err(), "byte {at}");
    }

    // Tampered bodies, packed correctly.
    let mut body = Vec::new();
    flate2::read::ZlibDecoder::new(&bytes[24..])
        .read_to_end(&mut body)
        .unwrap();
    let n = 2 * graph.portals.len();
    let row = n.div_ceil(8);
    let (tables, lines) = (40, 40 + 2 * n * row);
    let n_trace = verify_evidence(&graph, &bytes, None).unwrap().n_trace as usize;
    assert!(n_trace > 10);
    for i in 0..500 {
        let mut bad = body.clone();
        match i % 5 {
            0 => {
                // Drop a line: pairs that only it proves are no longer proved.
                let count = u64::from_le_bytes(bad[lines..lines + 8].try_into().unwrap());
                bad[lines..lines + 8].copy_from_slice(&(count - 1).to_le_bytes());
            }
            1 => {
                // Mark something visible as hidden, both ways.
                let (s, t) = loop {
                    let (s, t) = (rng.below(n), rng.below(n));
                    if bad[tables + s * row + t / 8] >> (t % 8) & 1 != 0 {
                        break (s, t);
                    }
                };
                for (s, t) in [(s, t), (t ^ 1, s ^ 1)] {
                    bad[tables + s * row + t / 8] &= !(1 << (t % 8));
                }
            }
            2 => {
                // Change the totals.
                let at = 24 + rng.below(16);
                bad[at] ^= 1 << rng.below(8);
            }
            3 => bad.truncate(body.len() - 1 - rng.below(n_trace)),
            _ => {
                // A symbol that no trace contains.
                let at = body.len() - 1 - rng.below(n_trace);
                bad[at] = 9 + rng.below(240) as u8;
            }
        }
        let packed = pack(&bad);
        assert!(i > 0 || verify_evidence(&graph, &pack(&body), None).is_ok());
        let verdict = verify_evidence(&graph, &packed, None);
        // If only one of several openings between two cells is marked as hidden, no line contradicts it; but it still
        // lacks a proof.
        assert!(verdict.is_err(), "lie {i} was believed");
    }
    let mut other = graph.clone();
    other.portals[0].winding[0].y += 1e-3;
    assert!(verify_evidence(&other, &bytes, None).is_err());
}

/// Two openings of one cell in one slanting plane, up to the rounding of their vertices, crossed back and forth.
fn there_and_back() -> SightGraph {
    let there = [
        [-48.60913705583784, 1344.7715736040611, 120.0],
        [-48.0, 1345.2631578947373, 120.0],
        [-48.0, 1345.2631578947373, 214.0],
        [-48.60913705583784, 1344.7715736040611, 214.0],
    ];
    let back = [
        [-79.30434782608745, 1320.0, 214.0],
        [-79.30434782608744, 1320.0, 120.0],
        [-77.90973408148353, 1321.125477758803, 120.0],
        [-77.90973408148346, 1321.1254777588033, 214.0],
    ];
    let across = DVec3::new(-0.628_019, 0.778_198, 0.0);
    let portal = |corners: [[f64; 3]; 4], from: u32, to: u32, ahead: DVec3| {
        let winding = corners.map(DVec3::from_array).to_vec();
        let normal = (winding[1] - winding[0]).cross(winding[2] - winding[0]);
        let is_ahead = normal.dot(ahead) > 0.0;
        SightPortal {
            cells: if is_ahead { [from, to] } else { [to, from] },
            winding,
            pieces: Vec::new(),
        }
    };
    SightGraph {
        n_cells: 3,
        portals: vec![portal(there, 0, 1, across), portal(back, 1, 2, -across)],
    }
}

// Covers Q4.
#[test]
fn what_only_lines_in_a_plane_would_pass_is_hidden_and_weights_show_it() {
    let graph = there_and_back();
    let vis = see(&graph, &with_evidence());
    assert!(!sees(&vis, 0, 2) && sees(&vis, 0, 1) && sees(&vis, 1, 2));
    assert!(vis.undecided.n_pairs() == 0);
    let bytes = vis.evidence.unwrap();
    let report = verify_evidence(&graph, &bytes, None).unwrap();
    let mut body = Vec::new();
    flate2::read::ZlibDecoder::new(&bytes[24..])
        .read_to_end(&mut body)
        .unwrap();
    // A step, an exit skipped or not, then the number of rows, and the index and weight of each.
    let trace = &body[body.len() - report.n_trace as usize..];
    let first = trace.iter().position(|&b| b == 8).expect("weights");
    let n = usize::from(trace[first + 1]);
    assert!((2..=7).contains(&n), "{n}");
    let start = body.len() - trace.len() + first + 2;
    for i in 0..n {
        let row = start + 10 * i;
        // Another row, a row that does not exist, and other weights: slightly more, none, less than none, not a
        // number.
        for (at, bytes) in [
            (row, vec![body[row] ^ 1]),
            (row, vec![0xff, 0xff]),
            (row + 2, 0.123_f64.to_le_bytes().to_vec()),
            (row + 2, 0.0_f64.to_le_bytes().to_vec()),
            (row + 2, (-0.5_f64).to_le_bytes().to_vec()),
            (row + 2, f64::NAN.to_le_bytes().to_vec()),
        ] {
            let mut bad = body.clone();
            bad[at..at + bytes.len()].copy_from_slice(&bytes);
            assert!(
                verify_evidence(&graph, &pack(&bad), None).is_err(),
                "{i}: {bytes:?}"
            );
        }
    }
    // Weights that are all zero also balance.
    let mut bad = body.clone();
    for i in 0..n {
        bad[start + 10 * i + 2..start + 10 * i + 10].fill(0);
    }
    assert!(verify_evidence(&graph, &pack(&bad), None).is_err());
}

#[test]
fn cells_without_portals_cost_nothing() {
    // A million cells, of which a few in the middle have portals: tables of all pairs would take 137 GB.
    let few = Grid::new(3, 2).graph();
    let first = 500_000;
    let mut many = SightGraph {
        n_cells: 1 << 20,
        portals: few.portals.clone(),
    };
    for portal in &mut many.portals {
        portal.cells = portal.cells.map(|c| first + c * 7);
    }
    let (few, many) = (
        see(&few, &with_evidence()),
        see(&many, &VisConfig::default()),
    );
    let n = few.cells.n_cells() as u32;
    for (a, b) in (0..n).flat_map(|a| (0..n).map(move |b| (a, b))) {
        let [x, y] = [a, b].map(|c| CellId(first + c * 7));
        assert_eq!(
            many.cells.sees(x, y),
            few.cells.sees(CellId(a), CellId(b)),
            "{a} {b}"
        );
        assert!(!many.cells.sees(x, CellId(y.0 + 1)));
    }
    assert_eq!(
        many.cells.n_pairs(),
        few.cells.n_pairs() + (1 << 20) - n as usize
    );
    assert_eq!(many.n_base, few.n_base + (1 << 20) - u64::from(n));
}

#[test]
fn a_graph_too_large_for_the_memory_allowed_is_refused_before_it_is_taken() {
    let graph = Grid::new(8, 8).graph();
    let see = |max_memory| {
        let mut context = VisContext {
            on_round: &mut |_, _| true,
            walls: None,
            checkpoint: None,
        };
        let config = VisConfig {
            max_memory,
            ..VisConfig::default()
        };
        see_all(&graph, &config, &mut context)
    };
    let Err(VisError::TooLarge { estimate, .. }) = see(1000) else {
        panic!("a table of all directions does not fit");
    };
    assert!(see(estimate).is_ok());
    let error = see(estimate - 1).unwrap_err().to_string();
    for word in ["portals", "GiB", "--max-memory"] {
        assert!(error.contains(word), "{error}");
    }
}

/// The parts of a body of evidence that a changed bit is tried in: names and bytes.
fn parts_of_body(body: &[u8], n: usize) -> Vec<(&'static str, Range<usize>)> {
    let word = |at: usize| u32::from_le_bytes(body[at..at + 4].try_into().unwrap()) as usize;
    let table = n * n.div_ceil(8);
    let lines = 40 + 2 * table;
    // Numbers of lines and trees fit in the lower half of theirs.
    let trees = (0..word(lines)).fold(lines + 8, |at, _| at + 52 + 4 * word(at + 48));
    let traces = (0..word(trees)).fold(trees + 8, |at, _| at + 12 + word(at + 8));
    vec![
        ("graph", 0..8),
        ("clearance", 8..16),
        ("far", 16..24),
        ("totals", 24..40),
        ("might", 40..40 + table),
        ("claims", 40 + table..lines),
        ("lines", lines..trees),
        ("number of trees", trees..traces),
        ("traces", traces..body.len()),
    ]
}

// The bits of a tree are those of `evidence_by_walls_that_are_not_there_is_rejected`.
#[test]
fn a_changed_bit_is_refused_or_changes_nothing_that_is_claimed() {
    let mut n_accepted = 0;
    for graph in [Grid::new(5, 11).graph(), Grid::new(3, 4).graph()] {
        let bytes = see(&graph, &with_evidence()).evidence.unwrap();
        let honest = verify_evidence(&graph, &bytes, None).unwrap();
        let mut body = Vec::new();
        let mut unpacker = flate2::read::ZlibDecoder::new(&bytes[24..]);
        unpacker.read_to_end(&mut body).unwrap();
        let n = 2 * graph.portals.len();
        let row_bytes = n.div_ceil(8);
        let mut rng = Rng::new(5);
        for (part, range) in parts_of_body(&body, n) {
            for _ in 0..200 {
                let (at, bit) = (range.start + rng.below(range.len()), rng.below(8));
                let mut forged = body.clone();
                forged[at] ^= 1 << bit;
                let Ok(report) = verify_evidence(&graph, &pack(&forged), None) else {
                    continue;
                };
                n_accepted += 1;
                let [row, column] = {
                    let at = at - range.start;
                    [at / row_bytes, at % row_bytes * 8 + bit]
                };
                match part {
                    "clearance" => assert_ne!(report.clearance, honest.clearance),
                    "far" => assert_ne!(report.far, honest.far),
                    // The two directions of one portal, between neighbors.
                    "might" => assert_eq!(column, row ^ 1),
                    // Claims that have another reason, too; lines that are as good.
                    "claims" | "lines" => {}
                    _ => panic!("{part}: byte {at}, bit {bit}"),
                }
                let mut claimed = report;
                (claimed.clearance, claimed.far) = (honest.clearance, honest.far);
                assert_eq!(claimed, honest, "{part}: byte {at}, bit {bit}");
            }
        }
    }
    assert!(n_accepted > 100, "{n_accepted}");
}
