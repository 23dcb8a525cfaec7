//! Progress: the stages of a bake, with reading before and the plan after them.

use std::sync::Mutex;

use enfilade_bake::{BakeConfig, Method, Progress, Stage};

/// Hears of each step: its name, its number from 0, the number of all.
pub type Told<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);

/// Hands on the steps of a bake.
pub struct Steps<'a> {
    told: Told<'a>,
    stages: Mutex<&'static [Stage]>,
}

impl<'a> Steps<'a> {
    /// Makes steps that are told to `told`.
    #[must_use]
    pub fn new(told: Told<'a>) -> Self {
        Self {
            told,
            stages: Mutex::new(Method::Watershed.stages()),
        }
    }

    pub(crate) fn plan_for(&self, config: &BakeConfig) {
        self.set(config.method.unwrap_or(Method::Watershed));
    }

    fn set(&self, method: Method) {
        if let Ok(mut stages) = self.stages.lock() {
            *stages = method.stages();
        }
    }

    fn all(&self) -> &'static [Stage] {
        self.stages.lock().map_or(&[], |stages| *stages)
    }

    pub(crate) fn begin_reading(&self) {
        (self.told)("reading", 0, self.all().len() + 2);
    }

    pub(crate) fn begin_plan(&self) {
        let n = self.all().len();
        (self.told)("plan", n + 1, n + 2);
    }
}

impl Progress for Steps<'_> {
    fn method(&self, method: Method, _reason: &str) {
        self.set(method);
    }

    fn stage(&self, stage: Stage) {
        let stages = self.all();
        let at = stages.iter().position(|s| *s == stage).unwrap_or(0);
        (self.told)(stage.name(), at + 1, stages.len() + 2);
    }
}
