//! Counts with example places.

use enfilade_geom::DVec3;

/// Most example positions kept per finding.
pub(crate) const MAX_EXAMPLES: usize = 5;

/// A count with a few example places.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Finding {
    /// Number of occurrences.
    pub n: u64,
    /// The first few, at most five.
    pub examples: Vec<Example>,
}

/// One place in the scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Example {
    /// The object or element.
    pub name: String,
    /// Position; in world space unless the finding says otherwise. [Units: wu]
    pub position: DVec3,
}

impl Finding {
    /// Counts an occurrence; `name` is called only for an example.
    #[doc(hidden)]
    pub fn add(&mut self, position: DVec3, name: impl FnOnce() -> String) {
        self.n += 1;
        if self.examples.len() < MAX_EXAMPLES {
            self.examples.push(Example {
                name: name(),
                position,
            });
        }
    }
}
