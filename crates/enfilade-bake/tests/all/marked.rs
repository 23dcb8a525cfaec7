//! Marked objects become mirrors and links as the bake ends, and stay geometry with a reason if they cannot. FEATURES: W7, W8.

use enfilade_bake::{BakeConfig, BakeContext, BakeOutput, bake};
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_cpg::{SpecialPortal, Way};
use enfilade_geom::scene::{Mark, MarkKind, Mesh, Object, Primitive, Role, Scene};
use enfilade_geom::{DMat4, DVec3, Similarity};
use enfilade_testkit::mixed::two_rooms;

/// Adds an object of polygons, each with vertices of its own; returns its number.
fn add(scene: &mut Scene, name: &str, role: Role, polygons: &[&[[f32; 3]]]) -> u32 {
    let mut primitive = Primitive::default();
    for polygon in polygons {
        let first = primitive.positions.len() as u32;
        primitive.positions.extend_from_slice(polygon);
        let fan = (2..polygon.len() as u32).flat_map(|k| [first, first + k - 1, first + k]);
        primitive.indices.extend(fan);
    }
    scene.meshes.push(Mesh {
        name: String::new(),
        primitives: vec![primitive],
    });
    scene.objects.push(Object {
        name: name.into(),
        mesh: scene.meshes.len() as u32 - 1,
        transform: DMat4::IDENTITY,
        role,
        reason: String::new(),
        filling: None,
        node: None,
    });
    scene.objects.len() as u32 - 1
}

fn mark(scene: &mut Scene, object: u32, kind: MarkKind) {
    scene.marks.push(Mark {
        object,
        primitive: None,
        kind,
    });
}

fn portal(name: &str) -> MarkKind {
    MarkKind::Portal(name.into())
}

fn baked(scene: &Scene) -> BakeOutput {
    bake(scene, &BakeConfig::default(), &BakeContext::default()).unwrap()
}

/// A rectangle in the plane `x`, seen from larger x, or from smaller x if it is turned.
fn at_x(x: f32, [y0, y1]: [f32; 2], [z0, z1]: [f32; 2], is_turned: bool) -> Vec<[f32; 3]> {
    let mut out = vec![[x, y0, z1], [x, y0, z0], [x, y1, z0], [x, y1, z1]];
    if is_turned {
        out.reverse();
    }
    out
}

/// A rectangle in the plane `z`, seen from larger z.
fn at_z(z: f32, [x0, x1]: [f32; 2], [y0, y1]: [f32; 2]) -> Vec<[f32; 3]> {
    vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]
}

fn named<'a>(out: &'a BakeOutput, name: &str) -> &'a SpecialPortal {
    let specials = &out.world.graph.specials;
    let found = specials.iter().find(|s| s.name == name);
    found.unwrap_or_else(|| panic!("no {name}: {:?}", out.notes))
}

/// The normal of a special portal, away from those who look.
fn outward(out: &BakeOutput, name: &str) -> DVec3 {
    let graph = &out.world.graph;
    let id = graph
        .special_ids()
        .find(|s| graph.specials[s.idx()].name == name);
    graph.special_opening(id.unwrap()).0
}

