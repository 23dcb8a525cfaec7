//! Places of a plan where the bake decided: what is in doubt, and what is as large as a room and none.

use enfilade_cpg::{Fact, World};
use enfilade_geom::DVec2;

use crate::drawing::{Class, Item, Path, Words};
use crate::label::{line_height, width};
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
pub(crate) fn doubts<'s>(
    world: &World,
    storeys: impl ExactSizeIterator<Item = &'s Storey> + Clone,
) -> Vec<Doubt> {
    if storeys.len() == 0 {
        return Vec::new();
    }
    let of_rooms = world.graph.room_doubt();
    let close = of_rooms.close.iter().map(|c| (c.at, &c.why));
    let clear = world.graph.places.iter().filter(|p| p.why.chance() == 0.0);
    let all = close.chain(clear.map(|p| (p.at, &p.why)));
    let page_of = |y: f32| {
        let floors = storeys.clone().enumerate().filter(|s| !s.1.is_between);
        let low = |s: &Storey| s.range[0] - RING;
        let under = floors.filter(|s| low(s.1) <= f64::from(y));
        let top = under.max_by(|a, b| low(a.1).total_cmp(&low(b.1)));
        top.map_or(0, |s| s.0)
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

/// Writes the reasons of the rings on a sheet, within `room`. Returns the y of their end. [Units: wu]
pub(crate) fn list(sheet: &mut Sheet, below: f64, room: f64, size: f64) -> f64 {
    let mut y = below;
    sheet.doubts.sort_unstable();
    for (number, text) in std::mem::take(&mut sheet.doubts) {
        let mut line = format!("?{number}");
        for word in text.split(' ') {
            if width(&line) * size + (width(word) + 1.0) * size > room {
                y += line_height() * size;
                let full = std::mem::replace(&mut line, "    ".to_owned());
                sheet.words(DVec2::new(0.0, y), size, false, full);
            }
            line.push(' ');
            line.push_str(word);
        }
        y += 1.3 * line_height() * size;
        sheet.words(DVec2::new(0.0, y), size, false, line);
    }
    y
}
