//! Occlusion by walls inside cells, compared with lines followed by other means.

use crate::common;

use std::io::Read;

use common::pack;
use enfilade_cpg::{CellId, Pvs, SightGraph, SightPortal};
use enfilade_geom::{DVec3, Triangle};
use enfilade_testkit::Rng;
use enfilade_verify::{EvidenceError, EvidenceReport, verify_evidence};
use enfilade_vis::{VisConfig, VisContext, VisOutput, see_all};
use proptest::prelude::*;

/// Rooms of one unit in a row along x, with a window from each to the next, and screens standing in them.
struct Row {
    /// Least and greatest z, then y, of each window.
    windows: Vec<[f64; 4]>,
    screens: Vec<Screen>,
}

/// An upright rectangle: its two ends on the floor plan (x, z), and its least and greatest height.
struct Screen {
    ends: [[f64; 2]; 2],
    heights: [f64; 2],
}

impl Row {
    fn random(n_rooms: usize, seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let mut span = |least: f64| {
            let low = rng.range(0.05, 0.9 - least);
            (low, rng.range(low + least, 0.95))
        };
        let windows = (1..n_rooms)
            .map(|_| {
                let ((a, b), (c, d)) = (span(0.1), span(0.1));
                [a, b, c, d]
            })
            .collect();
        let screens = (0..n_rooms)
            .map(|i| {
                let (x0, x1, z0, z1) = (
                    rng.range(0.1, 0.9),
                    rng.range(0.1, 0.9),
                    rng.range(-0.2, 0.4),
                    rng.range(0.6, 1.2),
                );
                let x = i as f64;
                Screen {
                    ends: [[x + x0, z0], [x + x1, z1]],
                    heights: [-0.1, rng.range(0.3, 1.2)],
                }
            })
            .collect();
        Self { windows, screens }
    }

    fn graph(&self) -> SightGraph {
        let portals = self.windows.iter().enumerate().map(|(i, &[a, b, c, d])| {
            let at = |z: f64, y: f64| DVec3::new(i as f64 + 1.0, y, z);
            SightPortal {
                cells: [i as u32, i as u32 + 1],
                winding: vec![at(a, c), at(a, d), at(b, d), at(b, c)],
                pieces: Vec::new(),
            }
        });
        SightGraph {
            n_cells: self.windows.len() as u32 + 1,
            portals: portals.collect(),
        }
    }

    /// Returns the walls around the windows, and the screens.
    fn triangles(&self) -> Vec<Triangle> {
        let mut out = Vec::new();
        let mut quad = |[a, b, c, d]: [DVec3; 4]| out.extend([[a, b, c], [a, c, d]]);
        for (i, &[a, b, c, d]) in self.windows.iter().enumerate() {
            let at = |z: f64, y: f64| DVec3::new(i as f64 + 1.0, y, z);
            let outer = [at(-2.0, -2.0), at(-2.0, 3.0), at(3.0, 3.0), at(3.0, -2.0)];
            let inner = [at(a, c), at(a, d), at(b, d), at(b, c)];
            for k in 0..4 {
                let next = (k + 1) % 4;
                quad([outer[k], outer[next], inner[next], inner[k]]);
            }
        }
        for screen in &self.screens {
            let at = |end: usize, y: f64| DVec3::new(screen.ends[end][0], y, screen.ends[end][1]);
            let [low, high] = screen.heights;
            quad([at(0, low), at(1, low), at(1, high), at(0, high)]);
        }
        out
    }

    /// Returns `true` if a segment between two rooms passes only through windows and no screen, by plain geometry.
    fn is_free(&self, p: DVec3, q: DVec3) -> bool {
        let passes = self.windows.iter().enumerate().all(|(i, &[a, b, c, d])| {
            let x = i as f64 + 1.0;
            if (p.x - x) * (q.x - x) > 0.0 {
                return true;
            }
            let at = p + (q - p) * ((x - p.x) / (q.x - p.x));
            at.z > a && at.z < b && at.y > c && at.y < d
        });
        passes
            && self.screens.iter().all(|screen| {
                let [[x0, z0], [x1, z1]] = screen.ends;
                let side = |v: DVec3| (x1 - x0) * (v.z - z0) - (z1 - z0) * (v.x - x0);
                let (h, g) = (side(p), side(q));
                if h * g > 0.0 {
                    return true;
                }
                let at = p + (q - p) * (h / (h - g));
                let along = if (x1 - x0).abs() > (z1 - z0).abs() {
                    (at.x - x0) / (x1 - x0)
                } else {
                    (at.z - z0) / (z1 - z0)
                };
                let [low, high] = screen.heights;
                !(0.0..=1.0).contains(&along) || at.y < low || at.y > high
            })
    }
}

