//! Portal textures against pictures of the same views through portals.

use enfilade_cpg::World;
use enfilade_render::{
    AdapterChoice, Camera, Culling, Frame, Gpu, Picture, PortalTextureOptions, PortalTexturePaint,
    RenderError, RenderList, Studio, Style, Viewpoints, walk_cameras,
};
use enfilade_testkit::{GridParams, room_grid};

const SIZE: [u32; 2] = [320, 240];

const ASPECT: f32 = 4.0 / 3.0;

fn offices(n: usize) -> World {
    room_grid(&GridParams::offices(n, 3))
}

fn studio(world: &World) -> Studio {
    let gpu = Gpu::open(&AdapterChoice::Software)
        .unwrap_or_else(|why| panic!("these tests need a software adapter: {why}"));
    Studio::new(gpu, world).unwrap()
}

fn style() -> Style {
    Style {
        shadows: false,
        ..Style::default()
    }
}

fn cameras(world: &World, studio: &Studio, n: usize) -> Vec<Camera> {
    walk_cameras(world, &studio.sight, n, 60_f32.to_radians())
}

fn list(studio: &mut Studio, camera: &Camera, culling: Culling) -> RenderList {
    let view = camera.view(ASPECT).unwrap();
    studio.list(&view, camera.eye, culling, SIZE).clone()
}

fn picture(studio: &mut Studio, camera: &Camera, list: &RenderList) -> Picture {
    let frame = Frame {
        projection: camera.projection(ASPECT).unwrap(),
        list,
        style: style(),
        marks: &[],
    };
    studio.picture_of(&frame, SIZE).unwrap()
}

/// Picture of textures, true picture, and for each pixel whether it is from a texture and whether it is a hole.
struct Compared {
    textured: Picture,
    truth: Picture,
    is_textured: Vec<bool>,
    is_hole: Vec<bool>,
}

fn compared(studio: &mut Studio, camera: &Camera) -> Compared {
    studio.plan_portal_textures(camera, style(), SIZE).unwrap();
    let own = list(studio, camera, Culling::PortalTextures);
    let textured = picture(studio, camera, &own);
    studio.paint_portal_textures(PortalTexturePaint::Tinted);
    let tinted = picture(studio, camera, &own);
    studio.paint_portal_textures(PortalTexturePaint::Holes);
    let holes = picture(studio, camera, &own);
    studio.paint_portal_textures(PortalTexturePaint::Plain);
    let all = list(studio, camera, Culling::Portals);
    let truth = picture(studio, camera, &all);
    let differs = |a: &Picture, b: &Picture| {
        let pairs = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
        pairs.map(|(a, b)| a != b).collect()
    };
    Compared {
        is_textured: differs(&textured, &tinted),
        is_hole: differs(&textured, &holes),
        textured,
        truth,
    }
}

/// Returns the sum of the differences of the pixels from textures, their number, and that of holes.
fn errors(own: &Compared) -> [u64; 3] {
    let mut out = [0; 3];
    for (i, is_textured) in own.is_textured.iter().enumerate() {
        let [a, b] = [&own.textured, &own.truth].map(|p| &p.rgba[i * 4..i * 4 + 3]);
        if *is_textured {
            let sum: u64 = (a.iter().zip(b))
                .map(|(a, b)| u64::from(a.abs_diff(*b)))
                .sum();
            out[0] += sum;
            out[1] += 1;
            out[2] += u64::from(own.is_hole[i]);
        }
    }
    out
}

fn options() -> PortalTextureOptions {
    PortalTextureOptions {
        max_made: 1000,
        transition_frames: 0,
        ..PortalTextureOptions::default()
    }
}

// Covers X1, X4.
#[test]
fn warped_textures_show_what_is_behind() {
    let world = offices(40);
    let mut studio = studio(&world);
    studio.add_portal_textures(options()).unwrap();
    let mut sum = [0; 3];
    let mut n_fewer = 0;
    for camera in cameras(&world, &studio, 16) {
        let own = compared(&mut studio, &camera);
        let [error, n, holes] = errors(&own);
        sum = [sum[0] + error, sum[1] + n, sum[2] + holes];
        let [few, many] = [Culling::PortalTextures, Culling::Portals]
            .map(|culling| list(&mut studio, &camera, culling).n_triangles());
        assert!(few <= many);
        n_fewer += usize::from(few < many);
        // All other pixels are as they were.
        for (i, is_textured) in own.is_textured.iter().enumerate() {
            let [a, b] = [&own.textured, &own.truth].map(|p| &p.rgba[i * 4..i * 4 + 3]);
            let near = || {
                // Ambient occlusion reaches over the edge of a doorway.
                a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) < 40)
            };
            assert!(
                *is_textured || near(),
                "{camera:?}, pixel {i}: {a:?}, {b:?}"
            );
        }
    }
    let [error, n, holes] = sum;
    assert!(n > 2_000 && n_fewer > 4, "{n} pixels, {n_fewer} views");
    let mean = error as f64 / 3.0 / n as f64;
    // Errors of edges, and of the noise of ambient occlusion, which lies elsewhere in the texture: 2.6 when this was written, and 2.7
    // without the contrast of tones, which is not their cause.
    assert!(mean < 3.0, "mean error {mean:.2} of 255 in {n} pixels");
    assert!(holes * 1000 <= n, "{holes} holes of {n} pixels");
}

