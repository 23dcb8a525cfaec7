//! Importers of scenes.

use enfilade_geom::DVec3;
use enfilade_geom::scene::Role;
use enfilade_import::{
    CleaningOptions, HeightOptions, ImportError, ImportOptions, Imported, Limits, VolumeOptions, cleaning_report, decode_gltf,
    decode_e57, decode_heights, decode_implicit, decode_las, decode_map, decode_obj, decode_patches, decode_ply, decode_stl, decode_volume, decode_vox, export_glb, read_prt, read_pvs_text, write_prt,
    write_pvs_text,
};

/// glTF, JSON or binary.
pub fn gltf(data: &[u8]) {
    check(decode_gltf(data, &options()));
}

/// Wavefront OBJ.
pub fn obj(data: &[u8]) {
    check(decode_obj(data, &options()));
}

/// Quake maps.
pub fn map(data: &[u8]) {
    check(decode_map(data, &options()));
}

/// PLY.
pub fn ply(data: &[u8]) {
    check(decode_ply(data, &options()));
}

/// Implicit scenes.
pub fn implicit(data: &[u8]) {
    check(decode_implicit(data, &options()));
}

/// Free-form patches in JSON.
pub fn patches(data: &[u8]) {
    check(decode_patches(data, &options()));
}

/// Volumes: NIfTI, NRRD and headers of raw samples, at a level that most values are not on.
pub fn volume(data: &[u8]) {
    let options = ImportOptions {
        volume: VolumeOptions {
            level: Some(0.5),
            air: None,
        },
        ..options()
    };
    check(decode_volume(data, &options));
}

/// Clouds of points in PLY, with a place of the scanner.
pub fn scan(data: &[u8]) {
    let options = ImportOptions {
        stations: vec![DVec3::new(0.5, 0.5, 0.5)],
        ..options()
    };
    check(decode_ply(data, &options));
}

/// Height maps: PNG and TIFF.
pub fn heights(data: &[u8]) {
    let options = ImportOptions {
        heights: HeightOptions {
            cell: Some(1.0),
            heights: Some([0.0, 10.0]),
        },
        ..options()
    };
    check(decode_heights(data, &options));
}

/// Scans in E57.
pub fn e57(data: &[u8]) {
    quiet();
    check(decode_e57(data, &options()));
}

/// Scans in LAS and LAZ, with a place of the scanner; of few voxels, since most damage leaves points that are carved.
pub fn las(data: &[u8]) {
    let mut options = ImportOptions {
        stations: vec![DVec3::new(0.5, 0.5, 0.5)],
        ..options()
    };
    options.limits.max_file_bytes = 1 << 15;
    quiet();
    check(decode_las(data, &options));
}

/// Lets panics through that the importer turns into errors: those of readers of other projects.
fn quiet() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let abort = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let is_theirs = |l: &std::panic::Location<'_>| {
                ["/e57-", "/las-", "/laz-"].iter().any(|c| l.file().contains(c))
            };
            if !info.location().is_some_and(is_theirs) {
                abort(info);
            }
        }));
    });
}

/// STL.
pub fn stl(data: &[u8]) {
    check(decode_stl(data, &options()));
}

/// Models of MagicaVoxel.
pub fn vox(data: &[u8]) {
    check(decode_vox(data, &options()));
}

/// Portal files and text PVS: a decoded file is encoded and decoded alike.
pub fn prt(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Ok(file) = read_prt(text) {
        assert_eq!(read_prt(&write_prt(&file)).as_ref(), Ok(&file));
    }
    if let Ok(pvs) = read_pvs_text(text) {
        let again = read_pvs_text(&write_pvs_text(&pvs)).map(|p| p.rows);
        assert_eq!(again, Ok(pvs.rows));
    }
}

/// Small limits, but scenes of any extent: most inputs would end at that check otherwise.
fn options() -> ImportOptions {
    ImportOptions {
        limits: Limits {
            max_extent: f64::INFINITY,
            min_extent: 0.0,
            max_coordinate: f64::INFINITY,
            ..Limits::tiny()
        },
        ..ImportOptions::default()
    }
}

/// An imported scene keeps the scene's promises, and can be inspected, exported and imported again.
fn check(result: Result<Imported, ImportError>) {
    let imported = match result {
        Ok(imported) => imported,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let scene = &imported.scene;
    let n = |scene: &enfilade_geom::scene::Scene| {
        [Role::Structural, Role::Detail].map(|role| scene.triangle_sources(role).count())
    };
    for role in [Role::Structural, Role::Detail] {
        for source in scene.triangle_sources(role) {
            assert!(scene.world_triangle(source).iter().all(|p| p.is_finite()));
        }
    }
    for object in &scene.objects {
        assert!(object.transform.determinant() >= 0.0);
    }
    let cleaning = CleaningOptions {
        has_detail: true,
        ..CleaningOptions::default()
    };
    let report = cleaning_report(scene, Some(&imported.report), &cleaning).expect("good options");
    assert!(!report.to_string().is_empty());
    let mut options = options();
    // The export is longer than the input, since less of it is shared.
    options.limits = Limits {
        max_extent: f64::INFINITY,
        min_extent: 0.0,
        ..Limits::default()
    };
    options.limits.max_coordinate = f64::INFINITY;
    let again = decode_gltf(&export_glb(scene), &options).expect("what is written can be read");
    let total = |n: [usize; 2]| n[0] + n[1];
    assert_eq!(total(n(&again.scene)), total(n(scene)));
}
