//! Open land divided into cells: valleys, hamlets among hollows, cities, a square kilometer each.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use anyhow::bail;
use enfilade::bake::{BakeConfig, BakeContext, Outdoors, Silent, bake};
use enfilade::cpg::{CellId, World};
use enfilade_testkit::{OpenLand, city, hamlets, valleys};
use enfilade_verify::{VerifyOptions, verify_world};

use crate::kept::Kept;
use crate::rows::Figure;
use crate::sight::visible;

/// Bars of the issue: share of places without a cell of their own, and seconds for a square kilometer.
const MISSED: f64 = 0.05;
const SECONDS: f64 = 30.0;
/// Share of the cells that a cell of a city may see: a fourth of what one outdoor cell shows.
const SEEN: f64 = 0.25;

/// Land and its world.
struct BakedLand {
    land: OpenLand,
    world: World,
    seconds: f64,
}

fn baked(name: &str) -> anyhow::Result<Arc<BakedLand>> {
    static BAKED: Kept<BakedLand> = Kept::new();
    BAKED.get(name, || BakedLand::of(name))
}

impl BakedLand {
    fn of(name: &str) -> anyhow::Result<Self> {
        let land = match name.split_once('-') {
            Some(("city", seed)) => city(seed.parse()?),
            _ if name == "valleys" => valleys(),
            _ if name == "hamlets" => hamlets(),
            _ => bail!("no land {name}"),
        };
        let config = BakeConfig {
            outdoors: Outdoors::Split { minima: Vec::new() },
            ..BakeConfig::default()
        };
        let start = Instant::now();
        let world = bake(&land.scene, &config, &BakeContext::new(&Silent, None))?.world;
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            land,
            world,
            seconds,
        })
    }
}

/// Share of valleys, streets, squares and courtyards without a cell of their own: a point of theirs is in no area of land,
/// or in the cell of another place.
pub(super) fn missed(name: &str) -> anyhow::Result<Figure> {
    let baked = baked(name)?;
    let graph = &baked.world.graph;
    let mut places_in: BTreeMap<CellId, Vec<usize>> = BTreeMap::new();
    let (places, mut is_missed) = (&baked.land.places, vec![false; baked.land.places.len()]);
    for (k, points) in places.iter().enumerate() {
        for &point in points {
            match graph.locator.locate(point).filter(|c| graph[*c].is_land) {
                Some(cell) => places_in.entry(cell).or_default().push(k),
                None => is_missed[k] = true,
            }
        }
    }
    for of in places_in.values_mut() {
        of.dedup();
        if of.len() > 1 {
            of.iter().for_each(|&k| is_missed[k] = true);
        }
    }
    let n = is_missed.iter().filter(|m| **m).count();
    let note = format!(
        "{n} of {} places; {} areas of land, {} with a point of a place",
        places.len(),
        graph.cells.iter().filter(|c| c.is_land).count(),
        places_in.len()
    );
    Ok(Figure::new(n as f64 / places.len() as f64, MISSED, note))
}

/// Blocks that are cells, houses without a room of their own, and rooms that no house has.
pub(super) fn rooms(name: &str) -> anyhow::Result<Figure> {
    let baked = baked(name)?;
    let graph = &baked.world.graph;
    let at = |p: &_| graph.locator.locate(*p);
    let blocks = baked.land.blocks.iter().filter(|p| at(p).is_some()).count();
    let mut rooms: Vec<CellId> = baked.land.rooms.iter().filter_map(at).collect();
    rooms.retain(|c| graph[*c].is_room());
    rooms.sort_unstable();
    rooms.dedup();
    let lost = baked.land.rooms.len() - rooms.len();
    let others = graph.rooms().count() - rooms.len();
    let note = format!(
        "{blocks} of {} blocks are cells, {lost} of {} houses lost, {others} other rooms",
        baked.land.blocks.len(),
        baked.land.rooms.len()
    );
    Ok(Figure::new((blocks + lost + others) as f64, 0.0, note))
}

/// Wall seconds of a bake.
pub(super) fn seconds(name: &str) -> anyhow::Result<Figure> {
    Ok(Figure::new(
        baked(name)?.seconds,
        SECONDS,
        "a square kilometer",
    ))
}

/// Broken promises of a world.
pub(super) fn broken(name: &str) -> anyhow::Result<Figure> {
    let baked = baked(name)?;
    let report = verify_world(&baked.world, None, &VerifyOptions::default());
    let n = report.unsealed + report.incomplete + report.problems.len() as u64;
    let note = format!("{} rays judged", report.sealed.judged);
    Ok(Figure::new(n as f64, 0.0, note))
}

/// Mean share of the cells that an area of land sees, itself and the outdoors included.
pub(super) fn seen(name: &str) -> anyhow::Result<Figure> {
    let baked = baked(name)?;
    let graph = &baked.world.graph;
    let found = visible(graph)?;
    let land: Vec<CellId> = (graph.indoor_cells().filter(|c| c.1.is_land))
        .map(|c| c.0)
        .collect();
    let n_seen = land
        .iter()
        .map(|&c| found.vis.cells.visible_from(c).count());
    let mean = n_seen.sum::<usize>() as f64 / land.len() as f64;
    let note = format!("{mean:.1} of {} cells", graph.cells.len());
    Ok(Figure::new(mean / graph.cells.len() as f64, SEEN, note))
}
