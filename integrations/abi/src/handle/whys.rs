//! Why cells, portals and places are there.

use std::fmt::Write;

use enfilade_cpg::Why;

use super::{EnfWorld, item};
use crate::answers::{EnfFact, EnfWhy};
use crate::status as s;
use crate::status::Failure;

impl EnfWorld {
    /// Tells decision number `decision` about a cell, a portal or a place; `None` after the last.
    ///
    /// # Errors
    ///
    /// If it does not exist, or `of` is none of the three kinds.
    pub fn why(&mut self, of: u32, index: u32, decision: u32) -> Result<Option<EnfWhy>, Failure> {
        let graph = &self.world.graph;
        let (whys, position): (&[Why], _) = match of {
            s::ENF_CELLS => {
                let cell = item(&graph.cells, index, "cell")?;
                let [low, high] = cell.aabb;
                (&cell.why, [0, 1, 2].map(|k| 0.5 * (low[k] + high[k])))
            }
            s::ENF_PORTALS => {
                let portal = item(&graph.portals, index, "portal")?;
                (&portal.why, portal.center())
            }
            s::ENF_PLACES => {
                let place = item(&graph.places, index, "place")?;
                (std::slice::from_ref(&place.why), place.at)
            }
            _ => {
                let text = format!("nothing is decided about things of the number {of}");
                return Err(Failure::argument(text));
            }
        };
        let Some(why) = whys.get(decision as usize) else {
            return Ok(None);
        };
        self.facts.clear();
        self.facts.extend(why.facts.iter().map(|(fact, &value)| {
            let name = fact.name();
            EnfFact {
                name: name.as_ptr().cast(),
                name_length: name.len() as u32,
                value,
            }
        }));
        self.text.clear();
        // Writing to a text cannot fail.
        let _ = write!(self.text, "{why}");
        let compared = why.comparison();
        let at = compared.and_then(|(fact, _, _)| why.facts.keys().position(|f| *f == fact));
        let reason = why.reason.name();
        Ok(Some(EnfWhy {
            text: self.text.as_ptr().cast(),
            reason: reason.as_ptr().cast(),
            facts: self.facts.as_ptr(),
            text_length: self.text.len() as u32,
            reason_length: reason.len() as u32,
            n_facts: self.facts.len() as u32,
            compared: at.map_or(s::ENF_NO_ID, |i| i as u32),
            limit: compared.map_or(0.0, |(_, _, limit)| limit),
            margin: why.margin(),
            position,
        }))
    }
}
