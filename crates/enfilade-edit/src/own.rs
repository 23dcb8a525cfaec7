//! Worlds of single instances with the changes by hand in them: what a change by hand takes to show, whatever the size of the level.

use std::collections::BTreeMap;
use std::sync::Arc;

use enfilade_cpg::World;
use enfilade_kit::{Assembly, InstanceId, Link};

use crate::hand::{HandEdit, HandEditError, HandEditKind};

/// The worlds of instances that changes by hand made different from their pieces.
#[derive(Debug, Default)]
pub struct OwnWorlds {
    by_host: BTreeMap<Option<InstanceId>, OwnWorld>,
}

#[derive(Clone, Debug)]
struct OwnWorld {
    /// The changes that were made, or could not be, in order.
    kinds: Vec<HandEditKind>,
    /// Those that could not be, by their place in the list.
    resting: Vec<(usize, HandEditError)>,
    world: Arc<World>,
}

/// The world of a host without changes by hand, and where another cell follows beyond its outdoors.
pub(crate) struct OwnBase {
    world: Arc<World>,
    /// Points in doorways that are joined to other instances.
    joined: Vec<[f32; 3]>,
}

/// Returns the changes by hand with a host.
pub(crate) fn kinds_of(edits: &[HandEdit], host: Option<InstanceId>) -> Vec<HandEditKind> {
    let own = edits.iter().filter(|edit| edit.host == host);
    own.map(|edit| edit.kind.clone()).collect()
}

/// Returns the world of a host as it was before any change by hand, if the host stands: `around` is that in which no instance is.
pub(crate) fn own_base(
    around: &Arc<World>,
    level: &Assembly,
    host: Option<InstanceId>,
) -> Option<OwnBase> {
    let Some(id) = host else {
        return Some(OwnBase {
            world: Arc::clone(around),
            joined: Vec::new(),
        });
    };
    let instance = level.standing(id).ok()?;
    let piece = level.piece(id);
    let links = piece.attachments().iter().zip(&instance.links);
    let joined = links.filter(|(_, link)| matches!(link, Link::Joined(_)));
    let graph = &piece.world().graph;
    Some(OwnBase {
        joined: joined.map(|(a, _)| graph[a.portal].center()).collect(),
        world: Arc::clone(piece.world()),
    })
}

impl OwnWorlds {
    /// Returns the world of an instance with changes by hand; of `None`, what is in no instance.
    #[must_use]
    pub fn get(&self, host: Option<InstanceId>) -> Option<&Arc<World>> {
        Some(&self.by_host.get(&host)?.world)
    }

    /// Returns the world of a host with exactly these changes by hand, and those that rest, if it is known.
    pub(crate) fn known(
        &self,
        host: Option<InstanceId>,
        edits: &[HandEdit],
    ) -> Option<(World, Vec<(usize, HandEditError)>)> {
        let known = self.by_host.get(&host)?;
        let is_same = edits.iter().map(|edit| &edit.kind).eq(&known.kinds);
        is_same.then(|| (World::clone(&known.world), known.resting.clone()))
    }

    /// Returns the reason for which a change of a host, counted among its own, is not in its world.
    pub(crate) fn resting(&self, host: Option<InstanceId>, at: usize) -> Option<HandEditError> {
        let mut resting = self.by_host.get(&host)?.resting.iter();
        let found = resting.find(|(number, _)| *number == at);
        found.map(|(_, why)| why.clone())
    }

    /// Makes a change by hand after those before.
    pub(crate) fn make(
        &mut self,
        host: Option<InstanceId>,
        base: &OwnBase,
        before: &[HandEditKind],
        kind: &HandEditKind,
    ) -> Result<(), HandEditError> {
        let mut own = self.made(host, base, before);
        base.add(&mut own, kind)?;
        self.by_host.insert(host, own);
        Ok(())
    }

    /// Makes and drops worlds as changes by hand are now.
    pub(crate) fn follow(
        &mut self,
        edits: &[HandEdit],
        base: impl Fn(Option<InstanceId>) -> Option<OwnBase>,
    ) {
        let mut kinds: BTreeMap<Option<InstanceId>, Vec<HandEditKind>> = BTreeMap::new();
        for edit in edits {
            let own = kinds.entry(edit.host).or_default();
            own.push(edit.kind.clone());
        }
        self.by_host.retain(|host, _| kinds.contains_key(host));
        for (host, kinds) in kinds {
            let known = self.by_host.get(&host);
            if known.is_some_and(|known| known.kinds == kinds) {
                continue;
            }
            // One that does not stand is not shown.
            if let Some(base) = base(host) {
                let own = self.made(host, &base, &kinds);
                self.by_host.insert(host, own);
            }
        }
    }

    /// Returns the world of a host with some changes, from what is known of it.
    fn made(&self, host: Option<InstanceId>, base: &OwnBase, kinds: &[HandEditKind]) -> OwnWorld {
        let known = self.by_host.get(&host);
        let begun = known.filter(|known| kinds.starts_with(&known.kinds));
        let mut own = begun.cloned().unwrap_or_else(|| OwnWorld {
            kinds: Vec::new(),
            resting: Vec::new(),
            world: Arc::clone(&base.world),
        });
        for kind in &kinds[own.kinds.len()..] {
            if let Err(why) = base.add(&mut own, kind) {
                own.resting.push((own.kinds.len() - 1, why));
            }
        }
        own
    }
}

impl OwnBase {
    /// Makes a change in the world of a host.
    fn add(&self, own: &mut OwnWorld, kind: &HandEditKind) -> Result<(), HandEditError> {
        let mut world = World::clone(&own.world);
        let made = kind.make(&mut world);
        own.kinds.push(kind.clone());
        match made {
            Ok(()) => {
                own.world = Arc::new(world);
                Ok(())
            }
            // The other cell is that of another instance, not the outdoors.
            Err(HandEditError::Outdoors { portal, .. })
                if self.joined.contains(&own.world.graph[portal].center()) =>
            {
                Ok(())
            }
            Err(why) => Err(why),
        }
    }
}
