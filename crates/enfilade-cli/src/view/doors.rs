//! Doors opened and closed by hand in the open window.

use enfilade::cpg::PortalId;
use enfilade::world::PartId;

use super::open::Open;

impl Open {
    /// Opens or closes a portal: its leaves begin to move; one without leaves changes at once, and with it those that it meets. It no
    /// longer opens by itself.
    pub(super) fn toggle(&mut self, part: PartId, portal: PortalId) {
        if part == PartId::ROOT {
            self.lived.leave_alone(portal);
        }
        let state = self.lived.space.state(part);
        let before = self.turning.iter().position(|(p, _)| *p == (part, portal));
        let before = before.map(|i| self.turning.swap_remove(i).1);
        let share = before.map(|b| b[0]).or_else(|| state.leaves(portal));
        let Some(share) = share else {
            let is_open = state.is_open(portal);
            let met = self.lived.space.meets(part, portal).to_vec();
            for (part, portal) in met.into_iter().chain([(part, portal)]) {
                self.set_open(part, portal, !is_open);
            }
            let now = if is_open { "closed" } else { "open" };
            self.say(format!("{portal} is {now}"));
            return;
        };
        let is_open = before.map_or(share, |b| b[1]) >= 0.5;
        self.turning
            .push(((part, portal), [share, if is_open { 0.0 } else { 1.0 }]));
        self.say(format!(
            "{portal} {}",
            if is_open { "closes" } else { "opens" }
        ));
    }

    fn set_open(&mut self, part: PartId, portal: PortalId, is_open: bool) {
        let is_root = part == PartId::ROOT;
        match (is_open, is_root) {
            (true, true) => self.studio.state.open(portal),
            (false, true) => self.studio.state.close(portal),
            _ => {}
        }
        if is_open {
            self.lived.space.open(part, portal);
        } else {
            self.lived.space.close(part, portal);
        }
    }

    /// Moves leaves for a time step.
    pub(super) fn turn_leaves(&mut self, seconds: f64) {
        /// Time from shut to open. [Units: s]
        const TIME: f32 = 0.7;
        let by = seconds as f32 / TIME;
        for ((part, portal), [share, to]) in &mut self.turning {
            *share = if *to > *share {
                (*share + by).min(*to)
            } else {
                (*share - by).max(*to)
            };
            if *part == PartId::ROOT {
                self.studio.state.set_leaves(*portal, *share);
            }
            self.lived.space.set_leaves(*part, *portal, *share);
        }
        self.turning.retain(|(_, [share, to])| share != to);
    }
}
