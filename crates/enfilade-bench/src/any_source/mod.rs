//! `bench any-source`: rooms of sources that are not triangles, each figure with its bar.
//!
//! To add rows, add a file for their family beside this one and lines in [`ROWS`].

mod bad;
mod implicit;
mod implicit_twins;
mod land;
mod parametric;
mod scan;
mod twins;
mod volume;

use enfilade::bake::{BakeConfig, BakeContext, Silent, bake};
use enfilade::cpg::World;
use enfilade::geom::scene::Scene;

use crate::living::made;
use crate::rows::{Measure, Row};

/// Implicit scenes with as many rooms and openings as they were made with.
const SHAPES: &[&str] = &["balls", "cavern", "house", "gyroid"];
/// Implicit scenes, each with a twin of triangles.
const TWINS: &[&str] = &["balls", "cavern", "house", "gyroid", "knot"];
/// Scenes of patches, each with a twin of triangles.
const PATCHES: &[&str] = &["patch-house", "patch-vault", "patch-tube"];
const AORTA: &[&str] = &["aorta"];
/// Airway trees of 15 branches, with the noise of computed tomography in its units.
const AIRWAYS: &[&str] = &["airway-noise-0", "airway-noise-40", "airway-noise-80"];

/// Open land of a square kilometer each.
const LANDS: &[&str] = &["valleys", "hamlets", "city-1", "city-2"];
const BUILT: &[&str] = &["hamlets", "city-1", "city-2"];
const CITIES: &[&str] = &["city-1", "city-2"];

/// Buildings that are scanned.
const HOUSE: &[&str] = &["fzk-haus"];
const BUILDINGS: &[&str] = &["fzk-haus", "institute"];

/// Families of bad input.
const BAD: &[&str] = &[
    "implicit",
    "volumes",
    "patches",
    "heights",
    "scans",
    "damaged-scans",
];

const fn named(
    name: &'static str,
    scenes: &'static [&'static str],
    measure: fn(&World, &str) -> anyhow::Result<crate::rows::Figure>,
) -> Row {
    let measure = Measure::Named(measure);
    Row {
        name,
        scenes,
        measure,
    }
}

pub(crate) const ROWS: &[Row] = &[
    named("volume: cells, 0.5 mm", AORTA, |w, s| {
        volume::cells(w, s, 0.5)
    }),
    named("volume: cells, 0.8 mm", AORTA, |w, s| {
        volume::cells(w, s, 0.8)
    }),
    named("volume: cells, 1.2 mm", AORTA, |w, s| {
        volume::cells(w, s, 1.2)
    }),
    made("volume: branches missed", AIRWAYS, volume::missed),
    made("implicit: cells", SHAPES, implicit::cells),
    made("implicit: portals", SHAPES, implicit::portals),
    made(
        "implicit: beside triangles",
        TWINS,
        implicit_twins::differences,
    ),
    made(
        "implicit: exponent of the time in the surface",
        &["balls", "knot"],
        implicit_twins::time,
    ),
    made("implicit: samples by volume", &["balls"], implicit::samples),
    made("parametric: cells", PATCHES, parametric::cells),
    made("parametric: portals", PATCHES, parametric::portals),
    named("scan: rooms missed, 3 stations", HOUSE, |w, s| {
        scan::rooms(w, s, (3, false))
    }),
    named("scan: doors missed, 3 stations", HOUSE, |w, s| {
        scan::doors(w, s, (3, false))
    }),
    named("scan: rooms missed, 12 stations", HOUSE, |w, s| {
        scan::rooms(w, s, (12, false))
    }),
    named("scan: doors missed, 12 stations", HOUSE, |w, s| {
        scan::doors(w, s, (12, false))
    }),
    named("scan: rooms missed, 30 stations", BUILDINGS, |w, s| {
        scan::rooms(w, s, (30, false))
    }),
    named("scan: doors missed, 30 stations", BUILDINGS, |w, s| {
        scan::doors(w, s, (30, false))
    }),
    named("scan: rooms missed, 7 and 4 outdoors", HOUSE, |w, s| {
        scan::rooms(w, s, (7, true))
    }),
    named("scan: doors missed, 7 and 4 outdoors", HOUSE, |w, s| {
        scan::doors(w, s, (7, true))
    }),
    made("land: places missed", LANDS, land::missed),
    made("land: rooms lost or made up", BUILT, land::rooms),
    made("land: seconds", LANDS, land::seconds),
    made("land: broken promises", LANDS, land::broken),
    made("land: visible share", CITIES, land::seen),
    made("bad input", BAD, bad::not_refused),
];

/// Bakes with default settings.
fn baked(scene: &Scene) -> anyhow::Result<World> {
    let context = BakeContext::new(&Silent, None);
    Ok(bake(scene, &BakeConfig::default(), &context)?.world)
}
