//! Random states of doors, to test promises with.

use enfilade::cpg::PortalId;
use enfilade::runtime::{Sight, SightState};
use enfilade_demo::Rng;

/// Shuts a third of all portals with leaves, opens a third partly, and leaves the others as in the model; closes a
/// tenth of the portals without leaves.
#[must_use]
pub fn random_doors(rng: &mut Rng, sight: &Sight) -> SightState {
    let mut state = SightState::new(sight);
    for p in (0..sight.n_portals() as u32).map(PortalId) {
        let chance = rng.range(0.0, 1.0);
        if sight.leaves(p).is_empty() {
            if chance < 0.1 {
                state.close(p);
            }
        } else if chance < 1.0 / 3.0 {
            state.set_leaves(p, 0.0);
        } else if chance < 2.0 / 3.0 {
            state.set_leaves(p, rng.range(0.0, 1.0) as f32);
        }
    }
    state
}
