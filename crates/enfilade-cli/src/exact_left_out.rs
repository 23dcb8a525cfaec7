//! `verify --views` in a build that draws no pictures: there is no such option.

use std::fmt;

use enfilade::cpg::World;
use serde::Serialize;

use crate::output::Outputs;

/// No options.
#[derive(clap::Args)]
pub(crate) struct ViewComparison {}

/// No results.
#[derive(Serialize)]
pub(crate) enum Exactness {}

impl ViewComparison {
    pub(crate) fn make_folder(&self) -> anyhow::Result<()> {
        Ok(())
    }

    pub(crate) fn compare(
        &self,
        _: &World,
        _: u64,
        _: usize,
        _: &mut Outputs,
    ) -> anyhow::Result<Option<Exactness>> {
        Ok(None)
    }
}

impl Exactness {
    pub(crate) fn differing(&self) -> u64 {
        match *self {}
    }
}

impl fmt::Display for Exactness {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {}
    }
}