// Covers X1.
#[test]
fn flat_textures_are_worse_than_warped_ones() {
    let world = offices(40);
    let mut studio = studio(&world);
    let cameras = cameras(&world, &studio, 16);
    let mut mean = |viewpoints| {
        let options = PortalTextureOptions {
            viewpoints,
            ..options()
        };
        studio.add_portal_textures(options).unwrap();
        let mut sum = [0; 2];
        for camera in &cameras {
            let [error, n, _] = errors(&compared(&mut studio, camera));
            sum = [sum[0] + error, sum[1] + n];
        }
        assert!(sum[1] > 1_000, "{sum:?}");
        sum[0] as f64 / sum[1] as f64
    };
    let warped = mean(Viewpoints::Warped { spacing: 0.0625 });
    let flat = [
        Viewpoints::semicircle(10.0),
        Viewpoints::Grid { spacing: 1.0 },
        Viewpoints::Single {
            radius: 4.0,
            height: 1.6,
        },
    ]
    .map(mean);
    assert!(flat.iter().all(|f| *f > 2.0 * warped), "{warped} {flat:?}");
}

// Covers X2.
#[test]
fn textures_are_kept_within_the_budget_and_made_again_when_a_style_changes() {
    let world = offices(40);
    let mut studio = studio(&world);
    let each = options().bytes_each();
    let own = PortalTextureOptions {
        max_bytes: 6 * each + 1,
        ..options()
    };
    studio.add_portal_textures(own).unwrap();
    let cameras = cameras(&world, &studio, 16);
    let mut n_made = 0;
    for camera in &cameras {
        let counts = studio.plan_portal_textures(camera, style(), SIZE).unwrap();
        assert!(
            counts.n_held <= 6 && counts.n_bytes <= 6 * each,
            "{counts:?}"
        );
        n_made += counts.n_made;
        let again = studio.plan_portal_textures(camera, style(), SIZE).unwrap();
        assert!(again.n_held <= 6);
    }
    assert!(n_made > 6, "{n_made}");
    studio.add_portal_textures(options()).unwrap();
    let camera = cameras
        .iter()
        .find(|c| {
            studio
                .plan_portal_textures(c, style(), SIZE)
                .unwrap()
                .n_made
                > 0
        })
        .expect("some view has textures");
    let counts = studio.plan_portal_textures(camera, style(), SIZE).unwrap();
    assert_eq!((counts.n_made, counts.n_textured > 0), (0, true));
    let plain = Style {
        dark_corners: false,
        ..style()
    };
    let counts = studio.plan_portal_textures(camera, plain, SIZE).unwrap();
    assert!(counts.n_made > 0);
}

#[test]
fn the_bound_on_triangles_holds_everywhere() {
    let world = offices(40);
    let mut studio = studio(&world);
    for most in [0, 1, 50, 200, 1_000] {
        let own = PortalTextureOptions {
            max_triangles: most,
            ..options()
        };
        studio.add_portal_textures(own).unwrap();
        for camera in cameras(&world, &studio, 12) {
            let counts = studio.plan_portal_textures(&camera, style(), SIZE).unwrap();
            let own = list(&mut studio, &camera, Culling::PortalTextures);
            assert!(own.n_triangles() + counts.n_made_triangles <= most);
        }
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let world = offices(2);
    let mut studio = studio(&world);
    let good = PortalTextureOptions::default;
    let bad = [
        PortalTextureOptions {
            max_bytes: 0,
            ..good()
        },
        PortalTextureOptions {
            max_bytes: good().bytes_each() - 1,
            ..good()
        },
        PortalTextureOptions { side: 8, ..good() },
        PortalTextureOptions {
            transition_distance: f32::NAN,
            ..good()
        },
        PortalTextureOptions {
            viewpoints: Viewpoints::Warped { spacing: 0.0 },
            ..good()
        },
        PortalTextureOptions {
            viewpoints: Viewpoints::semicircle(0.0),
            ..good()
        },
        PortalTextureOptions {
            viewpoints: Viewpoints::Grid { spacing: f64::NAN },
            ..good()
        },
        PortalTextureOptions {
            viewpoints: Viewpoints::Single {
                radius: 0.0,
                height: 1.0,
            },
            ..good()
        },
    ];
    for options in bad {
        let refused = studio.add_portal_textures(options.clone());
        assert!(
            matches!(refused, Err(RenderError::PortalTextures(_))),
            "{options:?}"
        );
        assert!(studio.portal_texture_options().is_none());
    }
}

// Covers X3, R7.
#[test]
fn a_transition_ends_as_geometry_after_its_frames() {
    let world = offices(40);
    let mut studio = studio(&world);
    let walk = cameras(&world, &studio, 60);
    for last in [0, 5] {
        let own = PortalTextureOptions {
            transition_frames: last,
            ..options()
        };
        studio.add_portal_textures(own).unwrap();
        let (mut n_turning, mut n_ended, mut n_in_row) = (0, 0, 0);
        for camera in &walk {
            // A walk that stands still until all transitions are over.
            for _ in 0..=last + 1 {
                let counts = studio.plan_portal_textures(camera, style(), SIZE).unwrap();
                n_turning += counts.n_turning;
                n_in_row = if counts.n_turning > 0 {
                    n_in_row + 1
                } else {
                    0
                };
                assert!(n_in_row < 2 * last as usize + 2, "a transition ends");
                let shown = list(&mut studio, camera, Culling::PortalTextures);
                if counts.n_turning == 0 && counts.n_textured == 0 {
                    let all = list(&mut studio, camera, Culling::Portals);
                    assert_eq!(shown.n_triangles(), all.n_triangles());
                    if n_ended < 3 {
                        n_ended += 1;
                        let ours = picture(&mut studio, camera, &shown);
                        assert!(ours == picture(&mut studio, camera, &all), "{camera:?}");
                    }
                }
            }
        }
        assert_eq!(n_turning > 0, last > 0);
        assert!(n_ended > 0);
    }
}