#[test]
fn mirrors_hang_where_they_are_modeled_and_look_into_their_room() {
    let mut scene = two_rooms().scene;
    let plain = baked(&scene);
    let quads: [(&str, Vec<[f32; 3]>, DVec3); 4] = [
        // In the wall, a little before it, facing it by mistake, and free in the room.
        ("in", at_x(0.0, [0.8, 2.0], [0.5, 1.5], false), -DVec3::X),
        ("on", at_x(9.18, [0.8, 2.0], [0.5, 1.5], true), DVec3::X),
        (
            "astray",
            at_x(9.18, [0.8, 2.0], [2.0, 3.0], false),
            DVec3::X,
        ),
        ("free", at_z(2.0, [1.0, 2.0], [0.5, 1.5]), -DVec3::Z),
    ];
    for (name, quad, _) in &quads {
        let object = add(&mut scene, name, Role::Detail, &[quad]);
        mark(&mut scene, object, MarkKind::Mirror);
    }
    // Many sides, and as many triangles as a face around its middle has.
    let round: Vec<[f32; 3]> = (0..24)
        .map(|i| (i as f32 * std::f32::consts::TAU / 24.0).sin_cos())
        .map(|(s, c)| [3.0 + 0.4 * c, 1.5 + 0.4 * s, 0.001])
        .collect();
    let object = add(&mut scene, "round", Role::Detail, &[&round]);
    mark(&mut scene, object, MarkKind::Mirror);
    let out = baked(&scene);
    assert!(out.notes == plain.notes, "{:?}", out.notes);
    out.world.validate().unwrap();
    for (name, quad, normal) in &quads {
        let special = named(&out, name);
        assert!(matches!(special.passes[0].way, Way::Mirror), "{name}");
        assert_eq!(outward(&out, name), *normal, "{name}");
        let (_, pieces) = {
            let graph = &out.world.graph;
            let id = (graph.special_ids()).find(|s| graph.specials[s.idx()].name == *name);
            graph.special_opening(id.unwrap())
        };
        assert_eq!(pieces.len(), 1);
        for p in quad {
            let p = DVec3::from_array(p.map(f64::from));
            assert!(
                pieces[0].points.iter().any(|q| q.distance(p) < 1e-6),
                "{name} {p}"
            );
        }
        let graph = &out.world.graph;
        let before = pieces[0].centroid() - *normal * 0.5;
        assert_eq!(graph.locator.locate(before), Some(special.cell), "{name}");
    }
    assert_eq!(named(&out, "round").cell, named(&out, "in").cell);
    // The rooms are as without them, and nothing counts as edited.
    assert_eq!(out.world.graph.portals, plain.world.graph.portals);
    assert_eq!(out.world.graph.cells.len(), plain.world.graph.cells.len());
    assert!(out.world.graph.cells.iter().all(|c| !c.why.is_empty()));
    assert_eq!(out.world.graph.statistics.counts.get("edits"), None);
    assert_eq!(out.world.details.len(), 5);
}

#[test]
fn two_portals_of_a_name_lead_to_each_other() {
    let mut scene = two_rooms().scene;
    let one = at_x(0.0, [0.0, 2.0], [1.5, 2.5], false);
    let other = at_z(0.0, [6.5, 7.5], [0.0, 2.0]);
    let object = add(&mut scene, "west end", Role::Detail, &[&one]);
    mark(&mut scene, object, portal("a"));
    let object = add(&mut scene, "east end", Role::Structural, &[&other]);
    mark(&mut scene, object, portal("a"));
    // Both ends in one object.
    let (low, high) = (
        at_x(0.0, [0.5, 1.0], [3.0, 3.5], false),
        at_x(9.2, [0.5, 1.0], [3.0, 3.5], true),
    );
    let object = add(&mut scene, "both", Role::Detail, &[&low, &high]);
    mark(&mut scene, object, portal("b"));
    let out = baked(&scene);
    out.world.validate().unwrap();
    let (west, east) = (named(&out, "west end"), named(&out, "east end"));
    let (to, map) = west.leads_to().unwrap();
    assert_eq!(to, east.cell);
    assert_ne!(west.cell, east.cell);
    // Worked out by hand: who walks in along -x comes out along +z; left stays left.
    let point = |x, y, z| DVec3::new(x, y, z);
    for (from, into) in [
        (point(0.0, 0.0, 2.0), point(7.0, 0.0, 0.0)),
        (point(0.0, 1.2, 1.7), point(6.7, 1.2, 0.0)),
        (point(-1.0, 0.5, 2.0), point(7.0, 0.5, 1.0)),
    ] {
        assert!(
            map.point(from).distance(into) < 1e-6,
            "{from}: {}",
            map.point(from)
        );
    }
    let (_, back) = east.leads_to().unwrap();
    assert!(map.after(back).is_near(&Similarity::IDENTITY, 10.0, 1e-9));
    let both = out.world.graph.specials.iter().filter(|s| s.name == "both");
    assert_eq!(both.count(), 2);
}

