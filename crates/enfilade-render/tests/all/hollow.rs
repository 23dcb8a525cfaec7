//! Pictures of hollow worlds, whose pieces come and go, against those of whole worlds: byte for byte.

use std::collections::BTreeSet;
use std::io::Cursor;
use std::time::Instant;

use enfilade_cpg::{CellId, World, wire};
use enfilade_geom::scene::{Image, Material, Primitive, Texture};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Gpu, GpuPiece, Picture, PieceMaker, PieceOf, PixelContent, Put,
    RenderError, SpaceShot, Sparing, StreamLimits, Studio, Style,
};
use enfilade_runtime::{DetailId, Sight, SightSkeleton};
use enfilade_testkit::{GridParams, Rng, room_grid, with_doors, with_specials};
use enfilade_world::{PartId, Space, SpaceViewer};

const SIZE: [u32; 2] = [96, 64];

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"))
}

/// A style without shadows of the sun, which hollow worlds do not have.
fn style() -> Style {
    Style {
        shadows: false,
        ..Style::default()
    }
}

fn png(seed: u64) -> Vec<u8> {
    let mut rng = Rng::new(seed);
    let mut picture = image::RgbaImage::new(16, 8);
    for pixel in picture.pixels_mut() {
        pixel.0 = [0; 4].map(|_| rng.below(256) as u8);
    }
    let mut bytes = Cursor::new(Vec::new());
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

/// Gives the surfaces of a world pictures, some of them with holes, some of glass, one of them damaged.
fn pictured(mut world: World) -> World {
    for i in 0..3 {
        world.images.push(Image {
            bytes: if i == 2 { vec![7; 20] } else { png(i) },
            ..Image::default()
        });
    }
    for image in [0, 1, 2, 0] {
        let sampler = [r#"{"wrapS":33071}"#, "", "", r#"{"wrapT":33648}"#];
        world.textures.push(Texture {
            image: Some(image),
            sampler: sampler[world.textures.len()].into(),
        });
    }
    let first = world.materials.len() as u32;
    for (i, mode) in ["OPAQUE", "MASK", "OPAQUE", "BLEND"]
        .into_iter()
        .enumerate()
    {
        world.materials.push(Material {
            gltf: format!(
                r#"{{"alphaMode":"{mode}","pbrMetallicRoughness":{{"baseColorTexture":{{"index":{i}}}}}}}"#
            ),
            base_color: [0.9, 0.7, 0.8, if mode == "BLEND" { 0.5 } else { 1.0 }],
            transparent: mode == "BLEND",
            ..Material::default()
        });
    }
    let batches = world.batches.iter_mut().map(|b| &mut b.primitive);
    let meshes = world
        .detail_meshes
        .iter_mut()
        .flat_map(|m| &mut m.primitives);
    for (i, primitive) in (0..).zip(batches.chain(meshes)) {
        if i % 3 < 2 {
            primitive.material = Some(first + i / 2 % 4);
            let uv = |p: &[f32; 3]| [p[0] + 0.3 * p[1], p[2] + 0.7 * p[1]];
            primitive.uvs = vec![primitive.positions.iter().map(uv).collect()];
        }
    }
    // Panes of two colors in one place: the order of equal distances shows.
    for i in 0..world.batches.len() {
        if world.batches[i].primitive.material == Some(first + 3) {
            let mut pane = world.batches[i].clone();
            pane.primitive.material = Some(world.materials.len() as u32);
            world.batches.push(pane);
        }
    }
    world.materials.push(Material {
        base_color: [0.1, 0.9, 0.2, 0.6],
        transparent: true,
        ..Material::default()
    });
    world
}

fn grid(rooms: usize, seed: u64) -> World {
    room_grid(&GridParams::offices(rooms, seed))
}

/// Worlds of rooms with furniture, pictures, doors of wood and glass, mirrors and leads.
fn worlds() -> Vec<World> {
    vec![
        grid(40, 3),
        pictured(grid(30, 5)),
        pictured(with_doors(grid(20, 8), |p| p % 2 == 0)),
        with_specials(grid(20, 9), 3, 4),
    ]
}

/// A camera in a room.
fn camera(rng: &mut Rng, world: &World) -> Camera {
    let cells = &world.graph.cells;
    let indoors: Vec<_> = cells.iter().filter(|c| !c.outdoor).collect();
    let [low, high] = indoors[rng.below(indoors.len())].aabb;
    let t = [0, 1, 2].map(|_| rng.range(0.1, 0.9) as f32);
    let angle = rng.range(0.0, std::f64::consts::TAU);
    let tilt = rng.range(-0.4, 0.4) as f32;
    Camera {
        eye: [0, 1, 2].map(|k| low[k] + (high[k] - low[k]) * t[k]),
        toward: [angle.cos() as f32, tilt, angle.sin() as f32],
        fov_y: rng.range(0.5, 1.8) as f32,
    }
}

/// A world, whole and hollow, on adapters.
struct Pair {
    world: World,
    whole: Studio,
    hollow: Studio,
    maker: PieceMaker,
    pieces: Vec<PieceOf>,
}

impl Pair {
    /// The hollow world's memory is a share of what it needs.
    fn new(world: World, share: f64) -> Self {
        Self::on([gpu(), gpu()], world, share)
    }

    fn on([gpu, other]: [Gpu; 2], world: World, share: f64) -> Self {
        let whole = Studio::new(gpu, &world).unwrap();
        let bytes = whole.sight.skeleton().encode();
        let skeleton = SightSkeleton::decode(&bytes).unwrap();
        let [n, n_indices] = skeleton.sizes().map(|n| n as f64);
        let limits = StreamLimits {
            triangle_bytes: ((n * 40.0 + n_indices * 4.0) * share) as u64,
            picture_bytes: 1 << 30,
        };
        let shell = SightSkeleton::hollow(&world);
        let sight = Sight::build_hollow(&shell, skeleton).unwrap();
        let hollow = Studio::hollow(other, &shell, sight, &limits, FORMAT).unwrap();
        let batches = (0..world.batches.len() as u32).map(PieceOf::Batch);
        let meshes = (0..world.detail_meshes.len() as u32).map(PieceOf::Mesh);
        let images = (0..world.images.len() as u32).map(PieceOf::Image);
        Self {
            pieces: batches.chain(meshes).chain(images).collect(),
            maker: hollow.world.piece_maker().unwrap(),
            world,
            whole,
            hollow,
        }
    }

    fn piece(&self, of: PieceOf) -> GpuPiece {
        let (world, maker) = (&self.world, &self.maker);
        let piece = match of {
            PieceOf::Batch(i) => {
                maker.batch(&self.hollow.sight, i, &world.batches[i as usize].primitive)
            }
            PieceOf::Mesh(i) => maker.mesh(i, &world.detail_meshes[i as usize].primitives),
            PieceOf::Image(i) => maker.image(i, &world.images[i as usize].bytes),
        };
        piece.unwrap()
    }

    fn put(&mut self, of: PieceOf) -> Put {
        let piece = self.piece(of);
        self.hollow.put(&piece).unwrap()
    }

    /// Takes away what is there, and puts what cells need: their batches, their objects, all pictures.
    fn settle(&mut self, cells: &[CellId]) {
        let is_in = |of: &[CellId]| of.is_empty() || of.iter().any(|c| cells.contains(c));
        let mut needed = BTreeSet::new();
        for (i, batch) in (0..).zip(&self.world.batches) {
            if is_in(&batch.cells) {
                needed.insert(PieceOf::Batch(i));
            }
        }
        for (i, object) in (0..).zip(&self.world.details) {
            let sight = &self.hollow.sight;
            if is_in(&sight.cells_of_detail(&self.world, DetailId(i))) {
                needed.insert(PieceOf::Mesh(object.mesh));
            }
        }
        for of in self.pieces.clone() {
            let is_image = matches!(of, PieceOf::Image(_));
            if !is_image && !needed.contains(&of) {
                self.hollow.take(of);
            }
        }
        for of in self.pieces.clone() {
            if needed.contains(&of) || matches!(of, PieceOf::Image(_)) {
                assert_eq!(self.put(of), Put::Done, "{of:?}");
            }
        }
    }

    fn pictures(&mut self, camera: &Camera, culling: Culling) -> [Picture; 2] {
        [&mut self.whole, &mut self.hollow]
            .map(|s| s.picture(camera, culling, style(), &[], SIZE).unwrap())
    }

    /// Returns the number of triangles drawn if everything is listed, without plugs of doors.
    fn n_drawn(&mut self) -> u64 {
        for portal in self.world.graph.portal_ids() {
            self.hollow.state.set_leaves(portal, 1.0);
        }
        self.hollow.everything().n_triangles()
    }

    /// Returns the number of triangles of the pieces that are there.
    fn n_there(&self) -> u64 {
        let n = |p: &Primitive| p.triples().len() as u64;
        let has = |of| self.hollow.world.has(of);
        let batches = (0..).zip(&self.world.batches);
        let batches = batches.filter(|(i, _)| has(PieceOf::Batch(*i)));
        let objects = (self.world.details.iter()).filter(|d| has(PieceOf::Mesh(d.mesh)));
        let meshes = objects.map(|d| &self.world.detail_meshes[d.mesh as usize].primitives);
        batches.map(|(_, b)| n(&b.primitive)).sum::<u64>() + meshes.flatten().map(n).sum::<u64>()
    }

    /// Opens or shuts doors by chance.
    fn move_doors(&mut self, rng: &mut Rng) {
        for portal in self.world.graph.portal_ids() {
            let share = [0.0, 0.4, 1.0][rng.below(3)];
            for studio in [&mut self.whole, &mut self.hollow] {
                studio.state.set_leaves(portal, share);
            }
        }
    }
}

fn shuffle<T>(rng: &mut Rng, items: &mut [T]) {
    for i in (1..items.len()).rev() {
        items.swap(i, rng.below(i + 1));
    }
}

fn n_colors(picture: &Picture) -> usize {
    let colors: BTreeSet<&[u8]> = picture.rgba.chunks_exact(4).collect();
    colors.len()
}

#[test]
fn pieces_put_in_any_order_give_the_picture_of_the_whole_world() {
    for (n, world) in worlds().into_iter().enumerate() {
        let mut rng = Rng::new(n as u64);
        let mut pair = Pair::new(world, 1.0);
        let mut order = pair.pieces.clone();
        shuffle(&mut rng, &mut order);
        for &of in &order {
            assert_eq!(pair.put(of), Put::Done, "{of:?}");
        }
        for round in 0..12 {
            // Pieces come back scattered over the room that others left.
            shuffle(&mut rng, &mut order);
            let (gone, _) = order.split_at(order.len() * 2 / 5);
            let mut gone = gone.to_vec();
            gone.retain(|of| pair.hollow.take(*of));
            assert!(gone.iter().all(|of| !pair.hollow.world.has(*of)));
            assert_eq!(pair.n_drawn(), pair.n_there());
            shuffle(&mut rng, &mut gone);
            for of in gone {
                assert_eq!(pair.put(of), Put::Done, "{of:?}");
            }
            pair.move_doors(&mut rng);
            let culling = [Culling::Portals, Culling::Portals, Culling::Everything][round % 3];
            for _ in 0..3 {
                let camera = camera(&mut rng, &pair.world);
                let [a, b] = pair.pictures(&camera, culling);
                assert!(n_colors(&a) > 20);
                assert!(a == b, "world {n}, {camera:?}");
            }
        }
    }
}

#[test]
fn with_the_pieces_of_the_visible_cells_alone_nothing_is_missing() {
    for (n, world) in worlds().into_iter().enumerate() {
        let mut rng = Rng::new(100 + n as u64);
        let mut pair = Pair::new(world, 1.0);
        let mut n_absent = 0;
        for i in 0..24 {
            if i % 6 == 5 {
                pair.move_doors(&mut rng);
            }
            let camera = camera(&mut rng, &pair.world);
            let view = camera.view(1.5).unwrap();
            let (sight, state) = (&pair.hollow.sight, &pair.hollow.state);
            let cells = pair.hollow.viewer.see(sight, state, &view).cells().to_vec();
            pair.settle(&cells);
            let pieces = pair.pieces.iter();
            n_absent += pieces.filter(|of| !pair.hollow.world.has(**of)).count();
            let [a, b] = pair.pictures(&camera, Culling::Portals);
            assert!(a == b, "world {n}, {camera:?}");
        }
        assert!(n_absent > 24 * 20, "{n_absent}");
    }
}

/// Opens OpenGL, with all its features, and with those of WebGL 2 alone, whose shaders do not fetch vertices; one adapter for
/// each of two studios.
fn by_opengl() -> Vec<[Gpu; 2]> {
    let open = |is_least: bool| {
        let mut asked = wgpu::InstanceDescriptor::new_without_display_handle();
        asked.backends = wgpu::Backends::GL;
        if is_least {
            asked.backend_options.gl.gles_minor_version = wgpu::Gles3MinorVersion::Version0;
        }
        let instance = wgpu::Instance::new(asked);
        let gpu = Gpu::open_with(&instance, &AdapterChoice::Software, None);
        gpu.map_err(|why| eprintln!("not tried by OpenGL: {why}"))
            .ok()
    };
    let pair = |least| Some([open(least)?, open(least)?]);
    [false, true].into_iter().filter_map(pair).collect()
}

/// Returns the chunk or object at each pixel, and its depth.
fn shown(studio: &mut Studio, camera: &Camera) -> Vec<(Option<(u32, bool)>, f32)> {
    let ids = studio.ids(camera, Culling::Portals, SIZE).unwrap();
    let world = &studio.world;
    let name = |content| match content {
        PixelContent::Sky => None,
        PixelContent::Structure { triangle } => {
            Some((world.chunk_of_triangle(triangle).unwrap(), true))
        }
        PixelContent::Detail { detail, .. } => Some((detail, false)),
        PixelContent::Plug { portal } => Some((portal.0 + 1_000_000, true)),
    };
    let pixels = ids.iter().flat_map(|p| &p.pixels);
    pixels.map(|p| (name(p.0), p.1)).collect()
}

#[test]
fn ids_are_those_of_the_whole_world_on_all_adapters() {
    let mut adapters = by_opengl();
    adapters.push([gpu(), gpu()]);
    for adapters in adapters {
        let mut rng = Rng::new(77);
        let mut pair = Pair::on(adapters, worlds().swap_remove(2), 1.0);
        let mut order = pair.pieces.clone();
        for _ in 0..6 {
            shuffle(&mut rng, &mut order);
            for &of in &order[..order.len() / 2] {
                pair.hollow.take(of);
            }
            for &of in &order {
                assert_eq!(pair.put(of), Put::Done, "{of:?}");
            }
            pair.move_doors(&mut rng);
            let camera = camera(&mut rng, &pair.world);
            let [a, b] = [&mut pair.whole, &mut pair.hollow].map(|s| shown(s, &camera));
            assert!(a.iter().any(|p| p.0.is_some()));
            assert!(a == b, "{camera:?}");
            let [a, b] = pair.pictures(&camera, Culling::Portals);
            assert!(a == b, "{camera:?}");
        }
    }
}

#[test]
fn what_mirrors_and_leads_show_is_there_too() {
    let world = worlds().swap_remove(3);
    let mut pair = Pair::new(world, 1.0);
    let shell = SightSkeleton::hollow(&pair.world);
    let whole_space = Space::new(pair.world.clone()).unwrap();
    let hollow_space = Space::with_sight(shell, pair.hollow.sight.clone());
    let spaces = [&whole_space, &hollow_space];
    let mut viewers = spaces.map(SpaceViewer::new);
    let mut rng = Rng::new(6);
    let mut n_contexts = 0;
    for _ in 0..30 {
        let camera = camera(&mut rng, &pair.world);
        let view = camera.view(1.5).unwrap();
        let seen = viewers[1].see(&hollow_space, PartId::ROOT, &view);
        let parts = seen.contexts().filter_map(|c| c.of_part(PartId::ROOT));
        let cells: Vec<CellId> = parts.flat_map(|s| s.cells().to_vec()).collect();
        pair.settle(&cells);
        let studios = [&mut pair.whole, &mut pair.hollow];
        let mut pictures = Vec::new();
        for ((studio, space), viewer) in studios.into_iter().zip(spaces).zip(&mut viewers) {
            let shot = SpaceShot {
                space,
                frame: PartId::ROOT,
                camera,
                seen: Some(viewer.see(space, PartId::ROOT, &view)),
                style: style(),
                marks: &[],
                props: &[],
                lamps: None,
            };
            let (picture, counts) = studio.space_picture(&shot, SIZE).unwrap();
            n_contexts += counts.n_contexts - 1;
            pictures.push((picture, counts));
        }
        assert!(pictures[0].0 == pictures[1].0, "{camera:?}");
    }
    assert!(n_contexts > 10, "{n_contexts}");
}

#[test]
fn absent_pieces_are_not_drawn_and_bare_cells_show_their_color_in_portals() {
    let mut rng = Rng::new(11);
    let mut pair = Pair::new(grid(40, 3), 1.0);
    for culling in [Culling::Portals, Culling::Everything, Culling::Frustum] {
        let camera = camera(&mut rng, &pair.world);
        let view = camera.view(1.5).unwrap();
        let list = pair.hollow.list(&view, camera.eye, culling, SIZE);
        assert_eq!(list.n_triangles(), 0);
        pair.pictures(&camera, culling);
        pair.hollow.ids(&camera, culling, SIZE).unwrap();
    }
    // Without outdoors, which sees no wall alone, and without objects: rooms share their mesh.
    let mut pair = Pair::new(
        room_grid(&GridParams {
            outdoors: false,
            windows: 0.0,
            furniture: 0,
            ..GridParams::offices(40, 3)
        }),
        1.0,
    );
    let mut n_filled = 0;
    for _ in 0..20 {
        let camera = camera(&mut rng, &pair.world);
        let view = camera.view(1.5).unwrap();
        let Some(cell) = pair.hollow.sight.locate(camera.eye) else {
            continue;
        };
        pair.settle(&[cell]);
        let list = pair.hollow.list(&view, camera.eye, Culling::Portals, SIZE);
        let stand_ins: BTreeSet<_> = list.stand_ins().iter().copied().collect();
        // Looking through no portal at all fills the same ones.
        pair.whole.sparing = Sparing {
            stop_below: 1e9,
            ..Sparing::default()
        };
        let list = pair.whole.list(&view, camera.eye, Culling::Portals, SIZE);
        let stopped: BTreeSet<_> = list.stand_ins().iter().copied().collect();
        assert!(stand_ins.is_subset(&stopped), "{stand_ins:?} {stopped:?}");
        let [a, b] = pair.pictures(&camera, Culling::Portals);
        if stand_ins == stopped && !stopped.is_empty() {
            n_filled += 1;
            assert!(a == b, "{camera:?}");
        }
    }
    assert!(n_filled > 8, "{n_filled}");
}

#[test]
fn memory_is_never_above_the_limit_and_room_is_never_lost() {
    for (n, world) in worlds().into_iter().enumerate() {
        let mut rng = Rng::new(50 + n as u64);
        let mut pair = Pair::new(world, 0.4);
        let all = pair.hollow.world.free_room();
        let sizes = pair.hollow.sight.skeleton().sizes();
        assert!(all[0] <= sizes[0] * 2 / 5 && all[1] <= sizes[1] * 2 / 5);
        let n_bytes = |pair: &Pair, of| pair.piece(of).n_bytes();
        let mut n_full = 0;
        for _ in 0..600 {
            let of = pair.pieces[rng.below(pair.pieces.len())];
            if rng.below(3) == 0 {
                let was_there = pair.hollow.world.has(of);
                let is_gone = pair.hollow.take(of);
                assert!(was_there || !is_gone);
                continue;
            }
            let before = pair.hollow.world.free_room();
            let is_there = pair.hollow.world.has(of);
            let put = pair.put(of);
            let after = pair.hollow.world.free_room();
            let taken: Vec<u64> = before.iter().zip(after).map(|(a, b)| a - b).collect();
            let bytes = taken[0] * 40 + taken[1] * 4 + taken[2];
            match put {
                Put::Done if is_there => assert_eq!(bytes, 0),
                Put::Done => assert_eq!(bytes, n_bytes(&pair, of)),
                Put::Full => {
                    n_full += 1;
                    assert_eq!(bytes, 0);
                    let primitives = match of {
                        PieceOf::Batch(i) => vec![&pair.world.batches[i as usize].primitive],
                        PieceOf::Mesh(i) => {
                            let mesh = &pair.world.detail_meshes[i as usize];
                            mesh.primitives.iter().collect()
                        }
                        PieceOf::Image(_) => unreachable!("there is room for all pictures"),
                    };
                    let n = |count: fn(&&Primitive) -> usize| {
                        primitives.iter().map(count).sum::<usize>() as u64
                    };
                    // Free triangles in whole, wherever they are.
                    let is_short =
                        before[0] < n(|p| p.positions.len()) || before[1] < n(|p| p.indices.len());
                    assert!(is_short, "{of:?}");
                }
            }
        }
        assert!(n_full > 20, "{n_full}");
        for of in pair.pieces.clone() {
            pair.hollow.take(of);
        }
        assert_eq!(pair.hollow.world.free_room(), all);
    }
}

#[test]
fn what_cannot_be_put_is_an_error_that_says_what_to_do() {
    let mut pair = Pair::new(worlds().swap_remove(2), 1.0);
    let (world, maker) = (&pair.world, &pair.maker);
    let sight = &pair.hollow.sight;
    let damaged = |found: Result<GpuPiece, RenderError>| {
        let why = found.map(|p| p.of()).unwrap_err().to_string();
        assert!(why.contains("fetch"), "{why}");
    };
    let first = &world.batches[0].primitive;
    damaged(maker.batch(sight, 1, first));
    damaged(maker.batch(sight, 9999, first));
    let mesh = &world.detail_meshes[0].primitives;
    damaged(maker.mesh(9999, mesh));
    damaged(maker.mesh(0, &[mesh.clone(), mesh.clone()].concat()));
    let mut broken = mesh.clone();
    broken[0].indices[4] = 5_000_000;
    damaged(maker.mesh(0, &broken));
    damaged(maker.image(3, b""));
    let piece = pair.piece(PieceOf::Batch(0));
    let found = pair.whole.put(&piece).unwrap_err();
    assert_eq!(found, RenderError::NotHollow);
    assert!(!pair.whole.take(PieceOf::Batch(0)));
    assert!(pair.whole.world.has(PieceOf::Batch(0)));
    let needs_whole = |found: Result<(), RenderError>| {
        assert!(
            matches!(found, Err(RenderError::NeedsWhole { .. })),
            "{found:?}"
        );
    };
    needs_whole(pair.hollow.add_light(&pair.world));
    needs_whole(pair.hollow.add_levels(&pair.world));
    // A piece larger than all room: no taking away helps.
    let mut tiny = Pair::new(grid(20, 9), 1e-3);
    let found = tiny.pieces.clone().into_iter().map(|of| {
        let piece = tiny.piece(of);
        tiny.hollow.put(&piece)
    });
    let mut found = found.filter(|p| !matches!(p, Ok(Put::Done | Put::Full)));
    assert!(matches!(
        found.next(),
        Some(Err(RenderError::TooLarge { .. }))
    ));
}

/// With `ENFILADE_TEST_WORLDS`, a folder of baked worlds: real buildings, packed against whole.
#[test]
fn real_buildings_settle() {
    let Some(dir) = std::env::var_os("ENFILADE_TEST_WORLDS") else {
        eprintln!("skipped: ENFILADE_TEST_WORLDS names no folder of worlds");
        return;
    };
    let mut files: Vec<_> = std::fs::read_dir(dir)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    files.retain(|p| p.extension().is_some_and(|e| e == "glb"));
    files.sort();
    for file in files {
        let world = wire::decode_glb(&std::fs::read(&file).unwrap()).unwrap();
        let mut pair = Pair::new(world, 1.0);
        let mut rng = Rng::new(1);
        let (mut n_there, mut n_pieces) = (0, 0);
        for _ in 0..200 {
            let camera = camera(&mut rng, &pair.world);
            let view = camera.view(1.5).unwrap();
            let (sight, state) = (&pair.hollow.sight, &pair.hollow.state);
            let seen = pair.hollow.viewer.see(sight, state, &view);
            let cells = if seen.counts().is_eye_lost || seen.counts().is_capped {
                (0..sight.n_cells() as u32).map(CellId).collect()
            } else {
                seen.cells().to_vec()
            };
            pair.settle(&cells);
            let there = pair.pieces.iter().filter(|of| pair.hollow.world.has(**of));
            n_there += there.count();
            n_pieces += pair.pieces.len();
            let [a, b] = pair.pictures(&camera, Culling::Portals);
            assert!(a == b, "{}: {camera:?}", file.display());
        }
        eprintln!("{}: {n_there} of {n_pieces} pieces", file.display());
        for of in pair.pieces.clone() {
            pair.hollow.take(of);
        }
        let mut times = [Vec::new(), Vec::new()];
        for of in pair.pieces.clone() {
            let start = Instant::now();
            let piece = pair.piece(of);
            times[0].push(start.elapsed());
            let start = Instant::now();
            assert_eq!(pair.hollow.put(&piece).unwrap(), Put::Done);
            times[1].push(start.elapsed());
        }
        for (times, what) in times.iter_mut().zip(["made ready", "put"]) {
            times.sort_unstable();
            let at = |share: usize| times[(times.len() - 1) * share / 100];
            let [middle, most] = [50, 100].map(at);
            eprintln!("  {what} in {middle:?}, {most:?} at most");
        }
    }
}
