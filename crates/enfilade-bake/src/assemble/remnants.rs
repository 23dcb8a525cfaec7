//! What is left of an opening that a decimation weighed, where walls of other cells take most of it, was not weighed itself.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Fact, Portal, Reason, Why};

/// Most that such an opening is larger than all portals that are made of it beside a cell: 3.3 in buildings, whose openings have
/// frames; in open caves 19 to 960, with portals of a few square centimeters.
const MOST: f64 = 4.0;

/// Gives remnants the reason of other gaps.
pub(super) fn tell_remnants(portals: &mut [Portal]) {
    let mut beside: BTreeMap<CellId, Vec<usize>> = BTreeMap::new();
    for (i, portal) in portals.iter().enumerate() {
        if opening(portal).is_some() {
            for cell in portal.cells {
                beside.entry(cell).or_default().push(i);
            }
        }
    }
    let is_remnant = |portal: &&Portal| {
        opening(portal).is_some_and(|(why, area)| {
            let all = beside[&portal.cells[0]].iter().map(|&i| &portals[i]);
            let of_opening = all.filter(|p| p.why.contains(why));
            area > MOST * of_opening.map(|p| f64::from(p.area)).sum::<f64>()
        })
    };
    let remnants: Vec<usize> = (0..portals.len())
        .filter(|&i| is_remnant(&&portals[i]))
        .collect();
    for i in remnants {
        portals[i].why = vec![Why::given(Reason::Gap)];
    }
}

/// Returns the decision of a decimation to keep an opening, and the opening's area.
fn opening(portal: &Portal) -> Option<(&Why, f64)> {
    let why = portal.why.iter().find(|why| why.reason == Reason::Kept)?;
    Some((why, f64::from(*why.facts.get(&Fact::Area)?)))
}

#[cfg(test)]
mod tests {
    use enfilade_geom::{DVec3, Plane, Winding};

    use super::*;
    use crate::assemble::rounded_portal;

    #[test]
    fn a_crack_is_not_the_opening_that_was_weighed_and_a_part_of_it_is() {
        let square = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let square = Winding::new(square.to_vec());
        let plane = Plane::through(DVec3::ZERO, DVec3::Z);
        let portal = |cell: u32, weighed: f64, area: f32| Portal {
            cells: [CellId(0), CellId(cell)],
            why: vec![Why::given(Reason::Kept).with(&[(Fact::Area, weighed)])],
            area,
            ..rounded_portal(&plane, &square, std::slice::from_ref(&square), 0.0).unwrap()
        };
        // An opening whole, one in two parts, and one of which hardly anything is left.
        let mut portals = [
            portal(1, 2.0, 1.9),
            portal(1, 4.0, 1.0),
            portal(2, 4.0, 0.9),
            portal(1, 3.4, 0.004),
        ];
        tell_remnants(&mut portals);
        let reasons = portals.each_ref().map(|p| p.why[0].reason);
        assert_eq!(
            reasons,
            [Reason::Kept, Reason::Kept, Reason::Kept, Reason::Gap]
        );
    }
}
