//! Volumes of samples: NIfTI, NRRD, and raw samples with a header in JSON.
//!
//! The crates for these formats trust their headers, or bring array libraries of their own; the parts that volumes of one
//! value a voxel need are short. Only headers are interpreted here, samples are read one by one, and never more than the
//! header announces and the limits allow.

mod gunzip;
mod nifti;
mod nrrd;
mod raw;
mod samples;

use enfilade_geom::{Aabb, DMat4, DVec3, Purse};

pub use gunzip::{gunzip, is_gzip};
pub use samples::SampleKind;

use crate::{
    ExtractOptions, Field, Interval, Lattice, SourceError, SourceLimits, Surface, extract,
};

/// A reader of files beside the one that is read, by name.
pub type Beside<'b> = dyn FnMut(&str) -> Result<Vec<u8>, String> + 'b;

/// A box of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Samples along each axis. [Limit: 2 to 2^20]
    pub size: [usize; 3],
    /// Values, the first axis fastest. Finite, or `NaN` where the file has none.
    pub values: Vec<f32>,
    /// Indices of samples to the space of the file.
    pub placement: DMat4,
    /// Meters per unit of that space, if the file says so.
    pub unit: Option<f64>,
    /// The file says that its third axis points up: from the feet to the head.
    pub is_z_up: bool,
}

/// The side of the level on which air is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AirSide {
    /// Lower values, as in computed tomography.
    Below,
    /// Higher values, as in masks, and where contrast fills vessels.
    Above,
}

/// Where the surface of a volume lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Level {
    /// The value between matter and air.
    pub value: f64,
    /// The side of air.
    pub air: AirSide,
}

/// The other side of the sides of a volume.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ends {
    Matter,
    Air,
}

/// Most samples along an axis.
const MAX_EDGE: usize = 1 << 20;
/// Pieces of surface that are smaller than this along all axes, in samples, are noise.
const NOISE: f64 = 3.0;

impl Volume {
    /// Returns `true` if a file looks like a volume; compressed files are looked into.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        if is_gzip(bytes) {
            let head = gunzip(bytes, 352).unwrap_or_default();
            return nifti::is_nifti(&head);
        }
        nifti::is_nifti(bytes) || nrrd::is_nrrd(bytes) || raw::is_header(bytes)
    }

    /// Returns the format of a volume for messages.
    #[must_use]
    pub fn format(bytes: &[u8]) -> &'static str {
        if nrrd::is_nrrd(bytes) {
            "NRRD"
        } else if raw::is_header(bytes) {
            "raw volume"
        } else {
            "NIfTI"
        }
    }

    /// Reads a volume. `beside` reads the file of its samples, where they are apart.
    ///
    /// # Errors
    ///
    /// If it is malformed, cut off, has more than three dimensions of more than one sample, or exceeds a limit.
    pub fn parse(
        bytes: &[u8],
        beside: &mut Beside<'_>,
        limits: &SourceLimits,
    ) -> Result<Self, SourceError> {
        if nrrd::is_nrrd(bytes) {
            nrrd::parse(bytes, beside, limits)
        } else if raw::is_header(bytes) {
            raw::parse(bytes, beside, limits)
        } else {
            nifti::parse(bytes, beside, limits)
        }
    }

    /// Checks the numbers of samples, and returns their product.
    pub(crate) fn check_size(
        size: [usize; 3],
        limits: &SourceLimits,
    ) -> Result<usize, SourceError> {
        let text = format!("{} x {} x {} samples", size[0], size[1], size[2]);
        if size.iter().any(|n| !(2..=MAX_EDGE).contains(n)) {
            let problem = format!("{text}: each axis needs 2 to {MAX_EDGE}");
            return Err(SourceError::new("size", problem));
        }
        let n = size.iter().map(|&n| n as u64).product::<u64>();
        if n > limits.max_samples {
            let problem = format!(
                "{text} are more than {}; take every second one",
                limits.max_samples
            );
            return Err(SourceError::new("size", problem));
        }
        Ok(n as usize)
    }

    /// Returns the numbers of samples with a value and without, and the least and largest value.
    #[must_use]
    pub fn summary(&self) -> VolumeSummary {
        let (mut lo, mut hi, mut n_missing) = (f32::INFINITY, f32::NEG_INFINITY, 0);
        let mut two = [None; 2];
        let mut has_more = false;
        let mut first_missing = None;
        for (i, &v) in self.values.iter().enumerate() {
            if v.is_nan() {
                n_missing += 1;
                let of = self.size;
                first_missing.get_or_insert([i % of[0], i / of[0] % of[1], i / (of[0] * of[1])]);
                continue;
            }
            (lo, hi) = (lo.min(v), hi.max(v));
            if !has_more && !two.contains(&Some(v)) {
                match two.iter_mut().find(|t| t.is_none()) {
                    Some(free) => *free = Some(v),
                    None => has_more = true,
                }
            }
        }
        VolumeSummary {
            range: [lo, hi],
            n_missing,
            first_missing,
            is_mask: !has_more && lo < hi,
        }
    }

    /// Returns the level of a mask: between its two values, the higher being air; `None` for other volumes.
    #[must_use]
    pub fn level_of_mask(summary: &VolumeSummary) -> Option<Level> {
        let middle = f64::midpoint(summary.range[0].into(), summary.range[1].into());
        summary.is_mask.then_some(Level {
            value: middle,
            air: AirSide::Above,
        })
    }

    /// Extracts the surface at a level, in the space of the file. The air ends at the sides of the volume; samples without a
    /// value are matter.
    ///
    /// # Errors
    ///
    /// If it exceeds a limit, or nothing of a surface is found.
    pub fn surface(&self, level: Level, limits: &SourceLimits) -> Result<Surface, SourceError> {
        self.surface_of_pieces(level, Ends::Matter, NOISE * self.least_step(), limits)
    }

    /// Works as [`Volume::surface`], without pieces smaller than `least_piece` along all axes.
    pub(crate) fn surface_of_pieces(
        &self,
        level: Level,
        ends: Ends,
        least_piece: f64,
        limits: &SourceLimits,
    ) -> Result<Surface, SourceError> {
        let field = VolumeField::new(self, level, ends, limits.purse());
        limits.go_on()?;
        let step = self.least_step();
        let options = ExtractOptions {
            lattice: Lattice {
                origin: DVec3::splat(-1.0),
                step: 1.0,
                n_cells: self.size.map(|n| n as i32 + 1),
            },
            placement: self.placement,
            tolerance: step * crate::surface::TOLERANCE,
            least_piece,
        };
        extract(&field, &options, limits)
    }

    fn least_step(&self) -> f64 {
        let along = |a: DVec3| self.placement.transform_vector3(a).length();
        DVec3::AXES
            .into_iter()
            .map(along)
            .fold(f64::INFINITY, f64::min)
    }

    /// Returns the lengths of its edges, in the space of the file.
    #[must_use]
    pub fn edges(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| {
            let along = DVec3::AXES[a] * (self.size[a] as f64 - 1.0);
            self.placement.transform_vector3(along).length()
        })
    }

    /// Returns the largest distance between neighbors, in the space of the file.
    #[must_use]
    pub fn step(&self) -> f64 {
        let steps = [0, 1, 2].map(|a| self.placement.transform_vector3(DVec3::AXES[a]).length());
        steps.into_iter().fold(0.0, f64::max)
    }
}

