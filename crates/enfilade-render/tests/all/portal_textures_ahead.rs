//! Portal textures that were made ahead, against those drawn when wanted. Covers X2.

use std::ops::ControlFlow;

use enfilade_cpg::{PortalId, World};
use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Gpu, LampLight, MadePortalTextures, Picture,
    PortalTextureCounts, PortalTextureFileError, PortalTextureMaking, PortalTextureOptions,
    PortalTextureProgress, RenderError, Studio, Style, Viewpoints,
};
use enfilade_testkit::{GridParams, room_grid};
use enfilade_world::PartId;

const SIZE: [u32; 2] = [80, 60];

const ASPECT: f32 = 4.0 / 3.0;

fn offices() -> World {
    room_grid(&GridParams::offices(5, 3))
}

fn studio(world: &World) -> Studio {
    let gpu = Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"));
    let mut studio = Studio::new(gpu, world).unwrap();
    studio.add_portal_textures(options()).unwrap();
    studio
}

fn options() -> PortalTextureOptions {
    PortalTextureOptions {
        viewpoints: Viewpoints::Warped { spacing: 0.25 },
        side: 64,
        max_made: 1000,
        transition_frames: 0,
        ..PortalTextureOptions::default()
    }
}

fn style() -> Style {
    Style {
        shadows: false,
        ..Style::default()
    }
}

fn making() -> PortalTextureMaking {
    PortalTextureMaking {
        style: style(),
        lines: SIZE[1],
        ..PortalTextureMaking::default()
    }
}

fn made(studio: &mut Studio, world: &World, making: &PortalTextureMaking) -> MadePortalTextures {
    let go_on = &mut |_| ControlFlow::Continue(());
    studio.make_portal_textures(world, making, go_on).unwrap()
}

/// Cameras in the middle of each room, at eye height, in four directions.
fn cameras(world: &World) -> Vec<Camera> {
    let mut out = Vec::new();
    for (_, cell) in world.graph.indoor_cells() {
        let [low, high] = cell.aabb;
        let middle = [0, 2].map(|k| (low[k] + high[k]) * 0.5);
        for toward in [
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ] {
            out.push(Camera {
                eye: [middle[0], low[1] + 1.6, middle[1]],
                toward,
                fov_y: 60_f32.to_radians(),
            });
        }
    }
    out
}

fn planned(studio: &mut Studio, camera: &Camera) -> (PortalTextureCounts, Picture) {
    let counts = studio.plan_portal_textures(camera, style(), SIZE).unwrap();
    let view = camera.view(ASPECT).unwrap();
    let list = studio.list(&view, camera.eye, Culling::PortalTextures, SIZE);
    let list = list.clone();
    let frame = Frame {
        projection: camera.projection(ASPECT).unwrap(),
        list: &list,
        style: style(),
        marks: &[],
    };
    (counts, studio.picture_of(&frame, SIZE).unwrap())
}

fn mean_difference(a: &Picture, b: &Picture) -> f64 {
    let pairs = a.rgba.iter().zip(&b.rgba);
    let sum: u64 = pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.rgba.len() as f64
}

/// Compares the pictures of two studios; returns the numbers of textures drawn by the first, and drawn and loaded by the second.
fn compared(drawing: &mut Studio, loading: &mut Studio, world: &World) -> [usize; 3] {
    let mut n = [0; 3];
    for camera in cameras(world) {
        let (drawn, a) = planned(drawing, &camera);
        let (loaded, b) = planned(loading, &camera);
        assert_eq!(drawn.n_textured, loaded.n_textured, "{camera:?}");
        let mean = mean_difference(&a, &b);
        assert!(mean <= 1.0, "mean {mean:.2} of 255: {camera:?}");
        let own = [drawn.n_made, loaded.n_made, loaded.n_loaded];
        n = [0, 1, 2].map(|k| n[k] + own[k]);
    }
    n
}

