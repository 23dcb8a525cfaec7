//! A walk through a packed world that does not fit in memory: what is shown, once it is there, and the memory that it takes.

use crate::pictured;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use enfilade::runtime::SightState;
use enfilade::stream::{Eye, PackedWorld};
use enfilade_cli::streamed::{Packed, Streamed, cells_in_view, view_of};
use enfilade_cpg::World;
use enfilade_cpg::wire::{decode_glb, encode_glb};
use enfilade_render::{AdapterChoice, Camera, Culling, FOV, Gpu, Studio, Style, walk_cameras};
use enfilade_testkit::{GridParams, room_grid, with_doors};
use pictured::pictured;

const SIZE: [u32; 2] = [96, 64];
const PATIENCE: Duration = Duration::from_secs(60);

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software).unwrap()
}

fn style() -> Style {
    Style {
        dark_corners: false,
        shadows: false,
        daylight: false,
        ..Style::default()
    }
}

fn packed(name: &str, world: &World) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let packed = PackedWorld::pack(&encode_glb(world).unwrap()).unwrap();
    fs::write(&path, packed.one_file().unwrap()).unwrap();
    path
}

fn rooms(n: usize) -> World {
    let grid = room_grid(&GridParams {
        outdoors: false,
        windows: 0.0,
        ..GridParams::offices(n, 4)
    });
    let world = pictured(with_doors(grid, |p| p % 3 == 0));
    // As it is after a file.
    decode_glb(&encode_glb(&world).unwrap()).unwrap()
}

/// A walker with a window's share of memory.
struct Walk {
    studio: Studio,
    streamed: Streamed,
    memory: u64,
    /// Room on the adapter before anything came.
    room: [u64; 3],
    most: u64,
}

impl Walk {
    fn open(path: &Path, memory: u64) -> Self {
        let packed = Packed::open(path).unwrap();
        let sight = packed.head.sight().unwrap();
        let format = wgpu::TextureFormat::Rgba8UnormSrgb;
        let (studio, streamed) = Streamed::for_walk(packed, gpu(), sight, memory, format).unwrap();
        Self {
            room: studio.world.free_room(),
            studio,
            streamed,
            memory,
            most: 0,
        }
    }

    fn frame(&mut self, camera: &Camera) {
        let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
        let sight = &self.studio.sight;
        let mut cells = BTreeMap::new();
        let seen = self.studio.viewer.see(sight, &self.studio.state, &view);
        cells_in_view(&seen, sight.n_cells(), &mut cells);
        self.streamed.look(view_of(&cells));
        let eye = Eye {
            cell: sight.locate(camera.eye),
            position: camera.eye,
            speed: 5.0,
        };
        self.streamed
            .frame(&mut self.studio, eye, Duration::from_millis(1));
        let left = self.studio.world.free_room();
        let [corners, indices, texels] = [0, 1, 2].map(|k| self.room[k] - left[k]);
        self.most = self.most.max(corners * 40 + indices * 4 + texels);
        assert!(self.most <= self.memory);
        let counts = self.streamed.counts();
        assert!(counts.kept[0] <= counts.kept[1] && counts.kept[1] < self.memory);
    }

    /// Runs frames until all in view is there.
    fn settle(&mut self, camera: &Camera) {
        let end = Instant::now() + PATIENCE;
        loop {
            self.frame(camera);
            let counts = self.streamed.counts();
            if self.streamed.is_settled() && counts.n_late == 0 {
                return;
            }
            assert!(
                Instant::now() < end,
                "{counts}, {:?}",
                self.streamed.problem()
            );
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn settled_frames_of_a_walk_are_those_of_the_whole_world_and_memory_keeps_to_its_limit() {
    let world = rooms(60);
    let path = packed("walk.enf", &world);
    let mut whole = Studio::new(gpu(), &world).unwrap();
    let sizes = whole.sight.skeleton().sizes();
    let pictures: usize = world.images.iter().map(|i| 32 * i.bytes.len()).sum();
    let memory = sizes[0] * 40 + sizes[1] * 4 + pictures as u64;
    let mut walk = Walk::open(&path, memory);
    let cameras = walk_cameras(&world, &whole.sight, 120, FOV);
    let mut n_absent = 0;
    for camera in cameras.iter().step_by(3) {
        walk.settle(camera);
        let counts = walk.streamed.counts();
        n_absent += usize::from(counts.n_there[0] < counts.n_there[1]);
        let [a, b] = [&mut whole, &mut walk.studio].map(|s| {
            s.picture(camera, Culling::Portals, style(), &[], SIZE)
                .unwrap()
        });
        assert!(a == b, "{camera:?}");
    }
    let counts = walk.streamed.counts();
    eprintln!(
        "{counts}; {} of {memory} bytes, loaded {:?}",
        walk.most, counts.loaded
    );
    assert!(n_absent > 20, "{n_absent}");
}

#[test]
fn a_view_that_does_not_fit_is_drawn_as_far_as_it_does() {
    let world = rooms(40);
    let path = packed("tight.enf", &world);
    let sizes = enfilade::Sight::build(&world).unwrap().skeleton().sizes();
    // One room or two have room.
    let memory = (sizes[0] * 40 + sizes[1] * 4) / 16;
    let mut walk = Walk::open(&path, memory);
    let cameras = walk_cameras(&world, &walk.studio.sight.clone(), 60, FOV);
    let mut n_late = 0;
    for camera in cameras.iter().step_by(4) {
        for _ in 0..60 {
            walk.frame(camera);
            std::thread::sleep(Duration::from_millis(1));
        }
        n_late += walk.streamed.counts().n_late;
        walk.studio
            .picture(camera, Culling::Portals, style(), &[], SIZE)
            .unwrap();
    }
    assert!(walk.most > memory / 8 && n_late > 0, "{n_late}");
}

#[test]
fn a_view_is_settled_for_a_picture_alone() {
    let world = rooms(40);
    let path = packed("alone.enf", &world);
    let packed = Packed::open(&path).unwrap();
    let sight = packed.head.sight().unwrap();
    let mut whole = Studio::new(gpu(), &world).unwrap();
    let camera = walk_cameras(&world, &sight, 8, FOV)[4];
    let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
    let mut cells = BTreeMap::new();
    let seen = whole.viewer.see(&whole.sight, &whole.state, &view);
    cells_in_view(&seen, sight.n_cells(), &mut cells);
    let views = [view_of(&cells)];
    let state = SightState::new(&sight);
    let opened = Streamed::for_views(packed, gpu(), sight, state, &views).unwrap();
    let (mut studio, mut streamed) = opened;
    let [view] = views;
    streamed.look(view);
    streamed.settle(&mut studio, Eye::default()).unwrap();
    assert_eq!(streamed.counts().n_late, 0);
    let [a, b] = [&mut whole, &mut studio].map(|s| {
        s.picture(&camera, Culling::Portals, style(), &[], SIZE)
            .unwrap()
    });
    assert!(a == b);
}
