//! Implicit scenes: bounds of boxes, work by surface, errors with their places. Covers S3.

use std::sync::Arc;
use std::time::{Duration, Instant};

use enfilade_geom::{Aabb, Allowance, DVec3};
use enfilade_source::{ExtractOptions, Field, ImplicitScene, SourceLimits, extract};

fn parse(text: &str) -> ImplicitScene {
    ImplicitScene::parse(text.as_bytes(), &SourceLimits::default()).unwrap()
}

fn scene(key: &str, shape: &str) -> String {
    format!(r#"{{"enfilade":"implicit","{key}":{shape}}}"#)
}

/// One shape of each kind, and each kind of combination.
const ALL: &str = r#"{"union":[
    {"ball":{"at":[1,2,3],"radius":1.5}},
    {"place":{"of":{"box":{"min":[0,0,0],"max":[2,1,3]}},"scale":1.3,"turn":[10,20,30],"by":[4,0,1]}},
    {"smooth_union":{"by":0.6,"of":[
        {"tube":{"points":[[0,0,0],[3,1,0],[4,3,1]],"radius":0.4}},
        {"torus":{"at":[3,1,2],"axis":[1,2,0],"radii":[2,0.5]}},
        {"ball":{"at":[9,9,9],"radius":0.5}}]}},
    {"intersection":[{"gyroid":{"period":3}},{"plane":{"at":[1,1,1],"normal":[1,1,1]}},{"ball":{"at":[0,0,0],"radius":4}}]},
    {"difference":[{"grow":{"of":{"ball":{"at":[6,6,6],"radius":1}},"by":0.5}},{"not":{"ball":{"at":[6,6,7],"radius":2}}}]},
    {"shell":{"of":{"ball":{"at":[-3,0,0],"radius":2}},"thickness":0.3}}]}"#;

#[test]
fn ranges_and_narrowed_fields_agree_with_the_values_of_points() {
    let whole = parse(&scene("matter", ALL));
    let mut seed = 1_u64;
    let mut next = || {
        seed = seed.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(1);
        (seed >> 40) as f64 / f64::from(1 << 24)
    };
    for _ in 0..2000 {
        let min = DVec3::new(next(), next(), next()) * 16.0 - 5.0;
        let within = Aabb::new(min, min + DVec3::new(next(), next(), next()) * 3.0);
        let range = whole.range(&within);
        let narrowed = whole.narrowed(&within);
        for _ in 0..20 {
            let p = within.min + within.size() * DVec3::new(next(), next(), next());
            let value = whole.at(p);
            assert!(
                range.lo <= value && value <= range.hi,
                "{range:?} {value} at {p}"
            );
            if let Some(narrowed) = &narrowed {
                assert_eq!(narrowed.at(p), value, "at {p}");
            }
        }
    }
}

#[test]
fn time_grows_with_the_surface_and_not_with_the_volume() {
    let n = |edge: u32| {
        let text = format!(
            r#"{{"enfilade":"implicit","step":0.1,"outside":"matter","box":[[0,0,0],[{edge},{edge},{edge}]],
                "air":{{"ball":{{"at":[2,2,2],"radius":1.5}}}}}}"#
        );
        parse(&text)
            .surface(&SourceLimits::default())
            .unwrap()
            .n_samples
    };
    let (small, large) = (n(4), n(400));
    assert!(large < small * 2, "{small} {large}");
}

#[test]
fn edges_of_a_house_stay_sharp_and_its_walls_flat() {
    let house = parse(&scene(
        "matter",
        r#"{"difference":[{"box":{"min":[0,0,0],"max":[5,3,4]}},{"box":{"min":[0.3,0.2,0.3],"max":[4.7,2.8,3.7]}},
            {"box":{"min":[-1,0.2,1],"max":[1,2.2,2]}}]}"#,
    ));
    let surface = house.surface(&SourceLimits::default()).unwrap();
    assert!(surface.triangles.len() < 80, "{}", surface.triangles.len());
    for p in &surface.positions {
        assert!(house.at(*p).abs() < 1e-6, "{p}");
    }
    assert!(surface.distance < 0.01, "{}", surface.distance);
}

