//! Free-form surfaces: distance from formulas, shared sides, trimming, bad input. Covers S3.

use std::collections::HashMap;
use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

use enfilade_geom::{DVec2, DVec3};
use enfilade_source::{
    FreeformCurve, FreeformMesh, FreeformScene, FreeformSurface, SourceLimits, SplineBasis,
    TrimCurve, tessellate,
};

const TOLERANCE: f64 = 0.01;

fn patch(degrees: [usize; 2], controls: Vec<(DVec3, f64)>) -> FreeformSurface {
    let bases = degrees.map(|d| SplineBasis::clamped(d, d + 1));
    FreeformSurface {
        place: "patch".into(),
        range: bases.each_ref().map(SplineBasis::range),
        bases,
        controls,
        loops: Vec::new(),
    }
}

/// A full circle as a quadratic spline with weights, about the z axis.
fn circle(radius: f64) -> (SplineBasis, Vec<(DVec2, f64)>) {
    let basis = SplineBasis::bezier(2, &[0.0, 0.25, 0.5, 0.75, 1.0]);
    let controls = (0..9).map(|k| {
        let (sin, cos) = (f64::from(k) * PI / 4.0).sin_cos();
        let (r, w) = if k % 2 == 0 {
            (1.0, 1.0)
        } else {
            (1.0 / FRAC_1_SQRT_2, FRAC_1_SQRT_2)
        };
        (DVec2::new(cos, sin) * r * radius, w)
    });
    (basis, controls.collect())
}

/// A tube from z = 0 to 5.
fn tube(radius: f64) -> FreeformSurface {
    let (basis, ring) = circle(radius);
    let bases = [basis, SplineBasis::clamped(1, 2)];
    let row = |z: f64| ring.iter().map(move |(p, w)| (p.extend(z), *w));
    FreeformSurface {
        place: "tube".into(),
        range: bases.each_ref().map(SplineBasis::range),
        bases,
        controls: row(0.0).chain(row(5.0)).collect(),
        loops: Vec::new(),
    }
}

fn mesh(patches: &[FreeformSurface]) -> FreeformMesh {
    tessellate(patches, TOLERANCE, &SourceLimits::default()).unwrap()
}

/// Points all over the triangles.
fn samples(mesh: &FreeformMesh) -> Vec<DVec3> {
    let mut all = Vec::new();
    for t in mesh.triangles.iter().flatten() {
        let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
        for i in 0..=6 {
            for j in 0..=6 - i {
                let [u, v] = [i, j].map(|k| f64::from(k) / 6.0);
                all.push(a + (b - a) * u + (c - a) * v);
            }
        }
    }
    all
}

fn area(mesh: &FreeformMesh) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
    let triangles = mesh.triangles.iter().flatten().map(corners);
    triangles
        .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0)
        .sum()
}

