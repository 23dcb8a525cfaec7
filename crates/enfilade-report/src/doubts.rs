//! Places of a plan where the bake decided: what is in doubt, and what is as large as a room and none.

use enfilade_cpg::{Fact, World};
use enfilade_geom::DVec2;

use crate::drawing::{Class, Item, Path, Words};
use crate::label::width;
use crate::sheet::Sheet;
use crate::storeys::Storey;

/// Most places drawn: more rings would hide the plan.
const MOST: usize = 40;
/// Radius of a ring, in a small house. [Units: wu]
const RING: f64 = 0.3;
/// Sides of a ring.
const SIDES: usize = 24;

/// A decision with its place.
pub(crate) struct Doubt {
    at: DVec2,
    /// Index of the plan that shows it.
    page: usize,
    text: String,
}

/// Returns the close decisions, the closest first, and then the spaces as large as a room and the openings that parted none, however clear.
/// Each is on the plan of the highest storey whose floor it is not below, else on the lowest.
pub(crate) fn doubts<'s>(world: &World, storeys: impl Iterator<Item = &'s Storey>) -> Vec<Doubt> {
    let floors: Vec<(usize, f64)> = (storeys.enumerate())
        .filter(|s| !s.1.is_between)
        .map(|(page, storey)| (page, storey.range[0] - RING))
        .collect();
    let of_rooms = world.graph.room_doubt();
    let close = of_rooms.close.iter().map(|c| (c.at, &c.why));
    let clear = world.graph.places.iter().filter(|p| p.why.chance() == 0.0);
    let all = close.chain(clear.map(|p| (p.at, &p.why)));
    let page_of = |y: f32| {
        let under = floors.iter().filter(|(_, low)| *low <= f64::from(y));
        let top = under.max_by(|a, b| a.1.total_cmp(&b.1));
        top.map_or(0, |floor| floor.0)
    };
    all.take(MOST)
        .map(|(at, why)| {
            let volume = why.facts.get(&Fact::Volume);
            let volume = volume.map_or(String::new(), |v| format!("; {v:.0} m³"));
            Doubt {
                at: DVec2::new(at[0].into(), at[2].into()),
                page: page_of(at[1]),
                text: format!("{why:#}{volume}"),
            }
        })
        .collect()
}

/// Draws the rings of a page, each with its number.
pub(crate) fn rings(doubts: &[Doubt], page: usize, sheet: &mut Sheet) {
    let radius = RING * sheet.zoom;
    for (number, doubt) in (1..).zip(doubts).filter(|d| d.1.page == page) {
        let corner = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / SIDES as f64;
            doubt.at + radius * DVec2::from_angle(angle)
        };
        sheet.items.push(Item::Path(Path {
            class: Class::Doubt,
            fill: None,
            lines: vec![(0..SIDES).map(corner).collect()],
            is_closed: true,
            cell: None,
            hint: Some(doubt.text.clone()),
        }));
        let text = format!("?{number}");
        let size = radius.min(1.6 * radius / width(&text));
        sheet.items.push(Item::Words(Words {
            at: doubt.at + DVec2::Y * 0.35 * size,
            size,
            is_centered: true,
            is_turned: false,
            text,
            cell: None,
        }));
        sheet.doubts.push((number, doubt.text.clone()));
    }
}
