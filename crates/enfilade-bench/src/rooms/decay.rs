//! Decay times of rooms by ray tracing of the meshes that are exported, beside those of their fields.

use std::collections::BTreeSet;
use std::process::Command;

use anyhow::Context;
use enfilade::cpg::{CellId, PortalKind, World};
use enfilade::geom::DVec3;
use enfilade::world::{
    Acoustics, Assumed, DecayLaw, DiffuseFields, PartId, Place, Reverb, Space, Transmission,
};
use enfilade_export::room_solids;
use enfilade_testkit::Rng;
use serde_json::{Value, json};

use super::score::list;
use crate::process::{output_of, python};
use crate::rows::Figure;

/// Rooms of a building, from the smallest to the largest.
const N_ROOMS: usize = 5;
/// Places of the source and of ears in a room.
const N_PLACES: usize = 5;
/// Least distance of a place from walls, along the axes. [Units: wu]
const OFF_WALLS: f64 = 0.25;

/// Prints, of rooms on standard input, the mean decay time of the bands of 500 and 1,000 Hz at the places after the first: twice that
/// from 5 to 35 dB down (Schroeder 1965, ISO 3382-2).
const PYROOMACOUSTICS: &str = "
import json, sys
import numpy as np
import pyroomacoustics as pra
BIN = 0.004
def time_of(energy):
    left = np.cumsum(energy[::-1])[::-1]
    level = 10 * np.log10(np.maximum(left / left[0], 1e-30))
    first, last = np.argmax(level < -5), np.argmax(level < -35)
    return -60 / np.polyfit(np.arange(first, last) * BIN, level[first:last], 1)[0]
np.random.seed(1)
times = []
for told in json.load(sys.stdin):
    walls = []
    for wall in told['room']['walls']:
        material = pra.Material(wall['absorption'], wall['scattering'])
        coefficients = material.absorption_coeffs, material.scattering_coeffs
        walls.append(pra.wall_factory(np.array(wall['corners']), *coefficients, wall['name']))
    room = pra.Room(walls, fs=16000, max_order=0, ray_tracing=True)
    room.set_ray_tracing(n_rays=10000, receiver_radius=0.2, hist_bin_size=BIN)
    source, *ears = told['places']
    room.add_source(source)
    for at in ears:
        room.add_microphone(at)
    room.image_source_model()
    room.ray_tracing()
    bands = [np.asarray(room.rt_histograms[k][0][0]) for k in range(len(ears))]
    times.append(float(np.mean([time_of(b[i]) for b in bands for i in (2, 3)])))
print(json.dumps(times))
";

/// Measures the worst share by which the decay time of a room's field is off one traced by pyroomacoustics in the mesh that is
/// exported of it: of five rooms by volume, all doors shut, without furniture, which meshes have not. Rooms with a way that nothing
/// shuts do not count, as their meshes end there. `ENFILADE_PYTHON` names a Python that has pyroomacoustics.
pub(super) fn traced(world: &World) -> anyhow::Result<Figure> {
    let solids = room_solids(world, &|name| Assumed::of_name(name).bands);
    let is_open = |cell: CellId| {
        let mut portals = world
            .graph
            .portals
            .iter()
            .filter(|p| p.cells.contains(&cell));
        portals.any(|p| matches!(p.kind, PortalKind::Open | PortalKind::Crack))
    };
    let mut closed: Vec<_> = solids.iter().filter(|s| !is_open(s.cell)).collect();
    closed.sort_by(|a, b| a.volume.total_cmp(&b.volume));
    let (n, n_chosen) = (closed.len(), closed.len().min(N_ROOMS));
    let step = (n.max(1) - 1) as f64 / (n_chosen.max(2) - 1) as f64;
    let chosen = (0..n_chosen).map(|k| closed[(k as f64 * step).round() as usize]);
    let chosen: Vec<_> = chosen.collect();
    let mut told = Vec::new();
    for solid in &chosen {
        let room: Value = serde_json::from_str(&solid.acoustics_json())?;
        let places: Vec<_> = (places_in(world, solid.cell).iter())
            .map(|p| [p.x, -p.z, p.y])
            .collect();
        anyhow::ensure!(places.len() == N_PLACES, "{} has no places", solid.name);
        told.push(json!({ "room": room, "places": places }));
    }
    let mut command = Command::new(python());
    let input = Value::from(told).to_string();
    let said = output_of(command.args(["-c", PYROOMACOUSTICS]), Some(&input));
    let said = said.context("needs `pip install pyroomacoustics`, in $ENFILADE_PYTHON")?;
    let times: Value = serde_json::from_str(said.lines().last().unwrap_or_default())?;

    let space = Space::new(without_furniture(world))?;
    let acoustics = Acoustics::new(&space, &Transmission::default());
    let bands = |_: PartId, material: Option<u32>| {
        let material = material.and_then(|m| world.materials.get(m as usize));
        Assumed::of_name(material.map_or("", |m| &m.name)).bands
    };
    let reverb = Reverb::new(&space, DecayLaw::Kuttruff, bands);
    let mut fields = DiffuseFields::new();
    let (mut worst, mut each): (f64, Vec<String>) = (0.0, Vec::new());
    for (solid, traced) in chosen.iter().zip(list(&times)) {
        let place = Place {
            part: PartId::ROOT,
            cell: solid.cell,
        };
        fields.solve(&reverb, &space, place, |part, portal| {
            acoustics.transmitted(&space, part, portal)
        });
        let (own, traced) = (fields.rt60(place), traced.as_f64().unwrap_or(f64::NAN));
        let off = own / traced - 1.0;
        worst = if off.is_nan() {
            off
        } else {
            worst.max(off.abs())
        };
        let name = &world.graph[solid.cell].name;
        each.push(format!("{name} {own:.2} for {traced:.2} s"));
    }
    let note = format!("{n} rooms are closed; {}", each.join(", "));
    Ok(Figure::new(worst, 0.1, note))
}

/// Returns a world of which only leaves and panes are left beside the walls.
fn without_furniture(world: &World) -> World {
    let mut bare = world.clone();
    let fittings = world.graph.portals.iter().flat_map(|p| &p.fittings);
    let fittings = fittings.map(|f| world.details[f.detail as usize].mesh);
    let fittings: BTreeSet<u32> = fittings.collect();
    for (id, mesh) in (0..).zip(&mut bare.detail_meshes) {
        if !fittings.contains(&id) {
            mesh.primitives.clear();
        }
    }
    bare
}

/// Returns places in a cell, off its walls.
fn places_in(world: &World, cell: CellId) -> Vec<DVec3> {
    let bounds = world.graph[cell].aabb;
    let [low, high] = bounds.map(|p| DVec3::from(p.map(f64::from)));
    let mut rng = Rng::new(7);
    let is_free = |p: DVec3| {
        let ends = [-OFF_WALLS, 0.0, OFF_WALLS];
        let all = (0..27).map(|k| DVec3::new(ends[k % 3], ends[k / 3 % 3], ends[k / 9]));
        let mut all = all.map(|d| world.graph.locator.locate(p + d));
        all.all(|found| found == Some(cell))
    };
    let tried = (0..100_000).map(|_| {
        let share = DVec3::from([0; 3].map(|_| rng.range(0.0, 1.0)));
        low + (high - low) * share
    });
    tried.filter(|&p| is_free(p)).take(N_PLACES).collect()
}
