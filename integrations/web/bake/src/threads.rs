//! A pool of threads in a page: workers with instances of their own on one shared memory.
//!
//! A page cannot start a thread from here. It makes a worker for each, whose instance calls [`enf_bake_thread`] and waits there until
//! [`enf_bake_threads`] of the first instance makes the pool. Each worker has a stack and a block of thread-local storage in the
//! shared memory, which the first instance allocates.
#![expect(unsafe_code, reason = "the boundary to JavaScript")]

use std::sync::{Condvar, Mutex, PoisonError};

use rayon::{ThreadBuilder, ThreadPoolBuilder};

/// Threads of the pool that no worker has taken.
static UNTAKEN: Mutex<Vec<ThreadBuilder>> = Mutex::new(Vec::new());
static MADE: Condvar = Condvar::new();

/// Makes the pool of `n` threads, and waits until that many workers have taken them. Returns 1, or 0 if there is a pool.
// SAFETY of both `no_mangle`: the prefix `enf_bake_` is ours, so no other symbol has the name.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_threads(n: usize) -> u32 {
    let pool = ThreadPoolBuilder::new().num_threads(n);
    let pool = pool.spawn_handler(|thread| {
        let mut untaken = UNTAKEN.lock().unwrap_or_else(PoisonError::into_inner);
        untaken.push(thread);
        MADE.notify_one();
        Ok(())
    });
    u32::from(pool.build_global().is_ok())
}

/// Works as a thread of the pool until the page ends it.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_thread() {
    let thread = {
        let mut untaken = UNTAKEN.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            match untaken.pop() {
                Some(thread) => break thread,
                None => {
                    untaken = MADE.wait(untaken).unwrap_or_else(PoisonError::into_inner);
                }
            }
        }
    };
    thread.run();
}
