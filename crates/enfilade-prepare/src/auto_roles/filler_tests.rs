//! Walls with holes, their fillers, and things that only seem to fill them.

use super::tests::Build;
use enfilade_geom::scene::Filling;

/// Six slabs around 6 x 2.6 x 6 m, and a wall of 24 cm across the space, at z 3 to 3.24: one mesh with a hole
/// for a door (x 1 to 2, up to 2.1) and one for a window (x 3.5 to 5, y 0.9 to 2.1).
pub(super) fn two_rooms() -> Build {
    let mut b = shell();
    b.blocks(
        "wall",
        &[
            ([0.0, 0.0, 3.0], [1.0, 2.6, 3.24]),
            ([1.0, 2.1, 3.0], [2.0, 2.6, 3.24]),
            ([2.0, 0.0, 3.0], [3.5, 2.6, 3.24]),
            ([3.5, 0.0, 3.0], [5.0, 0.9, 3.24]),
            ([3.5, 2.1, 3.0], [5.0, 2.6, 3.24]),
            ([5.0, 0.0, 3.0], [6.0, 2.6, 3.24]),
        ],
    );
    b
}

fn shell() -> Build {
    let mut b = Build::default();
    b.block("floor", [-0.3, -0.2, -0.3], [6.3, 0.0, 6.3])
        .block("ceiling", [-0.3, 2.6, -0.3], [6.3, 2.8, 6.3])
        .block("west", [-0.3, 0.0, -0.3], [0.0, 2.6, 6.3])
        .block("east", [6.0, 0.0, -0.3], [6.3, 2.6, 6.3])
        .block("north", [0.0, 0.0, -0.3], [6.0, 2.6, 0.0])
        .block("south", [0.0, 0.0, 6.0], [6.0, 2.6, 6.3]);
    b
}

#[test]
fn leaves_and_panes_fill_openings_with_frame_or_without() {
    let mut b = two_rooms();
    b.block("leaf", [1.0, 0.0, 3.11], [2.0, 2.1, 3.15]).blocks(
        "window",
        &[
            ([3.5, 0.9, 3.08], [3.56, 2.1, 3.16]),
            ([4.94, 0.9, 3.08], [5.0, 2.1, 3.16]),
            ([3.56, 0.9, 3.08], [4.94, 0.96, 3.16]),
            ([3.56, 2.04, 3.08], [4.94, 2.1, 3.16]),
            ([3.56, 0.96, 3.11], [4.94, 2.04, 3.13]),
        ],
    );
    assert_eq!(
        b.reasons(),
        [
            "leaf: fills an opening: 1.00 x 2.10 m, 0.04 m thick, the wall around it 0.24 m on 3 sides",
            "window: fills an opening: 1.50 x 1.20 m, 0.08 m thick, the wall around it 0.24 m on 4 sides",
        ]
    );
}

#[test]
fn leaf_and_frame_may_be_two_objects_and_the_wall_three() {
    let mut b = shell();
    b.block("jamb", [0.0, 0.0, 3.0], [1.0, 2.6, 3.12])
        .block("jamb", [2.0, 0.0, 3.0], [6.0, 2.6, 3.12])
        .block("lintel", [1.0, 2.1, 3.0], [2.0, 2.6, 3.12])
        .blocks(
            "frame",
            &[
                ([1.0, 0.0, 3.02], [1.06, 2.1, 3.1]),
                ([1.94, 0.0, 3.02], [2.0, 2.1, 3.1]),
                ([1.06, 2.04, 3.02], [1.94, 2.1, 3.1]),
            ],
        )
        .block("leaf", [1.06, 0.01, 3.04], [1.94, 2.04, 3.08]);
    assert_eq!(b.details(), ["frame", "leaf"]);
}

#[test]
fn a_block_as_thick_as_the_wall_fills_a_hole_that_one_wall_goes_round() {
    let mut b = two_rooms();
    b.block("door", [1.0, 0.0, 3.0], [2.0, 2.1, 3.24]).block(
        "window",
        [3.5, 0.9, 3.0],
        [5.0, 2.1, 3.24],
    );
    assert_eq!(b.details(), ["door", "window"]);
}

