//! The exported functions: all the unsafe code of this crate, and nothing but the crossing of the boundary.
//!
//! Every function does three things: it turns raw pointers into references, after a test for null; calls a safe function
//! of [`EnfWorld`]; and turns its result into a status and a struct of the caller. The callers' duties are those of the
//! [crate](crate): pointers lead to as many values as said, a handle is used by one thread at a time and not after it was
//! closed. Under them each use below is sound, for the reasons given once at the helpers.
#![expect(unsafe_code, reason = "the boundary to C")]
#![expect(
    clippy::missing_safety_doc,
    reason = "the duties are the same everywhere: see above"
)]

use std::ffi::{CStr, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use enfilade_runtime::View;

use crate::answers::{
    EnfBatch, EnfCell, EnfChunk, EnfDetail, EnfHit, EnfLeaf, EnfList, EnfPortal, EnfRoom, EnfSeen,
    EnfStart, EnfStep, EnfWhy,
};
use crate::handle::EnfWorld;
use crate::last_error;
use crate::status::{ENF_DEFECT, ENF_NONE, Failure};

/// Version of this ABI: functions and structs. Increases with every change that breaks a caller.
const ABI_VERSION: u32 = 1;

const VERSION: &CStr =
    match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(text) => text,
        Err(_) => c"",
    };

/// Runs the safe part of a function. A panic, which would be a defect of ours, ends here and does not unwind into C.
fn guarded(body: impl FnOnce() -> Result<i32, Failure>) -> i32 {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(value)) => value,
        Ok(Err(failure)) => last_error::keep(&failure),
        Err(_) => last_error::keep(&Failure {
            status: ENF_DEFECT,
            why: "a defect of the library; close this world".into(),
        }),
    }
}

fn null(of: &str) -> Failure {
    Failure::argument(format!("the pointer to {of} is null"))
}

/// Borrows a handle.
unsafe fn world<'a>(world: *mut EnfWorld) -> Result<&'a mut EnfWorld, Failure> {
    // SAFETY: not null, so made by `enf_open` as a `Box` and not closed yet; nobody else uses it during the call.
    unsafe { world.as_mut() }.ok_or_else(|| null("the world"))
}

/// Borrows an input array of `n` values.
unsafe fn array<'a, T>(values: *const T, n: usize, of: &str) -> Result<&'a [T], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    if values.is_null() || !values.is_aligned() || n > isize::MAX as usize / size_of::<T>() {
        return Err(null(of));
    }
    // SAFETY: not null and aligned, and the caller says that `n` values are there, which it does not change meanwhile.
    Ok(unsafe { std::slice::from_raw_parts(values, n) })
}

/// Copies an input array of fixed size.
unsafe fn numbers<const N: usize>(values: *const f32, of: &str) -> Result<[f32; N], Failure> {
    // SAFETY: the caller says that `N` values are there.
    let values = unsafe { array(values, N, of) }?;
    values.try_into().map_err(|_| null(of))
}

/// Writes an answer to a struct of the caller.
unsafe fn write<T>(out: *mut T, answer: T) -> Result<(), Failure> {
    if out.is_null() || !out.is_aligned() {
        return Err(null("the answer"));
    }
    // SAFETY: not null and aligned, and the caller says that a struct of this type is there. It may not be initialized,
    // so it is written without being read.
    unsafe { out.write(answer) };
    Ok(())
}

/// Answers about one thing of a world with a struct.
///
/// # Safety
///
/// As everywhere in this file.
unsafe fn describe<T>(
    handle: *mut EnfWorld,
    out: *mut T,
    of: impl FnOnce(&mut EnfWorld) -> Result<T, Failure>,
) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        let world = unsafe { world(handle) }?;
        let answer = of(world)?;
        // SAFETY: `out` is that of the caller.
        unsafe { write(out, answer) }?;
        Ok(1)
    })
}

/// As `describe`, where there may be nothing.
unsafe fn describe_if_any<T>(
    handle: *mut EnfWorld,
    out: *mut T,
    of: impl FnOnce(&mut EnfWorld) -> Result<Option<T>, Failure>,
    nothing: i32,
) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        let world = unsafe { world(handle) }?;
        let Some(answer) = of(world)? else {
            return Ok(nothing);
        };
        // SAFETY: `out` is that of the caller.
        unsafe { write(out, answer) }?;
        Ok(1)
    })
}

