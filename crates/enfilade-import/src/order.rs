//! A canonical order of a scene, whatever the order of its files, nodes, triangles and vertices.
//!
//! All later stages may then choose by index, sum and break ties freely: equal scenes are equal lists. The order
//! depends on content alone: names, bits of coordinates, bits of transforms. Items equal in all of that are
//! interchangeable. Equal vertices, pictures, textures, materials and meshes become one; otherwise only the
//! references to them could tell them apart.

use std::cmp::Ordering;
use std::mem::take;

use enfilade_geom::scene::{
    Entity, Fixture, GivenPortal, Image, Material, Mesh, Object, Primitive, RoomName, Scene,
    SourceNode, Texture,
};
use enfilade_geom::{ConvexSolid, DMat4, DVec3};
use enfilade_prepare::GridSteps;
use serde_json::Value;

use crate::textures::map_textures;

/// Puts a scene into its canonical order.
///
/// Scenes with the same objects, of the same triangles, under the same names, become bitwise equal, whatever the
/// order of files, nodes, meshes, primitives, triangles and vertices, and the first vertex of each triangle.
/// [`import`](crate::import) calls it; scenes from other sources need it to give the same world. Drops unused
/// vertices. `n log n` in the number of all items.
///
/// # Panics
///
/// When the scene breaks its own promises: an index out of range, or attributes of unequal lengths.
pub fn sort_scene(scene: &mut Scene) {
    sort(scene, &mut GridSteps::new());
}

/// Works as [`sort_scene`] on meshes that may have been rounded to a grid.
pub(crate) fn sort(scene: &mut Scene, steps: &mut GridSteps) {
    sort_looks(scene);
    sort_meshes(scene, steps);
    sort_objects(scene);
    scene.solids.sort_by(solids);
    scene.sky.sort_by(solids);
    scene.entities.sort_by(entities);
    scene.fixtures.sort_by(fixtures);
    scene.rooms.sort_by(rooms);
    scene.given_portals.sort_by(given_portals);
}

/// Makes pictures, textures and materials unique, and sorts them.
fn sort_looks(scene: &mut Scene) {
    let image_of = make_unique(&mut scene.images, images);
    for texture in &mut scene.textures {
        texture.image = texture.image.map(|i| image_of[i as usize]);
    }
    let texture_of = make_unique(&mut scene.textures, textures);
    for material in &mut scene.materials {
        renumber_textures(material, &texture_of);
    }
    let material_of = make_unique(&mut scene.materials, materials);
    let meshes = scene.meshes.iter_mut();
    for primitive in meshes.flat_map(|m| &mut m.primitives) {
        primitive.material = primitive.material.map(|m| material_of[m as usize]);
    }
}

fn renumber_textures(material: &mut Material, texture_of: &[u32]) {
    if !material.gltf.contains("Texture\"") {
        return;
    }
    let Ok(mut value) = serde_json::from_str::<Value>(&material.gltf) else {
        return;
    };
    let mut number = |_: &str, index: &Value| {
        let texture = index.as_u64().and_then(|i| usize::try_from(i).ok());
        let new = texture.and_then(|i| texture_of.get(i));
        Ok(new.map_or_else(|| index.clone(), |&n| n.into()))
    };
    if map_textures(&mut value, &mut number).is_ok() {
        material.gltf = value.to_string();
    }
}

/// Makes meshes unique, and sorts them and their contents.
fn sort_meshes(scene: &mut Scene, steps: &mut GridSteps) {
    /// A mesh with the grid width of each primitive, 0 for none.
    type Stepped = (Mesh, Vec<f32>);
    let stepped = |(i, mut mesh): (usize, Mesh)| -> Stepped {
        let of = steps.get(&(i as u32)).map_or(&[][..], Vec::as_slice);
        let width = |k: usize| of.get(k).copied().unwrap_or(0.0);
        let primitives = take(&mut mesh.primitives).into_iter().enumerate();
        let mut primitives: Vec<(Primitive, f32)> = primitives
            .map(|(k, mut primitive)| {
                sort_primitive(&mut primitive);
                (primitive, width(k))
            })
            .collect();
        primitives.sort_by(|(p, a), (q, b)| a.total_cmp(b).then_with(|| self::primitives(p, q)));
        let (primitives, steps) = primitives.into_iter().unzip();
        (Mesh { primitives, ..mesh }, steps)
    };
    let mut meshes: Vec<Stepped> = take(&mut scene.meshes)
        .into_iter()
        .enumerate()
        .map(stepped)
        .collect();
    let mesh_of = make_unique(&mut meshes, |(m, a), (n, b)| {
        let by_steps = || floats(a, b);
        let by_primitives = || all(&m.primitives, &n.primitives, primitives);
        (m.name.cmp(&n.name))
            .then_with(by_steps)
            .then_with(by_primitives)
    });
    steps.clear();
    for (i, (mesh, widths)) in meshes.into_iter().enumerate() {
        scene.meshes.push(mesh);
        if widths.iter().any(|&w| w > 0.0) {
            steps.insert(i as u32, widths);
        }
    }
    for object in &mut scene.objects {
        object.mesh = mesh_of[object.mesh as usize];
    }
}

