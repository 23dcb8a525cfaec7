//! Values that several rows share, each made once.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Values by name.
pub(crate) struct Kept<T>(Mutex<BTreeMap<String, Arc<T>>>);

impl<T> Kept<T> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// Returns the value of a name, made if it is asked for the first time.
    pub(crate) fn get(
        &self,
        name: &str,
        make: impl FnOnce() -> anyhow::Result<T>,
    ) -> anyhow::Result<Arc<T>> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = all.get(name) {
            return Ok(Arc::clone(known));
        }
        let made = Arc::new(make()?);
        all.insert(name.to_owned(), Arc::clone(&made));
        Ok(made)
    }
}
