//! Runs the examples, which check their own assertions.

#[path = "../examples/bake_a_file.rs"]
mod bake_a_file;
#[path = "../examples/doors.rs"]
mod doors;
#[path = "../examples/game_loop.rs"]
mod game_loop;
#[path = "../examples/own_builder.rs"]
mod own_builder;

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
fn a_world_can_be_made_by_hand() {
    own_builder::main().unwrap();
}
