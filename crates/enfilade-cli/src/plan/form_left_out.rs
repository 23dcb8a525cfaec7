//! The form of a plan's file in a build that does not print: SVG.

use anyhow::bail;
use enfilade_report::Plans;

use super::Plan;

/// SVG.
pub(super) struct Form;

impl Plan {
    /// Refuses names of other forms.
    pub(super) fn form(&self) -> anyhow::Result<Form> {
        let extension = self.output.extension().unwrap_or_default();
        let extension = extension.to_string_lossy().to_ascii_lowercase();
        if matches!(extension.as_str(), "png" | "pdf") {
            bail!(
                "{}: this build draws plans as SVG only; give -o a name that ends in .svg, or build it with the feature `print`",
                self.output.display()
            );
        }
        Ok(Form)
    }
}

impl Form {
    /// The bytes of one file.
    #[allow(clippy::unnecessary_wraps, reason = "the other forms can fail")]
    pub(super) fn drawn(&self, plans: &Plans, which: &[usize]) -> anyhow::Result<Vec<u8>> {
        Ok(plans.sheet(which).to_svg().into_bytes())
    }
}