/// Joins equal vertices, starts each triangle at its least vertex, sorts triangles by their vertices, and numbers
/// vertices by their first use.
fn sort_primitive(p: &mut Primitive) {
    let mut is_used = vec![false; p.positions.len()];
    p.indices.iter().for_each(|&i| is_used[i as usize] = true);
    let mut vertices: Vec<([u32; 3], u32)> = (0..p.positions.len() as u32)
        .filter(|&v| is_used[v as usize])
        .map(|v| (p.positions[v as usize].map(ordered), v))
        .collect();
    let order = |(a, v): &([u32; 3], u32), (b, w): &([u32; 3], u32)| {
        a.cmp(b).then_with(|| looks(p, *v as usize, *w as usize))
    };
    vertices.sort_unstable_by(order);
    // Rank of each vertex among the distinct ones, and one vertex of each rank.
    let mut place = vec![0; p.positions.len()];
    let mut first: Vec<u32> = Vec::new();
    for equal in vertices.chunk_by(|a, b| order(a, b).is_eq()) {
        for (_, v) in equal {
            place[*v as usize] = first.len() as u32;
        }
        first.push(equal[0].1);
    }
    let mut triangles: Vec<[u32; 3]> = (p.triples().iter())
        .map(|t| {
            let [a, b, c] = t.map(|i| place[i as usize]);
            [a, b, c].min([b, c, a]).min([c, a, b])
        })
        .collect();
    triangles.sort_unstable();
    let mut number = vec![u32::MAX; first.len()];
    let mut kept: Vec<usize> = Vec::with_capacity(first.len());
    p.indices = (triangles.into_iter().flatten())
        .map(|v| {
            let slot = &mut number[v as usize];
            if *slot == u32::MAX {
                *slot = kept.len() as u32;
                kept.push(first[v as usize] as usize);
            }
            *slot
        })
        .collect();
    fn pick<T: Copy>(values: &mut Vec<T>, kept: &[usize]) {
        if !values.is_empty() {
            *values = kept.iter().map(|&i| values[i]).collect();
        }
    }
    pick(&mut p.positions, &kept);
    pick(&mut p.normals, &kept);
    pick(&mut p.tangents, &kept);
    pick(&mut p.colors, &kept);
    p.uvs.iter_mut().for_each(|set| pick(set, &kept));
}

/// Sorts nodes depth first, siblings by name, and objects by node.
fn sort_objects(scene: &mut Scene) {
    let rank = ranks(scene.objects.len(), |i, j| {
        objects(&scene.objects[i], &scene.objects[j])
    });
    let number = node_numbers(&scene.nodes, &scene.objects, &rank);
    let mut nodes = vec![SourceNode::default(); number.len()];
    for (node, &n) in take(&mut scene.nodes).into_iter().zip(&number) {
        let parent = node.parent.map(|p| number[p as usize]);
        nodes[n as usize] = SourceNode { parent, ..node };
    }
    scene.nodes = nodes;
    for object in &mut scene.objects {
        object.node = object.node.map(|n| number[n as usize]);
    }
    let mut order: Vec<usize> = (0..rank.len()).collect();
    order.sort_by_key(|&i| (scene.objects[i].node, rank[i]));
    let mut place = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        place[old] = new as u32;
    }
    let mut old: Vec<Option<Object>> = take(&mut scene.objects).into_iter().map(Some).collect();
    scene.objects = order.iter().filter_map(|&i| old[i].take()).collect();
    for entity in &mut scene.entities {
        entity.object = entity.object.map(|o| place[o as usize]);
    }
}