#[test]
fn the_distance_covers_what_a_coarse_step_leaves_off() {
    let ball = parse(&scene("matter", r#"{"ball":{"at":[0,0,0],"radius":1}}"#));
    for step in [0.05, 0.1, 0.3] {
        let options = ExtractOptions::of_step(ball.bounds(), step);
        let surface = extract(&ball, &options, &SourceLimits::default()).unwrap();
        let corners = |t: &[u32; 3]| t.map(|i| surface.positions[i as usize]);
        let middles = surface
            .triangles
            .iter()
            .map(|t| corners(t).iter().sum::<DVec3>() / 3.0);
        let off = middles
            .map(|p| (p.length() - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(
            off <= surface.distance,
            "{step}: {off} {}",
            surface.distance
        );
        assert!(
            surface.distance < step * 0.5,
            "{step}: {}",
            surface.distance
        );
    }
}

#[test]
fn errors_name_the_place_and_the_remedy() {
    let ball = r#"{"ball":{"at":[0,0,0],"radius":1}}"#;
    let deep = format!("{}{ball}{}", r#"{"not":"#.repeat(40), "}".repeat(40));
    let limits = SourceLimits {
        max_nodes: 50,
        max_depth: 30,
        ..SourceLimits::default()
    };
    let many = format!(r#"{{"union":[{}]}}"#, vec![ball; 60].join(","));
    for (text, place, problem) in [
        ("{".to_owned(), "line 1", "not JSON"),
        ("[]".to_owned(), "scene", "object"),
        (scene("stone", ball), "scene", "'stone' is unknown"),
        (
            r#"{"enfilade":"implicit"}"#.to_owned(),
            "scene",
            "\"matter\" or \"air\"",
        ),
        (scene("air", r#"{"cube":{}}"#), "air.cube", "is no shape"),
        (
            scene("air", r#"{"ball":{"at":[0,0,0]}}"#),
            "air.ball",
            "\"radius\" is missing",
        ),
        (
            scene("air", r#"{"ball":{"at":[0,0],"radius":1}}"#),
            "air.ball.at",
            "three numbers",
        ),
        (
            scene("air", r#"{"ball":{"at":[0,0,1e300],"radius":1}}"#),
            "air.ball.at",
            "1e9",
        ),
        (
            scene("air", r#"{"ball":{"at":[0,0,0],"radius":-1}}"#),
            "air.ball.radius",
            "length",
        ),
        (scene("air", r#"{"union":[]}"#), "air.union", "list"),
        (
            scene("air", r#"{"box":{"min":[0,0,0],"max":[1,0,1]}}"#),
            "air.box",
            "empty",
        ),
        (
            scene("air", r#"{"gyroid":{"period":2}}"#),
            "air",
            "has no end",
        ),
        (
            scene(
                "air",
                r#"{"torus":{"at":[0,0,0],"axis":[0,0,0],"radii":[2,1]}}"#,
            ),
            "air.torus.axis",
            "zero",
        ),
        (scene("air", &deep), "not", "nested"),
        (scene("air", &many), "union", "more than 50 shapes"),
        (
            format!(r#"{{"enfilade":"implicit","step":1e-9,"air":{ball}}}"#),
            "step",
            "too fine",
        ),
    ] {
        let error = ImplicitScene::parse(text.as_bytes(), &limits).unwrap_err();
        assert!(
            error.place.contains(place) && error.problem.contains(problem),
            "{text}: {error}"
        );
    }
    let nothing = r#"{"intersection":[{"ball":{"at":[0,0,0],"radius":1}},{"ball":{"at":[1.2,1.2,0],"radius":0.4}}]}"#;
    assert!(
        parse(&scene("air", nothing))
            .surface(&SourceLimits::default())
            .is_err()
    );
}

#[test]
fn endless_work_ends_early() {
    let limits = SourceLimits {
        max_work: 100_000,
        ..SourceLimits::default()
    };
    let text = r#"{"enfilade":"implicit","step":0.001,"box":[[0,0,0],[10,10,10]],"matter":{"gyroid":{"period":0.01}}}"#;
    // Beforehand, and where time is limited as it goes on.
    let error = parse(text).surface(&limits).unwrap_err();
    assert!(error.problem.contains("a step of"), "{error}");
    let until = Instant::now() + Duration::from_secs(1000);
    let timed = SourceLimits {
        allowance: Some(Arc::new(Allowance::new(u64::MAX, Some(until)))),
        ..limits
    };
    let error = parse(text).surface(&timed).unwrap_err();
    assert!(error.problem.contains("coarser step"), "{error}");
}