/// Values of a volume.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeSummary {
    /// Least and largest value.
    pub range: [f32; 2],
    /// Samples without a value.
    pub n_missing: u64,
    /// Indices of the first of them.
    pub first_missing: Option<[usize; 3]>,
    /// Two values only.
    pub is_mask: bool,
}

/// Checks that a placement of samples is invertible and of sizes that can be computed with.
fn checked(placement: DMat4) -> Result<DMat4, SourceError> {
    let lengths = DVec3::AXES.map(|a| placement.transform_vector3(a).length());
    let volume = placement.determinant().abs() / lengths.iter().product::<f64>();
    let is_sound = placement.is_finite()
        && lengths.iter().all(|l| (1e-9..=1e9).contains(l))
        && placement.w_axis.abs().max_element() < 1e12
        // Axes within half a degree of a plane are an error, too.
        && volume > 0.01;
    if is_sound {
        return Ok(placement);
    }
    let problem =
        "the distances between samples, or their directions, are zero, parallel or not finite";
    Err(SourceError::new("header", problem))
}

/// Samples along the edge of a block of bounds.
const BLOCK: usize = 8;

/// A volume as a field over its indices: linear between samples, positive in air.
struct VolumeField<'v> {
    volume: &'v Volume,
    sign: f64,
    level: f64,
    ends: Ends,
    /// Value of samples without one.
    missing: f64,
    /// Least and largest value in blocks of [`BLOCK`] samples, then of twice as many, and so on; each block includes the
    /// first samples of the next.
    bounds: Vec<(usize, [usize; 3], Vec<[f32; 2]>)>,
}

impl<'v> VolumeField<'v> {
    /// Meaningless if the purse is empty.
    fn new(volume: &'v Volume, level: Level, ends: Ends, purse: Purse<'_>) -> Self {
        let sign = match level.air {
            AirSide::Above => 1.0,
            AirSide::Below => -1.0,
        };
        let found = volume.summary();
        let reach = found.range.map(|v| (f64::from(v) - level.value).abs());
        let mut field = Self {
            volume,
            sign,
            level: level.value,
            ends,
            missing: -reach[0].max(reach[1]).max(f64::MIN_POSITIVE),
            bounds: Vec::new(),
        };
        field.bounds.push(field.first_bounds(purse));
        while let Some((edge, n, of)) = field
            .bounds
            .last()
            .filter(|(_, n, _)| n.iter().any(|&n| n > 1))
        {
            let next = joined(*edge, *n, of);
            field.bounds.push(next);
        }
        field
    }

