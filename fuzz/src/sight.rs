//! Visibility before run-time: evidence, checkpoints, and the search itself.

use std::io::{Read, Write};
use std::sync::LazyLock;
use std::time::Duration;

use enfilade::verify::verify_evidence;
use enfilade::vis::{VisCheckpoint, VisConfig, VisContext, VisMode, VisOutput, see_all};
use enfilade_cpg::{CellId, Pvs, SightGraph};
use enfilade_geom::DVec3;
use enfilade_import::read_prt;
use enfilade_testkit::{GridParams, room_grid};
use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;

/// Evidence and checkpoints have the same head: magic, a number, and the check sum of the compressed rest.
const HEAD: usize = 24;

/// A graph, the known visibility in it, and valid files about it.
struct Known {
    graph: SightGraph,
    /// Pairs visible by lines that stay clear of all edges: calling one of these hidden is wrong.
    proved: Pvs,
    evidence: Vec<u8>,
    checkpoint: Vec<u8>,
}

static KNOWN: LazyLock<Known> = LazyLock::new(|| {
    let world = room_grid(&GridParams {
        turn: 0.4,
        furniture: 0,
        ..GridParams::offices(6, 3)
    });
    let graph = SightGraph::of_graph(&world.graph);
    let wide = VisConfig {
        clearance: Some(1e-3),
        ..VisConfig::default()
    };
    let sure = search(&graph, &wide, None).expect("a good graph");
    let proved = minus(&sure.cells, &sure.undecided);
    let with_evidence = VisConfig {
        has_evidence: true,
        ..VisConfig::default()
    };
    let evidence = search(&graph, &with_evidence, None)
        .expect("a good graph")
        .evidence;
    let mut checkpoint = Vec::new();
    let mut context = VisContext {
        on_round: &mut |_, _| false,
        walls: None,
        checkpoint: Some(VisCheckpoint {
            blocks: None,
            resume: None,
            salt: 0,
            every: Duration::MAX,
            save: &mut |bytes| checkpoint = bytes,
        }),
    };
    see_all(&graph, &VisConfig::default(), &mut context).expect("a good graph");
    assert!(
        checkpoint.len() > HEAD,
        "the search was over before it could be stopped"
    );
    Known {
        graph,
        proved,
        evidence: evidence.expect("requested"),
        checkpoint,
    }
});

fn minus(all: &Pvs, less: &Pvs) -> Pvs {
    let cells = 0..all.n_cells() as u32;
    Pvs::of_ascending(cells.map(|a| {
        let seen = all
            .visible_from(CellId(a))
            .filter(move |&b| !less.sees(CellId(a), b));
        seen.map(|b| b.0).collect::<Vec<_>>()
    }))
}

fn search(graph: &SightGraph, config: &VisConfig, resume: Option<Vec<u8>>) -> Option<VisOutput> {
    let mut save = |_| ();
    let mut context = VisContext {
        on_round: &mut |_, _| true,
        walls: None,
        checkpoint: resume.map(|bytes| VisCheckpoint {
            blocks: None,
            resume: Some(bytes),
            salt: 0,
            every: Duration::MAX,
            save: &mut save,
        }),
    };
    match see_all(graph, config, &mut context) {
        Ok(output) => Some(output),
        Err(error) => {
            assert!(!error.to_string().is_empty());
            None
        }
    }
}

/// Returns the body of a valid file, as a seed.
fn body(file: &[u8]) -> Vec<u8> {
    let mut body = Vec::new();
    ZlibDecoder::new(&file[HEAD..])
        .read_to_end(&mut body)
        .expect("a good file");
    body
}

/// Returns a file with this body and a valid length and sum.
fn packed(head: &[u8], body: &[u8], has_length: bool) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(body).expect("memory takes all");
    let packed = encoder.finish().expect("memory takes all");
    let fnv = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    let sum = packed.iter().fold(0xcbf2_9ce4_8422_2325, fnv).to_le_bytes();
    let length = (body.len() as u64).to_le_bytes();
    let second = if has_length {
        &length[..]
    } else {
        &head[8..16]
    };
    [&head[..8], second, &sum, &packed].concat()
}

/// Returns valid bodies of evidence and of a checkpoint.
#[must_use]
pub fn seeds() -> [Vec<u8>; 2] {
    [body(&KNOWN.evidence), body(&KNOWN.checkpoint)]
}

/// Accepted evidence calls no visible cell hidden.
pub fn evidence(data: &[u8]) {
    let known = &*KNOWN;
    for bytes in [data, &packed(&known.evidence, data, true)] {
        let Ok(report) = verify_evidence(&known.graph, bytes, None) else {
            continue;
        };
        for (a, visible) in (0..).zip(&report.cells) {
            for b in known.proved.visible_from(CellId(a)) {
                assert!(
                    visible.contains(b),
                    "cell {a} sees cell {}, which is claimed hidden",
                    b.0
                );
            }
        }
    }
}

/// A search resumed from any checkpoint finds all visible cells.
pub fn checkpoint(data: &[u8]) {
    let known = &*KNOWN;
    for bytes in [data, &packed(&known.checkpoint, data, false)] {
        let found = search(&known.graph, &VisConfig::default(), Some(bytes.to_vec()));
        if let Some(found) = found {
            check_holds(&found.cells, &known.proved);
        }
    }
}

/// Portal files after decoding: both searches agree, and the evidence is accepted.
pub fn pvs(data: &[u8]) {
    let Some(file) = std::str::from_utf8(data)
        .ok()
        .and_then(|text| read_prt(text).ok())
    else {
        return;
    };
    let winding = |points: &[[f64; 3]]| points.iter().map(|&p| DVec3::from_array(p)).collect();
    let portals = file.portals.iter();
    let graph = SightGraph::of_windings(
        file.n_clusters,
        portals.map(|portal| (portal.clusters, winding(&portal.points))),
    );
    if graph.n_cells > 1000 || graph.portals.len() > 40 {
        return;
    }
    let exact = VisConfig {
        has_evidence: true,
        max_pieces: 8,
        ..VisConfig::default()
    };
    let fast = VisConfig {
        mode: VisMode::Fast,
        ..VisConfig::default()
    };
    let (Some(exact), Some(fast)) = (search(&graph, &exact, None), search(&graph, &fast, None))
    else {
        return;
    };
    check_holds(&fast.cells, &minus(&exact.cells, &exact.undecided));
    for a in 0..graph.n_cells {
        for b in exact.cells.visible_from(CellId(a)) {
            assert!(
                exact.cells.sees(b, CellId(a)),
                "{a} sees {}, but not the reverse",
                b.0
            );
        }
    }
    let report = verify_evidence(&graph, &exact.evidence.expect("requested"), None);
    let report = report.expect("evidence of the search's own");
    assert_eq!(report.n_visible, exact.cells.n_pairs() as u64);
}

fn check_holds(all: &Pvs, some: &Pvs) {
    for a in (0..some.n_cells() as u32).map(CellId) {
        for b in some.visible_from(a) {
            assert!(
                all.sees(a, b),
                "cell {} sees cell {}, which was claimed hidden",
                a.0,
                b.0
            );
        }
    }
}
