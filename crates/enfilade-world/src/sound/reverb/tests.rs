//! Reverberation in simple rooms.

use super::*;
use enfilade_cpg::World;
use enfilade_geom::Aabb;
use enfilade_testkit::{GridParams, room_grid};

fn two_rooms() -> (Space, f64) {
    let space = Space::new(room_grid(&GridParams::two_rooms())).unwrap();
    let door = space.layout(PartId::ROOT).opening(PortalId(0)).area();
    (space, door)
}

fn at(cell: u32) -> Place {
    Place {
        part: PartId::ROOT,
        cell: CellId(cell),
    }
}

/// W11: a single room follows Sabine.
#[test]
fn a_closed_room_rings_as_sabine_says() {
    let (space, _) = two_rooms();
    let reverb = Reverb::of_rooms(
        &space,
        DecayLaw::Sabine,
        &[(100.0, 130.0, 0.1), (50.0, 90.0, 0.2)],
    );
    let mut fields = DiffuseFields::new();
    fields.solve(&reverb, &space, at(0), |_, _| 0.0);
    let sabine = 24.0 * 10f64.ln() / SPEED_OF_SOUND * 100.0 / 13.0;
    assert!(
        (fields.rt60(at(0)) / sabine - 1.0).abs() < 0.005,
        "{}",
        fields.rt60(at(0))
    );
    assert!((fields.density(at(0)) * 13.0 - 1.0).abs() < 1e-9);
    assert_eq!(fields.gain(at(1)), 0.0);
}

/// W11: two rooms and a door, against the balance of two equations in closed form.
#[test]
fn coupled_rooms_balance() {
    let (space, door) = two_rooms();
    let (v, a) = ([100.0, 50.0], [13.0, 18.0]);
    let reverb = Reverb::of_rooms(
        &space,
        DecayLaw::Sabine,
        &[(v[0], 130.0, 0.1), (v[1], 90.0, 0.2)],
    );
    let mut fields = DiffuseFields::new();
    for share in [0.0, 0.3, 1.0] {
        let s = door * share;
        fields.solve(&reverb, &space, at(0), |_, _| share);
        let (m00, m11) = (a[0] + s, a[1] + s);
        let det = m00 * m11 - s * s;
        let w = [m11 / det, s / det];
        for k in 0..2 {
            let got = fields.density(at(k as u32));
            assert!((got - w[k]).abs() < 1e-9 * w[0], "{got} {}", w[k]);
        }
        // The decay is a sum of two exponentials, in each room.
        let k = SPEED_OF_SOUND / 4.0;
        let rates = [
            [k * m00 / v[0], -k * s / v[0]],
            [-k * s / v[1], k * m11 / v[1]],
        ];
        let half = 0.5 * (rates[0][0] + rates[1][1]);
        let root = half * half - (rates[0][0] * rates[1][1] - rates[0][1] * rates[1][0]);
        let [slow, fast] = [half - root.sqrt(), half + root.sqrt()];
        for i in 0..2 {
            // From the field and its slope at first.
            let slope = -(rates[i][0] * w[0] + rates[i][1] * w[1]);
            let late = (slope + fast * w[i]) / (fast - slow).max(1e-9);
            let left = |t: f64| late * (-slow * t).exp() + (w[i] - late) * (-fast * t).exp();
            let level = |t: f64| 10.0 * (left(t) / w[i]).log10();
            if w[i] == 0.0 {
                assert_eq!(fields.rt60(at(i as u32)), 0.0);
                continue;
            }
            let times: Vec<f64> = (0..200_000).map(|n| f64::from(n) * 1e-5).collect();
            let inside = times
                .iter()
                .filter(|t| (-35.0..=-5.0).contains(&level(**t)));
            let (mut n, mut st, mut sl, mut stt, mut stl) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for &t in inside {
                let l = level(t);
                (n, st, sl, stt, stl) = (n + 1.0, st + t, sl + l, stt + t * t, stl + t * l);
            }
            let time = -60.0 * (n * stt - st * st) / (n * stl - st * sl);
            let got = fields.rt60(at(i as u32));
            assert!(
                (got / time - 1.0).abs() < 0.005,
                "room {i}, {share}: {got} {time}"
            );
        }
    }
}

