//! Shapes: values negative inside, of slope at most one.

use std::f64::consts::TAU;
use std::sync::Arc;

use enfilade_geom::{Aabb, DMat3, DVec2, DVec3, closest_point_on_segment};

use crate::Interval;

/// A shape, or a combination of shapes. [Units: those of the scene]
#[derive(Clone, Debug)]
pub(crate) enum Shape {
    Ball {
        at: DVec3,
        radius: f64,
    },
    Cuboid {
        center: DVec3,
        half: DVec3,
    },
    /// The points near a segment.
    Tube {
        ends: [DVec3; 2],
        radius: f64,
    },
    /// `axis` has unit length; the ring has the first radius, its tube the second.
    Torus {
        at: DVec3,
        axis: DVec3,
        radii: [f64; 2],
    },
    /// The half space behind a plane; `normal` has unit length.
    Plane {
        at: DVec3,
        normal: DVec3,
    },
    /// One side of a gyroid.
    Gyroid {
        at: DVec3,
        period: f64,
    },
    Union(Vec<Arc<Shape>>),
    Intersection(Vec<Arc<Shape>>),
    Not(Arc<Shape>),
    /// A union with rounded creases of this width.
    SmoothUnion(Vec<Arc<Shape>>, f64),
    /// Grown by a length, or shrunk.
    Grown(Arc<Shape>, f64),
    /// A wall of this thickness along the surface.
    Shell(Arc<Shape>, f64),
    /// Turned by a rotation, scaled and moved.
    Placed {
        of: Arc<Shape>,
        by: DVec3,
        turn: DMat3,
        scale: f64,
    },
}

/// Largest slope of `sin x cos y + sin y cos z + sin z cos x`: each part of its gradient has at most
/// `cos² y + sin² z` as its square, and the three sum up to three.
const GYROID_SLOPE: f64 = 1.732_050_807_568_877_3;

impl Shape {
    pub(crate) fn cuboid(b: Aabb) -> Self {
        Self::Cuboid {
            center: (b.min + b.max) * 0.5,
            half: b.size() * 0.5,
        }
    }

    pub(crate) fn at(&self, p: DVec3) -> f64 {
        match self {
            Self::Ball { at, radius } => p.distance(*at) - radius,
            Self::Cuboid { center, half } => {
                let q = (p - *center).abs() - *half;
                q.max(DVec3::ZERO).length() + q.max_element().min(0.0)
            }
            Self::Tube {
                ends: [a, b],
                radius,
            } => p.distance(closest_point_on_segment(p, *a, *b)) - radius,
            Self::Torus { at, axis, radii } => {
                let d = p - *at;
                let h = d.dot(*axis);
                let out = (d - *axis * h).length() - radii[0];
                DVec2::new(out, h).length() - radii[1]
            }
            Self::Plane { at, normal } => (p - *at).dot(*normal),
            Self::Gyroid { at, period } => {
                let q = (p - *at) * (TAU / period);
                let (s, c) = (q.map_each(f64::sin), q.map_each(f64::cos));
                let g = s.x * c.y + s.y * c.z + s.z * c.x;
                g * period / (TAU * GYROID_SLOPE)
            }
            Self::Union(all) => all.iter().fold(f64::INFINITY, |v, s| v.min(s.at(p))),
            Self::Intersection(all) => all.iter().fold(f64::NEG_INFINITY, |v, s| v.max(s.at(p))),
            Self::Not(of) => -of.at(p),
            Self::SmoothUnion(all, by) => all.iter().fold(f64::INFINITY, |v, s| {
                let w = s.at(p);
                let h = (by - (v - w).abs()).max(0.0);
                v.min(w) - h * h / (4.0 * by)
            }),
            Self::Grown(of, by) => of.at(p) - by,
            Self::Shell(of, by) => of.at(p).abs() - by * 0.5,
            Self::Placed {
                of,
                by,
                turn,
                scale,
            } => of.at(turn.transpose() * (p - *by) / *scale) * scale,
        }
    }

    pub(crate) fn range(&self, within: &Aabb) -> Interval {
        let middle = (within.min + within.max) * 0.5;
        Interval::of_slope_one(self.at(middle), within)
    }

    /// Returns the shape without the parts that cannot matter in a box, if it has any.
    pub(crate) fn narrow(self: &Arc<Self>, within: &Aabb) -> Option<Arc<Self>> {
        let narrow_of = |of: &Arc<Self>| of.narrow(within);
        let made = match &**self {
            Self::Union(all) => {
                let (kept, is_less) = kept(all, within, 0.0, 1.0);
                return only(kept, is_less, Self::Union);
            }
            Self::Intersection(all) => {
                let (kept, is_less) = kept(all, within, 0.0, -1.0);
                return only(kept, is_less, Self::Intersection);
            }
            Self::SmoothUnion(all, by) => {
                // Each fold lowers a value by a quarter of the width at most.
                let slack = by * (1.0 + all.len() as f64 * 0.25);
                let (kept, is_less) = kept(all, within, slack, 1.0);
                return only(kept, is_less, |all| Self::SmoothUnion(all, *by));
            }
            Self::Not(of) => Self::Not(narrow_of(of)?),
            Self::Grown(of, by) => Self::Grown(narrow_of(of)?, *by),
            Self::Shell(of, by) => Self::Shell(narrow_of(of)?, *by),
            Self::Placed {
                of,
                by,
                turn,
                scale,
            } => {
                let inner = Aabb::of_points(
                    &within
                        .corners()
                        .map(|p| turn.transpose() * (p - *by) / *scale),
                );
                Self::Placed {
                    of: of.narrow(&inner)?,
                    by: *by,
                    turn: *turn,
                    scale: *scale,
                }
            }
            Self::Ball { .. }
            | Self::Cuboid { .. }
            | Self::Tube { .. }
            | Self::Torus { .. }
            | Self::Plane { .. }
            | Self::Gyroid { .. } => return None,
        };
        Some(Arc::new(made))
    }