#[test]
fn textures_made_ahead_show_the_same_and_are_not_drawn_again() {
    let world = offices();
    let mut drawing = studio(&world);
    let mut looked = 0;
    let mut drawn = 0;
    let made = drawing
        .make_portal_textures(&world, &making(), &mut |now| {
            match now {
                PortalTextureProgress::Looking { done, all } => {
                    assert!(done < all && drawn == 0);
                    looked += 1;
                }
                PortalTextureProgress::Drawing { done, all, .. } => {
                    assert!(done < all);
                    drawn += 1;
                }
                _ => unreachable!("looked, then drawn"),
            }
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!((looked, drawn), (made.n_places, made.n_textures));
    assert!(
        made.n_textures > 50 && made.n_doorways > 2,
        "{} {}",
        made.n_textures,
        made.n_doorways
    );
    assert_eq!((made.n_left_out, made.n_special), (0, 0));
    let mut loading = studio(&world);
    let n = loading.load_portal_textures(&made.bytes).unwrap();
    assert_eq!(n, made.n_textures);
    let [by_drawing, by_loading, loaded] = compared(&mut drawing, &mut loading, &world);
    assert!(by_drawing > 5, "{by_drawing}");
    assert_eq!((by_loading, loaded), (0, by_drawing));
    // An eye a little higher counts as at the height of the file.
    let mut taller = cameras(&world);
    taller.iter_mut().for_each(|c| c.eye[1] += 0.08);
    loading.clear_portal_textures();
    let counts = taller.iter().map(|c| planned(&mut loading, c).0);
    let n = counts.fold([0; 2], |n, c| [n[0] + c.n_made, n[1] + c.n_loaded]);
    assert!(n[0] == 0 && n[1] > 5, "{n:?}");
}

#[test]
fn textures_made_ahead_are_left_alone_where_doors_or_the_look_differ() {
    let world = offices();
    let mut drawing = studio(&world);
    let file = made(&mut drawing, &world, &making()).bytes;
    let mut loading = studio(&world);
    loading.load_portal_textures(&file).unwrap();
    for own in [&mut drawing, &mut loading] {
        own.state.close(PortalId(1));
    }
    let [by_drawing, by_loading, loaded] = compared(&mut drawing, &mut loading, &world);
    assert!(
        by_loading > 0 && by_loading + loaded == by_drawing,
        "{by_drawing} {by_loading} {loaded}"
    );
    for own in [&mut drawing, &mut loading] {
        own.state.open(PortalId(1));
    }
    let [_, by_loading, _] = compared(&mut drawing, &mut loading, &world);
    assert_eq!(by_loading, 0);
    let plain = Style {
        dark_corners: false,
        ..style()
    };
    let counts = cameras(&world).into_iter().map(|camera| {
        let counts = loading.plan_portal_textures(&camera, plain, SIZE);
        counts.unwrap()
    });
    let n = counts.fold([0; 2], |n, c| [n[0] + c.n_made, n[1] + c.n_loaded]);
    assert!(n[0] > 0 && n[1] == 0, "{n:?}");
}

#[test]
fn files_keep_to_their_budget_and_a_making_can_be_stopped() {
    let world = offices();
    let mut studio = studio(&world);
    let mut last = 0;
    for max_bytes in [2_000, 20_000, 60_000] {
        let own = PortalTextureMaking {
            max_bytes,
            ..making()
        };
        let made = made(&mut studio, &world, &own);
        assert!(made.bytes.len() as u64 <= max_bytes);
        assert!(made.n_left_out > 0 && made.n_textures >= last);
        last = made.n_textures;
        let loaded = studio.load_portal_textures(&made.bytes).unwrap();
        assert_eq!(loaded, made.n_textures);
    }
    assert!(last > 5, "{last}");
    let none = PortalTextureMaking {
        max_bytes: 0,
        ..making()
    };
    let go_on = &mut |_| ControlFlow::Continue(());
    let refused = studio.make_portal_textures(&world, &none, go_on);
    let no_room = |e: &RenderError| {
        matches!(
            e,
            RenderError::PortalTextureFile(PortalTextureFileError::NoRoom { budget: 0, .. })
        )
    };
    assert!(refused.is_err_and(|e| no_room(&e)));
    let mut stop = |_| ControlFlow::Break(());
    let made = studio
        .make_portal_textures(&world, &making(), &mut stop)
        .unwrap();
    assert_eq!(made.n_textures, 0);
    assert_eq!(studio.load_portal_textures(&made.bytes), Ok(0));
}

#[test]
fn files_for_other_worlds_settings_or_lights_are_refused() {
    let world = offices();
    let mut own = studio(&world);
    let small = PortalTextureMaking {
        max_bytes: 20_000,
        ..making()
    };
    let file = made(&mut own, &world, &small).bytes;
    let refused = |studio: &mut Studio, file: &[u8]| match studio.load_portal_textures(file) {
        Err(RenderError::PortalTextureFile(why)) => why,
        other => panic!("{other:?}"),
    };
    let other = room_grid(&GridParams::offices(12, 3));
    assert_eq!(
        refused(&mut studio(&other), &file),
        PortalTextureFileError::OtherWorld
    );
    assert_eq!(
        refused(&mut own, b"glTF and more"),
        PortalTextureFileError::Foreign
    );
    assert_eq!(refused(&mut own, b""), PortalTextureFileError::Foreign);
    let mut bad = file.clone();
    let middle = file.len() / 2;
    bad[middle] ^= 1;
    for bad in [&bad, &file[..middle]] {
        let why = refused(&mut own, bad);
        assert!(matches!(why, PortalTextureFileError::Damaged { .. }));
    }
    own.set_lamps(vec![LampLight {
        part: PartId::ROOT,
        at: [2.0, 2.5, 1.0],
        color: [2.0; 3],
        range: 8.0,
        cone: None,
    }])
    .unwrap();
    assert_eq!(refused(&mut own, &file), PortalTextureFileError::OtherLight);
    let side = PortalTextureOptions {
        side: 32,
        ..options()
    };
    let spacing = PortalTextureOptions {
        viewpoints: Viewpoints::Warped { spacing: 0.5 },
        ..options()
    };
    let wrong = [
        (
            side,
            PortalTextureFileError::OtherSide {
                found: 64,
                wanted: 32,
            },
        ),
        (spacing, PortalTextureFileError::OtherViewpoints),
    ];
    for (options, why) in wrong {
        own.add_portal_textures(options).unwrap();
        assert_eq!(refused(&mut own, &file), why);
    }
    own.remove_portal_textures();
    assert_eq!(refused(&mut own, &file), PortalTextureFileError::Off);
    let go_on = &mut |_| ControlFlow::Continue(());
    let off = own.make_portal_textures(&world, &making(), go_on);
    assert_eq!(off.unwrap_err(), PortalTextureFileError::Off.into());
}