/// Edges that are not between two triangles.
fn open_edges(mesh: &FreeformMesh) -> Vec<[DVec3; 2]> {
    let mut n: HashMap<[u32; 2], i32> = HashMap::new();
    for &[a, b, c] in mesh.triangles.iter().flatten() {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            *n.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let open = n.into_iter().filter(|(_, n)| *n != 2).map(|(e, _)| e);
    open.map(|e| e.map(|v| mesh.positions[v as usize]))
        .collect()
}

#[test]
fn a_tube_is_within_the_tolerance_and_closed_along_its_seam() {
    let mesh = mesh(&[tube(2.0)]);
    let off = |p: &DVec3| (p.truncate().length() - 2.0).abs();
    let worst = samples(&mesh).iter().map(off).fold(0.0, f64::max);
    assert!(worst <= TOLERANCE && worst > 0.1 * TOLERANCE, "{worst}");
    assert!(mesh.distance <= TOLERANCE, "{}", mesh.distance);
    // Straight along its axis, so that few triangles do.
    let n = mesh.triangles[0].len();
    assert!((40..200).contains(&n), "{n}");
    let is_inner = |e: &&[DVec3; 2]| e.iter().any(|p| (p.z - 2.5).abs() < 2.5 - 1e-9);
    assert_eq!(open_edges(&mesh).iter().find(is_inner), None);
    // Front faces show where u crossed with v points.
    let [a, b, c] = mesh.triangles[0][0].map(|v| mesh.positions[v as usize]);
    assert!((b - a).cross(c - a).dot(a.with_z(0.0)) > 0.0);
}

#[test]
fn patches_that_share_the_curve_of_a_side_share_its_vertices() {
    // Two patches of other degrees and directions, one of them far more curved, along the arc from (-2, 0, 0) to (2, 0, 0).
    let arc = [
        DVec3::new(-2.0, 0.0, 0.0),
        DVec3::new(0.0, 3.0, 0.0),
        DVec3::new(2.0, 0.0, 0.0),
    ];
    let near: Vec<_> = (arc.iter().rev())
        .flat_map(|p| [(*p + DVec3::Z * 4.0, 1.0), (*p, 1.0)])
        .collect();
    let far = [0.0, 2.0, 5.0].map(|z| {
        let bow = if z == 5.0 { 20.0 } else { 0.0 };
        arc.map(|p| (p + DVec3::new(0.0, p.y / 3.0 * bow, -z), 1.0))
    });
    let patches = [patch([1, 2], near), patch([2, 2], far.concat())];
    let mesh = mesh(&patches);
    let on_arc = |e: &&[DVec3; 2]| e.iter().all(|p| p.z == 0.0);
    assert_eq!(open_edges(&mesh).iter().find(on_arc), None);
    assert!(mesh.distance <= TOLERANCE, "{}", mesh.distance);
}

#[test]
fn a_side_that_is_a_point_has_no_triangles_of_its_own() {
    // An eighth of a ball.
    let w = FRAC_1_SQRT_2;
    let controls = [
        [
            (DVec3::X, 1.0),
            (DVec3::new(1.0, 1.0, 0.0), w),
            (DVec3::Y, 1.0),
        ],
        [
            (DVec3::new(1.0, 0.0, 1.0), w),
            (DVec3::new(1.0, 1.0, 1.0), w * w),
            (DVec3::new(0.0, 1.0, 1.0), w),
        ],
        [(DVec3::Z, 1.0), (DVec3::Z, w), (DVec3::Z, 1.0)],
    ];
    let mesh = mesh(&[patch([2, 2], controls.concat())]);
    let off = |p: &DVec3| (p.length() - 1.0).abs();
    let worst = samples(&mesh).iter().map(off).fold(0.0, f64::max);
    assert!(worst <= TOLERANCE, "{worst}");
    assert!((area(&mesh) - PI / 2.0).abs() < 0.02, "{}", area(&mesh));
    assert_eq!(mesh.positions.iter().filter(|p| **p == DVec3::Z).count(), 1);
}

#[test]
fn loops_cut_holes_of_the_right_size_into_flat_and_curved_patches() {
    let (basis, ring) = circle(0.25);
    let controls = ring.iter().map(|(p, w)| (*p + 0.5, *w)).collect();
    let hole = vec![TrimCurve::whole(FreeformCurve { basis, controls })];
    let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)];
    let flat = corners.map(|(x, y)| (DVec3::new(x, y, 0.0), 1.0));
    let mut flat = patch([1, 1], flat.to_vec());
    flat.trim(Vec::new(), vec![hole.clone()]);
    let found = area(&mesh(&[flat]));
    let wanted = 16.0 - PI;
    assert!((found - wanted).abs() < 0.1, "{found} {wanted}");
    // On the tube, a quarter of the way around and of the length: an ellipse on the unrolled tube.
    let mut cut = tube(2.0);
    cut.trim(Vec::new(), vec![hole]);
    let mesh = mesh(&[cut]);
    let (whole, wanted) = (TAU * 2.0 * 5.0, 0.25 * 0.25 * PI);
    // The parameter of a circle with weights is not its angle, but nearly.
    let found = 1.0 - area(&mesh) / whole;
    assert!((found / wanted - 1.0).abs() < 0.1, "{found} {wanted}");
    let off = |p: &DVec3| (p.truncate().length() - 2.0).abs();
    let worst = samples(&mesh).iter().map(off).fold(0.0, f64::max);
    assert!(worst <= TOLERANCE, "{worst}");
}

#[test]
fn a_trimmed_patch_has_the_vertices_of_its_neighbor_where_its_loop_follows_a_side() {
    let (basis, ring) = circle(0.25);
    let controls = ring.iter().map(|(p, w)| (*p + 0.5, *w)).collect();
    let hole = vec![TrimCurve::whole(FreeformCurve { basis, controls })];
    let mut cut = tube(2.0);
    cut.trim(Vec::new(), vec![hole]);
    let mut other = tube(2.0);
    other.controls.iter_mut().for_each(|c| c.0.z = -c.0.z);
    let found = mesh(&[cut, other]);
    let at_joint = |e: &&[DVec3; 2]| e.iter().all(|p| p.z == 0.0);
    assert_eq!(open_edges(&found).iter().find(at_joint), None);
}

