//! Prints how well the surfaces of each room close.

use std::io::Write;

use enfilade_cpg::wire;
use enfilade_export::{SurfaceLevel, SurfaceOptions, room_surfaces};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let bytes = std::fs::read(&args[1]).expect("a world");
    let world = wire::decode_glb(&bytes).expect("a valid world");
    let mut out = std::io::stdout();
    let t = std::time::Instant::now();
    for level in [SurfaceLevel::First, SurfaceLevel::Second] {
        let rooms = room_surfaces(
            &world,
            &SurfaceOptions {
                level,
                ..SurfaceOptions::default()
            },
        );
        writeln!(
            out,
            "{level:?} {:?} nodes {}",
            t.elapsed(),
            world.graph.locator.nodes.len()
        )
        .unwrap();
        for r in &rooms {
            let cell = &world.graph[r.cell];
            writeln!(
                out,
                "{} void={} n={} paired={} open={} gap={:.2e} volume {:.4} / {:.4} ({:.3}%)",
                cell.name,
                cell.is_void,
                r.surfaces.len(),
                r.surfaces.iter().filter(|s| s.pair.is_some()).count(),
                r.n_open_edges,
                r.gap,
                r.volume,
                cell.volume,
                100.0 * (r.volume / f64::from(cell.volume) - 1.0)
            )
            .unwrap();
        }
    }
}
