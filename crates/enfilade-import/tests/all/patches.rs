//! Free-form patches in OBJ and in JSON. Covers S3.

use enfilade_geom::scene::Role;
use enfilade_import::{ImportError, ImportOptions, Imported, decode_obj, decode_patches};

/// A vault of 4 m by 6 m over a floor, with a round hole, and a wall with faces.
const VAULT: &str = "\
o Floor\nv 0 0 0\nv 4 0 0\nv 4 0 6\nv 0 0 6\nf 4 3 2 1\n\
o Vault\n\
v 0 2 0 1\nv 2 5 0 0.5\nv 4 2 0 1\nv 0 2 6 1\nv 2 5 6 0.5\nv 4 2 6 1\n\
vp 0.6 0.5\nvp 0.6 0.6\nvp 0.5 0.6\nvp 0.4 0.6\nvp 0.4 0.5\nvp 0.4 0.4\nvp 0.5 0.4\nvp 0.6 0.4\n\
cstype bezier\ndeg 2\ncurv2 -8 -7 -6 -5 -4 -3 -2 -1 -8\nparm u 0 1 2 3 4\nend\n\
cstype rat bspline\ndeg 2 1\nsurf 0 1 0 1 -6 -5 -4 -3 \\\n-2 -1\nparm u 0 0 0 1 1 1\nparm v 0 0 1 1\nhole 0 4 1\nend\n\
o Gable\nv 0 2 0\nv 4 2 0\nv 2 3 0\nf -3 -2 -1\n";

fn read(text: &str) -> Result<Imported, ImportError> {
    decode_obj(text.as_bytes(), &ImportOptions::default())
}

fn area(imported: &Imported, object: usize) -> f64 {
    let sources = imported.scene.triangle_sources(Role::Structural);
    let of_object = sources.filter(|s| s.object as usize == object);
    of_object
        .map(|s| imported.scene.world_triangle(s))
        .map(|t| (t[1] - t[0]).cross(t[2] - t[0]).length() / 2.0)
        .sum()
}

#[test]
fn patches_of_obj_are_faces_of_their_object_beside_others() {
    let imported = read(VAULT).unwrap();
    let names: Vec<_> = imported
        .scene
        .objects
        .iter()
        .map(|o| o.name.as_str())
        .collect();
    assert_eq!(names, ["Floor", "Gable", "Vault"]);
    assert_eq!(imported.report.notes, []);
    let surface = imported.report.files[0].surface.as_ref().unwrap();
    assert!(
        surface.distance <= 0.01 && surface.distance > 0.001,
        "{surface:?}"
    );
    assert_eq!(surface.step, None);
    let told = &imported.report.settings;
    assert_eq!(told.keys().collect::<Vec<_>>(), ["surface.distance"]);
    // The conic with weight 1/2 through (0, 2), (4, 2) below (2, 5), by a formula of its own.
    let at = |t: f64| {
        let (a, b, c) = ((1.0 - t) * (1.0 - t), t * (1.0 - t), t * t);
        [
            (2.0 * b + 4.0 * c) / (a + b + c),
            (2.0 * a + 5.0 * b + 2.0 * c) / (a + b + c),
        ]
    };
    let arc: f64 = (0..1000)
        .map(|i| [at(f64::from(i) / 1000.0), at(f64::from(i + 1) / 1000.0)])
        .map(|[p, q]| (p[0] - q[0]).hypot(p[1] - q[1]))
        .sum();
    // The hole is made of four arcs that are parabolas: 0.04 less a tenth in the middle of each.
    let found = area(&imported, 2);
    assert!(
        found > arc * 6.0 * 0.94 && found < arc * 6.0 * 0.97,
        "{found} {arc}"
    );
    // A vertex of the vault is where the faces beside it have theirs.
    let positions =
        &imported.scene.meshes[imported.scene.objects[2].mesh as usize].primitives[0].positions;
    assert!(positions.contains(&[0.0, 2.0, 0.0]) && positions.contains(&[4.0, 2.0, 6.0]));
}