#[test]
fn creases_are_edges_of_triangles() {
    // A zigzag of degree 1 whose middle has a hole across its creases.
    let bases = [SplineBasis::clamped(1, 4), SplineBasis::clamped(1, 2)];
    let points = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0), (3.0, 1.0)];
    let row = |z: f64| points.map(|(x, y)| (DVec3::new(x, y, z), 1.0));
    let mut zigzag = FreeformSurface {
        place: "zigzag".into(),
        range: bases.each_ref().map(SplineBasis::range),
        bases,
        controls: [row(0.0), row(2.0)].concat(),
        loops: Vec::new(),
    };
    // A strip across a crease whose shortest edges would cross it.
    let strip = [
        [0.75, 0.05],
        [1.08, 0.38],
        [1.5, 0.8],
        [1.5, 1.0],
        [0.92, 0.42],
        [0.55, 0.05],
        [0.75, 0.05],
    ];
    let strip = TrimCurve::whole(FreeformCurve {
        basis: SplineBasis::clamped(1, strip.len()),
        controls: strip.map(|p| (p.into(), 1.0)).to_vec(),
    });
    let loops = vec![vec![strip]];
    zigzag.trim(loops.clone(), Vec::new());
    let kept = mesh(std::slice::from_ref(&zigzag));
    assert!(kept.distance < 1e-9, "{}", kept.distance);
    zigzag.trim(Vec::new(), loops);
    let cut = mesh(&[zigzag]);
    assert!(cut.distance < 1e-9, "{}", cut.distance);
    let whole = 2.0_f64.sqrt() * 3.0 * 2.0;
    let sum = area(&kept) + area(&cut);
    assert!((sum - whole).abs() < 1e-9, "{sum} {whole}");
}

#[test]
fn patches_in_json_are_read_with_their_defaults() {
    let text = br#"{ "enfilade": "patches", "unit": "cm", "patches": [
        { "name": "Vault", "degrees": [2, 1], "points": [
            [[-200, 250, 0], [0, 450, 0, 0.7], [200, 250, 0]], [[-200, 250, 600], [0, 450, 600, 0.7], [200, 250, 600]]
          ], "holes": [[{ "points": [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8], [0.2, 0.2]] }]] } ] }"#;
    let scene = FreeformScene::parse(text, &SourceLimits::default()).unwrap();
    assert_eq!((scene.unit, scene.patches.len()), (Some(0.01), 1));
    let patch = &scene.patches[0];
    assert_eq!(
        (patch.name.as_str(), patch.surface.loops.len()),
        ("Vault", 2)
    );
    assert_eq!(patch.surface.controls[1].1, 0.7);
    let mesh = tessellate(
        std::slice::from_ref(&patch.surface),
        1.0,
        &SourceLimits::default(),
    )
    .unwrap();
    assert!(mesh.distance <= 1.0 && !mesh.triangles[0].is_empty());
}

#[test]
fn bad_patches_are_refused_with_their_place() {
    let limits = SourceLimits::default();
    let said = |patch: &FreeformSurface| {
        let error = tessellate(std::slice::from_ref(patch), TOLERANCE, &limits)
            .err()
            .unwrap();
        assert_eq!(error.place, "tube");
        error.problem
    };
    let bad = |change: &dyn Fn(&mut FreeformSurface)| {
        let mut patch = tube(2.0);
        change(&mut patch);
        said(&patch)
    };
    assert!(bad(&|p| p.controls[3].0.x = f64::NAN).contains("control point 4 is not finite"));
    assert!(bad(&|p| p.controls[3].1 = 0.0).contains("weight 0"));
    assert!(bad(&|p| p.controls[3].1 = -1.0).contains("weight -1"));
    assert!(bad(&|p| p.controls.truncate(17)).contains("17 control points"));
    assert!(bad(&|p| p.bases[0].knots[4] = 7.0).contains("along u: knot 6 is less"));
    assert!(bad(&|p| p.bases[1].degree = 99).contains("along v: the degree is 99"));
    assert!(bad(&|p| p.range[0] = [0.5, 0.5]).contains("is empty"));
    assert!(bad(&|p| p.range[0] = [0.0, 2.0]).contains("leaves that of the knots"));
    let far = [DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::ONE].map(|p| (p * 9e8, 1.0));
    let error = tessellate(&[patch([1, 1], far.to_vec())], TOLERANCE, &limits)
        .err()
        .unwrap();
    assert!(error.problem.contains("--patch-tolerance"), "{error}");
    let loop_of = |points: &[[f64; 2]]| {
        vec![vec![TrimCurve::whole(FreeformCurve {
            basis: SplineBasis::clamped(1, points.len()),
            controls: points.iter().map(|p| ((*p).into(), 1.0)).collect(),
        })]]
    };
    let bow = [[0.1, 0.1], [0.9, 0.8], [0.9, 0.1], [0.1, 0.95], [0.1, 0.1]];
    assert!(bad(&|p| p.trim(loop_of(&bow), vec![])).contains("cross near u 0."));
    let out = [[0.1, 0.1], [1.5, 0.1], [0.5, 0.5], [0.1, 0.1]];
    assert!(bad(&|p| p.trim(loop_of(&out), vec![])).contains("outside the surface"));
    assert!(bad(&|p| p.trim(loop_of(&[[0.1, 0.1], [0.1, 0.1]]), vec![])).contains("no area"));
}
