//! Objects called `mirror` or `portal:NAME` are marked, whatever the format. FEATURES: W7, W8.

use crate::common;

use common::{glb, triangle_bin, triangle_json};
use enfilade_geom::scene::{MarkKind, Scene};
use enfilade_import::{ImportOptions, decode_gltf, decode_obj, decode_stl};

/// The marks of a scene: the object's name, its primitive, and the kind.
fn marks(scene: &Scene) -> Vec<(&str, Option<u32>, String)> {
    let kind = |kind: &MarkKind| match kind {
        MarkKind::Mirror => "mirror".to_owned(),
        MarkKind::Portal(name) => format!("portal:{name}"),
    };
    let of = |m: &enfilade_geom::scene::Mark| {
        let object = &scene.objects[m.object as usize];
        (object.name.as_str(), m.primitive, kind(&m.kind))
    };
    scene.marks.iter().map(of).collect()
}

#[test]
fn names_and_extras_of_gltf_nodes_mark() {
    let json = triangle_json(
        r#""scenes":[{"nodes":[0,1,2,3,4]}],"nodes":[
        {"mesh":0,"name":"Mirror_bath"},
        {"mesh":0,"name":"portal:hall.001","translation":[1,0,0]},
        {"mesh":0,"name":"door","extras":{"enfilade":"portal:hall"},"translation":[2,0,0]},
        {"mesh":0,"name":"mirror","extras":{"enfilade":"plain"},"translation":[3,0,0]},
        {"mesh":0,"name":"mirror frame","translation":[4,0,0]}]"#,
    );
    let bytes = glb(&json, &triangle_bin());
    let scene = decode_gltf(&bytes, &ImportOptions::default())
        .unwrap()
        .scene;
    let mut found = marks(&scene);
    found.sort();
    assert_eq!(
        found,
        [
            ("Mirror_bath", None, "mirror".to_owned()),
            ("door", None, "portal:hall".to_owned()),
            ("portal:hall.001", None, "portal:hall".to_owned()),
        ]
    );
    let plain = ImportOptions {
        ignores_marks: true,
        ..ImportOptions::default()
    };
    assert!(decode_gltf(&bytes, &plain).unwrap().scene.marks.is_empty());
    // Without a name of its own, an object has its mesh's.
    let json = triangle_json(r#""scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}]"#);
    let named = json.replace(r#""name":"m""#, r#""name":"mirror""#);
    let scene = decode_gltf(&glb(&named, &triangle_bin()), &ImportOptions::default());
    assert_eq!(marks(&scene.unwrap().scene).len(), 1);
}

#[test]
fn names_of_obj_and_stl_and_materials_mark() {
    let text = b"o Mirror_hall\nv 0 0 0\nv 4 0 0\nv 4 3 0\nf 1 2 3\n\
        o cabinet\nusemtl wood\nv 0 0 1\nv 4 0 1\nv 4 3 1\nf 4 5 6\n\
        usemtl mirror\nv 0 0 2\nv 4 0 2\nv 4 3 2\nf 7 8 9\n";
    let scene = decode_obj(text, &ImportOptions::default()).unwrap().scene;
    let found = marks(&scene);
    assert!(
        found.contains(&("Mirror_hall", None, "mirror".to_owned())),
        "{found:?}"
    );
    let (_, primitive, _) = found
        .iter()
        .find(|f| f.0 == "cabinet")
        .expect("the material marks");
    let cabinet = scene.objects.iter().find(|o| o.name == "cabinet").unwrap();
    let part = &scene.meshes[cabinet.mesh as usize].primitives[primitive.unwrap() as usize];
    assert!(part.positions.iter().all(|p| p[2] == 2.0));
    assert_eq!(found.len(), 2);

    let text = b"solid mirror\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 4 0 0\nvertex 4 3 0\nendloop\nendfacet\nendsolid\n";
    let scene = decode_stl(text, &ImportOptions::default()).unwrap().scene;
    assert_eq!(marks(&scene), [("mirror", None, "mirror".to_owned())]);
}
