//! Worlds made in code for the tests of this crate.
#![allow(dead_code, reason = "every test binary uses a part of it")]

use enfilade_cpg::{
    Batch, Cell, CellId, CellPortalGraph, CellSet, DecidedPlace, DetailObject, Fact, Fitting,
    FittingPart, Locator, LocatorNode, MonitorCamera, Motion, MotionKind, PartNumbers, Pass,
    Portal, PortalId, PortalKind, Provenance, Pvs, Reason, RoomFacts, SourceRuns, SpecialId,
    SpecialPortal, SpecialShape, Statistics, VisibleParts, VisibleVolumes, Way, Why, World,
};
use enfilade_geom::scene::{
    About, Fixture, FixtureKind, Image, Material, Mesh, Primitive, SourceNode, Texture,
};
use enfilade_geom::{Aabb, DMat4, DQuat, DVec3, Similarity};

/// Makes two triangles of four vertices, with normals and texture coordinates.
pub(crate) fn quad(corners: [[f32; 3]; 4], normal: [f32; 3]) -> Primitive {
    Primitive {
        positions: corners.to_vec(),
        normals: vec![normal; 4],
        tangents: Vec::new(),
        uvs: vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]],
        colors: Vec::new(),
        indices: vec![0, 1, 2, 0, 2, 3],
        material: Some(0),
    }
}

/// Makes the floor of the rectangle `x0..x1` × `0..5`.
pub(crate) fn floor(x0: f32, x1: f32) -> Primitive {
    quad(
        [
            [x0, 0.0, 0.0],
            [x0, 0.0, 5.0],
            [x1, 0.0, 5.0],
            [x1, 0.0, 0.0],
        ],
        [0.0, 1.0, 0.0],
    )
}

pub(crate) fn cell(name: &str, aabb: [[f32; 3]; 2], portals: &[u32]) -> Cell {
    let size = [0, 1, 2].map(|k| aabb[1][k] - aabb[0][k]);
    Cell {
        name: name.into(),
        aabb,
        volume: size[0] * size[1] * size[2],
        n_triangles: 2,
        n_detail_triangles: 2,
        portals: portals.iter().copied().map(PortalId).collect(),
        outdoor: name == "outdoors",
        is_void: false,
        is_land: false,
        why: vec![Why::compared(
            Reason::Standing,
            0.05,
            &[(Fact::Standing, 0.75)],
        )],
    }
}

/// Makes a rectangle in the plane at `x`, facing +x, from `z0` to `z1` and from the floor to `height`.
pub(crate) fn doorway(x: f32, z0: f32, z1: f32, height: f32, cells: [u32; 2]) -> Portal {
    let outline = vec![[x, 0.0, z0], [x, height, z0], [x, height, z1], [x, 0.0, z1]];
    Portal {
        cells: cells.map(CellId),
        kind: PortalKind::Open,
        normal: [1.0, 0.0, 0.0],
        pieces: vec![outline.clone()],
        outline,
        area: height * (z1 - z0),
        fittings: Vec::new(),
        why: vec![Why::given(Reason::Asked).with(&[(Fact::Area, 2.0)])],
    }
}