// Energy models: walls, leaves and panes are single sheets.
#[test]
fn sheets_fill_holes_in_the_plane_of_one_sheet() {
    let hole = [
        ([0.0, 0.0, 3.0], [1.0, 2.6, 3.0]),
        ([1.0, 2.1, 3.0], [2.0, 2.6, 3.0]),
        ([2.0, 0.0, 3.0], [6.0, 2.6, 3.0]),
    ];
    let filled = |wall: &[&[([f64; 3], [f64; 3])]], at: f64| {
        let mut b = shell();
        for pieces in wall {
            b.blocks("wall", pieces);
        }
        b.block("leaf", [1.0, 0.0, at], [2.0, 2.1, at]);
        b.reasons()
    };
    let leaf =
        "leaf: fills an opening: 1.00 x 2.10 m, 0.00 m thick, one wall goes round it on 3 sides";
    // Welding moves vertices by a millimeter.
    for at in [3.0, 3.001] {
        assert_eq!(filled(&[&hole], at), [leaf]);
    }
    // Before the wall; and between sheets of which any may be the leaf.
    assert_eq!(filled(&[&hole], 3.003), [""; 0]);
    let pieces = hole.each_ref().map(std::slice::from_ref);
    assert_eq!(filled(&pieces, 3.0), [""; 0]);
}

// A floor of sheets with a carpet in it, a room above and one below.
#[test]
fn a_sheet_that_lies_in_a_sheet_is_no_pane() {
    let mut b = shell();
    b.blocks(
        "storey",
        &[
            ([0.0, 1.3, 0.0], [2.0, 1.3, 6.0]),
            ([2.0, 1.3, 0.0], [5.0, 1.3, 2.0]),
            ([2.0, 1.3, 4.0], [5.0, 1.3, 6.0]),
            ([5.0, 1.3, 0.0], [6.0, 1.3, 6.0]),
        ],
    )
    .block("carpet", [2.0, 1.3, 2.0], [5.0, 1.3, 4.0]);
    assert_eq!(b.details(), [""; 0]);
}

// Beside the thick wall that holds it, a thick leaf may meet sheets, as pieces of kits open at their ends are.
#[test]
fn a_sheet_beside_a_thick_leaf_does_not_make_its_wall_thin() {
    let mut b = shell();
    b.block("jamb", [0.0, 0.0, 3.0], [1.0, 2.6, 3.24])
        .block("jamb", [2.0, 0.0, 3.0], [6.0, 2.6, 3.24])
        .block("lintel", [1.0, 2.1, 3.0], [2.0, 2.6, 3.24])
        .block("leaf", [1.0, 0.0, 3.11], [2.0, 2.1, 3.15])
        .block("sheet", [0.0, -0.15, 3.13], [6.0, 0.0, 3.13]);
    assert_eq!(b.details(), ["leaf"]);
}

// Pieces of a kit: `wall_doorway`, and below it `wall_doorway_door`.
#[test]
fn of_what_is_named_as_a_wall_and_a_door_the_shape_tells() {
    for (filling, leaf) in [(Some(Filling::Door), vec!["leaf"]), (None, vec![])] {
        let mut b = two_rooms();
        b.by_name(filling)
            .block("leaf", [1.0, 0.0, 3.1], [2.0, 2.1, 3.15])
            .by_name(filling)
            .block("wall piece", [3.5, 0.9, 3.0], [5.0, 2.1, 3.24])
            .by_name(None);
        assert_eq!(b.details(), leaf);
    }
}

#[test]
fn jambs_with_beveled_edges_hold_a_leaf() {
    // To 3 cm, over 9 cm: steeper than 45 degrees.
    let beveled = |p: [f32; 3]| {
        let is_edge = p[0] == 1.0 || p[0] == 2.0;
        let z = if is_edge { p[2].clamp(3.1, 3.13) } else { p[2] };
        [p[0], p[1], z]
    };
    let mut b = shell();
    b.blocks(
        "wall",
        &[
            ([0.0, 0.0, 3.0], [0.91, 2.6, 3.24]),
            ([0.91, 0.0, 3.0], [1.0, 2.1, 3.24]),
            ([2.0, 0.0, 3.0], [2.09, 2.1, 3.24]),
            ([2.09, 0.0, 3.0], [6.0, 2.6, 3.24]),
            ([0.91, 2.1, 3.0], [2.09, 2.6, 3.24]),
        ],
    )
    .bent(beveled)
    .block("leaf", [1.0, 0.0, 3.07], [2.0, 2.1, 3.17]);
    assert_eq!(b.details(), ["leaf"]);
}