#[test]
fn the_tolerance_of_patches_is_an_option_in_meters() {
    let n = |tolerance: Option<f64>, unit: Option<f64>| {
        let options = ImportOptions {
            patch_tolerance: tolerance,
            unit,
            ..ImportOptions::default()
        };
        let imported = decode_obj(VAULT.as_bytes(), &options).unwrap();
        let surface = imported.report.files[0].surface.clone().unwrap();
        assert!(surface.distance <= tolerance.unwrap_or(0.01), "{surface:?}");
        imported.report.files[0].n_triangles
    };
    let usual = n(None, None);
    assert!(n(Some(0.0001), None) > 2 * usual);
    assert!(n(None, Some(100.0)) > 2 * usual);
    assert_eq!(n(Some(1.0), Some(100.0)), usual);
}

#[test]
fn patches_of_one_name_in_json_are_one_object() {
    let wall = |name: &str, x: f64| {
        format!(
            r#"{{ "name": "{name}", "degrees": [1, 1], "points": [[[{x}, 0, 0], [{x}, 0, 4]], [[{x}, 3, 0], [{x}, 3, 4]]] }}"#
        )
    };
    let text = format!(
        r#"{{ "enfilade": "patches", "unit": "cm", "patches": [{}, {}, {}] }}"#,
        wall("Wall", 0.0),
        wall("Chair 1", 20.0),
        wall("Wall", 50.0)
    );
    let imported = decode_patches(text.as_bytes(), &ImportOptions::default()).unwrap();
    let objects = &imported.scene.objects;
    assert_eq!(objects.len(), 2);
    let wall = objects.iter().position(|o| o.name == "Wall").unwrap();
    assert!((imported.scene.object_aabb(wall).size().x - 0.5).abs() < 1e-6);
}

#[test]
fn bad_patches_are_refused_with_their_line() {
    let said = |from: &str, to: &str| {
        assert!(VAULT.contains(from), "{from}");
        read(&VAULT.replacen(from, to, 1)).unwrap_err().to_string()
    };
    let about = |from: &str, to: &str, wanted: &[&str]| {
        let said = said(from, to);
        for wanted in wanted {
            assert!(said.contains(wanted), "{said}\nhas no: {wanted}");
        }
    };
    about(
        "v 2 5 0 0.5",
        "v 2 NaN 0 0.5",
        &["line 30", "control point 2 is not finite"],
    );
    about("v 2 5 0 0.5", "v 2 5 0 -1", &["line 30", "the weight -1"]);
    about(
        "parm u 0 0 0 1 1 1",
        "parm u 0 0 0 1 1",
        &["line 30", "along u", "6 knots"],
    );
    about(
        "parm u 0 0 0 1 1 1",
        "parm u 0 0 1 0 1 1",
        &["line 30", "knot 4 is less"],
    );
    about("parm v 0 0 1 1\n", "", &["'parm v' is missing"]);
    about(
        "deg 2 1",
        "deg 1000000000 1",
        &["line 28", "not a degree from 1 to 16"],
    );
    about(
        "surf 0 1 0 1",
        "surf 0 1 0 7",
        &["line 30", "leaves that of the knots"],
    );
    about(
        "surf 0 1 0 1 -6 ",
        "surf 0 1 0 1 -60 ",
        &["line 30", "'-60' points at nothing"],
    );
    about(
        "-2 -1\nparm u",
        "-2\nparm u",
        &["line 30", "5 control points", "3 × 2"],
    );
    about(
        "hole 0 4 1",
        "hole 0 4 2",
        &["'2' points at nothing: 1 curves"],
    );
    about(
        "hole 0 4 1",
        "hole 0 9 1",
        &["loop 2", "leaves that of the knots"],
    );
    about("vp 0.6 0.5", "vp 1.6 0.5", &["outside the surface"]);
    about("hole 0 4 1\nend", "hole 0 4 1", &["line 30", "no 'end'"]);
    about(
        "parm u 0 0 0 1 1 1",
        "surf 0 1 0 1 1 2",
        &["line 30 has no 'end'"],
    );
}

#[test]
fn kinds_that_are_not_read_are_noted() {
    let text = VAULT.replace("rat bspline", "rat cardinal");
    let imported = read(&text).unwrap();
    assert_eq!(imported.scene.objects.len(), 2);
    assert!(
        imported.report.notes[0].text.contains("bspline"),
        "{:?}",
        imported.report.notes
    );
}
