//! Rooms on an adapter that is smaller than the streamer believes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use enfilade::stream::PackedWorld;
use enfilade_render::{AdapterChoice, Camera, Culling, FOV, StreamLimits, Style, walk_cameras};
use enfilade_testkit::{GridParams, room_grid};

use super::*;

const SIZE: [u32; 2] = [64, 48];

fn gpu() -> Gpu {
    Gpu::open(&AdapterChoice::Software).unwrap()
}

fn pack(name: &str, world: &enfilade::World) -> PathBuf {
    let dir = std::env::temp_dir().join(format!("enfilade-{name}-{}", std::process::id()));
    let glb = enfilade::cpg::wire::encode_glb(world).unwrap();
    std::fs::write(&dir, PackedWorld::pack(&glb).unwrap().one_file().unwrap()).unwrap();
    dir
}

fn look(streamed: &mut Streamed, studio: &mut Studio, camera: &Camera) {
    let view = camera.view(SIZE[0] as f32 / SIZE[1] as f32).unwrap();
    let mut cells = BTreeMap::new();
    let seen = studio.viewer.see(&studio.sight, &studio.state, &view);
    cells_in_view(&seen, studio.sight.n_cells(), &mut cells);
    streamed.look(view_of(&cells));
}

#[test]
fn pieces_in_view_take_the_room_of_others_that_come_back_when_they_are_in_view() {
    let world = room_grid(&GridParams {
        outdoors: false,
        windows: 0.0,
        ..GridParams::offices(60, 4)
    });
    let path = pack("room", &world);
    let packed = Packed::open(&path).unwrap();
    let sight = packed.head.sight().unwrap();
    let mut whole = Studio::new(gpu(), &world).unwrap();
    let [n_corners, n_indices] = sight.skeleton().sizes();
    let limits = StreamLimits {
        triangle_bytes: (n_corners * 40 + n_indices * 4) / 3,
        picture_bytes: 0,
    };
    let format = wgpu::TextureFormat::Rgba8UnormSrgb;
    let shell = &packed.head.world;
    let mut studio = Studio::hollow(gpu(), shell, sight, &limits, format).unwrap();
    // The streamer takes all of it for resident.
    let options = StreamOptions {
        policy: Policy::Cache,
        ..StreamOptions::default()
    };
    let catalog = packed.head.catalog.clone();
    let mut streamed = Streamed::new(packed, catalog, &studio, options, u64::MAX).unwrap();
    let cameras = walk_cameras(&world, &whole.sight, 400, FOV);
    let style = Style {
        shadows: false,
        daylight: false,
        ..Style::default()
    };
    for camera in cameras
        .iter()
        .step_by(4)
        .chain(cameras.iter().rev().step_by(40))
    {
        look(&mut streamed, &mut studio, camera);
        streamed.settle(&mut studio, Eye::default()).unwrap();
        let [a, b] = [&mut whole, &mut studio].map(|s| {
            s.picture(camera, Culling::Portals, style, &[], SIZE)
                .unwrap()
        });
        assert!(a == b, "{camera:?}");
    }
    let counts = streamed.counts();
    assert!(
        counts.loaded[0] > counts.loaded[1],
        "{counts}: nothing came twice"
    );
    std::fs::remove_file(path).unwrap();
}
