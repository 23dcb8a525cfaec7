//! Claims about why cells, portals and places are there.

use enfilade_cpg::{DecidedPlace, Fact, Reason, Why, World};

use super::{Tampering, pick, room};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new(
        "a portal's decision that its numbers contradict",
        |w, at| contradict(of_portal(w, at, |why| why.comparison().is_some())?),
    ),
    Tampering::new("a cell's decision that its numbers contradict", |w, at| {
        contradict(of_cell(w, at, |why| why.comparison().is_some())?)
    }),
    Tampering::new("a decision without what it weighed", |w, at| {
        of_cell(w, at, |why| why.comparison().is_some())?.limit = None;
        Some(())
    }),
    Tampering::new("a cell without a decision", |w, at| {
        w.graph.cells.get_mut(at)?.why.clear();
        Some(())
    }),
    Tampering::new("a portal without a decision", |w, at| {
        let i = pick(w.graph.portals.len(), at, |_| true)?;
        w.graph.portals[i].why.clear();
        Some(())
    }),
    Tampering::new("a portal with the decision of a room", |w, at| {
        of_portal(w, at, |_| true)?.reason = Reason::Unscaled;
        Some(())
    }),
    Tampering::new("a room with the decision of a void", |w, at| {
        let i = room(w, at)?;
        let low = Why::compared(Reason::Low, 0.05, &[(Fact::Standing, 0.0)]);
        w.graph.cells[i].why = vec![low];
        Some(())
    }),
    Tampering::new("a room that is called a void", |w, at| {
        let is_room = |i: usize| w.graph.cells[i].is_room();
        let i = pick(w.graph.cells.len(), at, is_room)?;
        w.graph.cells[i].is_void = true;
        Some(())
    }),
    Tampering::new("a void that is called a room", |w, at| {
        let i = pick(w.graph.cells.len(), at, |i| w.graph.cells[i].is_void)?;
        w.graph.cells[i].is_void = false;
        Some(())
    }),
    Tampering::new("a room that is called land", |w, at| {
        called_land(w, at).map(|_| ())
    }),
    Tampering::new("a room that is called land, and decided so", |w, at| {
        let i = called_land(w, at)?;
        w.graph.cells[i].why = vec![Why::given(Reason::Land)];
        Some(())
    }),
    Tampering::new("an outdoors with the decision of land", |w, _| {
        let mut cells = w.graph.cells.iter_mut();
        let outdoors = cells.find(|c| c.outdoor)?;
        outdoors.why = vec![Why::given(Reason::Land)];
        Some(())
    }),
    Tampering::new("land with the decision of the outdoors", |w, at| {
        let i = pick(w.graph.cells.len(), at, |i| w.graph.cells[i].is_land)?;
        w.graph.cells[i].why = vec![Why::given(Reason::Outside)];
        Some(())
    }),
    Tampering::new("the area of a shut opening ten times as large", |w, at| {
        let is_shut = |why: &Why| why.reason == Reason::Shut;
        times(of_portal(w, at, is_shut)?, Fact::Area, 10.0)
    }),
    Tampering::new("the area of an opening forty times as small", |w, at| {
        let is_known = |why: &Why| why.facts.contains_key(&Fact::Area);
        times(of_portal(w, at, is_known)?, Fact::Area, 0.025)
    }),
    Tampering::new("a floor twice as large", |w, at| {
        times(of_cell(w, at, is_of_room)?, Fact::Floor, 2.0)
    }),
    Tampering::new("a fifth of the floor to stand on", |w, at| {
        times(of_cell(w, at, is_of_room)?, Fact::Standing, 0.2)
    }),
    Tampering::new("a higher doorway", |w, at| {
        let is_entered = |why: &Why| is_of_room(why) && why.facts[&Fact::Doorway] > 0.0;
        times(of_cell(w, at, is_entered)?, Fact::Doorway, 1.3)
    }),
    Tampering::new("a share of backs that nobody sees", |w, at| {
        let is_facing = |why: &Why| why.reason == Reason::Facing;
        let why = of_cell(w, at, is_facing)?;
        *why.facts.get_mut(&Fact::Backs)? = 0.55;
        Some(())
    }),
    Tampering::new("matter in the middle of a room", |w, at| {
        let i = room(w, at)?;
        let [low, high] = w.graph.cells[i].aabb;
        w.graph.places.push(DecidedPlace {
            at: [0, 1, 2].map(|k| 0.5 * (low[k] + high[k])),
            why: Why::compared(Reason::Solid, 1.0, &[(Fact::Inside, 1.1)]),
        });
        Some(())
    }),
];

fn called_land(w: &mut World, at: usize) -> Option<usize> {
    let i = pick(w.graph.cells.len(), at, |i| w.graph.cells[i].is_room())?;
    w.graph.cells[i].is_land = true;
    Some(i)
}

/// Returns `true` for the decision that people can stand in a room.
fn is_of_room(why: &Why) -> bool {
    why.reason == Reason::Standing
}

/// Returns a decision about a cell that `is_fit`.
fn of_cell(w: &mut World, at: usize, is_fit: fn(&Why) -> bool) -> Option<&mut Why> {
    let cells = &w.graph.cells;
    let i = pick(cells.len(), at, |i| cells[i].why.iter().any(is_fit))?;
    w.graph.cells[i].why.iter_mut().find(|why| is_fit(why))
}

/// Returns a decision about a portal that `is_fit`.
fn of_portal(w: &mut World, at: usize, is_fit: fn(&Why) -> bool) -> Option<&mut Why> {
    let portals = &w.graph.portals;
    let i = pick(portals.len(), at, |i| portals[i].why.iter().any(is_fit))?;
    w.graph.portals[i].why.iter_mut().find(|why| is_fit(why))
}

/// Moves the deciding fact to the other side of its limit.
fn contradict(why: &mut Why) -> Option<()> {
    let (fact, value, limit) = why.comparison()?;
    let other = if value < limit {
        2.0 * limit
    } else {
        0.5 * limit
    };
    why.facts.insert(fact, other);
    Some(())
}

/// Multiplies a fact.
fn times(why: &mut Why, fact: Fact, by: f32) -> Option<()> {
    *why.facts.get_mut(&fact)? *= by;
    Some(())
}