    fn first_bounds(&self, purse: Purse<'_>) -> (usize, [usize; 3], Vec<[f32; 2]>) {
        // From one sample before the first to one after the last.
        let n = self.volume.size.map(|n| (n + 2).div_ceil(BLOCK));
        let mut all = vec![[f32::INFINITY, f32::NEG_INFINITY]; n[0] * n[1] * n[2]];
        // A block has nine samples along each edge.
        let blocks = all.iter_mut().enumerate().take_while(purse.each(30));
        for (i, bounds) in blocks {
            let block = [i % n[0], i / n[0] % n[1], i / (n[0] * n[1])];
            let from = block.map(|b| (b * BLOCK) as i64 - 1);
            for z in 0..=BLOCK as i64 {
                for y in 0..=BLOCK as i64 {
                    for x in 0..=BLOCK as i64 {
                        // Rounded outwards: one step of `f32` on both sides.
                        let v = self.node([from[0] + x, from[1] + y, from[2] + z]) as f32;
                        bounds[0] = bounds[0].min(v.next_down());
                        bounds[1] = bounds[1].max(v.next_up());
                    }
                }
            }
        }
        (BLOCK, n, all)
    }

    /// Returns the value of a sample, or beyond the sides that of the nearest one, as it ends there.
    fn node(&self, at: [i64; 3]) -> f64 {
        let size = self.volume.size;
        let inner = [0, 1, 2].map(|a| at[a].clamp(0, size[a] as i64 - 1) as usize);
        let value = self.volume.values[inner[0] + size[0] * (inner[1] + size[1] * inner[2])];
        let value = if value.is_nan() {
            self.missing
        } else {
            (f64::from(value) - self.level) * self.sign
        };
        if (0..3).all(|a| inner[a] as i64 == at[a]) {
            value
        } else {
            // Not zero, so that the surface does not run between equal zeros.
            let beyond = value.abs().max(f64::from(f32::MIN_POSITIVE));
            match self.ends {
                Ends::Matter => -beyond,
                Ends::Air => beyond,
            }
        }
    }
}

fn joined(edge: usize, n: [usize; 3], of: &[[f32; 2]]) -> (usize, [usize; 3], Vec<[f32; 2]>) {
    let half = n.map(|n| n.div_ceil(2));
    let mut all = vec![[f32::INFINITY, f32::NEG_INFINITY]; half[0] * half[1] * half[2]];
    for (i, bounds) in of.iter().enumerate() {
        let at = [i % n[0] / 2, i / n[0] % n[1] / 2, i / (n[0] * n[1]) / 2];
        let into = &mut all[at[0] + half[0] * (at[1] + half[1] * at[2])];
        *into = [into[0].min(bounds[0]), into[1].max(bounds[1])];
    }
    (edge * 2, half, all)
}

impl Field for VolumeField<'_> {
    fn at(&self, p: DVec3) -> f64 {
        let base = p.floor();
        let t = p - base;
        let from = base.to_array().map(|x| x.clamp(-2.0, 2e6) as i64);
        let value = |v: i64| self.node([0, 1, 2].map(|a| from[a] + (v >> a & 1)));
        if t == DVec3::ZERO {
            return value(0);
        }
        let along_x = |v: i64| value(v) + (value(v | 1) - value(v)) * t.x;
        let along_y = |v: i64| {
            let a = along_x(v);
            a + (along_x(v | 2) - a) * t.y
        };
        let a = along_y(0);
        a + (along_y(4) - a) * t.z
    }

    fn range(&self, within: &Aabb) -> Interval {
        let longest = within.size().max_element();
        let fits = |level: &&(usize, [usize; 3], Vec<[f32; 2]>)| level.0 as f64 >= longest;
        let Some((edge, n, bounds)) = self.bounds.iter().find(fits).or(self.bounds.last()) else {
            return Interval {
                lo: f64::NEG_INFINITY,
                hi: f64::INFINITY,
            };
        };
        let at = |x: f64| (x + 1.0) / *edge as f64;
        let (from, to) = (within.min.to_array(), within.max.to_array());
        let range = |a: usize| {
            let last = n[a] - 1;
            let first = (at(from[a]).floor().max(0.0) as usize).min(last);
            // The first samples of a block belong to the one before, too.
            let end = at(to[a]).ceil() - 1.0;
            first..=(end.max(0.0) as usize).clamp(first, last)
        };
        let mut found = Interval {
            lo: f64::INFINITY,
            hi: f64::NEG_INFINITY,
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let [lo, hi] = bounds[x + n[0] * (y + n[1] * z)];
                    found.lo = found.lo.min(lo.into());
                    found.hi = found.hi.max(hi.into());
                }
            }
        }
        found
    }
}