/// Returns the new number of each node; `rank` is that of each object.
///
/// Classifies nodes from the leaves up by their contents and children, as in the isomorphism of unordered trees (Aho,
/// Hopcroft & Ullman, "The Design and Analysis of Computer Algorithms", 1974, example 3.2).
fn node_numbers(nodes: &[SourceNode], objects: &[Object], rank: &[u32]) -> Vec<u32> {
    let n = nodes.len();
    let mut height = vec![0_u32; n];
    let mut below: Vec<Vec<u32>> = vec![Vec::new(); n];
    // Nodes follow their parents.
    for i in (0..n).rev() {
        if let Some(parent) = nodes[i].parent {
            let parent = parent as usize;
            height[parent] = height[parent].max(height[i] + 1);
            below[parent].push(i as u32);
        }
    }
    let mut own: Vec<Vec<u32>> = vec![Vec::new(); n];
    for (object, &rank) in objects.iter().zip(rank) {
        if let Some(node) = object.node {
            own[node as usize].push(rank);
        }
    }
    own.iter_mut().for_each(|ranks| ranks.sort_unstable());
    let mut by_height: Vec<u32> = (0..n as u32).collect();
    by_height.sort_by_key(|&i| height[i as usize]);
    let mut kind = vec![0_u32; n];
    let mut kinds_below: Vec<Vec<u32>> = vec![Vec::new(); n];
    let mut n_kinds = 0;
    for level in by_height.chunk_by(|&i, &j| height[i as usize] == height[j as usize]) {
        for &i in level {
            let mut kinds: Vec<u32> = below[i as usize]
                .iter()
                .map(|&b| kind[b as usize])
                .collect();
            kinds.sort_unstable();
            kinds_below[i as usize] = kinds;
        }
        let told = |k: usize| {
            let i = level[k] as usize;
            let SourceNode { name, extras, .. } = &nodes[i];
            (name, extras, &own[i], &kinds_below[i])
        };
        let ranks = ranks(level.len(), |a, b| told(a).cmp(&told(b)));
        for (&i, rank) in level.iter().zip(&ranks) {
            kind[i as usize] = n_kinds + rank;
        }
        n_kinds += level.len() as u32;
    }
    // Reversed, as the stack returns the last first.
    let reversed = |list: &mut Vec<u32>| {
        list.sort_by_key(|&i| std::cmp::Reverse((&nodes[i as usize].name, kind[i as usize])));
    };
    below.iter_mut().for_each(reversed);
    let mut stack: Vec<u32> = (0..n as u32)
        .filter(|&i| nodes[i as usize].parent.is_none())
        .collect();
    reversed(&mut stack);
    let mut number = vec![0; n];
    let mut next = 0;
    while let Some(i) = stack.pop() {
        number[i as usize] = next;
        next += 1;
        stack.extend(&below[i as usize]);
    }
    number
}

/// Sorts a list, keeps one of each set of equal items, and returns the new number for each old one.
fn make_unique<T>(list: &mut Vec<T>, order: impl Fn(&T, &T) -> Ordering) -> Vec<u32> {
    let mut items: Vec<(u32, T)> = (0..).zip(take(list)).collect();
    items.sort_by(|a, b| order(&a.1, &b.1));
    let mut number = vec![0; items.len()];
    for (old, item) in items {
        if list.last().is_none_or(|last| order(last, &item).is_ne()) {
            list.push(item);
        }
        number[old as usize] = list.len() as u32 - 1;
    }
    number
}

/// Returns the rank of each item; equal items have equal ranks.
fn ranks(n: usize, order: impl Fn(usize, usize) -> Ordering) -> Vec<u32> {
    let mut items: Vec<usize> = (0..n).collect();
    items.sort_by(|&a, &b| order(a, b));
    let mut rank = vec![0; n];
    for (k, equal) in items.chunk_by(|&a, &b| order(a, b).is_eq()).enumerate() {
        equal.iter().for_each(|&i| rank[i] = k as u32);
    }
    rank
}

/// Returns a number that orders as [`f32::total_cmp`] does.
fn ordered(x: f32) -> u32 {
    let bits = x.to_bits();
    let sign = 1 << 31;
    if bits & sign == 0 { bits | sign } else { !bits }
}

/// Orders shorter lists first, then by the first items that differ.
pub(crate) fn all<T>(a: &[T], b: &[T], order: impl Fn(&T, &T) -> Ordering) -> Ordering {
    let unequal = || {
        let mut pairs = a.iter().zip(b).map(|(a, b)| order(a, b));
        pairs.find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
    };
    a.len().cmp(&b.len()).then_with(unequal)
}

fn floats(a: &[f32], b: &[f32]) -> Ordering {
    all(a, b, f32::total_cmp)
}

