//! Portal textures of rooms whose lamps change. Covers X2.

use std::ops::ControlFlow;

use enfilade_cpg::World;
use enfilade_render::{
    AdapterChoice, Camera, Culling, Gpu, LampLight, Picture, PortalTextureCounts,
    PortalTextureMaking, PortalTextureOptions, Studio, Style, Viewpoints,
};
use enfilade_testkit::{GridParams, room_grid};
use enfilade_world::PartId;

const SIZE: [u32; 2] = [80, 60];

/// Without effects that depend on neighboring pixels.
fn style() -> Style {
    Style {
        dark_corners: false,
        shadows: false,
        ..Style::default()
    }
}

/// A studio at night, with a lamp in each room.
fn studio(world: &World) -> Studio {
    let gpu = Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"));
    let mut studio = Studio::new(gpu, world).unwrap();
    studio.add_light(world).unwrap();
    studio.day = 0.0;
    studio.set_lamps(lamps(world)).unwrap();
    let options = PortalTextureOptions {
        viewpoints: Viewpoints::Warped { spacing: 0.25 },
        side: 64,
        max_made: 1000,
        transition_frames: 0,
        ..PortalTextureOptions::default()
    };
    studio.add_portal_textures(options).unwrap();
    studio
}

fn middles(world: &World, height: f32) -> Vec<[f32; 3]> {
    let cells = world.graph.indoor_cells();
    let middle = |[low, high]: [[f32; 3]; 2]| {
        let [x, z] = [0, 2].map(|k| (low[k] + high[k]) * 0.5);
        [x, low[1] + height, z]
    };
    cells.map(|(_, cell)| middle(cell.aabb)).collect()
}

fn lamps(world: &World) -> Vec<LampLight> {
    let lamp = |at| LampLight {
        part: PartId::ROOT,
        at,
        color: [4.0, 3.6, 3.0],
        range: 6.0,
        cone: None,
    };
    middles(world, 2.2).into_iter().map(lamp).collect()
}

fn cameras(world: &World) -> Vec<Camera> {
    let towards = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let eyes = middles(world, 1.6).into_iter();
    let all = eyes.flat_map(|eye| towards.map(|toward| (eye, toward)));
    all.map(|(eye, toward)| Camera {
        eye,
        toward,
        fov_y: 60_f32.to_radians(),
    })
    .collect()
}

fn plan(studio: &mut Studio, camera: &Camera) -> PortalTextureCounts {
    studio.plan_portal_textures(camera, style(), SIZE).unwrap()
}

fn picture(studio: &mut Studio, camera: &Camera) -> Picture {
    let culling = Culling::PortalTextures;
    studio.picture(camera, culling, style(), &[], SIZE).unwrap()
}

#[test]
fn a_lamp_that_changes_makes_the_textures_anew_that_show_its_light() {
    let world = room_grid(&GridParams::offices(12, 3));
    let [mut studio, mut fresh] = [(), ()].map(|()| studio(&world));
    let all = lamps(&world);
    // As many as a picture has: none takes the place of another.
    assert!(all.len() <= 16, "{}", all.len());
    let (mut n_kept, mut n_anew) = (0, 0);
    for camera in cameras(&world) {
        plan(&mut studio, &camera);
        let settled = plan(&mut studio, &camera);
        assert_eq!(settled.n_made, 0);
        if settled.n_textured == 0 {
            continue;
        }
        // The same lamps in another order.
        let mut turned = all.clone();
        turned.reverse();
        studio.set_lamps(turned).unwrap();
        assert_eq!(plan(&mut studio, &camera).n_made, 0);
        for dark in 0..all.len() {
            let mut fewer = all.clone();
            fewer[dark].color = [0.0; 3];
            studio.set_lamps(fewer.clone()).unwrap();
            let off = plan(&mut studio, &camera);
            fresh.set_lamps(fewer).unwrap();
            fresh.clear_portal_textures();
            let [a, b] = [&mut studio, &mut fresh].map(|s| picture(s, &camera));
            assert!(a == b, "without lamp {dark}: {camera:?}");
            studio.set_lamps(all.clone()).unwrap();
            let on = plan(&mut studio, &camera);
            assert_eq!(on.n_made, off.n_made);
            n_anew += usize::from(off.n_made > 0);
            n_kept += usize::from(off.n_made == 0);
        }
    }
    assert!(n_anew > 5 && n_kept > 5, "{n_anew} {n_kept}");
}

#[test]
fn textures_made_ahead_wait_until_lamps_are_as_they_were() {
    let world = room_grid(&GridParams::offices(5, 3));
    let mut studio = studio(&world);
    let making = PortalTextureMaking {
        style: style(),
        lines: SIZE[1],
        ..PortalTextureMaking::default()
    };
    let go_on = &mut |_| ControlFlow::Continue(());
    let made = studio.make_portal_textures(&world, &making, go_on).unwrap();
    studio.load_portal_textures(&made.bytes).unwrap();
    let all = lamps(&world);
    let count = |studio: &mut Studio| {
        studio.clear_portal_textures();
        let counts = cameras(&world).into_iter().map(|c| plan(studio, &c));
        counts.fold([0; 2], |n, c| [n[0] + c.n_made, n[1] + c.n_loaded])
    };
    let [made, loaded] = count(&mut studio);
    assert!(made == 0 && loaded > 5, "{made} {loaded}");
    let mut fewer = all.clone();
    fewer[0].color = [0.0; 3];
    studio.set_lamps(fewer).unwrap();
    let [anew, rest] = count(&mut studio);
    assert!(anew > 0 && anew + rest == loaded, "{anew} {rest}");
    studio.set_lamps(all).unwrap();
    assert_eq!(count(&mut studio), [0, loaded]);
}