#[test]
fn a_door_and_the_light_above_it_fill_one_hole() {
    let mut b = two_rooms();
    b.block("door", [1.0, 0.0, 3.0], [2.0, 1.6, 3.24]).block(
        "light",
        [1.0, 1.6, 3.0],
        [2.0, 2.1, 3.24],
    );
    assert_eq!(b.details(), ["door", "light"]);
}

/// The leaf ends at the wall, which replaces the other jamb.
#[test]
fn a_leaf_in_a_corner_fills_an_opening() {
    let mut b = shell();
    b.block("wall", [0.0, 0.0, 3.0], [5.0, 2.6, 3.12])
        .block("lintel", [5.0, 2.1, 3.0], [6.0, 2.6, 3.12])
        .block("leaf", [5.0, 0.0, 3.04], [6.0, 2.1, 3.08]);
    assert_eq!(b.details(), ["leaf"]);
}

/// Without a lintel only its thickness tells it from a piece of the wall.
#[test]
fn a_leaf_as_high_as_the_room_fills_the_gap_between_two_jambs() {
    let fills = |thickness: f64, wall: f64| {
        let middle = 3.0 + 0.5 * wall;
        let (front, back) = (middle - 0.5 * thickness, middle + 0.5 * thickness);
        let mut b = shell();
        b.block("left", [0.0, 0.0, 3.0], [2.0, 2.6, 3.0 + wall])
            .block("right", [3.0, 0.0, 3.0], [6.0, 2.6, 3.0 + wall])
            .block("leaf", [2.0, 0.0, front], [3.0, 2.6, back]);
        b.details() == ["leaf"]
    };
    assert!(fills(0.05, 0.12));
    // A piece of the wall, one hardly thinner, and a partition between columns.
    for [thickness, wall] in [[0.12, 0.12], [0.065, 0.12], [0.1, 0.24]] {
        assert!(!fills(thickness, wall), "{thickness} in {wall}");
    }
}

#[test]
fn casings_handles_and_the_windows_of_a_whole_wall_go_together() {
    let mut b = two_rooms();
    b.blocks(
        "door and window",
        &[
            ([1.0, 0.0, 3.11], [2.0, 2.1, 3.15]),
            // Casing on the other side, and a handle.
            ([0.95, 0.0, 3.24], [1.05, 2.15, 3.26]),
            ([1.95, 0.0, 3.24], [2.05, 2.15, 3.26]),
            ([1.05, 2.05, 3.24], [1.95, 2.15, 3.26]),
            ([1.8, 1.0, 3.16], [1.9, 1.02, 3.18]),
            ([3.5, 0.9, 3.1], [5.0, 2.1, 3.12]),
        ],
    );
    assert_eq!(b.details(), ["door and window"]);
}

