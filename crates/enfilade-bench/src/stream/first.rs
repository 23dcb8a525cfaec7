//! First pictures: the time until the first room is complete, and all that is in view, head included, as a share of the time of
//! the whole file.

use std::time::Duration;

use anyhow::ensure;
use enfilade::World;
use enfilade::cpg::wire::encode_glb;
use enfilade::stream::{
    Changes, PackedWorld, SimulatedLink, SimulatedLinkOptions, StreamFrame, StreamOptions, Streamer,
};
use enfilade_testkit::Rng;

use super::settled::draw_stands;
use super::site::{FRAME, Streamed};
use crate::rows::Figure;
use crate::sight::walkthrough::Rings;

/// Triangles of the furnished building.
const TRIANGLES: u64 = 820_000;
/// First views.
const VIEWS: usize = 50;
/// Most frames until a view is settled: five minutes.
const MOST_FRAMES: u32 = 18_000;

/// Furnishes a building, packs it, and opens it over 1 MB/s with a latency of 50 ms, each time anew; returns the longest time
/// until the eye's room is complete.
pub(super) fn first_picture(world: &World) -> anyhow::Result<Figure> {
    let world = furnished(world, TRIANGLES)?;
    let site = Streamed::of(&world)?;
    let file = encode_glb(&world)?;
    let packed = PackedWorld::pack(&file)?;
    let n_head = packed.head.encode()?.len();
    let catalog = &packed.head.catalog;
    let of_file = |n: usize| {
        let link = SimulatedLinkOptions::default();
        link.latency.as_secs_f64() + n as f64 / link.bandwidth
    };
    let whole = of_file(file.len());
    let (mut rooms, mut views) = (Vec::new(), Vec::new());
    for stand in draw_stands(&site, VIEWS)? {
        let mut link = SimulatedLink::new(catalog, SimulatedLinkOptions::default());
        let pvs = Some(site.pvs.clone());
        let options = StreamOptions::default();
        let mut streamer = Streamer::new(catalog.clone(), &world.graph, pvs, options);
        let mut changes = Changes::default();
        let own = stand
            .eye
            .cell
            .map_or(&[][..], |cell| catalog.pieces_of(cell));
        let (mut now, mut is_settled, mut of_room) = (Duration::ZERO, false, None);
        for _ in 0..MOST_FRAMES {
            link.advance(now);
            let frame = StreamFrame {
                now,
                eye: stand.eye,
                in_view: &stand.in_view,
            };
            streamer.update(&mut link, &frame, &mut changes);
            if of_room.is_none() && own.iter().all(|p| streamer.is_resident(*p)) {
                of_room = Some(now);
            }
            is_settled = streamer.view_settled();
            if is_settled {
                break;
            }
            now += FRAME;
        }
        ensure!(is_settled, "a view is not complete after five minutes");
        let is_absent = stand.visible.iter().any(|p| !streamer.is_resident(*p));
        ensure!(!is_absent, "a view is settled without a piece in view");
        let since_head = |now: Duration| of_file(n_head) + now.as_secs_f64();
        rooms.push(since_head(of_room.unwrap_or(now)));
        views.push(since_head(now));
    }
    for times in [&mut rooms, &mut views] {
        times.sort_by(f64::total_cmp);
    }
    let [longest, longest_view] = [&rooms, &views].map(|t| t.last().copied().unwrap_or(f64::NAN));
    let note = format!(
        "{longest:.2} s of {whole:.1} s; median of {VIEWS} rooms {:.2} s; all in view after {longest_view:.2} s, median {:.2} s; \
             file of {:.1} MB, packed {:.1} MB, head {:.2} MB",
        rooms[rooms.len() / 2],
        views[views.len() / 2],
        file.len() as f64 / 1e6,
        (n_head + packed.body().len()) as f64 / 1e6,
        n_head as f64 / 1e6,
    );
    Ok(Figure::new(longest / whole, 0.1, note))
}

/// Returns the building with an object of its own in each room, and about `total` triangles.
pub(crate) fn furnished(world: &World, total: u64) -> anyhow::Result<World> {
    let mut world = world.clone();
    let n = world.details.len();
    Rings::of(&world, total)?.place(&mut world);
    let mut rng = Rng::new(3);
    let Some(ring) = world.detail_meshes.pop() else {
        return Ok(world);
    };
    for object in &mut world.details[n..] {
        let mut own = ring.clone();
        let vertices = own.primitives.iter_mut().flat_map(|p| &mut p.positions);
        for x in vertices.flatten() {
            // No two are equal: vertices are moved by up to a millimeter.
            *x += rng.range(-1e-3, 1e-3) as f32;
        }
        object.mesh = world.detail_meshes.len() as u32;
        world.detail_meshes.push(own);
    }
    Ok(world)
}
