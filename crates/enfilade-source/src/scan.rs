//! Scans: points on surfaces, each seen from a station, and the surface of the air that the stations saw.
//!
//! The space between a station and what it saw is free; the rest is unknown, and counts as matter. Near points the field is the
//! distance from the planes through them (Kolluri, "Provably good moving least squares", 2005), which averages the noise of
//! the scanner.

mod carve;
mod cells;
mod frontier;
mod gaps;
mod planes;
mod view;

use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::volume::{Ends, Volume};
use crate::{AirSide, Level, SourceError, SourceLimits, Surface};

/// Points that a scanner saw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Scan {
    /// Points.
    pub points: Vec<DVec3>,
    /// For each point, the station that saw it, as an index into `stations`.
    pub station_of: Vec<u16>,
    /// Places of the scanner.
    pub stations: Vec<DVec3>,
}

/// How a scan becomes a field. [Units: those of the scan]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanOptions {
    /// Edge of the voxels; larger if there would be more than [`SourceLimits::max_voxels`], or than 10,000 for each point.
    pub step: f64,
    /// Points farther from all stations than this along an axis are left out; ways to them end there.
    pub reach: f64,
    /// Pieces of surface smaller than this along all axes are left out.
    pub least_piece: f64,
}

/// Reach of a plane through points. [Units: voxels]
pub(crate) const REACH: f64 = 2.0;
/// Voxels around the points, so that planes end before the sides. [Units: voxels]
const MARGIN: f64 = 4.0;
/// Most voxels for each point, so that a single damaged point does not make a small file the work of a large one: a hundred
/// times those of a room with a point every decimeter.
const VOXELS_OF_POINT: u64 = 10_000;

impl Scan {
    /// Returns the box of points and stations that matters.
    #[must_use]
    pub fn bounds(&self, options: &ScanOptions) -> Aabb {
        let stations = Aabb::of_points(&self.stations);
        let near = stations.expanded(options.reach);
        Aabb::of_points(&self.points)
            .union(stations)
            .intersection(near)
    }

    /// Returns the edge of the voxels that keeps their number within the limits.
    #[must_use]
    pub fn step(&self, options: &ScanOptions, limits: &SourceLimits) -> f64 {
        let size = self.bounds(options).size() + 2.0 * MARGIN * options.step;
        let of_points = VOXELS_OF_POINT.saturating_mul(self.points.len().max(1) as u64);
        let most = limits.max_voxels.min(of_points);
        let least = (size.element_product() / most as f64).cbrt();
        options.step.max(least)
    }

    /// Extracts the surface between the air that the stations saw and everything else.
    ///
    /// # Errors
    ///
    /// If a number is not finite, a point has no station, a limit is exceeded, or the stations saw no air.
    pub fn surface(
        &self,
        options: &ScanOptions,
        limits: &SourceLimits,
    ) -> Result<Surface, SourceError> {
        let volume = self.volume(options, limits)?;
        let level = Level {
            value: 0.0,
            air: AirSide::Above,
        };
        // Air that reaches a side is outdoors.
        volume.surface_of_pieces(level, Ends::Air, options.least_piece, limits)
    }

    /// Returns the field at the vertices of a lattice: positive in air, at most [`REACH`] steps.
    fn volume(&self, options: &ScanOptions, limits: &SourceLimits) -> Result<Volume, SourceError> {
        self.check()?;
        let step = self.step(options, limits);
        let bounds = self.bounds(options).expanded(MARGIN * step);
        let size = (bounds.size() / step)
            .ceil()
            .to_array()
            .map(|n| n as usize + 1);
        Volume::check_size(size, limits)?;
        let grid = cells::ScanGrid {
            origin: bounds.min,
            step,
            size,
        };
        let purse = limits.purse();
        let found = planes::of_scan(self, &grid, purse);
        let free = carve::carve(self, &grid, purse);
        limits.go_on()?;
        let reach = (REACH * step) as f32;
        let start = |is_free: &bool| if *is_free { reach } else { -reach };
        let mut values: Vec<f32> = free.iter().map(start).collect();
        let is_measured = planes::blend(&found, &grid, &free, &mut values, purse);
        frontier::smooth(&grid, &is_measured, &mut values, purse);
        limits.go_on()?;
        Ok(Volume {
            size,
            values,
            placement: DMat4::from_translation(bounds.min) * DMat4::from_scale(DVec3::splat(step)),
            unit: None,
            is_z_up: false,
        })
    }

    fn check(&self) -> Result<(), SourceError> {
        let bad = |place: String, problem: &str| Err(SourceError::new(place, problem));
        if self.stations.is_empty() {
            return bad(
                "scan".into(),
                "has no station: the place of the scanner is needed to tell air from matter",
            );
        }
        if let Some(i) = self.stations.iter().position(|p| !p.is_finite()) {
            return bad(format!("station {i}"), "is not finite");
        }
        if let Some(i) = self.points.iter().position(|p| !p.is_finite()) {
            return bad(format!("point {i}"), "is not finite");
        }
        let n = self.stations.len();
        if let Some(i) = self.station_of.iter().position(|&s| usize::from(s) >= n) {
            return bad(format!("point {i}"), "names a station that does not exist");
        }
        if self.points.is_empty() || self.points.len() != self.station_of.len() {
            return bad("scan".into(), "needs points, each with a station");
        }
        Ok(())
    }
}