/// Makes two rooms of 4 × 3 × 5 m side by side along x, with a doorway between them and a window to outdoors.
pub(crate) fn two_rooms() -> World {
    let mut window = doorway(8.0, 1.0, 3.0, 2.0, [1, 2]);
    window.kind = PortalKind::Window;
    // An opening in two pieces, with a mullion of 10 cm between.
    window.pieces = vec![
        vec![
            [8.0, 0.0, 1.0],
            [8.0, 2.0, 1.0],
            [8.0, 2.0, 1.9],
            [8.0, 0.0, 1.9],
        ],
        vec![
            [8.0, 0.0, 2.0],
            [8.0, 2.0, 2.0],
            [8.0, 2.0, 3.0],
            [8.0, 0.0, 3.0],
        ],
    ];
    window.area = 3.8;
    let fitting = |detail, part, kind, [shut, open]: [f32; 2]| Fitting {
        detail,
        part,
        motion: (part == FittingPart::Leaf).then_some(Motion { kind, shut, open }),
    };
    let turn = MotionKind::Turn {
        through: [4.0, 0.0, 1.0],
        axis: [0.0, 1.0, 0.0],
    };
    let slide = MotionKind::Slide {
        along: [0.0, 0.0, -1.0],
    };
    let mut door = doorway(4.0, 2.0, 3.0, 2.1, [0, 1]);
    door.fittings = vec![fitting(0, FittingPart::Leaf, turn, [-0.25, 1.25])];
    window.fittings = vec![
        fitting(1, FittingPart::Pane, turn, [0.0; 2]),
        fitting(2, FittingPart::Leaf, slide, [0.0, 1.5]),
    ];
    let locator = Locator {
        bounds: Aabb::new(DVec3::new(0.0, 0.0, 0.0), DVec3::new(8.0, 3.0, 5.0)),
        outside: Some(CellId(2)),
        planes: vec![[1.0, 0.0, 0.0, -4.0], [0.0, 1.0, 0.0, -0.1]],
        nodes: vec![
            LocatorNode {
                plane: 1,
                children: [1, Locator::leaf(None)],
            },
            LocatorNode {
                plane: 0,
                children: [
                    Locator::leaf(Some(CellId(1))),
                    Locator::leaf(Some(CellId(0))),
                ],
            },
        ],
        root: 0,
    };
    let graph = CellPortalGraph {
        specials: Vec::new(),
        cells: vec![
            cell("cell-0", [[0.0, 0.0, 0.0], [4.0, 3.0, 5.0]], &[0]),
            cell("cell-1", [[4.0, 0.0, 0.0], [8.0, 3.0, 5.0]], &[0, 1]),
            cell("outdoors", [[-1.0, -1.0, -1.0], [9.0, 4.0, 6.0]], &[1]),
        ],
        portals: vec![door, window],
        locator: locator.into(),
        provenance: Provenance {
            generator: "enfilade 0.1.0".into(),
            method: "watershed".into(),
            settings: [("voxel_size".to_owned(), "0.1".to_owned())].into(),
            input_hash: "00ff".into(),
        },
        statistics: Statistics {
            counts: [("input_triangles".to_owned(), 8.0), ("odd".to_owned(), 0.1)].into(),
        },
        places: vec![DecidedPlace {
            at: [1.0, 2.0, 3.0],
            why: Why::compared(Reason::Wide, 0.7, &[(Fact::Share, 0.75)]),
        }],
    };
    let batch = |cells: &[u32], primitive| Batch {
        cells: cells.iter().copied().map(CellId).collect(),
        primitive,
        is_seal: false,
        sources: SourceRuns::default(),
    };
    let source = |name: &str, parent, extras: &str| SourceNode {
        name: name.into(),
        parent,
        extras: extras.into(),
    };
    let fixture = |kind, name: &str, x, gltf: &str, extras: &str| Fixture {
        kind,
        name: name.into(),
        transform: DMat4::from_translation(DVec3::new(x, 2.0, 1.0)),
        gltf: gltf.into(),
        extras: extras.into(),
    };
    let lamp = r#"{"color":[1,0.5,0.25],"intensity":40,"range":8,"type":"point"}"#;
    let camera = r#"{"extensions":{"EXT_shutter":{}},"perspective":{"yfov":1,"znear":0.1},"type":"perspective"}"#;
    let turned = [
        0.0, 0.0, -2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.5, 1.0, 1.0,
    ];
    let chair = |name: &str, transform, cells: &[u32]| DetailObject {
        name: name.into(),
        mesh: 0,
        transform,
        cells: cells.iter().copied().map(CellId).collect(),
        source: None,
        part_of: None,
    };
    let mut identity = [0.0; 16];
    [0, 5, 10, 15].into_iter().for_each(|i| identity[i] = 1.0);
    let sampler = r#"{ "magFilter": 9729, "wrapS": 33071 }"#;
    World {
        graph,
        batches: vec![
            Batch {
                sources: SourceRuns::from_runs(vec![[1, 1], [0, 1]]),
                ..batch(&[1], floor(4.0, 8.0))
            },
            batch(&[0], floor(0.0, 4.0)),
            batch(&[0, 1], floor(3.0, 5.0)),
            batch(&[], floor(-1.0, 0.0)),
            batch(
                &[0],
                Primitive {
                    material: Some(1),
                    ..floor(0.0, 1.0)
                },
            ),
            batch(
                &[0, 1, 2],
                Primitive {
                    uvs: Vec::new(),
                    material: None,
                    ..floor(2.0, 3.0)
                },
            ),
        ],
        details: vec![
            chair("chair", identity, &[0]),
            DetailObject {
                source: Some(3),
                part_of: Some(0),
                ..chair("chair", turned, &[0, 1])
            },
            chair("stool", identity, &[1]),
        ],
        sources: vec![
            source("house", None, r#"{"site": [1, {"a": null}]}"#),
            source("floor", Some(0), ""),
            source("", Some(0), r#"{"storey":0}"#),
            source("chair", Some(2), "\"oak\""),
        ],
        fixtures: vec![
            fixture(FixtureKind::Light, "lamp", 1.0, lamp, ""),
            fixture(FixtureKind::Camera, "entrance", 0.5, camera, "[2]"),
            fixture(FixtureKind::Marker, "start", 0.0, "", r#"{"team":1}"#),
            fixture(FixtureKind::Light, "lamp", 5.0, lamp, ""),
        ],
        about: About {
            copyright: "2026 A. Mason, CC-BY 4.0".into(),
            extras: r#"{"project":7}"#.into(),
        },
        detail_meshes: vec![Mesh {
            name: "chair".into(),
            primitives: vec![Primitive {
                tangents: vec![[1.0, 0.0, 0.0, 1.0]; 4],
                colors: vec![[1.0, 0.5, 0.25, 1.0]; 4],
                ..floor(0.0, 0.5)
            }],
        }],
        materials: vec![
            Material {
                name: "brick".into(),
                gltf: r#"{"name":"brick",  "pbrMetallicRoughness":{"baseColorTexture":{"index":0},
                    "baseColorFactor":[0.5,0.25,1,1]},"extras":{"extensions":{"no":1}},
                    "extensions":{"KHR_materials_ior":{"ior":1.4}}}"#
                    .into(),
                double_sided: false,
                transparent: false,
                base_color: [0.5, 0.25, 1.0, 1.0],
            },
            Material {
                name: "glass".into(),
                gltf: String::new(),
                double_sided: true,
                transparent: true,
                base_color: [1.0, 1.0, 1.0, 0.5],
            },
        ],
        textures: vec![
            Texture {
                image: Some(0),
                sampler: sampler.into(),
            },
            Texture {
                image: Some(0),
                sampler: String::new(),
            },
            Texture {
                image: Some(0),
                sampler: sampler.into(),
            },
        ],
        images: vec![Image {
            name: "lost".into(),
            mime: "image/png".into(),
            bytes: Vec::new(),
        }],
        leak_path: Vec::new(),
        pvs: None,
        room_facts: None,
    }
}

/// Makes the two rooms with special portals of every kind: a mirror in two pieces, a link of the doorway and a wall, a window that
/// reflects, a monitor, and a way into another scale without a way back.
pub(crate) fn two_rooms_with_specials() -> World {
    let special = |name: &str, cell, shape, passes| SpecialPortal {
        name: name.into(),
        cell: CellId(cell),
        shape,
        passes,
    };
    let surface = |normal, pieces| SpecialShape::Surface { normal, pieces };
    // Rectangles in walls at x, and at z, counter-clockwise about the second argument.
    let at_x = |x: f32, [z0, z1]: [f32; 2], [y0, y1]: [f32; 2]| {
        vec![[x, y0, z0], [x, y0, z1], [x, y1, z1], [x, y1, z0]]
    };
    let at_z = |z: f32, toward: f32, [x0, x1]: [f32; 2], [y0, y1]: [f32; 2]| {
        let mut points = vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]];
        if toward < 0.0 {
            points.reverse();
        }
        points
    };
    // The door's middle and outward normal become the middle and inward normal there.
    let quarter = DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2);
    let map = Similarity {
        turn: quarter,
        at: DVec3::new(5.5, 1.05, 0.0) - quarter * DVec3::new(4.0, 1.05, 2.5),
        scale: 1.0,
    };
    let lead = |to, map, back: Option<u32>| {
        let to = CellId(to);
        let back = back.map(SpecialId);
        Pass::new(Way::Lead { to, map, back })
    };
    let tinted = |way, tint| Pass { way, tint };
    let giant = Similarity {
        turn: DQuat::from_rotation_y(0.5),
        at: DVec3::new(6.0, 1.0 / 3.0, 2.0),
        scale: -2.5,
    };
    let camera = MonitorCamera {
        eye: [1.0, 2.5, 1.0],
        toward: [1.0, -0.5, 0.75],
        up: [0.0, 1.0, 0.0],
        fov_y: 1.25,
    };
    let mut world = two_rooms();
    world.graph.specials = vec![
        special(
            "portrait",
            0,
            surface(
                [-1.0, 0.0, 0.0],
                vec![
                    at_x(0.0, [1.0, 2.0], [0.5, 2.0]),
                    at_x(0.0, [2.5, 3.0], [0.5, 2.0]),
                ],
            ),
            vec![Pass::new(Way::Mirror)],
        ),
        special(
            "",
            0,
            SpecialShape::Portal(PortalId(0)),
            vec![lead(1, map, Some(2))],
        ),
        special(
            "wardrobe",
            1,
            surface(
                [0.0, 0.0, -1.0],
                vec![at_z(0.0, -1.0, [5.0, 6.0], [0.0, 2.1])],
            ),
            vec![lead(0, map.inverse(), Some(1))],
        ),
        special(
            "",
            1,
            SpecialShape::Portal(PortalId(1)),
            vec![
                tinted(Way::Through, [0.5, 1.0, 0.75, 1.0]),
                tinted(Way::Mirror, [1.0, 1.0, 1.0, 0.2]),
            ],
        ),
        special(
            "\u{1b}[31mscreen",
            1,
            surface(
                [0.0, 0.0, 1.0],
                vec![at_z(5.0, 1.0, [5.0, 7.0], [1.0, 2.0])],
            ),
            vec![Pass::new(Way::Monitor(camera))],
        ),
        special(
            "looking glass",
            0,
            surface(
                [0.0, 0.0, 1.0],
                vec![at_z(5.0, 1.0, [1.0, 2.0], [0.0, 2.0])],
            ),
            vec![lead(1, giant, None)],
        ),
    ];
    world
}