/// Returns the version of the ABI.
// SAFETY of this and all further `no_mangle`: the prefix `enf_` is ours, so no other symbol has the name.
#[unsafe(no_mangle)]
pub extern "C" fn enf_abi_version() -> u32 {
    ABI_VERSION
}

/// Returns the version of the library as text, such as `0.1.0`.
#[unsafe(no_mangle)]
pub extern "C" fn enf_version() -> *const c_char {
    VERSION.as_ptr()
}

/// Returns the reason of this thread's last failure as text, empty if there was none; valid until the next failure.
#[unsafe(no_mangle)]
pub extern "C" fn enf_last_error() -> *const c_char {
    last_error::text()
}

/// Allocates `n` bytes for input, for callers that cannot share their own memory, such as browsers. Null if there is not
/// enough memory, or `n` is 0.
#[unsafe(no_mangle)]
pub extern "C" fn enf_alloc(n: usize) -> *mut u8 {
    let mut bytes = Vec::new();
    if n == 0 || bytes.try_reserve_exact(n).is_err() {
        return std::ptr::null_mut();
    }
    bytes.resize(n, 0_u8);
    Box::into_raw(bytes.into_boxed_slice()).cast()
}

/// Frees the `n` bytes of `enf_alloc(n)`. Null is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_free(bytes: *mut u8, n: usize) {
    if !bytes.is_null() {
        let whole = std::ptr::slice_from_raw_parts_mut(bytes, n);
        // SAFETY: made by `enf_alloc(n)` as a boxed slice of this size, and freed once.
        drop(unsafe { Box::from_raw(whole) });
    }
}

/// Opens a world from the bytes of its file, which are not needed afterwards. Null on failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_open(glb: *const u8, n: usize) -> *mut EnfWorld {
    let mut opened = std::ptr::null_mut();
    guarded(|| {
        // SAFETY: the caller says that `n` bytes are there.
        let glb = unsafe { array(glb, n, "the file") }?;
        opened = Box::into_raw(Box::new(EnfWorld::open(glb)?));
        Ok(1)
    });
    opened
}

/// Opens a world whose triangles come later, from sections 2 and 3 of the head of a packed world: a world file and the
/// skeleton of its sight. Answers of `enf_see` are those of the whole world. Null on failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_open_hollow(
    glb: *const u8,
    n: usize,
    skeleton: *const u8,
    n_skeleton: usize,
) -> *mut EnfWorld {
    let mut opened = std::ptr::null_mut();
    guarded(|| {
        // SAFETY: the caller says that `n` bytes are there.
        let glb = unsafe { array(glb, n, "the file") }?;
        // SAFETY: the caller says that `n_skeleton` bytes are there.
        let skeleton = unsafe { array(skeleton, n_skeleton, "the skeleton") }?;
        opened = Box::into_raw(Box::new(EnfWorld::open_hollow(glb, skeleton)?));
        Ok(1)
    });
    opened
}

/// Closes a world. Null is ignored.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_close(world: *mut EnfWorld) {
    if !world.is_null() {
        // SAFETY: made by `enf_open` as a `Box`, and closed once.
        drop(unsafe { Box::from_raw(world) });
    }
}

/// Returns the number of cells, portals, batches, …: `what` is `ENF_CELLS`, `ENF_PORTALS`, ….
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_count(handle: *mut EnfWorld, what: u32) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        let n = unsafe { world(handle) }?.count(what)?;
        Ok(n.min(i32::MAX as usize) as i32)
    })
}

/// Describes a cell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_cell(handle: *mut EnfWorld, cell: u32, out: *mut EnfCell) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.cell(cell)) }
}

/// Tells the facts of a room: floor area, height, storeys, doors, windows. Returns `ENF_NONE`, and writes nothing, for other
/// cells and where the file has none: those that the command bakes have them.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_room(handle: *mut EnfWorld, cell: u32, out: *mut EnfRoom) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe_if_any(handle, out, |w| w.room(cell), ENF_NONE) }
}