/// An object has one role: a wall with its pane stays structural.
#[test]
fn what_is_more_than_a_filler_stays() {
    let mut b = two_rooms();
    b.blocks(
        "leaf and wall",
        &[
            ([1.0, 0.0, 3.11], [2.0, 2.1, 3.15]),
            ([3.0, 0.0, 4.0], [3.2, 2.6, 6.0]),
        ],
    );
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn pieces_of_walls_are_no_fillers() {
    let mut b = shell();
    // A wall of pieces with an opening, a parapet and a lintel, all of one thickness.
    b.block("left", [0.0, 0.0, 3.0], [2.0, 2.6, 3.24])
        .block("right", [4.0, 0.0, 3.0], [6.0, 2.6, 3.24])
        .block("lintel", [2.0, 2.1, 3.0], [4.0, 2.6, 3.24])
        .block("parapet", [2.0, 0.0, 3.0], [4.0, 0.9, 3.24])
        // A wall between two others, and one of blocks.
        .block("across", [2.95, 0.0, 0.0], [3.0, 2.6, 3.0]);
    for i in 0..4 {
        for k in 0..4 {
            let (z, y) = (3.24 + 0.69 * f64::from(i), 0.65 * f64::from(k));
            b.block("brick", [1.0, y, z], [1.2, y + 0.65, z + 0.69]);
        }
    }
    assert_eq!(b.details(), [""; 0]);
}

/// In a frame of columns and beams a partition is thinner than its surroundings.
#[test]
fn a_partition_under_a_beam_is_no_filler() {
    let mut b = shell();
    b.block("column", [0.0, 0.0, 3.0], [0.3, 2.6, 3.3])
        .block("column", [5.7, 0.0, 3.0], [6.0, 2.6, 3.3])
        .block("beam", [0.3, 2.2, 3.0], [5.7, 2.6, 3.3])
        .block("partition", [0.3, 0.0, 3.1], [5.7, 2.2, 3.2]);
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn what_covers_a_niche_is_no_filler() {
    let mut b = shell();
    // A niche of 10 cm in a wall of 30 cm, and a board in it, with the wall behind.
    b.blocks(
        "wall",
        &[
            ([0.0, 0.0, 3.0], [6.0, 2.6, 3.2]),
            ([0.0, 0.0, 3.2], [2.0, 2.6, 3.3]),
            ([4.0, 0.0, 3.2], [6.0, 2.6, 3.3]),
            ([2.0, 0.0, 3.2], [4.0, 0.8, 3.3]),
            ([2.0, 2.0, 3.2], [4.0, 2.6, 3.3]),
        ],
    )
    .block("board", [2.0, 0.8, 3.2], [4.0, 2.0, 3.24]);
    assert_eq!(b.details(), [""; 0]);
}

/// Without its neighbors the middle piece might be a leaf.
#[test]
fn a_thin_piece_among_thin_pieces_is_no_filler() {
    let mut b = shell();
    b.block("left", [0.0, 0.0, 3.0], [2.0, 2.0, 3.08])
        .block("right", [4.0, 0.0, 3.0], [6.0, 2.0, 3.08])
        .block("above", [0.0, 2.0, 3.0], [6.0, 2.6, 3.08])
        .block("middle", [2.0, 0.0, 3.0], [4.0, 2.0, 3.06]);
    assert_eq!(b.details(), [""; 0]);
}

/// Boxes that overlap share no vertex and still make one wall.
#[test]
fn a_wall_of_pieces_that_overlap_goes_round_its_hole() {
    let mut b = shell();
    b.blocks(
        "wall",
        &[
            ([0.0, 0.0, 3.0], [1.0, 2.6, 3.24]),
            ([0.9, 2.1, 3.01], [2.1, 2.5, 3.23]),
            ([2.0, 0.0, 3.0], [6.0, 2.6, 3.24]),
        ],
    )
    .block("door", [1.0, 0.0, 3.01], [2.0, 2.1, 3.23]);
    assert_eq!(b.details(), ["door"]);
}

#[test]
fn there_is_air_before_and_behind_a_filler() {
    let mut b = two_rooms();
    // The window is walled up from behind, 10 cm away.
    b.block("board", [3.5, 0.9, 3.1], [5.0, 2.1, 3.15]).block(
        "bricks",
        [3.0, 0.0, 3.24],
        [5.5, 2.6, 3.4],
    );
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn a_screen_before_a_wall_is_no_filler() {
    let mut b = two_rooms();
    b.block("screen", [2.2, 0.0, 2.6], [3.4, 2.3, 2.64]);
    assert_eq!(b.details(), [""; 0]);
}

/// The gap between the two skins of a cavity wall is air, not a thick wall.
#[test]
fn a_thin_piece_of_a_cavity_wall_is_no_filler() {
    let mut b = shell();
    for (name, x, y, tie) in [
        ("left", [0.0, 2.0], [0.0, 2.0], 0.0),
        ("right", [4.0, 6.0], [0.0, 2.0], 5.9),
        ("above", [0.0, 6.0], [2.0, 2.6], 0.0),
    ] {
        b.blocks(
            name,
            &[
                ([x[0], y[0], 3.0], [x[1], y[1], 3.08]),
                ([x[0], y[0], 3.4], [x[1], y[1], 3.48]),
                ([tie, y[0], 3.08], [tie + 0.1, y[1], 3.4]),
            ],
        );
    }
    b.block("middle", [2.0, 0.0, 3.04], [4.0, 2.0, 3.1]);
    assert_eq!(b.details(), [""; 0]);
}

#[test]
fn what_goes_through_a_wall_is_no_filler() {
    let mut b = two_rooms();
    b.block("duct", [3.5, 0.9, 2.8], [5.0, 2.1, 3.5]);
    assert_eq!(b.details(), [""; 0]);
}