fn see(graph: &SightGraph, walls: &[Triangle]) -> VisOutput {
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: Some(walls),
        checkpoint: None,
    };
    let config = VisConfig {
        has_evidence: true,
        ..VisConfig::default()
    };
    see_all(graph, &config, &mut context).unwrap()
}

fn check(
    graph: &SightGraph,
    vis: &VisOutput,
    walls: &[Triangle],
) -> Result<EvidenceReport, EvidenceError> {
    verify_evidence(graph, vis.evidence.as_deref().unwrap(), Some(walls))
}

fn sees(vis: &VisOutput, a: usize, b: usize) -> bool {
    vis.cells.sees(CellId(a as u32), CellId(b as u32))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_free_line_is_lost_behind_walls(seed in 0u64..1 << 32, n in 3usize..6) {
        let row = Row::random(n, seed);
        let (graph, walls) = (row.graph(), row.triangles());
        let vis = see(&graph, &walls);
        let mut rng = Rng::new(seed ^ 1);
        for _ in 0..4000 {
            let (a, b) = (rng.below(n), rng.below(n));
            let mut point = |room: usize| {
                DVec3::new(room as f64 + rng.range(0.0, 1.0), rng.range(0.0, 1.0), rng.range(0.0, 1.0))
            };
            let (p, q) = (point(a), point(b));
            prop_assert!(sees(&vis, a, b) || !row.is_free(p, q), "{a} {p} sees {b} {q}");
        }
        for line in vis.witnesses.iter().filter(|line| line.chain.len() > 1) {
            let along = |d: u32| {
                let x = f64::from(d / 2) + 1.0;
                line.origin + line.direction * ((x - line.origin.x) / line.direction.x)
            };
            let ends = [line.chain[0], *line.chain.last().unwrap()].map(along);
            prop_assert!(row.is_free(ends[0], ends[1]), "{line:?} proves nothing");
        }
        let report = check(&graph, &vis, &walls).unwrap();
        prop_assert_eq!(Pvs::of_rows(&report.cells), vis.cells);
    }
}

/// Three rooms, windows in line, and a screen across the middle one up to a height.
fn with_screen(height: f64) -> Row {
    Row {
        windows: vec![[0.3, 0.7, 0.3, 0.7]; 2],
        screens: vec![Screen {
            ends: [[1.4, -0.1], [1.6, 1.1]],
            heights: [-0.1, height],
        }],
    }
}

#[test]
fn a_screen_hides_what_it_covers_and_nothing_more() {
    for (height, is_hidden) in [(0.9, true), (0.71, true), (0.69, false), (0.4, false)] {
        let row = with_screen(height);
        let (graph, walls) = (row.graph(), row.triangles());
        let vis = see(&graph, &walls);
        assert_eq!(sees(&vis, 0, 2), !is_hidden, "screen up to {height}");
        assert!(sees(&vis, 0, 1) && sees(&vis, 1, 2));
        assert!(vis.undecided.n_pairs() == 0);
        let report = check(&graph, &vis, &walls).unwrap();
        assert_eq!(report.n_walled > 0, is_hidden);
    }
}

#[test]
fn a_corner_of_two_walls_hides_what_neither_does_alone() {
    // Between two windows stands a wedge of two walls that share an upright edge.
    let mut row = with_screen(1.1);
    row.screens[0].ends = [[1.3, -0.1], [1.5, 0.5]];
    row.screens.push(Screen {
        ends: [[1.5, 0.5], [1.3, 1.1]],
        heights: [-0.1, 1.1],
    });
    let (graph, walls) = (row.graph(), row.triangles());
    let vis = see(&graph, &walls);
    assert!(!sees(&vis, 0, 2));
    check(&graph, &vis, &walls).unwrap();
    row.screens.pop();
    assert!(sees(&see(&graph, &row.triangles()), 0, 2));
}

