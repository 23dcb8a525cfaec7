//! The enfilade command.
fn main() {}
