//! Rooms of sources that are not triangles, each figure with its bar.
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

use crate::rows::Row;

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

pub(crate) const ROWS: &[Row] = &[
    Row::named("volume: cells, 0.5 mm", AORTA, volume::cells::<5>),
    Row::named("volume: cells, 0.8 mm", AORTA, volume::cells::<8>),
    Row::named("volume: cells, 1.2 mm", AORTA, volume::cells::<12>),
    Row::made("volume: branches missed", AIRWAYS, volume::missed),
    Row::made("implicit: cells", SHAPES, implicit::cells),
    Row::made("implicit: portals", SHAPES, implicit::portals),
    Row::made(
        "implicit: beside triangles",
        TWINS,
        implicit_twins::differences,
    ),
    Row::made(
        "implicit: exponent of the time in the surface",
        &["balls", "knot"],
        implicit_twins::time,
    ),
    Row::made("implicit: samples by volume", &["balls"], implicit::samples),
    Row::made("parametric: cells", PATCHES, parametric::cells),
    Row::made("parametric: portals", PATCHES, parametric::portals),
    Row::named("scan: rooms missed, 3 stations", HOUSE, |w, s| {
        scan::rooms(w, s, (3, false))
    }),
    Row::named("scan: doors missed, 3 stations", HOUSE, |w, s| {
        scan::doors(w, s, (3, false))
    }),
    Row::named("scan: rooms missed, 12 stations", HOUSE, |w, s| {
        scan::rooms(w, s, (12, false))
    }),
    Row::named("scan: doors missed, 12 stations", HOUSE, |w, s| {
        scan::doors(w, s, (12, false))
    }),
    Row::named("scan: rooms missed, 30 stations", BUILDINGS, |w, s| {
        scan::rooms(w, s, (30, false))
    }),
    Row::named("scan: doors missed, 30 stations", BUILDINGS, |w, s| {
        scan::doors(w, s, (30, false))
    }),
    Row::named("scan: rooms missed, 7 and 4 outdoors", HOUSE, |w, s| {
        scan::rooms(w, s, (7, true))
    }),
    Row::named("scan: doors missed, 7 and 4 outdoors", HOUSE, |w, s| {
        scan::doors(w, s, (7, true))
    }),
    Row::made("land: places missed", LANDS, land::missed),
    Row::made("land: rooms lost or made up", BUILT, land::rooms),
    Row::made("land: seconds", LANDS, land::seconds),
    Row::made("land: broken promises", LANDS, land::broken),
    Row::made("land: visible share", CITIES, land::seen),
    Row::made("bad input", BAD, bad::not_refused),
];
