//! Implicit scenes: shapes of a small language in JSON, and the field that they make.
//!
//! All shapes are fields of slope at most one: no value changes faster than the distance does. So one value in the middle
//! of a box bounds all values in it, and shapes that cannot matter there are dropped before its points are evaluated.

mod parse;
mod shape;

use std::sync::Arc;

use enfilade_geom::{Aabb, DVec3};

use crate::{ExtractOptions, Field, Interval, SourceError, SourceLimits, Surface, extract};
pub(crate) use parse::unit;
use shape::Shape;

/// Steps along the longest edge of a scene that does not give its step.
const USUAL_STEPS: f64 = 128.0;
/// Most steps along it, whatever its thinnest part.
const MOST_STEPS: f64 = 1024.0;
/// Steps across the thinnest part.
const STEPS_OF_THINNEST: f64 = 2.5;

/// A scene of implicit shapes. [Units: those of its file]
#[derive(Clone, Debug)]
pub struct ImplicitScene {
    /// Matter inside, air outside.
    shape: Arc<Shape>,
    bounds: Aabb,
    step: f64,
    /// Meters per unit, if the file says so.
    pub unit: Option<f64>,
}

impl ImplicitScene {
    /// Returns `true` if a file looks like an implicit scene.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        crate::is_json_of(bytes, "implicit")
    }

    /// Parses a scene; `docs/sources.md` explains the language.
    ///
    /// # Errors
    ///
    /// If it is not JSON of the language, or exceeds a limit; the error names the place.
    pub fn parse(bytes: &[u8], limits: &SourceLimits) -> Result<Self, SourceError> {
        let read = parse::scene(bytes, limits)?;
        let size = read.bounds.size();
        let step = read.step.unwrap_or_else(|| {
            let longest = size.max_element();
            let thin = (read.thinnest / STEPS_OF_THINNEST).min(longest / USUAL_STEPS);
            thin.max(longest / MOST_STEPS)
        });
        // The surface at the limits of the box is part of it.
        let limit = Arc::new(Shape::cuboid(read.bounds));
        let shape = if read.is_outside_matter {
            Shape::Union(vec![read.matter, Arc::new(Shape::Not(limit))])
        } else {
            Shape::Intersection(vec![read.matter, limit])
        };
        Ok(Self {
            shape: Arc::new(shape),
            bounds: read.bounds,
            step,
            unit: read.unit,
        })
    }

    /// Returns the box that holds the surface.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Returns the distance between points at which the field is evaluated.
    #[must_use]
    pub fn step(&self) -> f64 {
        self.step
    }

    /// Extracts the surface.
    ///
    /// # Errors
    ///
    /// If it exceeds a limit, or there is none.
    pub fn surface(&self, limits: &SourceLimits) -> Result<Surface, SourceError> {
        extract(
            self,
            &ExtractOptions::of_step(self.bounds, self.step),
            limits,
        )
    }
}

impl Field for ImplicitScene {
    fn at(&self, p: DVec3) -> f64 {
        self.shape.at(p)
    }

    fn range(&self, within: &Aabb) -> Interval {
        self.shape.range(within)
    }

    fn narrowed(&self, within: &Aabb) -> Option<Box<dyn Field + '_>> {
        let shape = self.shape.narrow(within)?;
        Some(Box::new(Narrowed(shape)))
    }

    fn normal(&self, p: DVec3) -> Option<DVec3> {
        self.shape.gradient(p).try_normalize()
    }

    fn cost(&self) -> u64 {
        self.shape.cost()
    }
}

/// The shapes that matter in a box.
struct Narrowed(Arc<Shape>);

impl Field for Narrowed {
    fn at(&self, p: DVec3) -> f64 {
        self.0.at(p)
    }

    fn range(&self, within: &Aabb) -> Interval {
        self.0.range(within)
    }

    fn narrowed(&self, within: &Aabb) -> Option<Box<dyn Field + '_>> {
        Some(Box::new(Self(self.0.narrow(within)?)))
    }

    fn normal(&self, p: DVec3) -> Option<DVec3> {
        self.0.gradient(p).try_normalize()
    }

    fn cost(&self) -> u64 {
        self.0.cost()
    }
}
