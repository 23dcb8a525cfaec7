//! The walk of a listener: along walking paths, or straight, with warnings where no one could walk or stand.

use anyhow::Context;
use enfilade::cpg::World;
use enfilade::geom::DVec3;
use enfilade::runtime::Sightlines;
use enfilade::world::{PartId, Path, Space};

use super::{SPEED, Sound};
use crate::path::refusal::Wanted;
use crate::screen::At;
use crate::walk::{self, Walks, WorldFile};

/// Height of a walker's ears. [Units: wu]
const EARS: f64 = 1.6;
/// Length of the lines that look for ground: more than any building is high. [Units: wu]
const FAR: f64 = 1e4;

/// Returns the positions of the ears on the walking path from point to point; ends elsewhere than asked are added to `warnings`.
pub(super) fn along_paths(
    args: &Sound,
    world: &World,
    hash: u64,
    points: &[DVec3],
    warnings: &mut Vec<String>,
) -> anyhow::Result<Vec<DVec3>> {
    let space = Space::new(world.clone()).with_context(|| args.world.display().to_string())?;
    let file = WorldFile {
        path: &args.world,
        hash,
    };
    let walks = Walks::usual();
    let map = walk::kept_or_made(Some(file), &space, &walks);
    let mut ears: Vec<DVec3> = Vec::new();
    let mut path = Path::default();
    for leg in points.windows(2) {
        let wanted = Wanted {
            space: &space,
            map: &map,
            walks,
            ends: [leg[0], leg[1]],
            options: ["--listener", "--listener"],
            closed: &args.closed,
        };
        wanted.find(&mut path)?;
        for moved in &wanted.moved(&path) {
            let told = wanted.told(moved);
            if !warnings.contains(&told) {
                warnings.push(told);
            }
        }
        ears.extend(path.points.iter().map(|p| p.at + DVec3::Y * EARS));
    }
    ears.dedup();
    if ears.is_empty() {
        ears.extend_from_slice(points);
    }
    Ok(ears)
}

/// Adds warnings of a walk along straight lines: through walls, below the ground.
pub(super) fn check(
    world: &World,
    points: &[DVec3],
    warnings: &mut Vec<String>,
) -> anyhow::Result<()> {
    let space = Space::new(world.clone())?;
    let lines = Sightlines::build(world);
    let wall = |a: DVec3, b: DVec3| {
        let [from, to] = [a, b].map(|p| p.as_vec3().to_array());
        lines.first_hit(from, to).map(|hit| hit.t)
    };
    let mut n_through = 0;
    let mut walked = 0.0;
    for leg in points.windows(2) {
        if let Some(t) = wall(leg[0], leg[1]) {
            n_through += 1;
            if n_through == 1 {
                let at = walked + t * leg[0].distance(leg[1]);
                warnings.push(format!(
                    "the listener walks through a wall at {}, after {:.1} s; --walk leads around walls, through doorways",
                    At(leg[0].lerp(leg[1], t).into()),
                    at / SPEED
                ));
            }
        }
        walked += leg[0].distance(leg[1]);
    }
    if n_through > 1 {
        warnings.push(format!(
            "the listener walks through walls on {n_through} of {} lines",
            points.len() - 1
        ));
    }
    let layout = space.layout(PartId::ROOT);
    let is_below = |p: &&DVec3| {
        let cell = layout.locate(**p);
        cell.is_some_and(|c| layout.cell(c).is_outdoor)
            && wall(**p, **p - DVec3::Y * FAR).is_none()
            && wall(**p, **p + DVec3::Y * FAR).is_some()
    };
    if let Some(p) = points.iter().find(is_below) {
        warnings.push(format!(
            "the listener is at {} outdoors, with no ground below but surfaces above: below the ground, or under the building",
            At((*p).into())
        ));
    }
    Ok(())
}