/// Describes a portal and its present state.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_portal(
    handle: *mut EnfWorld,
    portal: u32,
    out: *mut EnfPortal,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.portal(portal)) }
}

/// Tells why the bake made a cell, a portal or a place: decision number `decision`, from 0 on. `of` is `ENF_CELLS`,
/// `ENF_PORTALS` or `ENF_PLACES`. Returns `ENF_NONE` after the last decision; older files have none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_why(
    handle: *mut EnfWorld,
    of: u32,
    index: u32,
    decision: u32,
    out: *mut EnfWhy,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe_if_any(handle, out, |w| w.why(of, index, decision), ENF_NONE) }
}

/// Describes leaf number `leaf` of a portal.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_leaf(
    handle: *mut EnfWorld,
    portal: u32,
    leaf: u32,
    out: *mut EnfLeaf,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.leaf(portal, leaf)) }
}

/// Describes a batch and its triangles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_batch(handle: *mut EnfWorld, batch: u32, out: *mut EnfBatch) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.batch(batch)) }
}

/// Describes a placed object.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_detail(
    handle: *mut EnfWorld,
    detail: u32,
    out: *mut EnfDetail,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.detail(detail)) }
}

/// Describes a chunk.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_chunk(handle: *mut EnfWorld, chunk: u32, out: *mut EnfChunk) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.chunk(chunk)) }
}

/// Lists the cells that see a batch, ascending.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_cells_of_batch(
    handle: *mut EnfWorld,
    batch: u32,
    out: *mut EnfList,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.cells_of_batch(batch)) }
}

/// Lists the cells that an object touches, ascending; for a door leaf, all that it sweeps.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_cells_of_detail(
    handle: *mut EnfWorld,
    detail: u32,
    out: *mut EnfList,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.cells_of_detail(detail)) }
}

/// Lists the portals of which an object is a leaf, ascending; for most objects none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_portals_of_detail(
    handle: *mut EnfWorld,
    detail: u32,
    out: *mut EnfList,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe(handle, out, |w| w.portals_of_detail(detail)) }
}

/// Lists the cells that may be visible from a cell, ascending. Returns `ENF_NONE` if the file holds no such sets.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_pvs_row(handle: *mut EnfWorld, cell: u32, out: *mut EnfList) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe_if_any(handle, out, |w| w.pvs_row(cell), ENF_NONE) }
}

/// Returns the cell of a point (three numbers), or `ENF_NONE` in solid matter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_locate(handle: *mut EnfWorld, point: *const f32) -> i32 {
    guarded(|| {
        // SAFETY: the pointers are those of the caller.
        let (world, point) = unsafe { (world(handle)?, numbers(point, "the point")?) };
        Ok(world.locate(point)?.map_or(ENF_NONE, |c| c as i32))
    })
}

/// Finds a place to begin a walk, in a room with many ways out. Returns `ENF_NONE`, and writes nothing, in a world without cells.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_start(handle: *mut EnfWorld, out: *mut EnfStart) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe_if_any(handle, out, EnfWorld::start, ENF_NONE) }
}

/// Follows a step in a straight line from cell to cell.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_step(
    handle: *mut EnfWorld,
    from: *const f32,
    to: *const f32,
    out: *mut EnfStep,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe {
        describe(handle, out, |w| {
            w.step(numbers(from, "the start")?, numbers(to, "the end")?)
        })
    }
}

/// Moves the leaves of a portal to a position from 0 for shut to 1 for fully open. A portal without leaves is closed at 0
/// and open above. Shut leaves of glass are seen through: see `enf_set_closed`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_set_openness(handle: *mut EnfWorld, portal: u32, share: f32) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        unsafe { world(handle) }?.set_openness(portal, share)?;
        Ok(1)
    })
}

/// Closes a portal for sight, whatever its leaves are made of, if `is_closed` is not 0; otherwise opens it fully.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_set_closed(handle: *mut EnfWorld, portal: u32, is_closed: u32) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        unsafe { world(handle) }?.set_closed(portal, is_closed != 0)?;
        Ok(1)
    })
}