fn vectors<const N: usize>(a: &[[f32; N]], b: &[[f32; N]]) -> Ordering {
    all(a, b, |a, b| floats(a, b))
}

fn transforms(a: &DMat4, b: &DMat4) -> Ordering {
    let (a, b) = (a.to_cols_array(), b.to_cols_array());
    all(&a, &b, f64::total_cmp)
}

fn images(a: &Image, b: &Image) -> Ordering {
    (&a.name, &a.mime, &a.bytes).cmp(&(&b.name, &b.mime, &b.bytes))
}

fn textures(a: &Texture, b: &Texture) -> Ordering {
    (a.image, &a.sampler).cmp(&(b.image, &b.sampler))
}

fn materials(a: &Material, b: &Material) -> Ordering {
    let told = |m: &Material| (m.double_sided, m.transparent);
    (&a.name, &a.gltf)
        .cmp(&(&b.name, &b.gltf))
        .then_with(|| told(a).cmp(&told(b)))
        .then_with(|| floats(&a.base_color, &b.base_color))
}

fn primitives(a: &Primitive, b: &Primitive) -> Ordering {
    (a.material, &a.indices)
        .cmp(&(b.material, &b.indices))
        .then_with(|| vectors(&a.positions, &b.positions))
        .then_with(|| vectors(&a.normals, &b.normals))
        .then_with(|| vectors(&a.tangents, &b.tangents))
        .then_with(|| all(&a.uvs, &b.uvs, |a, b| vectors(a, b)))
        .then_with(|| vectors(&a.colors, &b.colors))
}

/// Compares two vertices of a primitive by everything but their positions.
fn looks(p: &Primitive, v: usize, w: usize) -> Ordering {
    fn by<const N: usize>(list: &[[f32; N]], v: usize, w: usize) -> Ordering {
        if list.is_empty() {
            return Ordering::Equal;
        }
        floats(&list[v], &list[w])
    }
    by(&p.normals, v, w)
        .then_with(|| by(&p.tangents, v, w))
        .then_with(|| {
            let mut sets = p.uvs.iter().map(|set| by(set, v, w));
            sets.find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
        })
        .then_with(|| by(&p.colors, v, w))
}

/// Compares by everything but the nodes.
fn objects(a: &Object, b: &Object) -> Ordering {
    (&a.name, a.mesh)
        .cmp(&(&b.name, b.mesh))
        .then_with(|| transforms(&a.transform, &b.transform))
        .then_with(|| (a.role, &a.reason).cmp(&(b.role, &b.reason)))
}

fn solids(a: &ConvexSolid, b: &ConvexSolid) -> Ordering {
    let numbers = |s: &ConvexSolid| -> Vec<f64> {
        let planes = s.planes.iter();
        let planes = planes.flat_map(|p| p.normal.to_array().into_iter().chain([p.d]));
        let points = s.faces.iter().flat_map(|f| &f.points);
        planes.chain(points.flat_map(DVec3::to_array)).collect()
    };
    all(&numbers(a), &numbers(b), f64::total_cmp)
}

fn entities(a: &Entity, b: &Entity) -> Ordering {
    let place = |e: &Entity| e.position.map_or(Vec::new(), |p| p.to_array().to_vec());
    (&a.class, &a.properties, a.object)
        .cmp(&(&b.class, &b.properties, b.object))
        .then_with(|| all(&place(a), &place(b), f64::total_cmp))
}

fn given_portals(a: &GivenPortal, b: &GivenPortal) -> Ordering {
    let numbers = |g: &GivenPortal| {
        g.outline
            .iter()
            .flat_map(DVec3::to_array)
            .collect::<Vec<_>>()
    };
    // Numbered names with fewer digits come first.
    (a.name.len(), &a.name)
        .cmp(&(b.name.len(), &b.name))
        .then_with(|| all(&numbers(a), &numbers(b), f64::total_cmp))
}

fn rooms(a: &RoomName, b: &RoomName) -> Ordering {
    let numbers = |r: &RoomName| -> Vec<f64> {
        let points = r.points.iter().flat_map(DVec3::to_array);
        points.chain([r.volume]).collect()
    };
    (a.name.cmp(&b.name)).then_with(|| all(&numbers(a), &numbers(b), f64::total_cmp))
}

fn fixtures(a: &Fixture, b: &Fixture) -> Ordering {
    (a.kind, &a.name, &a.gltf, &a.extras)
        .cmp(&(b.kind, &b.name, &b.gltf, &b.extras))
        .then_with(|| transforms(&a.transform, &b.transform))
}
