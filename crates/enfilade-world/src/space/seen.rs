//! Answers to views.

use std::fmt;

use enfilade_cpg::SpecialId;
use enfilade_geom::{DVec3, Similarity};
use enfilade_runtime::{Seen, View};

use super::context::{Context, SeenVia, StoppedSpecial};
use super::{PartId, Space};

/// The answer to a view, context by context and part by part.
#[derive(Clone, Copy)]
pub struct SpaceSeen<'a> {
    pub(super) contexts: &'a [Context],
    pub(super) stopped: &'a [StoppedSpecial],
    pub(super) is_capped: bool,
}

impl fmt::Debug for SpaceSeen<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SpaceSeen")
            .field("n_contexts", &self.contexts.len())
            .field("is_capped", &self.is_capped)
            .finish_non_exhaustive()
    }
}

/// The view of one eye: the direct one, or that in one special portal.
#[derive(Clone, Copy)]
pub struct SeenContext<'a> {
    context: &'a Context,
}

impl fmt::Debug for SeenContext<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SeenContext")
            .field("via", &self.via())
            .finish_non_exhaustive()
    }
}

impl<'a> SpaceSeen<'a> {
    /// Returns the visible parts, ascending, each with its visible contents in its own frame: draw them at its
    /// [pose](crate::Space::pose). The border cell of a part stands for its outside. Without what is seen in special portals.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = (PartId, Seen<'a>)> + use<'a> {
        let own = &self.contexts[0];
        own.seen.iter().map(|id| (*id, own.answer(*id)))
    }

    /// Returns the visible contents of one part; `None` if nothing of it is seen directly.
    #[must_use]
    pub fn of_part(&self, part: PartId) -> Option<Seen<'a>> {
        self.context(0).of_part(part)
    }

    /// Returns the direct view, and then what is seen in special portals, each after the context that sees it.
    pub fn contexts(&self) -> impl ExactSizeIterator<Item = SeenContext<'a>> + use<'a> {
        self.contexts.iter().map(|context| SeenContext { context })
    }

    /// Returns one context.
    ///
    /// # Panics
    ///
    /// If there is no such context.
    #[must_use]
    pub fn context(&self, index: usize) -> SeenContext<'a> {
        let context = &self.contexts[index];
        SeenContext { context }
    }

    /// Returns the special portals in view that were not looked into: too small, or one too many.
    #[must_use]
    pub fn stopped_specials(&self) -> &'a [StoppedSpecial] {
        self.stopped
    }

    /// Returns `true` if special portals were not looked into because there were
    /// [too many contexts](crate::SpecialOptions::max_contexts).
    #[must_use]
    pub fn is_capped(&self) -> bool {
        self.is_capped
    }
}

impl<'a> SeenContext<'a> {
    /// Returns the special portal that it is seen in; `None` for the direct view.
    #[must_use]
    pub fn via(&self) -> Option<SeenVia> {
        self.context.via
    }

    /// Returns the part in whose frame [its view](SeenContext::view) is.
    #[must_use]
    pub fn frame(&self) -> PartId {
        self.context.frame
    }

    /// Returns the view: that of the query, or of the eye moved by special portals.
    #[must_use]
    pub fn view(&self) -> &'a View {
        self.context.view.as_ref().expect("a context has a view")
    }

    /// Returns the map from the frame of [its part](SeenContext::frame) to the frame of the query: where things appear. The
    /// identity for a monitor, whose picture is apart.
    #[must_use]
    pub fn map(&self) -> &'a Similarity {
        &self.context.map
    }

    /// Returns the plane beyond which things are seen: its normal, away from the eye, and its distance from the eye, in the
    /// frame of [its part](SeenContext::frame). `None` if the eye may be on it, and for direct views. [Units: wu]
    #[must_use]
    pub fn plane(&self) -> Option<(DVec3, f64)> {
        self.context.gate
    }

    /// Returns `true` if no line of sight meets a special portal in the cells that it sees: what is
    /// [in view](Seen::specials) errs to more.
    #[must_use]
    #[doc(hidden)]
    pub fn never_meets(&self, space: &Space, part: PartId, special: SpecialId) -> bool {
        self.context.never_meets(space, part, special)
    }

    /// Returns the rectangle of the screen around it: `[left, bottom, right, top]`, -1 to 1.
    #[must_use]
    pub fn rectangle(&self) -> [f64; 4] {
        self.context.rectangle
    }

    /// Returns the visible parts, ascending, each with its visible contents in its own frame.
    pub fn parts(&self) -> impl ExactSizeIterator<Item = (PartId, Seen<'a>)> + use<'a> {
        let own = self.context;
        own.seen.iter().map(|id| (*id, own.answer(*id)))
    }

    /// Returns the visible contents of one part; `None` if nothing of it is seen.
    #[must_use]
    pub fn of_part(&self, part: PartId) -> Option<Seen<'a>> {
        let is_seen = self.context.seen.binary_search(&part).is_ok();
        is_seen.then(|| self.context.answer(part))
    }
}