/// Locks a cell if `is_locked` is not 0, so that it is never seen from others; otherwise unlocks it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_lock(handle: *mut EnfWorld, cell: u32, is_locked: u32) -> i32 {
    guarded(|| {
        // SAFETY: `handle` is that of the caller.
        unsafe { world(handle) }?.lock(cell, is_locked != 0)?;
        Ok(1)
    })
}

/// Writes the transform (16 numbers) from an object's pose in the file to its present one, to be applied after its own
/// transform. Returns 0, and writes nothing, if it was not moved.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_pose(handle: *mut EnfWorld, detail: u32, out: *mut [f32; 16]) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe { describe_if_any(handle, out, |w| w.pose(detail), 0) }
}

/// Answers a view by an engine's camera: the eye (three numbers) and the matrix (16) from world to clip space. Near and far
/// planes and the direction of depth do not matter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_see(
    handle: *mut EnfWorld,
    eye: *const f32,
    view_projection: *const f32,
    out: *mut EnfSeen,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe {
        describe(handle, out, |w| {
            let matrix = numbers::<16>(view_projection, "the matrix")?;
            let columns = [0, 4, 8, 12].map(|c| [0, 1, 2, 3].map(|row| matrix[c + row]));
            let eye = numbers(eye, "the eye")?;
            w.see(View::from_view_projection(eye, columns))
        })
    }
}

/// Answers a view by its parts: eye, direction and upward direction (three numbers each), vertical angle in radians, and
/// width divided by height.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_see_perspective(
    handle: *mut EnfWorld,
    eye: *const f32,
    toward: *const f32,
    up: *const f32,
    fov_y: f32,
    aspect: f32,
    out: *mut EnfSeen,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe {
        describe(handle, out, |w| {
            let (eye, toward) = (numbers(eye, "the eye")?, numbers(toward, "the direction")?);
            let up = numbers(up, "the upward direction")?;
            w.see(View::perspective(eye, toward, up, fov_y, aspect))
        })
    }
}

/// Answers what is seen in all directions from the eye (three numbers).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_see_around(
    handle: *mut EnfWorld,
    eye: *const f32,
    out: *mut EnfSeen,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe {
        describe(handle, out, |w| {
            w.see(View::around(numbers(eye, "the eye")?))
        })
    }
}

/// Returns 1 if a box (six numbers: minimum and maximum) that is in `n` cells may be visible in the last view, otherwise 0.
/// For moving things that are not in the file.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_sees_box(
    handle: *mut EnfWorld,
    cells: *const u32,
    n: usize,
    aabb: *const f32,
) -> i32 {
    guarded(|| {
        // SAFETY: the pointers are those of the caller.
        let (world, aabb) = unsafe { (world(handle)?, numbers(aabb, "the box")?) };
        // SAFETY: the caller says that `n` ids are there.
        let cells = unsafe { array(cells, n, "the cells") }?;
        Ok(world.sees_box(cells, aabb).into())
    })
}

/// Returns 1 if neither wall nor closed portal is between two points (three numbers each), otherwise 0. Objects do not
/// count. The first call takes as long as the world has triangles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_is_clear(
    handle: *mut EnfWorld,
    from: *const f32,
    to: *const f32,
) -> i32 {
    guarded(|| {
        // SAFETY: the pointers are those of the caller.
        let (world, from) = unsafe { (world(handle)?, numbers(from, "the start")?) };
        // SAFETY: the pointer is that of the caller.
        let to = unsafe { numbers(to, "the end") }?;
        Ok(world.is_clear(from, to)?.into())
    })
}

/// Finds the first wall, object or closed portal between two points (three numbers each). Returns 0, and writes nothing, if
/// there is none. The first call takes as long as the world has triangles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn enf_pick(
    handle: *mut EnfWorld,
    from: *const f32,
    to: *const f32,
    out: *mut EnfHit,
) -> i32 {
    // SAFETY: the pointers are those of the caller.
    unsafe {
        describe_if_any(
            handle,
            out,
            |w| w.pick(numbers(from, "the start")?, numbers(to, "the end")?),
            0,
        )
    }
}
