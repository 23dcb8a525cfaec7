//! `enfilade edit`: removes portals from a world, inserts others, and makes mirrors, monitors and links.

mod special;

use std::path::PathBuf;

use anyhow::{Context, bail};
use enfilade::bake::edit::add_portal;
use enfilade::bake::simplify::{Simplified, delete_portal};
use enfilade::cpg::{Portal, PortalId, World};
use enfilade::geom::DVec3;

use crate::formats::Format;
use crate::limits::Limits;
use crate::output::Outputs;
use crate::simplify::{Done, write};
use enfilade_cli::input::name_of;
use enfilade_cli::world::read_world;

/// Removes portals from a world, inserts new ones, and makes mirrors, monitors, tinted panes and links of them.
#[derive(clap::Args)]
#[command(group(clap::ArgGroup::new("edits").required(true).multiple(true)))]
pub(crate) struct Edit {
    /// World from any builder; `-` for standard input.
    #[arg(value_name = "IN.glb")]
    input: PathBuf,
    /// World to write; `-` for standard output.
    #[arg(short, long, value_name = "OUT.glb")]
    output: PathBuf,
    /// Portal to remove, by its number in the input; all others between its two cells go, too.
    #[arg(long, value_name = "ID", group = "edits")]
    delete_portal: Vec<u32>,
    /// Portal to insert after removals, given by the vertices of a convex planar polygon in order; it cuts the cell
    /// that contains its middle, and may reach into walls.
    #[arg(
        long,
        value_name = "X,Y,Z;X,Y,Z;…",
        group = "edits",
        value_parser = parse_polygon,
        allow_hyphen_values = true
    )]
    add_portal: Vec<Polygon>,
    #[command(flatten)]
    specials: special::Specials,
    /// Print JSON for machines.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    limits: Limits,
}

/// Vertices of a polygon.
#[derive(Clone, Debug, PartialEq)]
struct Polygon(Vec<DVec3>);

fn parse_polygon(text: &str) -> Result<Polygon, String> {
    let corner = |(i, part): (usize, &str)| {
        let numbers: Vec<f64> = part
            .split(',')
            .map(|n| {
                let value = n.trim().parse::<f64>().ok().filter(|v| v.is_finite());
                value.ok_or_else(|| format!("vertex {i}: '{}' is not a number", n.trim()))
            })
            .collect::<Result<_, _>>()?;
        match numbers[..] {
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            _ => Err(format!(
                "vertex {i}: '{}' has {} numbers, not three",
                part.trim(),
                numbers.len()
            )),
        }
    };
    let text = text.trim().trim_end_matches(';');
    let corners: Vec<DVec3> = text
        .split(';')
        .enumerate()
        .map(corner)
        .collect::<Result<_, _>>()?;
    if corners.len() < 3 {
        return Err(format!(
            "a portal needs at least 3 vertices, not {}; put ';' between them",
            corners.len()
        ));
    }
    Ok(Polygon(corners))
}

pub(crate) fn run(args: &Edit) -> anyhow::Result<()> {
    args.limits.begin()?;
    let mut outputs = Outputs::reading([&args.input])?;
    outputs.write("-o", Format::World, &args.output)?;
    let before = read_world(&args.input)?;
    let mut done = Done::default();
    let mut world: Option<World> = None;
    // Clones only what is changed.
    let specials = &args.specials;
    if specials.removes() {
        let changed = world.insert(before.clone());
        specials.remove(changed, &mut done.notes)?;
    }
    if !args.delete_portal.is_empty() {
        let simpler = without_portals(args, world.as_ref().unwrap_or(&before))?;
        done.costs = Some([simpler.min_cost, simpler.max_cost]);
        world = Some(simpler.world);
    }
    for (i, polygon) in args.add_portal.iter().enumerate() {
        let of = world.as_ref().unwrap_or(&before);
        let added = add_portal(of, &polygon.0)
            .with_context(|| format!("--add-portal number {} changes nothing", i + 1))?;
        let area: f32 = added
            .portals
            .iter()
            .map(|p| added.world.graph[*p].area)
            .sum();
        let cells = [added.cell, added.new_cell].map(|c| &added.world.graph[c]);
        let [(one, v1), (other, v2)] = cells.map(|c| (&c.name, c.volume));
        done.notes.push(format!(
            "{} of {area:.2} m² divides {one}: now {one} ({v1:.1} m³) and {other} ({v2:.1} m³)",
            added.portals[0]
        ));
        for (kept, new) in &added.halved {
            done.notes
                .push(format!("{kept} is cut in two: now {kept} and {new}"));
        }
        world = Some(added.world);
    }
    if specials.makes() {
        let changed = world.get_or_insert_with(|| before.clone());
        specials.make(changed, &mut done.notes)?;
    }
    let mut world = world.context("no portal was removed")?;
    write(&outputs, &args.output, &before, &mut world, done, args.json)
}

/// The world without the portals to remove.
fn without_portals(args: &Edit, before: &World) -> anyhow::Result<Simplified> {
    let n = before.graph.portals.len();
    if let Some(id) = args.delete_portal.iter().find(|&&id| id as usize >= n) {
        bail!(
            "there is no portal {id}: {} has {n}, counted from 0",
            name_of(&args.input)
        );
    }
    let mut result: Option<Simplified> = None;
    // Numbers change as portals go, so find each one again by its cells' new numbers.
    let mut cell_of: Vec<u32> = (0..before.graph.cells.len() as u32).collect();
    for &id in &args.delete_portal {
        let cells = before.graph.portals[id as usize]
            .cells
            .map(|c| cell_of[c.0 as usize]);
        let world = result.as_ref().map_or(before, |r| &r.world);
        let between = |p: &Portal| {
            let now = p.cells.map(|c| c.0);
            now == cells || now == [cells[1], cells[0]]
        };
        let Some(portal) = world.graph.portals.iter().position(between) else {
            // Already removed with another portal between the same cells.
            continue;
        };
        if let Some(next) = delete_portal(world, PortalId(portal as u32)) {
            for c in &mut cell_of {
                *c = next.cell_of[*c as usize].0;
            }
            result = Some(next);
        }
    }
    result.context("no portal was removed")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_is_read_and_what_is_none_is_refused_with_its_corner() {
        let polygon = parse_polygon("-1,2,3; 4,5.5,6;7,8,9;").unwrap();
        assert_eq!(polygon.0[0], DVec3::new(-1.0, 2.0, 3.0));
        assert_eq!(polygon.0.len(), 3);
        for (text, says) in [
            ("1,2,3;4,5,6", "at least 3 vertices, not 2"),
            ("1,2,3;4,x,6;7,8,9", "vertex 1: 'x' is not a number"),
            ("1,2,3;4,5,6;7,8", "vertex 2: '7,8' has 2 numbers"),
            ("1,2,3;4,5,6;7,8,inf", "vertex 2: 'inf' is not a number"),
            ("", "vertex 0: '' is not a number"),
        ] {
            let error = parse_polygon(text).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
    }
}
