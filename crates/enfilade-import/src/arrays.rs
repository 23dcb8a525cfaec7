//! Meshes held as arrays by a program, such as those of a script: no file, but the same rules.

use std::path::Path;

use enfilade_geom::DMat4;
use enfilade_geom::scene::{Mesh, Primitive};

use crate::builder::{Builder, Placement};
use crate::files::Beside;
use crate::{ImportError, ImportOptions, Imported, finish, soup};

/// A placed mesh as arrays.
#[derive(Clone, Debug)]
pub struct ArrayMesh {
    /// Names that may tell its role: its own, and that of its shape; both may be empty.
    pub names: [String; 2],
    /// Vertex positions, in the unit and with the axes of [`ImportOptions`].
    pub positions: Vec<[f64; 3]>,
    /// Triangles as triples of position indices.
    pub triangles: Vec<[u32; 3]>,
    /// Mesh space to the space of the scene.
    pub transform: DMat4,
    /// `true` if it bounds no room, whatever its names.
    pub is_detail: bool,
}

/// Makes a scene of meshes in memory, as [`import`](crate::import()) does of files. `name` stands for the file in messages.
///
/// Normals, materials and pictures are left out. Linear time and memory.
///
/// # Errors
///
/// As [`import`](crate::import()); and if a triangle has a vertex that does not exist.
pub fn import_arrays(
    name: &str,
    meshes: Vec<ArrayMesh>,
    options: &ImportOptions,
) -> Result<Imported, ImportError> {
    let mut builder = Builder::new(options)?;
    builder.begin_file(Path::new(name), Beside::Nothing, false);
    builder.set_format("arrays");
    for (i, mesh) in meshes.into_iter().enumerate() {
        builder.is_detail_file = mesh.is_detail;
        add(&mut builder, i, mesh)?;
    }
    finish(builder, options)
}

fn add(builder: &mut Builder<'_>, i: usize, mut mesh: ArrayMesh) -> Result<(), ImportError> {
    let name = mesh.names.iter().find(|name| !name.is_empty());
    let place = name.map_or_else(|| format!("mesh {i}"), |name| format!("mesh '{name}'"));
    let n = mesh.positions.len();
    builder.add_read_bytes(
        (size_of_val(&mesh.positions[..]) + size_of_val(&mesh.triangles[..])) as u64,
    );
    builder.charge_vertices(&place, n as u64)?;
    builder.check_triangles(&place, mesh.triangles.len() as u64)?;
    let is_bad = |t: &[u32; 3]| t.iter().any(|&v| v as usize >= n);
    if let Some(face) = mesh.triangles.iter().position(is_bad) {
        let problem = format!(
            "face {face} is {:?}, but there are {n} vertices",
            mesh.triangles[face]
        );
        return Err(builder.malformed(place, problem));
    }
    let offset = soup::recenter(&mut mesh.positions);
    let mut primitive = Primitive {
        positions: mesh.positions.iter().map(|p| p.map(|c| c as f32)).collect(),
        indices: mesh.triangles.into_flattened(),
        ..Primitive::default()
    };
    builder.drop_nonfinite(&place, &mut primitive);
    let [own, shape] = &mesh.names;
    let made = builder.push_mesh(Mesh {
        name: shape.clone(),
        primitives: vec![primitive],
    });
    builder.place(&Placement {
        mesh: made,
        names: [own, shape],
        ancestors: &[],
        transforms: &[builder.base * mesh.transform * DMat4::from_translation(offset)],
        moves: None,
        place: &place,
        source: None,
    })
}

#[cfg(test)]
mod tests {
    use enfilade_geom::DVec3;
    use enfilade_geom::scene::Role;

    use super::*;
    use crate::Up;

    fn quad(name: &str) -> ArrayMesh {
        ArrayMesh {
            names: [name.to_owned(), String::new()],
            positions: vec![
                [0.0, 0.0, 0.0],
                [4.0, 0.0, 0.0],
                [4.0, 3.0, 0.0],
                [0.0, 3.0, 0.0],
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            transform: DMat4::IDENTITY,
            is_detail: false,
        }
    }

    #[test]
    fn arrays_are_read_as_a_file_with_the_same_contents() {
        let text = b"o Wall\nv 0 0 0\nv 4 0 0\nv 4 3 0\nv 0 3 0\nf 1 2 3\nf 1 3 4\n";
        let options = ImportOptions::default();
        let of_file = crate::decode_obj(text, &options).unwrap().scene;
        let of_arrays = import_arrays("arrays", vec![quad("Wall")], &options)
            .unwrap()
            .scene;
        let [a, b] = [&of_file, &of_arrays]
            .map(|s| (s.objects[0].clone(), s.meshes[0].primitives[0].clone()));
        assert_eq!(a.0.reason, b.0.reason);
        assert_eq!(a.1.positions, b.1.positions);
        assert_eq!(a.1.indices, b.1.indices);
    }

    #[test]
    fn placements_units_and_axes_hold() {
        let mut far = quad("Desk");
        far.is_detail = true;
        // As in maps: `f32` would round these vertices to half a meter.
        far.transform = DMat4::from_translation(DVec3::new(-4e6, 0.0, 0.0));
        for p in &mut far.positions {
            p[0] += 4e6 + 0.125;
        }
        let options = ImportOptions {
            unit: Some(0.5),
            up: Some(Up::Z),
            ..ImportOptions::default()
        };
        let scene = import_arrays("arrays", vec![quad("Wall"), far], &options)
            .unwrap()
            .scene;
        let desk = (0..2)
            .find(|&i| scene.objects[i].role == Role::Detail)
            .unwrap();
        let aabb = scene.object_aabb(desk);
        assert_eq!(aabb.min.to_array(), [0.0625, 0.0, -1.5]);
        assert_eq!(aabb.max.to_array(), [2.0625, 0.0, 0.0]);
    }

    #[test]
    fn a_vertex_that_does_not_exist_is_an_error() {
        let mut wall = quad("Wall");
        wall.triangles[1] = [0, 2, 4];
        let error = import_arrays("arrays", vec![wall], &ImportOptions::default()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "arrays: mesh 'Wall': face 1 is [0, 2, 4], but there are 4 vertices"
        );
        assert!(import_arrays("arrays", vec![], &ImportOptions::default()).is_err());
    }
}
