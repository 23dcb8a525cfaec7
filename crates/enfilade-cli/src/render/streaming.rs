//! Worlds for pictures: read whole, or packed ones of which only the pieces in view are loaded.

use std::collections::BTreeMap;
use std::io::Write;

use anyhow::bail;
use enfilade::cpg::{PortalId, World};
use enfilade::runtime::{Sight, SightState, Viewer};
use enfilade::stream::{Eye, InView};
use enfilade_render::{Camera, Studio, good_camera, walk_cameras};

use super::options::{Colors, Render, RenderMode};
use super::special::Mirrored;
use super::whole::open;
use crate::screen::{Told, Warned};
use enfilade_cli::adapter;
use enfilade_cli::input::name_of;
use enfilade_cli::streamed::{Packed, Streamed, StreamedCounts, cells_in_view, view_of};

/// All that pictures are drawn of.
pub(super) struct Setting {
    /// Hollow if it is streamed.
    pub(super) world: World,
    pub(super) studio: Studio,
    pub(super) cameras: Vec<Camera>,
    pub(super) mirrored: Option<Mirrored>,
    pub(super) pieces: Option<Pieces>,
}

/// The pieces of a packed world, and what each picture shows.
pub(super) struct Pieces {
    streamed: Streamed,
    views: Vec<Vec<InView>>,
}

impl Setting {
    /// Opens the world; of a packed one only the head, if that is enough.
    ///
    /// # Errors
    ///
    /// A world that cannot be read or drawn, a portal that does not exist, no place for a camera.
    pub(super) fn open(args: &Render, given: Option<Vec<Camera>>) -> anyhow::Result<Self> {
        let given = given.or_else(|| Some(vec![given_camera(args)?]));
        if Packed::is_at(&args.world) {
            match (needs_whole(args), &given) {
                (None, Some(cameras)) => return Self::of_pieces(args, cameras.clone()),
                (Some(why), _) => note(args, why)?,
                (None, None) => note(
                    args,
                    "finding views needs all of it; --eye and --look, or --path, give them",
                )?,
            }
        }
        let (world, mut studio) = open(&args.world, &args.adapter)?;
        set_doors(args, &studio.sight, &mut studio.state)?;
        let cameras = match given {
            Some(given) => given,
            None => cameras(args, &mut studio, &world)?,
        };
        if cameras.is_empty() {
            bail!("{}: no room to walk in", name_of(&args.world));
        }
        Ok(Self {
            mirrored: Mirrored::new(&world, &studio.sight, &args.door, &args.close),
            world,
            studio,
            cameras,
            pieces: None,
        })
    }

    fn of_pieces(args: &Render, cameras: Vec<Camera>) -> anyhow::Result<Self> {
        let packed = Packed::open(&args.world)?;
        let world = packed.head.world.clone();
        let sight = packed.head.sight()?;
        let mut state = SightState::new(&sight);
        set_doors(args, &sight, &mut state)?;
        let mut mirrored = Mirrored::new(&world, &sight, &args.door, &args.close);
        let mut viewer = Viewer::new(&sight);
        let mut views = Vec::with_capacity(cameras.len());
        for camera in &cameras {
            let view = camera.view(args.size[0] as f32 / args.size[1] as f32)?;
            let mut cells = BTreeMap::new();
            let seen = viewer.see(&sight, &state, &view);
            cells_in_view(&seen, sight.n_cells(), &mut cells);
            if let Some(mirrored) = &mut mirrored {
                mirrored.cells(&view, &mut cells);
            }
            views.push(view_of(&cells));
        }
        let gpu = adapter::open(&args.adapter)?;
        let (studio, streamed) = Streamed::for_views(packed, gpu, sight, state, &views)?;
        Ok(Self {
            world,
            studio,
            cameras,
            mirrored,
            pieces: Some(Pieces { streamed, views }),
        })
    }
}

impl Pieces {
    /// Waits until all that picture number `i` shows is on the adapter.
    ///
    /// # Errors
    ///
    /// As [`Streamed::settle`].
    pub(super) fn settle(&mut self, studio: &mut Studio, i: usize) -> anyhow::Result<()> {
        self.streamed.look(std::mem::take(&mut self.views[i]));
        self.streamed.settle(studio, Eye::default())
    }

    pub(super) fn counts(&self) -> StreamedCounts {
        self.streamed.counts()
    }

    /// Warns about texture pictures that are not drawn.
    pub(super) fn tell_of_pictures(&self) -> anyhow::Result<()> {
        let n = self.counts().n_bare_pictures;
        if n > 0 {
            writeln!(
                Warned,
                "enfilade: {n} texture pictures are damaged or larger than 8192x8192; drawn without them"
            )?;
        }
        Ok(())
    }
}

/// Tells that a packed world is read whole.
fn note(args: &Render, why: &str) -> anyhow::Result<()> {
    let name = name_of(&args.world);
    writeln!(Told, "enfilade: {name} is loaded whole: {why}")?;
    Ok(())
}

/// Names the reason why pieces in view are not enough.
fn needs_whole(args: &Render) -> Option<&'static str> {
    let reasons = [
        (
            args.above,
            "--above shows all of it; pictures from inside need only what is in view",
        ),
        (
            args.living.is_some(),
            "--living needs all of it; without, what is in view is enough",
        ),
        (
            args.walk.is_some(),
            "--walk needs all of it; --path needs only what is in view",
        ),
        (
            args.mode != RenderMode::Portals,
            "--mode shows all of it; through portals, what is in view is enough",
        ),
        (
            args.lod > 0.0,
            "--lod measures all of it; without, what is in view is enough",
        ),
        (
            args.paint == Colors::Cells,
            "--paint cells needs all of it; other paints with --plain need only what is in view",
        ),
        (
            !args.plain,
            "daylight and shadows need all of it; with --plain, what is in view is enough",
        ),
    ];
    let reason = reasons.into_iter().find(|r| r.0);
    reason.map(|r| r.1)
}

/// Closes portals and moves leaves.
fn set_doors(args: &Render, sight: &Sight, state: &mut SightState) -> anyhow::Result<()> {
    let n = sight.n_portals();
    let asked = args.door.iter().map(|(p, _)| p).chain(&args.close);
    if let Some(p) = asked.into_iter().find(|p| **p as usize >= n) {
        bail!("there is no portal {p}; `enfilade inspect` lists them");
    }
    for &(p, share) in &args.door {
        if sight.leaves(PortalId(p)).is_empty() {
            bail!(
                "--door: portal {p} has no leaf that moves; `enfilade inspect` lists those with leaves; --close fills any"
            );
        }
        state.set_leaves(PortalId(p), share);
    }
    for &p in &args.close {
        state.close(PortalId(p));
    }
    Ok(())
}

/// The cameras to draw from, if neither a path nor options give them.
fn cameras(args: &Render, studio: &mut Studio, world: &World) -> anyhow::Result<Vec<Camera>> {
    let fov_y = args.fov.to_radians();
    if let Some(n) = args.walk {
        return Ok(walk_cameras(world, &studio.sight, n as usize, fov_y));
    }
    let camera = good_camera(studio, world)?;
    Ok(vec![Camera { fov_y, ..camera }])
}

/// The camera of --eye and --look.
fn given_camera(args: &Render) -> Option<Camera> {
    let (eye, look) = args.eye.zip(args.look)?;
    Some(Camera {
        fov_y: args.fov.to_radians(),
        ..Camera::looking_at(eye, look)
    })
}
