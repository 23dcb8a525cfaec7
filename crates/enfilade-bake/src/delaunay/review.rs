//! The review of a decimation by a person: steps forwards and back, decisions about portals, undo and redo.
//!
//! Gjørup 1999, §4.2.3. It has no window and no text, so that all that show it agree.

use enfilade_geom::DVec3;

use super::decimate::{Choice, RemainingPortal, Step};
use super::session::Session;
use crate::BakeConfig;
use crate::config::Choices;

/// A decision about a portal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// The choice.
    pub choice: Choice,
    /// Place of the portal. [Units: wu]
    pub position: DVec3,
}

/// A decision, and the state on its other side: before it while it is made, after it while it is undone.
struct Made {
    decision: Decision,
    choices: Choices,
    at: usize,
}

/// A decimation under review: the step at which the person is, and the decisions made so far.
pub struct Review {
    session: Session,
    config: BakeConfig,
    at: usize,
    made: Vec<Made>,
    undone: Vec<Made>,
}

impl Review {
    /// Begins where the decimation stops by itself. `config` is that with which the session began; its choices are
    /// extended, and not undone.
    #[must_use]
    pub fn new(session: Session, config: BakeConfig) -> Self {
        Self {
            at: session.decimation.stop,
            session,
            config,
            made: Vec::new(),
            undone: Vec::new(),
        }
    }

    /// Returns the state of decimation.
    #[must_use]
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Returns the settings, with all decisions.
    #[must_use]
    pub fn config(&self) -> &BakeConfig {
        &self.config
    }

    /// Returns all decisions.
    #[must_use]
    pub fn choices(&self) -> &Choices {
        &self.config.delaunay.choices
    }

    /// Returns the number of steps taken.
    #[must_use]
    pub fn at(&self) -> usize {
        self.at
    }

    /// Returns the number of steps after which the decimation stops by itself.
    #[must_use]
    pub fn stop(&self) -> usize {
        self.session.decimation.stop
    }

    /// Returns all steps, those taken first.
    #[must_use]
    pub fn steps(&self) -> &[Step] {
        &self.session.decimation.steps
    }

    /// Returns the next step, unless no portal is left.
    #[must_use]
    pub fn next_step(&self) -> Option<&Step> {
        self.steps().get(self.at)
    }

    /// Goes to where `n_steps` are taken, or to the end.
    pub fn go_to(&mut self, n_steps: usize) {
        self.at = n_steps.min(self.steps().len());
    }

    /// Takes steps forwards, or back if `by` is negative, up to either end.
    pub fn go_by(&mut self, by: isize) {
        self.go_to(self.at.saturating_add_signed(by));
    }

    /// Returns the portals left at this step.
    #[must_use]
    pub fn portals(&self) -> Vec<RemainingPortal> {
        self.session.remaining(self.at, &self.config)
    }

    /// Returns the number of rooms left, which are the indoor cells of a bake, and of other cells: crevices and the
    /// insides of walls.
    #[must_use]
    pub fn count_rooms(&self) -> [usize; 2] {
        self.session.count_rooms(self.at, &self.config)
    }

    /// Decides about a portal left at this step, decimates again, and goes to where that stops. The decision takes the
    /// place of earlier ones on the portal. Returns `None`, and does nothing, if this is decided already.
    pub fn decide(&mut self, portal: &RemainingPortal, choice: Choice) -> Option<Decision> {
        if portal.choice == Some(choice) {
            return None;
        }
        let decision = Decision {
            choice,
            position: portal.position,
        };
        self.made.push(Made {
            decision,
            choices: self.choices().clone(),
            at: self.at,
        });
        self.undone.clear();
        let choices = &mut self.config.delaunay.choices;
        for list in [&mut choices.keep, &mut choices.join] {
            list.retain(|p| !portal.decided_at.contains(p));
        }
        match choice {
            Choice::Keep => choices.keep.push(portal.position),
            Choice::Join => choices.join.push(portal.position),
        }
        self.session.decimate(&self.config);
        self.at = self.stop();
        Some(decision)
    }

    /// Decides about the portal that the next step removes, as [`Review::decide`] does.
    pub fn decide_next(&mut self, choice: Choice) -> Option<Decision> {
        let portals = self.portals();
        let next = portals.iter().find(|portal| portal.is_next)?;
        self.decide(next, choice)
    }

    /// Goes back to before the last decision; returns that, or `None` if there is none of this review.
    pub fn undo(&mut self) -> Option<Decision> {
        let made = self.made.pop()?;
        let undone = self.swapped(made);
        let decision = undone.decision;
        self.undone.push(undone);
        Some(decision)
    }

    /// Makes the decision again that was undone last; returns it, or `None` if there is none.
    pub fn redo(&mut self) -> Option<Decision> {
        let undone = self.undone.pop()?;
        let made = self.swapped(undone);
        let decision = made.decision;
        self.made.push(made);
        Some(decision)
    }

    /// Returns the numbers of decisions to undo and to redo.
    #[must_use]
    pub fn n_decisions(&self) -> [usize; 2] {
        [self.made.len(), self.undone.len()]
    }

    /// Takes up the state on the other side of a decision, and returns the decision with the state that was left.
    fn swapped(&mut self, mut made: Made) -> Made {
        std::mem::swap(&mut self.config.delaunay.choices, &mut made.choices);
        std::mem::swap(&mut self.at, &mut made.at);
        self.session.decimate(&self.config);
        made
    }
}
