//! People on errands: each walks from place to place by the shortest path, whether anybody looks or not.

use std::collections::HashMap;

use enfilade::cpg::PortalId;
use enfilade::geom::DVec3;
use enfilade::world::{
    ActorEvent, ActorId, Actors, Chance, Errands, PartId, Path, PathSearch, PlanDraft, Space,
    WalkMap,
};

use super::file::PeopleEntry;
use crate::walk::{Walks, WorldFile, kept_or_made};

/// Most ways that are remembered.
const MOST_KNOWN: usize = 1000;

/// The people of a world.
pub(super) struct People {
    pub(super) actors: Actors,
    errands: Errands,
    places: Vec<DVec3>,
    map: Option<WalkMap>,
    search: PathSearch,
    path: Path,
}

impl People {
    /// Makes people at their places in turn. Makes a map of the floors if there are any, which takes seconds in large buildings,
    /// unless one is kept beside the world.
    pub(super) fn new(space: &Space, entry: &PeopleEntry, file: Option<WorldFile<'_>>) -> Self {
        let layout = space.layout(PartId::ROOT);
        let mut errands = Errands::default();
        errands.stay = entry.stay;
        let mut people = Self {
            actors: Actors::new(layout.n_cells(), entry.seed),
            errands,
            places: entry.places.iter().map(|p| DVec3::from_array(*p)).collect(),
            map: None,
            search: PathSearch::new(),
            path: Path::default(),
        };
        if entry.count > 0 {
            people.map = Some(kept_or_made(file, space, &Walks::usual()));
        }
        people
    }

    /// Adds those who are missing, each at a place in turn.
    pub(super) fn fill(&mut self, space: &Space, n: u32, is_way: impl Fn(PortalId) -> bool) {
        let layout = space.layout(PartId::ROOT);
        let up = DVec3::Y * 0.5;
        let start = |i: u32| {
            let at = self.places[i as usize % self.places.len()];
            Some((at, layout.locate(at + up)?))
        };
        let starts: Vec<_> = (self.actors.len() as u32..n).filter_map(start).collect();
        let mut actors = std::mem::replace(&mut self.actors, Actors::new(0, 0));
        let mut plan = self.planner(space, &is_way);
        for (at, cell) in starts {
            actors.add(at, cell, &mut plan);
        }
        drop(plan);
        self.actors = actors;
    }

    /// Plays until a time. Doors open for people, so all but those that `is_way` excludes are ways. [Units: s]
    pub(super) fn advance(&mut self, space: &Space, now: f64, is_way: impl Fn(PortalId) -> bool) {
        let mut actors = std::mem::replace(&mut self.actors, Actors::new(0, 0));
        actors.advance(now, self.planner(space, &is_way));
        self.actors = actors;
    }

    /// Returns a planner of errands. Many people go from place to place, so it remembers ways while it lasts.
    fn planner<'a, F: Fn(PortalId) -> bool>(
        &'a mut self,
        space: &'a Space,
        is_way: &'a F,
    ) -> impl FnMut(&ActorEvent, &mut Chance, &mut PlanDraft<'_>) + use<'a, F> {
        let Self {
            errands,
            places,
            map,
            search,
            path,
            ..
        } = self;
        let layout = space.layout(PartId::ROOT);
        // They do not use lifts.
        let may_pass = |part, portal| part == PartId::ROOT && is_way(portal);
        let mut known: HashMap<([u64; 3], u32), Option<Path>> = HashMap::new();
        move |event, chance, plan| {
            let n = places.len() as u32;
            errands.plan(chance, plan, n, |place, way| {
                let Some(map) = map else { return };
                if known.len() >= MOST_KNOWN {
                    known.clear();
                }
                let from = event.at.to_array().map(f64::to_bits);
                let found = known.entry((from, place)).or_insert_with(|| {
                    let ends = [event.at, places[place as usize]].map(|p| (PartId::ROOT, p));
                    let found = search.find(map, space, ends, may_pass, path);
                    found.is_ok().then(|| path.clone())
                });
                if let Some(path) = found {
                    path.add_way_points(layout, event.cell, way);
                }
            });
        }
    }

    /// Returns the feet of a person and the direction that it faces.
    pub(super) fn pose(&self, id: ActorId) -> Option<(DVec3, DVec3)> {
        let place = self.actors.place(id)?;
        // At rest, each faces another way.
        let angle = f64::from(id.0) * 2.4;
        let rest = DVec3::new(angle.cos(), 0.0, angle.sin());
        let ahead = place.velocity.with_y(0.0).try_normalize().unwrap_or(rest);
        Some((place.at, ahead))
    }
}
