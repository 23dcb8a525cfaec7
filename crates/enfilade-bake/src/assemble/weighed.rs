//! Portals that have hardly anything of an opening that a decimation weighed, or far more, were not weighed themselves.
//!
//! A portal of the exact cut has the decision of the opening that its largest part lies on. Where walls of other cells take most of
//! an opening, the portal is the little that they leave; where a gap of the model goes on in its plane, the opening is a small part of it.

use std::collections::BTreeMap;

use enfilade_cpg::{CellId, Fact, Portal, Reason, Why};

/// Most that an opening is larger than all portals that are made of it beside a cell, and a portal than its opening: 3.3 in
/// buildings whose openings have frames; up to 960 in open caves, with portals of a few square centimeters.
const MOST: f64 = 4.0;

/// Gives such portals the reason of other gaps.
pub(super) fn tell_unweighed(portals: &mut [Portal]) {
    let mut beside: BTreeMap<CellId, Vec<usize>> = BTreeMap::new();
    for (i, portal) in portals.iter().enumerate() {
        if opening(portal).is_some() {
            for cell in portal.cells {
                beside.entry(cell).or_default().push(i);
            }
        }
    }
    let is_unweighed = |portal: &Portal| {
        opening(portal).is_some_and(|(why, weighed)| {
            let all = beside[&portal.cells[0]].iter().map(|&i| &portals[i]);
            let all = all.filter(|p| p.why.contains(why));
            let all: f64 = all.map(|p| f64::from(p.area)).sum();
            weighed > MOST * all || f64::from(portal.area) > MOST * weighed
        })
    };
    let unweighed: Vec<usize> = (0..portals.len())
        .filter(|&i| is_unweighed(&portals[i]))
        .collect();
    for i in unweighed {
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
        // An opening whole, one in two parts, one of which hardly anything is left, and one that is a small part of a gap.
        let mut portals = [
            portal(1, 2.0, 1.9),
            portal(1, 4.0, 1.0),
            portal(2, 4.0, 0.9),
            portal(1, 3.4, 0.004),
            portal(1, 0.05, 2.1),
        ];
        tell_unweighed(&mut portals);
        let reasons = portals.each_ref().map(|p| p.why[0].reason);
        assert_eq!(
            reasons,
            [
                Reason::Kept,
                Reason::Kept,
                Reason::Kept,
                Reason::Gap,
                Reason::Gap
            ]
        );
    }
}
