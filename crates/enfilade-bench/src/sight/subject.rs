//! Subjects of view queries: worlds, portal files and generated offices.

use std::path::{Path, PathBuf};

use anyhow::Context;
use enfilade::cpg::{Cell, CellId, CellPortalGraph, Portal, PortalId, PortalKind, World};
use enfilade::geom::{DVec3, Winding};
use enfilade::import::read_prt;
use enfilade::runtime::{Sight, View};
use enfilade_cli::world::read_world;
use enfilade_testkit::{GridParams, Rng, room_grid};

use crate::measure::name;

/// A scene, with eyes in known cells if it has no locator.
pub(crate) struct Subject {
    pub(crate) name: String,
    pub(crate) world: World,
    pub(crate) eyes: Eyes,
}

pub(crate) enum Eyes {
    /// Anywhere in the boxes of cells that are not outdoors.
    Located,
    /// One point in each cell.
    Known(Vec<[f32; 3]>),
}

/// Approximate length of a Quake unit. [Units: wu]
const QUAKE_UNIT: f64 = 1.0 / 32.0;

/// Loads the leaves of a Quake portal file as a world without triangles.
fn read_portal_file(path: &Path) -> anyhow::Result<Subject> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let file = read_prt(&text).with_context(|| path.display().to_string())?;
    let mut cells = vec![Cell::default(); file.n_clusters as usize];
    let mut sums = vec![(DVec3::ZERO, 0.0); cells.len()];
    let mut portals = Vec::new();
    for p in &file.portals {
        let points: Vec<DVec3> = p
            .points
            .iter()
            // +Z is up in Quake.
            .map(|&[x, y, z]| DVec3::new(x, z, -y) * QUAKE_UNIT)
            .collect();
        let winding = Winding::new(points);
        let Some(normal) = winding.area_normal().try_normalize() else {
            continue;
        };
        for c in p.clusters {
            let sum = &mut sums[c as usize];
            *sum = (sum.0 + winding.centroid(), sum.1 + 1.0);
            cells[c as usize]
                .portals
                .push(PortalId(portals.len() as u32));
        }
        let outline: Vec<[f32; 3]> = winding
            .points
            .iter()
            .map(|p| p.as_vec3().to_array())
            .collect();
        portals.push(Portal {
            cells: p.clusters.map(CellId),
            kind: PortalKind::Open,
            normal: normal.as_vec3().to_array(),
            pieces: vec![outline.clone()],
            outline,
            area: winding.area() as f32,
            fittings: Vec::new(),
            why: Vec::new(),
        });
    }
    for (i, cell) in cells.iter_mut().enumerate() {
        cell.name = format!("cell-{i}");
    }
    // A leaf is convex, so the mean of points on its portals lies in it.
    let eyes = sums
        .iter()
        .map(|(sum, n)| (*sum / f64::max(*n, 1.0)).as_vec3().to_array())
        .collect();
    Ok(Subject {
        name: name(path),
        world: World {
            graph: CellPortalGraph {
                cells,
                portals,
                ..CellPortalGraph::default()
            },
            ..World::default()
        },
        eyes: Eyes::Known(eyes),
    })
}

pub(crate) fn subjects(scenes: &[PathBuf], rooms: &[usize]) -> anyhow::Result<Vec<Subject>> {
    let mut out = Vec::new();
    for path in scenes {
        if path.extension().is_some_and(|e| e == "prt") {
            out.push(read_portal_file(path)?);
        } else {
            out.push(Subject {
                name: name(path),
                world: read_world(path)?,
                eyes: Eyes::Located,
            });
        }
    }
    for &n in rooms {
        out.push(Subject {
            name: format!("offices of {n} rooms"),
            world: room_grid(&GridParams::offices(n, 1)),
            eyes: Eyes::Located,
        });
    }
    Ok(out)
}

/// Draws a view with the cell of its eye: upright, 60 degrees high, 16:9.
pub(crate) fn draw_view(
    rng: &mut Rng,
    subject: &Subject,
    sight: &Sight,
) -> anyhow::Result<Option<(View, CellId)>> {
    let cells = &subject.world.graph.cells;
    for _ in 0..10_000 {
        let c = rng.below(cells.len().max(1));
        let (eye, cell) = match &subject.eyes {
            Eyes::Known(eyes) => (eyes[c], Some(CellId(c as u32))),
            Eyes::Located => {
                if cells.get(c).is_none_or(|c| c.outdoor) {
                    continue;
                }
                let [low, high] = cells[c].aabb;
                let eye = [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * rng.unit() as f32);
                (eye, sight.locate(eye).filter(|f| f.0 == c as u32))
            }
        };
        if let Some(cell) = cell {
            let angle = rng.range(0.0, std::f64::consts::TAU);
            let level = rng.range(-0.2, 0.2) as f32;
            let toward = [angle.cos() as f32, level, angle.sin() as f32];
            let view = View::perspective(eye, toward, [0.0, 1.0, 0.0], 1.047, 16.0 / 9.0)?;
            return Ok(Some((view, cell)));
        }
    }
    Ok(None)
}