#[test]
fn what_is_no_mirror_or_pair_stays_geometry_and_is_told_with_place_and_reason() {
    let mut scene = two_rooms().scene;
    let quad = at_x(0.0, [0.8, 2.0], [0.5, 1.5], false);
    let mut bent = quad.clone();
    bent[2][0] = 0.03;
    let shape: Vec<[f32; 3]> = [
        [1.0, 1.0],
        [2.0, 1.0],
        [2.0, 1.4],
        [1.4, 1.4],
        [1.4, 2.0],
        [1.0, 2.0],
    ]
    .map(|[x, y]| [x, y, 0.0])
    .to_vec();
    let line = at_x(0.0, [0.8, 0.8], [0.5, 1.5], false);
    let far = at_x(-3.0, [0.8, 2.0], [0.5, 1.5], false);
    let inside = at_z(2.0, [1.0, 1.1], [-0.2, -0.1]);
    let wide = at_x(9.2, [0.8, 2.0], [0.5, 2.5], true);
    let mirrors: [(&str, &[[f32; 3]]); 4] = [
        ("bent", &bent),
        ("corner", &shape),
        ("line", &line),
        ("walled", &inside),
    ];
    for (name, polygon) in mirrors {
        let object = add(&mut scene, name, Role::Detail, &[polygon]);
        mark(&mut scene, object, MarkKind::Mirror);
    }
    let portals: [(&str, &[[f32; 3]], &str); 7] = [
        ("alone", &quad, "a"),
        ("first", &quad, "b"),
        ("second", &quad, "b"),
        ("third", &far, "b"),
        ("nameless", &quad, ""),
        ("narrow", &quad, "c"),
        ("wide", &wide, "c"),
    ];
    for (name, polygon, of) in portals {
        let object = add(&mut scene, name, Role::Detail, &[polygon]);
        mark(&mut scene, object, portal(of));
    }
    let out = baked(&scene);
    let made = &out.world.graph.specials;
    assert!(made.is_empty(), "{made:?}");
    assert_eq!(out.world.details.len(), 11);
    assert_eq!(out.world.graph.statistics.counts.get("edits"), None);
    for words in [
        &[
            "'bent' at 0.01,1.40,1.00",
            "mm off its plane",
            "stays plain geometry",
            "flat",
        ][..],
        &[
            "'corner' at 1.50,1.50,0.00",
            "0.640 m² of a hull of 0.820 m²",
            "convex",
        ],
        &["'line'", "no area"],
        &["'walled' at 1.05,-0.15,2.00", "no cell is within"],
        &[
            "'alone' at 0.00,1.40,1.00",
            "no other flat object is called portal:a",
        ],
        &[
            "'first' at",
            "'second' at",
            "'third' at",
            "3 objects are called portal:b",
            "stay plain",
        ],
        &["'nameless'", "needs a name"],
        &[
            "'narrow' at 0.00,1.40,1.00 (to wide at 9.20,1.40,1.50)",
            "one shape",
        ],
    ] {
        let is_it = |note: &&String| words.iter().all(|w| note.contains(w));
        assert_eq!(
            out.notes.iter().filter(is_it).count(),
            1,
            "{words:?}: {:#?}",
            out.notes
        );
    }
}

#[test]
fn equal_scenes_give_equal_bytes_and_many_problems_a_short_note() {
    let mut scene = two_rooms().scene;
    let quads = [
        at_x(0.0, [0.8, 2.0], [0.5, 1.5], false),
        at_x(0.0, [0.8, 2.0], [2.0, 3.0], false),
    ];
    for (i, quad) in (0..).zip(&quads) {
        let object = add(&mut scene, "m", Role::Detail, &[quad]);
        let kind = [MarkKind::Mirror, portal("x")][i].clone();
        mark(&mut scene, object, kind);
    }
    let other = add(
        &mut scene,
        "p",
        Role::Detail,
        &[&at_x(9.2, [0.8, 2.0], [2.0, 3.0], true)],
    );
    mark(&mut scene, other, portal("x"));
    for i in 0..10 {
        let mut bent = quads[0].clone();
        bent[0][0] += 0.02 + 0.001 * i as f32;
        let object = add(&mut scene, "bent", Role::Detail, &[&bent]);
        mark(&mut scene, object, MarkKind::Mirror);
    }
    let [first, again] = [(); 2].map(|()| baked(&scene));
    let bytes = encode_glb(&first.world).unwrap();
    assert_eq!(bytes, encode_glb(&again.world).unwrap());
    let read = decode_glb(&bytes).unwrap();
    assert_eq!(read.graph.specials, first.world.graph.specials);
    assert_eq!(read.graph.specials.len(), 3);
    let told: Vec<&String> = first
        .notes
        .iter()
        .filter(|n| n.contains("'bent'"))
        .collect();
    assert_eq!(told.len(), 1);
    assert!(told[0].contains("and 7 more stay plain"), "{}", told[0]);
    assert_eq!(told[0].matches("'bent'").count(), 3);
}