/// W11: walls without thickness belong to the cells in front of them.
#[test]
fn a_rooms_walls_are_its_box_less_its_doors() {
    let (space, _) = two_rooms();
    let layout = space.layout(PartId::ROOT);
    let reverb = Reverb::new(&space, DecayLaw::Eyring, |_, _| [0.2; N_BANDS]);
    for c in [at(0), at(1)] {
        let bounds = layout.cell(c.cell).bounds;
        let size = bounds.max - bounds.min;
        let all = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let walls = all - layout.opening(PortalId(0)).area();
        assert!(
            (reverb.area(c) - walls).abs() < 0.01 * walls,
            "{} {walls}",
            reverb.area(c)
        );
        let eyring = -0.8f64.ln() * reverb.area(c);
        assert!((reverb.absorbing_area(c)[2] - eyring).abs() < 1e-6 * eyring);
    }
}

/// W11: a door that is shut absorbs as doors do, and no more than a wall of its size where it is open.
#[test]
fn what_shuts_an_opening_absorbs() {
    let (space, _) = two_rooms();
    let layout = space.layout(PartId::ROOT);
    let reverb = Reverb::new(&space, DecayLaw::Eyring, |_, _| [0.02; N_BANDS]);
    let door = layout.opening(PortalId(0)).area();
    let mut fields = DiffuseFields::new();
    fields.solve(&reverb, &space, at(0), |_, _| 0.0);
    let (walls, alpha) = (reverb.area(at(0)), Assumed::of_name("door").bands);
    for (band, time) in fields.rt60_bands(at(0)).into_iter().enumerate() {
        let whole = walls + door;
        let mean = (walls * 0.02 + door * alpha[band]) / whole;
        let volume = layout.cell(at(0).cell).volume;
        let eyring = 55.3 * volume / (SPEED_OF_SOUND * -(1.0 - mean).ln() * whole);
        assert!((time / eyring - 1.0).abs() < 0.01, "{time} {eyring}");
    }
    let shut = fields.rt60(at(0));
    fields.solve(&reverb, &space, at(0), |_, _| 1.0);
    // The room behind is alike, and returns what goes there.
    let open = fields.rt60(at(0));
    assert!(open > shut, "{open} {shut}");
}

/// W11: furniture absorbs by its surface, but not more than the box around it, to 5 %: few lines cross small things.
#[test]
fn furniture_absorbs_in_its_room() {
    let mut world = room_grid(&GridParams {
        furniture: 3,
        ..GridParams::two_rooms()
    });
    assert!(!world.details.is_empty());
    let reverb = |world: &World| {
        let space = Space::new(world.clone()).unwrap();
        let reverb = Reverb::new(&space, DecayLaw::Eyring, |_, _| [0.2; N_BANDS]);
        [at(0), at(1)]
            .map(|c| reverb.absorbing_area(c)[2])
            .iter()
            .sum::<f64>()
    };
    let with = reverb(&world);
    // As many triangles again within the same box change nothing.
    for mesh in &mut world.detail_meshes {
        let again = mesh.primitives.clone();
        mesh.primitives
            .extend(again.iter().cloned().chain(again.clone()));
    }
    assert!((reverb(&world) - with).abs() < 1e-3 * with);
    let boxes: f64 = world
        .details
        .iter()
        .map(|object| {
            let primitives = &world.detail_meshes[object.mesh as usize].primitives;
            let triangles = primitives
                .iter()
                .flat_map(|p| p.placed_triangles(object.placement()));
            Aabb::of_points(&triangles.flatten().collect::<Vec<_>>()).surface_area()
        })
        .sum();
    world.details.clear();
    let without = reverb(&world);
    assert!(
        with > without && with - without <= 0.2 * boxes * 1.05,
        "{with} {without} {boxes}"
    );
}
