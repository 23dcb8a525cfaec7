//! The exported functions: all the unsafe code of this crate. The page calls them one at a time.
//!
//! A caller allocates with `enf_bake_alloc`, fills the memory, and hands it over to `enf_bake_file` or `enf_bake_run`. The
//! answers of `enf_bake_answer` stay until the next run.
#![expect(unsafe_code, reason = "the boundary to JavaScript")]
#![expect(clippy::missing_safety_doc, reason = "the duties are said above")]

use std::cell::RefCell;
use std::sync::Once;
use std::time::Duration;

use enfilade_import::{ConvertedIfc, HeldFiles};

use crate::{BakeRequest, Failure, Steps, baked};

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Returns the time since any moment. [Units: ms]
    safe fn now() -> f64;
    /// Hears of a step: its name, its number, the number of all.
    fn step(name: *const u8, n: usize, at: usize, of: usize);
    /// Hears of a panic, after which the module is of no more use.
    fn panicked(text: *const u8, n: usize);
}

/// Version of these functions. Increases with every change that breaks a caller.
const VERSION: u32 = 1;
/// Size of a page of memory.
const PAGE: u64 = 1 << 16;

#[derive(Default)]
struct Module {
    files: HeldFiles,
    /// World, plan, facts or failure.
    answers: [Vec<u8>; 3],
}

thread_local! {
    static MODULE: RefCell<Module> = RefCell::default();
}

fn held() -> Option<u64> {
    Some(core::arch::wasm32::memory_size(0) as u64 * PAGE)
}

fn clock() -> Duration {
    Duration::from_secs_f64((now() / 1e3).max(0.0))
}

fn begin() {
    static BEGUN: Once = Once::new();
    BEGUN.call_once(|| {
        enfilade_geom::set_clock(clock);
        std::panic::set_hook(Box::new(|info| {
            let text = info.to_string();
            // SAFETY: the text lives as long as the call.
            unsafe { panicked(text.as_ptr(), text.len()) };
        }));
    });
}

fn tell(name: &str, at: usize, of: usize) {
    // SAFETY: the name lives as long as the call.
    unsafe { step(name.as_ptr(), name.len(), at, of) };
}

/// Takes what a caller allocated and filled.
unsafe fn taken(bytes: *mut u8, n: usize) -> Vec<u8> {
    if bytes.is_null() {
        return Vec::new();
    }
    // SAFETY: made by `enf_bake_alloc(n)` with this length and capacity, all of it set, and handed over once.
    unsafe { Vec::from_raw_parts(bytes, n, n) }
}

/// Returns the version of these functions.
// SAFETY of this and all further `no_mangle`: the prefix `enf_bake_` is ours, so no other symbol has the name.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_version() -> u32 {
    VERSION
}

/// Allocates `n` bytes for input. Null if there is not enough memory, or `n` is 0.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_alloc(n: usize) -> *mut u8 {
    let mut bytes = Vec::new();
    if n == 0 || bytes.try_reserve_exact(n).is_err() {
        return std::ptr::null_mut();
    }
    bytes.resize(n, 0_u8);
    Box::into_raw(bytes.into_boxed_slice()).cast()
}

/// Adds a file for the next bake, by its name, an UTF-8 text; all of it is detail if `is_detail` is not 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_bake_file(
    name: *mut u8,
    n_name: usize,
    bytes: *mut u8,
    n: usize,
    is_detail: u32,
) {
    begin();
    // SAFETY: both are handed over by the caller.
    let [name, bytes] = unsafe { [taken(name, n_name), taken(bytes, n)] };
    let name = String::from_utf8_lossy(&name).into_owned();
    MODULE.with_borrow_mut(|module| module.files.add(name, bytes, is_detail != 0));
}

/// Adds what a reader made of an IFC file that was added by this name: a GLB, and notes for the user, a line each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_bake_ifc(
    name: *mut u8,
    n_name: usize,
    glb: *mut u8,
    n: usize,
    notes: *mut u8,
    n_notes: usize,
) {
    begin();
    // SAFETY: all are handed over by the caller.
    let [name, glb, notes] = unsafe { [taken(name, n_name), taken(glb, n), taken(notes, n_notes)] };
    let [name, notes] = [name, notes].map(|text| String::from_utf8_lossy(&text).into_owned());
    let notes = notes.lines().map(str::to_owned).collect();
    MODULE.with_borrow_mut(|module| {
        module
            .files
            .add_converted(name, ConvertedIfc { glb, notes });
    });
}

/// Bakes the files as a request in JSON says, and forgets them. Returns 1, or 0 if there is no world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_bake_run(request: *mut u8, n: usize) -> u32 {
    begin();
    // SAFETY: handed over by the caller.
    let request = unsafe { taken(request, n) };
    let files = MODULE.with_borrow_mut(|module| {
        module.answers = Default::default();
        std::mem::take(&mut module.files)
    });
    let run = || {
        let text = String::from_utf8_lossy(&request);
        let request = BakeRequest {
            probe: Some(held),
            ..BakeRequest::of_json(&text)?
        };
        baked(&files, &request, &Steps::new(&tell))
    };
    let (answers, status) = match run() {
        Ok(answer) => {
            let [plan, facts] = [answer.plan, answer.facts].map(String::into_bytes);
            ([answer.world, plan, facts], 1)
        }
        Err(failure) => ([Vec::new(), Vec::new(), of_failure(&failure)], 0),
    };
    MODULE.with_borrow_mut(|module| module.answers = answers);
    status
}

fn of_failure(failure: &Failure) -> Vec<u8> {
    serde_json::to_vec(failure).unwrap_or_default()
}

/// Returns where an answer lies: 0 the world, 1 the plan, 2 the facts or the failure.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_answer(which: usize) -> *const u8 {
    MODULE.with_borrow(|module| module.answers[which.min(2)].as_ptr())
}

/// Returns the length of an answer.
#[unsafe(no_mangle)]
pub extern "C" fn enf_bake_answer_size(which: usize) -> usize {
    MODULE.with_borrow(|module| module.answers[which.min(2)].len())
}
