//! Steps of a test: named, timed, counted.

use std::time::Instant;

use anyhow::Context;

/// Steps that passed so far.
#[derive(Default)]
pub(crate) struct Steps {
    pub(crate) passed: usize,
}

impl Steps {
    /// Runs a step and prints how long it took; an error contains its name.
    pub(crate) fn step(
        &mut self,
        name: &str,
        work: impl FnOnce() -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        println!("== {name}");
        let start = Instant::now();
        work().with_context(|| format!("step '{name}' failed"))?;
        println!("== {name}: {:.1} s", start.elapsed().as_secs_f64());
        self.passed += 1;
        Ok(())
    }
}
