//! The text of the last failure of each thread, ended by a zero byte.

use std::cell::RefCell;
use std::ffi::{CString, c_char};

use crate::status::Failure;

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Keeps the reason of a failure and returns its status.
pub(crate) fn keep(failure: &Failure) -> i32 {
    // A text cannot hold the zero byte that ends it.
    let text = CString::new(failure.why.replace('\0', " ")).unwrap_or_default();
    LAST.with(|last| last.replace(text));
    failure.status
}

/// Returns the text of the last failure; valid until the next failure of this thread.
pub(crate) fn text() -> *const c_char {
    LAST.with(|last| last.borrow().as_ptr())
}
