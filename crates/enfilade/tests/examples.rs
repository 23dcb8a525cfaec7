//! Runs the examples, which check their own assertions.

#[path = "../examples/bake_a_file.rs"]
mod bake_a_file;
#[path = "../examples/doors.rs"]
mod doors;
#[path = "../examples/errands.rs"]
mod errands;
#[path = "../examples/game_loop.rs"]
mod game_loop;
#[path = "../examples/lift.rs"]
mod lift;
#[path = "../examples/live_edit.rs"]
mod live_edit;
#[path = "../examples/own_builder.rs"]
mod own_builder;
#[path = "../examples/radio.rs"]
mod radio;

#[test]
fn a_file_is_baked() {
    bake_a_file::main().unwrap();
}

#[test]
fn doors_close_slide_and_are_hit() {
    doors::main().unwrap();
}

#[test]
fn a_walk_draws_less_than_everything() {
    game_loop::main().unwrap();
}

#[test]
fn a_door_is_cut_while_the_world_is_in_use() {
    live_edit::main().unwrap();
}

#[test]
fn a_world_can_be_made_by_hand() {
    own_builder::main().unwrap();
}

#[test]
fn people_run_errands() {
    errands::main().unwrap();
}

#[test]
fn a_lift_is_ridden() {
    lift::main().unwrap();
}

#[test]
fn a_radio_is_heard_through_a_door() {
    radio::main().unwrap();
}