/// Makes the two rooms with a potentially visible set: all pairs, except from the outdoors into the second room.
pub(crate) fn two_rooms_with_pvs() -> World {
    let mut world = two_rooms();
    let n = world.graph.cells.len();
    let mut rows = vec![CellSet::all(n); n];
    rows[n - 1].remove(CellId(1));
    world.pvs = Some(Pvs::of_rows(&rows));
    world
}

/// Makes the same world with the parts visible by pair of cells.
#[allow(dead_code)] // Not all tests that share this file use it.
pub(crate) fn two_rooms_with_parts() -> World {
    let mut world = two_rooms_with_pvs();
    let n_parts = PartNumbers::new(&world).n_parts();
    let pvs = world.pvs.as_mut().unwrap();
    let n_pairs = pvs.n_pairs() as u32;
    let row = |pair: u32| (0..n_parts).filter(move |part| !(part + pair).is_multiple_of(3));
    pvs.parts = Some(VisibleParts::of_ascending((0..n_pairs).map(row)));
    let plane = |pair: u32| [0.0, 1.0, 0.0, f64::from(pair)];
    let pieces = |pair: u32| vec![vec![plane(pair); pair as usize % 3]; pair as usize % 2 + 1];
    pvs.volumes = Some(VisibleVolumes::of_pairs((0..n_pairs).map(pieces)));
    world
}

