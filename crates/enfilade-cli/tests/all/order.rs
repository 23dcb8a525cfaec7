//! The same scene in another order gives the same file, by every builder.

use std::path::Path;
use std::process::Command;

use enfilade::import::export_glb;
use enfilade_geom::scene::Scene;
use enfilade_testkit::mixed::{pitched_roof_attic, rooms_with_closet};
use enfilade_testkit::{TowerParams, office_tower, shuffled_glb};

/// The bytes of the world baked from files in a folder.
fn baked(dir: &Path, files: &[&str], method: &str) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_enfilade"));
    command.current_dir(dir).arg("bake").args(files);
    let done = command
        .args(["--method", method, "-o", "world.glb"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    std::fs::read(dir.join("world.glb")).unwrap()
}

#[test]
fn any_order_of_triangles_vertices_nodes_and_files_gives_the_same_bytes() {
    let dir = std::env::temp_dir().join(format!("enfilade-order-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.join(name), bytes).unwrap();
    let scenes: [(&str, Scene); 3] = [
        ("closet", rooms_with_closet().scene),
        ("attic", pitched_roof_attic().scene),
        ("tower", office_tower(&TowerParams::with_rooms(4, 3)).scene),
    ];
    for (name, scene) in scenes {
        // Half of the objects in each of two files.
        let mut halves = [scene.clone(), scene];
        for (half, one) in halves.iter_mut().enumerate() {
            let mut n = 0;
            one.objects.retain(|_| {
                n += 1;
                n % 2 == half
            });
        }
        let halves = halves.map(|half| export_glb(&half));
        for method in ["watershed", "bsp", "delaunay"] {
            write("a.glb", &halves[0]);
            write("b.glb", &halves[1]);
            let plain = baked(&dir, &["a.glb", "b.glb"], method);
            // Another half a minute of tetrahedra would tell little.
            let n_orders = if method == "delaunay" { 1 } else { 2 };
            for seed in 0..n_orders {
                write("a.glb", &shuffled_glb(&halves[0], seed));
                write("b.glb", &shuffled_glb(&halves[1], seed));
                let other = baked(&dir, &["b.glb", "a.glb"], method);
                assert!(other == plain, "{name} by {method}, seed {seed}");
            }
        }
    }
    std::fs::remove_dir_all(&dir).unwrap();
}
