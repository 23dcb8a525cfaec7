//! A world's data about its source match the source.

use crate::houses;

use enfilade_cpg::World;
use enfilade_geom::DMat4;
use enfilade_geom::scene::Role;
use enfilade_testkit::tamper::{ShownBy, tamperings};
use enfilade_verify::{
    SourceDetail, VerifyOptions, compare_details, compare_scene, structural_triangles, verify_world,
};
use houses::{HOUSE, SCENE, SLITS, verify};

type Change = fn(&mut World, usize);

/// Returns one of three details in the house.
fn detail(w: &World, place: usize) -> usize {
    let is_in_room = |&i: &usize| matches!(w.details[i].cells[..], [c] if !w.graph[c].outdoor);
    let fit: Vec<usize> = (0..w.details.len()).filter(is_in_room).collect();
    fit[place * (fit.len() - 1) / 2]
}

#[test]
fn what_a_file_cannot_tell_its_source_does() {
    assert_eq!(compare_scene(&HOUSE, &SCENE), [""; 0]);
    assert_eq!(of_scene(&HOUSE), [""; 0]);
    let mut n = 0;
    for tampering in tamperings().filter(|t| t.shown_by == ShownBy::Source) {
        for place in 0..3 {
            let Some(world) = tampering.apply(&HOUSE, place) else {
                continue;
            };
            let said = [compare_scene(&world, &SCENE), of_scene(&world)].concat();
            let is_said = !said.is_empty() || !verify(&world, 0).holds();
            assert!(is_said, "{}, place {place}", tampering.name);
            assert!(said.len() < 20, "{said:?}");
            n += 1;
        }
    }
    assert!(n >= 20, "{n}");
}

/// Returns problems of the details of the house.
fn of_scene(w: &World) -> Vec<String> {
    let ids = 0..SCENE.objects.len();
    let ids: Vec<usize> = ids
        .filter(|&i| SCENE.objects[i].role == Role::Detail)
        .collect();
    compare_details(w, ids.len(), |i| {
        let object = &SCENE.objects[ids[i]];
        let own = SCENE.triangle_sources(Role::Detail);
        let own = own.filter(|t| t.object as usize == ids[i]);
        SourceDetail {
            name: object.name.clone(),
            source: object.node,
            triangles: own.map(|t| SCENE.world_triangle(t)).collect(),
        }
    })
}

#[test]
fn an_unrelated_source_is_named_as_such() {
    let triangles = |w: &World| -> Vec<enfilade_geom::Triangle> {
        let own = structural_triangles(w);
        own.into_iter().map(|t| t.0).collect()
    };
    let options = VerifyOptions {
        rays: 5_000,
        ..VerifyOptions::default()
    };
    let report = verify_world(&HOUSE, Some(&triangles(&HOUSE)), &options);
    assert!(report.holds(), "{report}");
    for other in [triangles(&SLITS), Vec::new()] {
        let report = verify_world(&HOUSE, Some(&other), &options);
        let said = report.problems.iter().any(|p| p.contains("another scene"));
        assert!(said, "{report}");
    }
}

/// Returns a detail of a world as a detail of the source scene.
fn detail_of(w: &World, i: usize) -> SourceDetail {
    let d = &w.details[i];
    let by = DMat4::from_cols_array(&d.transform.map(f64::from));
    let mut triangles = Vec::new();
    for p in &w.detail_meshes[d.mesh as usize].primitives {
        triangles.extend(p.placed_triangles(by));
    }
    SourceDetail {
        name: d.name.clone(),
        source: d.source,
        triangles,
    }
}

#[test]
fn details_are_where_the_source_has_them() {
    let n = HOUSE.details.len();
    let problems = |w: &World| compare_details(w, n, |i| detail_of(&HOUSE, i));
    assert_eq!(problems(&HOUSE), [""; 0]);
    // Order does not matter.
    let mut turned = HOUSE.clone();
    turned.details.reverse();
    assert_eq!(problems(&turned), [""; 0]);
    let changes: [(&str, Change); 5] = [
        ("moved within its room", |w, at| {
            let i = detail(w, at);
            w.details[i].transform[12] += 0.01;
        }),
        ("turned about where it is", |w, at| {
            let i = detail(w, at);
            let t = &mut w.details[i].transform;
            let by = DMat4::from_cols_array(&t.map(f64::from));
            let spun = by * DMat4::from_rotation_y(0.1);
            *t = spun.to_cols_array().map(|v| v as f32);
        }),
        ("taken away, and never counted", |w, at| {
            let i = detail(w, at);
            w.details.remove(i);
        }),
        ("twice", |w, at| {
            let twice = w.details[detail(w, at)].clone();
            w.details.push(twice);
        }),
        ("of another shape", |w, at| {
            let mesh = w.details[detail(w, at)].mesh as usize;
            w.detail_meshes[mesh].primitives[0].positions[0][1] += 0.01;
        }),
    ];
    for (name, change) in changes {
        for place in 0..3 {
            let mut world = HOUSE.clone();
            change(&mut world, place);
            let said = problems(&world);
            assert!(!said.is_empty() && said.len() <= 22, "{name}: {said:?}");
            assert!(!said[0].contains("another scene"), "{name}: {said:?}");
        }
    }
    let said = compare_details(&HOUSE, 0, |i| detail_of(&HOUSE, i));
    assert!(said.len() == 1 && said[0].contains("other settings"));
}

/// Returns the world with every third triangle of a detail taken out as a part.
fn divided(whole: usize) -> World {
    let mut world = HOUSE.clone();
    let mesh = world.detail_meshes[world.details[whole].mesh as usize].clone();
    for is_part in [false, true] {
        let mut part = mesh.clone();
        for p in &mut part.primitives {
            let triangles = p.indices.chunks_exact(3).enumerate();
            let own = triangles.filter(|(t, _)| (t % 3 == 0) == is_part);
            p.indices = own.flat_map(|(_, t)| t.to_vec()).collect();
        }
        world.detail_meshes.push(part);
        let mesh = world.detail_meshes.len() as u32 - 1;
        if is_part {
            let mut detail = world.details[whole].clone();
            (detail.mesh, detail.part_of) = (mesh, Some(whole as u32));
            world.details.push(detail);
        } else {
            world.details[whole].mesh = mesh;
        }
    }
    world
}

#[test]
fn a_part_is_where_the_source_has_its_whole() {
    let n = HOUSE.details.len();
    let problems = |w: &World| compare_details(w, n, |i| detail_of(&HOUSE, i));
    let mut world = divided(n / 2);
    assert_eq!(problems(&world), [""; 0]);
    let is_told = |w: &World| {
        let found = verify(w, 0).problems;
        found
            .iter()
            .any(|p| p.contains("not of its name and source"))
    };
    let called = tamperings().find(|t| t.name.starts_with("a part called"));
    let called = called.and_then(|t| t.apply(&world, 0)).unwrap();
    assert!(is_told(&called) && !is_told(&world));
    let part = world.details.len() - 1;
    world.details[part].transform[13] += 0.01;
    assert!(!problems(&world).is_empty());
    world.details.pop();
    assert!(!problems(&world).is_empty());
}
