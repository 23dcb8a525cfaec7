//! Furniture at walls, and structure that only seems to be furniture.

use super::tests::Build;

#[test]
fn a_box_that_touches_walls_is_still_a_box() {
    let mut b = Build::room();
    b.block("wardrobe", [0.0, 0.0, 0.0], [2.4, 1.9, 0.6])
        .block("bed", [3.0, 0.0, 2.0], [5.0, 0.5, 4.0])
        .block("cupboard", [0.0, 1.4, 2.0], [0.35, 2.1, 3.2])
        .block("cupboard", [0.0, 1.4, 3.2], [0.35, 2.1, 4.0]);
    assert_eq!(b.details(), ["wardrobe", "bed", "cupboard", "cupboard"]);
}

#[test]
fn the_reason_is_told() {
    let mut b = Build::room();
    b.block("wardrobe", [0.0, 0.0, 0.0], [2.4, 1.9, 0.6]);
    assert_eq!(
        b.reasons(),
        [
            "wardrobe: furniture: 0.6 x 1.9 x 2.4 m, stands on others, air above and walls higher around it"
        ]
    );
}

/// The lower box holds the upper one, which is furniture.
#[test]
fn a_stack_is_furniture() {
    let mut b = Build::room();
    b.block("low", [0.0, 0.0, 0.0], [2.4, 0.9, 0.6]).block(
        "high",
        [0.0, 0.9, 0.0],
        [2.4, 1.8, 0.6],
    );
    assert_eq!(b.details(), ["low", "high"]);
}

#[test]
fn what_reaches_the_ceiling_or_is_a_low_wall_stays() {
    let mut b = Build::room();
    b.block("shaft", [0.0, 0.0, 0.0], [0.6, 2.6, 0.6])
        // Between two walls, with air before and behind it.
        .block("parapet", [0.0, 0.0, 3.0], [5.0, 1.0, 3.24])
        .block("skirting", [0.0, 0.0, 0.0], [0.02, 0.1, 3.0]);
    assert_eq!(b.details(), [""; 0]);
}

/// A gallery hangs by its rim, and a stage is too large for furniture.
#[test]
fn what_people_stand_on_stays() {
    let mut b = Build::room();
    b.block("gallery", [0.0, 1.5, 1.0], [2.2, 1.6, 3.0]).block(
        "finish",
        [2.0, 0.0, 0.0],
        [5.0, 0.02, 3.0],
    );
    assert_eq!(b.details(), [""; 0]);
    let mut b = Build::room();
    b.block("step", [0.2, 0.0, 0.0], [4.7, 0.2, 4.0]);
    assert_eq!(b.details(), [""; 0]);
    let mut b = Build::default();
    b.block("floor", [0.0, -0.2, 0.0], [20.0, 0.0, 20.0])
        .block("ceiling", [0.0, 5.0, 0.0], [20.0, 5.2, 20.0])
        .block("west", [-0.2, 0.0, 0.0], [0.0, 5.0, 20.0])
        .block("east", [20.0, 0.0, 0.0], [20.2, 5.0, 20.0])
        .block("north", [0.0, 0.0, -0.2], [20.0, 5.0, 0.0])
        .block("south", [0.0, 0.0, 20.0], [20.0, 5.0, 20.2])
        .block("stage", [6.0, 0.0, 0.0], [14.0, 0.8, 4.0])
        .block("table", [6.0, 0.0, 8.0], [10.0, 0.8, 9.0]);
    assert_eq!(b.details(), ["table"]);
}

/// Extruded floor plans have air above every wall.
#[test]
fn walls_without_a_ceiling_stay() {
    let mut b = Build::default();
    b.block("floor", [-20.0, -0.2, -20.0], [28.0, 0.0, 24.0]);
    for x in [0.0, 4.0, 8.0] {
        b.block("wall", [x, 0.0, 0.0], [x + 0.2, 1.9, 4.0]);
    }
    for (x, z) in [(0.2, 0.0), (0.2, 3.8), (4.2, 0.0), (4.2, 3.8)] {
        b.block("wall", [x, 0.0, z], [x + 3.8, 1.9, z + 0.2]);
    }
    b.block("stub", [2.0, 0.0, 0.2], [2.2, 1.9, 2.4]);
    assert_eq!(b.details(), [""; 0]);
}