#[test]
fn triangles_that_are_none_hide_nothing() {
    let row = with_screen(0.9);
    let (graph, mut walls) = (row.graph(), row.triangles());
    let before = see(&graph, &walls);
    let point = DVec3::new(1.5, 0.5, 0.5);
    walls.push([DVec3::NAN, point, point + DVec3::X]);
    walls.push([point; 3]);
    walls.push([DVec3::splat(f64::INFINITY); 3]);
    let vis = see(&graph, &walls);
    assert_eq!(vis.cells, before.cells);
    check(&graph, &vis, &walls).unwrap();
    // Degenerate triangles alone hide nothing.
    let vis = see(&graph, &walls[walls.len() - 3..]);
    assert!(sees(&vis, 0, 2));
    check(&graph, &vis, &walls[walls.len() - 3..]).unwrap();
}

#[test]
fn threads_change_nothing() {
    let row = Row::random(5, 7);
    let (graph, walls) = (row.graph(), row.triangles());
    let on = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build();
        pool.unwrap().install(|| see(&graph, &walls))
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(8));
}

#[test]
fn evidence_by_walls_that_are_not_there_is_rejected() {
    let row = with_screen(0.9);
    let (graph, walls) = (row.graph(), row.triangles());
    let vis = see(&graph, &walls);
    let bytes = vis.evidence.clone().unwrap();
    assert!(verify_evidence(&graph, &bytes, None).is_err());
    // Move each of the screen's vertices to open a way, remove one triangle, and tear the two apart.
    let first = walls.len() - 2;
    let refused = |changed: &[Triangle], what: &str| {
        assert!(check(&graph, &vis, changed).is_err(), "{what} was not seen");
    };
    let lower = |p: DVec3| DVec3::new(p.x, p.y.min(0.6), p.z);
    let mut low = walls.clone();
    for triangle in &mut low[first..] {
        *triangle = triangle.map(lower);
    }
    refused(&low, "a screen that is too low");
    for gone in [first, first + 1] {
        let mut half = walls.clone();
        half[gone] = half[gone].map(|p| p + DVec3::new(0.0, 5.0, 0.0));
        refused(&half, "a triangle that is gone");
        let mut rent = walls.clone();
        rent[gone] = rent[gone].map(|p| p + DVec3::new(1e-3, 0.0, 0.0));
        refused(&rent, "a rent");
    }

    let mut body = Vec::new();
    flate2::read::ZlibDecoder::new(&bytes[24..])
        .read_to_end(&mut body)
        .unwrap();
    let row_bytes = 1;
    let lines = 40 + 2 * 4 * row_bytes;
    let count = |at: usize| u64::from_le_bytes(body[at..at + 8].try_into().unwrap());
    let mut at = lines + 8;
    for _ in 0..count(lines) {
        let n = u32::from_le_bytes(body[at + 48..at + 52].try_into().unwrap());
        at += 52 + 4 * n as usize;
    }
    assert_eq!(count(at), 1, "one tree closes both ways");
    let tree = at + 8 + 12;
    let length = u32::from_le_bytes(body[tree - 4..tree].try_into().unwrap()) as usize;
    assert!(length >= 6);
    verify_evidence(&graph, &pack(&body), Some(&walls)).unwrap();
    for byte in at..tree + length {
        for bit in 0..8 {
            let mut bad = body.clone();
            bad[byte] ^= 1 << bit;
            let verdict = verify_evidence(&graph, &pack(&bad), Some(&walls));
            // The same pair named from its other side is the same claim, with mirrored pieces.
            let is_mirrored = byte < tree - 4 && bad[at + 8..tree - 4] != body[at + 8..tree - 4];
            assert!(verdict.is_err() || is_mirrored, "byte {byte}, bit {bit}");
        }
    }
}
