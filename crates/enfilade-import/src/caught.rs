//! Readers of dependencies, whose panics on damaged files become errors.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Returns `true` while this thread is in a reader of a dependency, of which a panic becomes an error that names the file.
///
/// A program's panic hook, which runs before a panic is caught, can be silent then.
#[must_use]
pub fn is_panic_caught() -> bool {
    IS_CAUGHT.get()
}

/// Calls a reader of a dependency; `None` if it panics.
pub(crate) fn caught<T>(read: impl FnOnce() -> T) -> Option<T> {
    let was = IS_CAUGHT.replace(true);
    let read = catch_unwind(AssertUnwindSafe(read)).ok();
    IS_CAUGHT.set(was);
    read
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_caught_within_a_reader_and_nowhere_else() {
        assert!(!is_panic_caught());
        assert_eq!(caught(is_panic_caught), Some(true));
        assert_eq!(caught(|| -> u8 { panic!("damaged") }), None);
        assert!(!is_panic_caught());
    }
}
