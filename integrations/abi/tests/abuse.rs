//! Covers R1 and P6 at the C boundary. Callers that pass null, ids that do not exist, numbers that are none, and damaged files get errors.
#![expect(
    unsafe_code,
    reason = "the functions under test are those of the boundary"
)]

use std::ffi::CStr;
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

use enfilade_abi::EnfWorld;
use enfilade_abi::answers::{EnfCell, EnfPortal, EnfRoom, EnfStart, EnfWhy};
use enfilade_abi::ffi::*;
use enfilade_abi::status::*;
use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{Fact, PortalKind, Reason, RoomFacts, Why};
use enfilade_testkit::{GridParams, room_grid};

fn file() -> Vec<u8> {
    let mut world = room_grid(&GridParams::offices(24, 1));
    let facts = [(Fact::Share, 0.2), (Fact::Area, 1.5)];
    world.graph.portals[0].kind = PortalKind::Door;
    world.graph.portals[0].why = vec![
        Why::given(Reason::Gap),
        Why::compared(Reason::Narrow, 0.7, &facts),
    ];
    let facts = world.graph.rooms().map(|(cell, _)| {
        let n = |kind| world.graph.n_portals(cell, kind);
        RoomFacts {
            cell,
            storeys: vec!["1".into(), "2".into()],
            floor_area: 12.5,
            area_above_1_5: 10.0,
            area_above_2_3: 7.5,
            height: 2.5,
            n_doors: n(PortalKind::Door),
            n_windows: n(PortalKind::Window),
        }
    });
    world.room_facts = Some(facts.collect());
    encode_glb(&world).expect("a valid world")
}

fn last_error() -> String {
    // SAFETY: the library returns a text that is valid until the next failure.
    let text = unsafe { CStr::from_ptr(enf_last_error()) };
    text.to_string_lossy().into_owned()
}

/// Closes the world at the end of a test.
struct Open(*mut EnfWorld);

impl Drop for Open {
    fn drop(&mut self) {
        // SAFETY: opened below, closed once.
        unsafe { enf_close(self.0) };
    }
}

fn open() -> Open {
    let bytes = file();
    // SAFETY: the bytes are there.
    let world = unsafe { enf_open(bytes.as_ptr(), bytes.len()) };
    assert!(!world.is_null(), "{}", last_error());
    Open(world)
}

#[test]
fn null_is_an_error_everywhere() {
    let Open(w) = &open();
    let w = *w;
    let p = [1.0_f32; 16];
    let p = p.as_ptr();
    // SAFETY: null is allowed; all other pointers lead to enough values.
    let statuses = unsafe {
        [
            enf_count(null_mut(), ENF_CELLS),
            enf_cell(null_mut(), 0, null_mut()),
            enf_cell(w, 0, null_mut()),
            enf_room(null_mut(), 0, null_mut()),
            enf_room(w, 0, null_mut()),
            enf_portal(w, 0, null_mut()),
            enf_why(null_mut(), ENF_CELLS, 0, 0, null_mut()),
            enf_why(w, ENF_PORTALS, 0, 0, null_mut()),
            enf_leaf(w, 0, 0, null_mut()),
            enf_batch(w, 0, null_mut()),
            enf_detail(w, 0, null_mut()),
            enf_chunk(w, 0, null_mut()),
            enf_cells_of_batch(w, 0, null_mut()),
            enf_cells_of_detail(w, 0, null_mut()),
            enf_portals_of_detail(w, 0, null_mut()),
            enf_pvs_row(null_mut(), 0, null_mut()),
            enf_locate(w, null()),
            enf_locate(null_mut(), p),
            enf_start(null_mut(), null_mut()),
            enf_start(w, null_mut()),
            enf_step(w, null(), p, null_mut()),
            enf_step(w, p, p, null_mut()),
            enf_set_openness(null_mut(), 0, 1.0),
            enf_set_closed(null_mut(), 0, 1),
            enf_lock(null_mut(), 0, 1),
            enf_pose(null_mut(), 0, null_mut()),
            enf_see(w, null(), p, null_mut()),
            enf_see(w, p, null(), null_mut()),
            enf_see_perspective(w, p, p, null(), 1.0, 1.0, null_mut()),
            enf_see_around(w, p, null_mut()),
            enf_sees_box(w, null(), 3, p),
            enf_sees_box(w, null(), 0, null()),
            enf_is_clear(w, p, null()),
            enf_pick(w, null(), p, null_mut()),
        ]
    };
    assert_eq!(statuses, [ENF_BAD_ARGUMENT; 34]);
    assert!(last_error().contains("null"), "{}", last_error());
    // SAFETY: null is allowed.
    unsafe {
        assert!(enf_open(null(), 12).is_null());
        assert!(enf_open_hollow(null(), 0, null(), 0).is_null());
        enf_close(null_mut());
        enf_free(null_mut(), 3);
    }
}

