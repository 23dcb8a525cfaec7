//! Maps for robots.

use enfilade_export::{FloorMap, FloorMapError, FloorMapOptions};
use serde_json::Value;

use crate::common::house;

#[test]
fn labels_are_the_cells_of_the_pixels() {
    let world = house();
    let map = FloorMap::new(&world, &FloorMapOptions::default()).unwrap();
    let mut n_labeled = 0;
    for i in 0..map.labels.len() {
        let cell = world.graph.locate(map.middle(i).map(|x| x as f32));
        let is_place = cell.is_some_and(|c| world.graph[c].is_place());
        let label = if is_place { cell.unwrap().0 + 1 } else { 0 };
        assert_eq!(u32::from(map.labels[i]), label, "pixel {i}");
        n_labeled += usize::from(is_place);
    }
    assert!(n_labeled > 10_000, "{n_labeled}");
    // Furniture stands on the floor, walls between the rooms.
    let n_occupied = map.occupancy.iter().filter(|&&o| o == 0).count();
    let n_free = map.occupancy.iter().filter(|&&o| o == 254).count();
    assert!(n_occupied > 1000 && n_free > 10_000 && n_free < n_labeled);
    let table: Value = serde_json::from_str(&map.rooms_json(&world)).unwrap();
    let rooms = table["rooms"].as_array().unwrap();
    assert!(
        rooms
            .iter()
            .any(|r| !r["doors"].as_array().unwrap().is_empty())
    );
}

#[test]
fn settings_without_sense_are_refused_with_a_remedy() {
    let world = house();
    let refused = |options: FloorMapOptions| FloorMap::new(&world, &options).unwrap_err();
    let usual = FloorMapOptions::default();
    for resolution in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(FloorMapOptions {
            resolution,
            ..usual
        });
        assert_eq!(error, FloorMapError::Settings);
    }
    let error = refused(FloorMapOptions {
        floor: 900.0,
        ..usual
    });
    assert_eq!(error, FloorMapError::NoRoom { floor: 900.0 });
    let error = refused(FloorMapOptions {
        resolution: 1e-5,
        ..usual
    });
    let FloorMapError::TooFine { least } = error else {
        panic!("{error}");
    };
    assert!(least > 1e-5 && error.to_string().contains("or more"));
    let resolution = least;
    assert!(
        FloorMap::new(
            &world,
            &FloorMapOptions {
                resolution: 20.0 * resolution,
                ..usual
            }
        )
        .is_ok()
    );
}
