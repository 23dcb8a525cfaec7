//! Areas of the walls of rooms, against the rooms of the model's author.

use anyhow::Context;
use enfilade::geom::DVec3;
use enfilade::internals::geom::triangle_area_normal;
use enfilade::world::{DecayLaw, PartId, Place, Reverb, Space};
use enfilade::{CellId, World};
use serde_json::Value;

use crate::rows::{Figure, folder_of};

fn point(value: &Value) -> Option<DVec3> {
    let xs: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    Some(DVec3::from_slice(xs?.get(..3)?))
}

/// Surface of a room's mesh. [Units: wu²]
fn surface(room: &Value) -> Option<f64> {
    let vertices: Option<Vec<DVec3>> = room["mesh"]["vertices"]
        .as_array()?
        .iter()
        .map(point)
        .collect();
    let vertices = vertices?;
    let mut area = 0.0;
    for triangle in room["mesh"]["triangles"].as_array()? {
        let mut corners = [DVec3::ZERO; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            *corner = *vertices.get(triangle[k].as_u64()? as usize)?;
        }
        area += 0.5 * triangle_area_normal(&corners).length();
    }
    Some(area)
}

/// Compares the walls and openings of each cell that holds one room with the surface of that room.
pub(super) fn areas(world: &World, name: &str) -> anyhow::Result<Figure> {
    let folder = folder_of(name).context("no folder")?;
    let text = std::fs::read_to_string(folder.join("truth.json"))?;
    let truth: Value = serde_json::from_str(&text)?;
    let space = Space::new(world.clone())?;
    let layout = space.layout(PartId::ROOT);
    let reverb = Reverb::new(&space, DecayLaw::Eyring, |_, _| [0.1; 6]);
    let mut rooms_of: Vec<Vec<&Value>> = vec![Vec::new(); layout.n_cells()];
    let rooms = truth["rooms"].as_array().context("no rooms")?;
    for room in rooms {
        let places = room["sample_points"].as_array().context("no points")?;
        let mut cells: Vec<CellId> = places
            .iter()
            .filter_map(|p| layout.locate(point(p)?))
            .collect();
        cells.sort_unstable();
        if let Some(cell) = cells.get(cells.len() / 2) {
            rooms_of[cell.idx()].push(room);
        }
    }
    let (mut ratios, mut n_other) = (Vec::new(), 0);
    let mut worst = (0.0, String::new());
    for (i, rooms) in rooms_of.iter().enumerate() {
        let [room] = rooms[..] else {
            continue;
        };
        let cell = CellId(i as u32);
        let exits = layout.exits(cell).iter();
        let openings: f64 = exits.map(|e| layout.opening(e.portal).area()).sum();
        let all = surface(room).context("no mesh")?;
        let ratio = (reverb.area(Place {
            part: PartId::ROOT,
            cell,
        }) + openings)
            / all;
        ratios.push(ratio);
        // Where the cell itself is another space than the room, such as one with the hollow above its ceiling.
        let volume = layout.cell(cell).volume / room["volume"].as_f64().context("no volume")?;
        let is_off = |ratio: f64| (ratio - 1.0).abs() > 0.1;
        n_other += usize::from(is_off(ratio) && is_off(volume));
        if (ratio - 1.0).abs() > worst.0 {
            worst = (
                (ratio - 1.0).abs(),
                format!("{} at {ratio:.3}, its volume at {volume:.3}", room["name"]),
            );
        }
    }
    ratios.sort_by(f64::total_cmp);
    let n_off = ratios.iter().filter(|r| (*r - 1.0).abs() > 0.1).count();
    let median = ratios
        .get(ratios.len() / 2)
        .copied()
        .context("no room found")?;
    let note = format!(
        "error of area, the worst of {} rooms alone in their cell, of {}; median ratio {median:.3}, {n_off} off by \
             more than a tenth, {n_other} of them with a cell whose volume is, too; {}",
        ratios.len(),
        rooms.len(),
        worst.1
    );
    Ok(Figure::new(worst.0, 0.1, note))
}