#[test]
fn ids_that_do_not_exist_and_numbers_that_are_none_are_errors() {
    let Open(w) = &open();
    let w = *w;
    let (nan, far) = ([f32::NAN; 16], u32::MAX);
    let good = [1.0_f32; 6];
    // SAFETY: all pointers lead to enough values, and to room for the answers.
    let statuses = unsafe {
        [
            enf_count(w, 99),
            enf_cell(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_room(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_portal(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_why(w, ENF_CELLS, far, 0, MaybeUninit::uninit().as_mut_ptr()),
            enf_why(w, ENF_PORTALS, far, 0, MaybeUninit::uninit().as_mut_ptr()),
            enf_why(w, ENF_PLACES, 0, 0, MaybeUninit::uninit().as_mut_ptr()),
            enf_why(w, ENF_DETAILS, 0, 0, MaybeUninit::uninit().as_mut_ptr()),
            enf_leaf(w, 0, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_batch(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_detail(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_chunk(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_cells_of_batch(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_cells_of_detail(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_portals_of_detail(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_pvs_row(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_pose(w, far, MaybeUninit::uninit().as_mut_ptr()),
            enf_set_openness(w, far, 1.0),
            enf_set_openness(w, 0, f32::NAN),
            enf_set_closed(w, far, 1),
            enf_lock(w, far, 1),
            enf_locate(w, nan.as_ptr()),
            enf_see(
                w,
                good.as_ptr(),
                nan.as_ptr(),
                MaybeUninit::uninit().as_mut_ptr(),
            ),
            enf_see_around(w, nan.as_ptr(), MaybeUninit::uninit().as_mut_ptr()),
            enf_is_clear(w, nan.as_ptr(), good.as_ptr()),
            enf_pick(
                w,
                good.as_ptr(),
                nan.as_ptr(),
                MaybeUninit::uninit().as_mut_ptr(),
            ),
        ]
    };
    assert_eq!(statuses, [ENF_BAD_ARGUMENT; 26]);
    // SAFETY: as above.
    let without_sets = unsafe { enf_pvs_row(w, 0, MaybeUninit::uninit().as_mut_ptr()) };
    assert_eq!(without_sets, ENF_NONE);
}

#[test]
fn damaged_files_are_errors_with_a_reason() {
    let whole = file();
    let mut opened = 0;
    for at in (0..whole.len()).step_by(97) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x55;
        for bytes in [&bytes[..], &whole[..at]] {
            // SAFETY: the bytes are there.
            let world = unsafe { enf_open(bytes.as_ptr(), bytes.len()) };
            if world.is_null() {
                assert!(!last_error().is_empty());
            } else {
                // A changed vertex or name is still a world.
                opened += 1;
            }
            drop(Open(world));
            // SAFETY: as above; a skeleton is expected.
            let hollow = unsafe {
                enf_open_hollow(whole.as_ptr(), whole.len(), bytes.as_ptr(), bytes.len())
            };
            assert!(hollow.is_null());
        }
    }
    assert!(opened > 0);
}

#[test]
fn a_view_lists_the_eyes_own_cell_first_and_a_closed_door_hides_the_rest() {
    let Open(w) = &open();
    let w = *w;
    let eye = [6.0_f32, 1.6, 6.0];
    // SAFETY: all pointers lead to enough values and to room for the answers, which are read after success only.
    unsafe {
        let mut seen = MaybeUninit::uninit();
        assert_eq!(enf_see_around(w, eye.as_ptr(), seen.as_mut_ptr()), 1);
        let before = seen.assume_init();
        let cells = std::slice::from_raw_parts(before.cells, before.n_cells as usize).to_vec();
        assert_eq!(cells[0] as i32, enf_locate(w, eye.as_ptr()));
        assert!(cells.len() > 1);
        for portal in 0..enf_count(w, ENF_PORTALS) as u32 {
            assert_eq!(enf_set_closed(w, portal, 1), 1);
        }
        let mut seen = MaybeUninit::uninit();
        assert_eq!(enf_see_around(w, eye.as_ptr(), seen.as_mut_ptr()), 1);
        let after = seen.assume_init();
        assert_eq!(after.n_cells, 1);
        assert_eq!(*after.cells, cells[0]);
    }
}

#[test]
fn a_walk_begins_in_a_room() {
    let Open(w) = &open();
    let mut start = MaybeUninit::<EnfStart>::uninit();
    // SAFETY: the pointers lead to enough values and to room for the answers, which are read after success only.
    unsafe {
        assert_eq!(enf_start(*w, start.as_mut_ptr()), 1);
        let cell = enf_locate(*w, start.assume_init().eye.as_ptr());
        assert!(cell >= 0);
        let mut room = MaybeUninit::<EnfCell>::uninit();
        assert_eq!(enf_cell(*w, cell as u32, room.as_mut_ptr()), 1);
        assert_eq!(room.assume_init().kind, ENF_ROOM);
    }
}

#[test]
fn rooms_have_facts_and_the_outdoors_has_none() {
    let Open(w) = &open();
    let mut room = MaybeUninit::<EnfRoom>::uninit();
    // SAFETY: all pointers lead to enough values, and the answer is read once it is there.
    unsafe {
        let mut door = MaybeUninit::<EnfPortal>::uninit();
        assert_eq!(enf_portal(*w, 0, door.as_mut_ptr()), 1);
        let cell = door.assume_init().cells[0];
        assert_eq!(enf_room(*w, cell, room.as_mut_ptr()), 1);
        let room = room.assume_init();
        let storeys =
            std::slice::from_raw_parts(room.storeys.cast::<u8>(), room.storeys_length as usize);
        assert_eq!(storeys, b"1 2");
        let measures = [
            room.floor_area,
            room.area_above_1_5,
            room.area_above_2_3,
            room.height,
        ];
        assert_eq!(measures, [12.5, 10.0, 7.5, 2.5]);
        assert!(room.n_doors > 0);
        let outdoors = (0..).find(|&cell| {
            let mut found = MaybeUninit::<EnfCell>::uninit();
            assert_eq!(enf_cell(*w, cell, found.as_mut_ptr()), 1);
            found.assume_init().kind == ENF_OUTDOORS
        });
        let none = enf_room(
            *w,
            outdoors.unwrap_or_default(),
            MaybeUninit::uninit().as_mut_ptr(),
        );
        assert_eq!(none, ENF_NONE);
    }
}

#[test]
fn decisions_are_told_with_their_facts() {
    let Open(w) = &open();
    let w = *w;
    let why = |of, index, decision| {
        let mut out = MaybeUninit::<EnfWhy>::uninit();
        // SAFETY: there is room for the answer, which is read only where the call says that it was written.
        unsafe {
            let status = enf_why(w, of, index, decision, out.as_mut_ptr());
            (status == 1).then(|| out.assume_init()).ok_or(status)
        }
    };
    // SAFETY: texts are as long as said, and stay until the next decision.
    let text = |at: *const std::ffi::c_char, n: u32| unsafe {
        let bytes = std::slice::from_raw_parts(at.cast::<u8>(), n as usize);
        String::from_utf8(bytes.to_vec()).expect("text")
    };
    let first = why(ENF_PORTALS, 0, 0).expect("a decision");
    assert_eq!(text(first.reason, first.reason_length), "gap");
    assert_eq!((first.n_facts, first.compared), (0, ENF_NO_ID));
    let second = why(ENF_PORTALS, 0, 1).expect("a decision");
    assert_eq!(text(second.reason, second.reason_length), "narrow");
    let said = text(second.text, second.text_length);
    assert!(said.contains("0.2, under 0.7"), "{said}");
    // SAFETY: as many facts as said are there.
    let facts = unsafe { std::slice::from_raw_parts(second.facts, second.n_facts as usize) };
    let names: Vec<String> = facts.iter().map(|f| text(f.name, f.name_length)).collect();
    assert_eq!(names, ["share", "area"]);
    assert_eq!(
        (second.compared, facts[0].value, second.limit),
        (0, 0.2, 0.7)
    );
    assert!((second.margin - 0.714).abs() < 1e-3);
    assert_eq!(why(ENF_PORTALS, 0, 2).err(), Some(ENF_NONE));
    assert_eq!(why(ENF_CELLS, 0, 0).err(), Some(ENF_NONE));
}