    /// Returns the direction in which the value grows, by differences.
    pub(crate) fn gradient(&self, p: DVec3) -> DVec3 {
        let h = 1e-6 * (1.0 + p.abs().max_element());
        let d = |axis: DVec3| self.at(p + axis * h) - self.at(p - axis * h);
        DVec3::new(d(DVec3::X), d(DVec3::Y), d(DVec3::Z))
    }

    pub(crate) fn cost(&self) -> u64 {
        match self {
            Self::Union(all) | Self::Intersection(all) | Self::SmoothUnion(all, _) => {
                1 + all.iter().map(|s| s.cost()).sum::<u64>()
            }
            Self::Not(of) | Self::Grown(of, _) | Self::Shell(of, _) | Self::Placed { of, .. } => {
                1 + of.cost()
            }
            Self::Gyroid { .. } => 4,
            _ => 1,
        }
    }

    /// Returns a box around the shape; infinite for those without end.
    pub(crate) fn bounds(&self) -> Aabb {
        let all = Aabb::new(DVec3::NEG_INFINITY, DVec3::INFINITY);
        match self {
            Self::Ball { at, radius } => Aabb::new(*at, *at).expanded(*radius),
            Self::Cuboid { center, half } => Aabb::new(*center - *half, *center + *half),
            Self::Tube { ends, radius } => Aabb::of_points(ends).expanded(*radius),
            Self::Torus { at, radii, .. } => Aabb::new(*at, *at).expanded(radii[0] + radii[1]),
            Self::Plane { .. } | Self::Gyroid { .. } | Self::Not(_) => all,
            Self::Union(of) => of.iter().fold(Aabb::EMPTY, |b, s| b.union(s.bounds())),
            Self::SmoothUnion(of, by) => {
                let b = of.iter().fold(Aabb::EMPTY, |b, s| b.union(s.bounds()));
                b.expanded(by * 0.25 * of.len() as f64)
            }
            Self::Intersection(of) => of.iter().fold(all, |b, s| b.intersection(s.bounds())),
            Self::Grown(of, by) => of.bounds().expanded(*by),
            Self::Shell(of, by) => of.bounds().expanded(by * 0.5),
            Self::Placed {
                of,
                by,
                turn,
                scale,
            } => {
                let b = of.bounds();
                if !(b.min.is_finite() && b.max.is_finite()) {
                    return all;
                }
                let place = |p: DVec3| *turn * p * *scale + *by;
                Aabb::of_points(&b.corners().map(place))
            }
        }
    }
}

/// Applies a function to each component.
trait MapEach {
    fn map_each(self, f: fn(f64) -> f64) -> Self;
}

impl MapEach for DVec3 {
    fn map_each(self, f: fn(f64) -> f64) -> Self {
        Self::new(f(self.x), f(self.y), f(self.z))
    }
}

/// Returns the parts whose values can be the least in a box, or the largest with a negative `sign`, each narrowed; and
/// whether anything was dropped.
fn kept(all: &[Arc<Shape>], within: &Aabb, slack: f64, sign: f64) -> (Vec<Arc<Shape>>, bool) {
    let middle = (within.min + within.max) * 0.5;
    let range = |s: &Arc<Shape>| Interval::of_slope_one(sign * s.at(middle), within);
    let ranges: Vec<Interval> = all.iter().map(range).collect();
    let bar = ranges.iter().fold(f64::INFINITY, |m, r| m.min(r.hi)) + slack;
    let mut is_less = false;
    let mut left = Vec::new();
    for (shape, range) in all.iter().zip(&ranges) {
        if range.lo > bar {
            is_less = true;
            continue;
        }
        let narrowed = shape.narrow(within);
        is_less |= narrowed.is_some();
        left.push(narrowed.unwrap_or_else(|| shape.clone()));
    }
    (left, is_less)
}

fn only(
    mut kept: Vec<Arc<Shape>>,
    is_less: bool,
    make: impl Fn(Vec<Arc<Shape>>) -> Shape,
) -> Option<Arc<Shape>> {
    if !is_less {
        return None;
    }
    Some(match kept.pop() {
        Some(one) if kept.is_empty() => one,
        Some(last) => {
            kept.push(last);
            Arc::new(make(kept))
        }
        None => Arc::new(make(kept)),
    })
}