/// Makes the two rooms with everything that inputs contain and glTF forbids.
pub(crate) fn nasty_rooms() -> World {
    let mut world = two_rooms();
    let p = &mut world.batches[0].primitive;
    p.normals[2] = [0.0; 3];
    p.uvs[0][1] = [f32::NAN, f32::INFINITY];
    p.colors = vec![[2.0, -1.0, f32::NAN, 0.5]; 4];
    let tilted = &mut world.detail_meshes[0].primitives[0];
    tilted.tangents[3] = [1.0, 0.0, 0.0, 0.5];
    // Material 0 reads a texture coordinate set that this primitive lacks.
    world.batches[1].primitive.uvs.clear();
    // Every index is the largest of 16 bits, or one less.
    let many = &mut world.batches[2].primitive;
    many.positions = (0..65_535)
        .map(|i| [i as f32 * 1e-4, -0.0, (i % 7) as f32])
        .collect();
    many.normals = vec![[0.0, 1.0, 0.0]; 65_535];
    many.uvs.clear();
    many.indices = vec![65_534, 65_533, 0];
    many.material = None;
    // With one more vertex, the largest 16-bit index would restart the triangles.
    let mut more = many.clone();
    more.positions.push([7.0, 0.0, 1.0]);
    more.normals.push([0.0, 1.0, 0.0]);
    more.indices = vec![65_535, 65_534, 0];
    world.batches.push(Batch {
        cells: vec![CellId(2)],
        primitive: more,
        is_seal: true,
        sources: enfilade_cpg::SourceRuns::default(),
    });
    world.batches.push(Batch {
        cells: vec![CellId(1)],
        ..Batch::default()
    });
    world.detail_meshes.push(Mesh {
        name: "nothing".into(),
        primitives: Vec::new(),
    });
    world.detail_meshes[0].primitives.push(Primitive::default());
    let detail = |name: &str, mesh, transform| DetailObject {
        name: name.into(),
        mesh,
        transform,
        cells: vec![CellId(0)],
        source: None,
        part_of: None,
    };
    let mut identity = [0.0; 16];
    [0, 5, 10, 15].into_iter().for_each(|i| identity[i] = 1.0);
    let changed = |changes: &[(usize, f32)]| {
        let mut t = identity;
        changes.iter().for_each(|&(i, v)| t[i] = v);
        t
    };
    world.details.extend([
        detail("nothing", 1, changed(&[(12, 3.0)])),
        detail("sheared", 0, changed(&[(4, 0.5), (13, 2.0)])),
        detail("mirrored and sheared", 0, changed(&[(0, -1.0), (6, 0.25)])),
        detail("flat", 0, changed(&[(5, 0.0)])),
        detail("vanished", 0, changed(&[(0, 0.0), (5, 0.0), (10, 0.0)])),
        detail("mirrored", 0, changed(&[(0, -1.0)])),
        detail(
            "huge",
            0,
            changed(&[(0, 0.0), (2, 9e3), (8, -9e3), (10, 1e-3), (5, 7.0)]),
        ),
    ]);
    let picture = |mime: &str, bytes: &[u8]| Image {
        name: String::new(),
        mime: mime.into(),
        bytes: bytes.to_vec(),
    };
    world.images.extend([
        // The smallest WebP: one pixel, lossless. Its type is wrong in the input.
        picture(
            "image/png",
            b"RIFF\x1a\0\0\0WEBPVP8L\x0d\0\0\0/\0\0\0\x10\x07\x10\x11\x11\x88\x88\xfe\x07\0",
        ),
    ]);
    world.textures.push(Texture {
        image: Some(1),
        sampler: String::new(),
    });
    world.textures.push(Texture::default());
    world
}

/// Facts of the rooms of a world: some numbers, each other.
pub(crate) fn room_facts(world: &World) -> Vec<RoomFacts> {
    let n = |cell, kind| world.graph.n_portals(cell, kind);
    let facts = world.graph.rooms().map(|(cell, _)| RoomFacts {
        cell,
        storeys: vec!["1".into(), "2a".into()],
        floor_area: 20.125,
        area_above_1_5: 17.5,
        area_above_2_3: 10.25,
        height: 2.5,
        n_doors: n(cell, PortalKind::Door),
        n_windows: n(cell, PortalKind::Window),
    });
    facts.collect()
}
