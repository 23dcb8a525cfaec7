//! Progress on standard error, when that is a terminal.

use std::io::{IsTerminal, stderr};

use indicatif::{ProgressBar, ProgressStyle};

/// A line on the terminal that shows the stage under way, how far it is and the time left.
///
/// Shows nothing when standard error is no terminal. The line disappears when dropped.
pub(crate) struct StageBar {
    bar: ProgressBar,
}

impl StageBar {
    /// A bar without a stage.
    pub(crate) fn new() -> Self {
        let bar = if stderr().is_terminal() {
            ProgressBar::new(0)
        } else {
            ProgressBar::hidden()
        };
        Self { bar }
    }

    /// Begins a stage of `total` steps; 0 where nobody knows how many.
    pub(crate) fn start(&self, stage: &str, total: u64) {
        let template = if total > 0 {
            "{msg:>24} {wide_bar} {percent:>3} %  {eta} left"
        } else {
            "{msg:>24} {spinner}  {elapsed}"
        };
        // Templates are constants; a style that does not parse would be seen at once.
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style);
        }
        self.bar.reset();
        self.bar.set_length(total);
        self.bar.set_message(stage.to_owned());
    }

    /// Says how many steps of the stage are done.
    pub(crate) fn set(&self, done: u64) {
        self.bar.set_position(done);
    }

    /// Takes the line away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Drop for StageBar {
    fn drop(&mut self) {
        self.finish();
    }
}
