//! Free-form surfaces of OBJ, from `cstype` to `end`: Bézier and B-spline patches, rational, trimmed.

use enfilade_geom::{DVec2, DVec3};
use enfilade_source::{FreeformCurve, FreeformSurface, SplineBasis, TrimCurve};

use crate::soup::{resolve, shortened};

/// The kinds of splines that are read.
#[derive(Clone, Copy, PartialEq)]
enum SplineKind {
    Bezier,
    Bspline,
    /// Basis matrices, Cardinal and Taylor curves.
    Other,
}

/// A statement that ends with `end`.
struct FreeformElement {
    line: usize,
    kind: SplineKind,
    is_surface: bool,
    /// Ranges of the parameters of a surface.
    range: [[f64; 2]; 2],
    degrees: [usize; 2],
    /// Control points of a surface, or of a curve in the plane of parameters, with their weights.
    controls: Vec<(DVec3, f64)>,
    knots: [Vec<f64>; 2],
    kept: Vec<Vec<TrimCurve>>,
    holes: Vec<Vec<TrimCurve>>,
}

/// Vertices known so far, and their weights.
pub(super) struct Controls<'r> {
    pub(super) positions: &'r [[f64; 3]],
    /// Weights of the first positions; 1 for the rest.
    pub(super) weights: &'r [f64],
}

/// A statement's effect beyond the state of the reader.
pub(super) enum Ended {
    Nothing,
    Surface(FreeformSurface),
    /// A curve in space, or a surface of a kind that is not read.
    LeftOut,
}

/// State of the free-form statements.
pub(super) struct FreeformReader {
    /// `vp`: points in the plane of parameters, with weights.
    points: Vec<(DVec2, f64)>,
    kind: SplineKind,
    is_rational: bool,
    degrees: [usize; 2],
    /// `curv2`; `None` for kinds that are not read.
    curves: Vec<Option<FreeformCurve>>,
    element: Option<FreeformElement>,
}

impl FreeformReader {
    pub(super) fn new() -> Self {
        Self {
            points: Vec::new(),
            kind: SplineKind::Other,
            is_rational: false,
            degrees: [0; 2],
            curves: Vec::new(),
            element: None,
        }
    }

    /// Reads a statement. An error tells the problem with it.
    pub(super) fn read(
        &mut self,
        word: &str,
        rest: &str,
        line: usize,
        vertices: &Controls<'_>,
    ) -> Result<Ended, String> {
        let words: Vec<&str> = rest.split_ascii_whitespace().collect();
        match word {
            "vp" => {
                let n = numbers(&words)?;
                let [u, v, w] = [(0, 0.0), (1, 0.0), (2, 1.0)]
                    .map(|(k, usual): (usize, f64)| n.get(k).copied().unwrap_or(usual));
                if n.is_empty() {
                    return Err("a point needs one number or more".into());
                }
                self.points.push((DVec2::new(u, v), w));
            }
            "cstype" => {
                self.is_rational = words.first() == Some(&"rat");
                self.kind = match words.last() {
                    Some(&"bezier") => SplineKind::Bezier,
                    Some(&"bspline") => SplineKind::Bspline,
                    _ => SplineKind::Other,
                };
            }
            "deg" => {
                let degree = |word: &&str| {
                    let degree = word
                        .parse()
                        .ok()
                        .filter(|d| (1..=SplineBasis::MAX_DEGREE).contains(d));
                    let most = SplineBasis::MAX_DEGREE;
                    degree.ok_or_else(|| {
                        format!("'{}' is not a degree from 1 to {most}", shortened(word))
                    })
                };
                let degrees = words.iter().map(degree).collect::<Result<Vec<_>, _>>()?;
                let first = *degrees.first().ok_or("a degree is missing")?;
                self.degrees = [first, degrees.get(1).copied().unwrap_or(first)];
            }
            "surf" => self.begin_surface(&words, line, vertices)?,
            "curv2" => self.begin_curve(&words, line)?,
            "curv" => {
                let element = self.new_element(line, SplineKind::Other)?;
                self.element = Some(element);
            }
            "parm" => {
                let axis = match words.first() {
                    Some(&"u") => 0,
                    Some(&"v") => 1,
                    _ => return Err("'parm' needs u or v, and numbers".into()),
                };
                self.open(word)?.knots[axis] = numbers(&words[1..])?;
            }
            "trim" | "hole" => {
                let curves = self.trim_curves(&words)?;
                let element = self.open(word)?;
                match word {
                    "trim" => element.kept.push(curves),
                    _ => element.holes.push(curves),
                }
            }
            "end" => return self.end(),
            _ => {}
        }
        Ok(Ended::Nothing)
    }

    /// Returns the line of an element without an end.
    pub(super) fn unfinished(&self) -> Option<usize> {
        self.element.as_ref().map(|e| e.line)
    }

    fn open(&mut self, word: &str) -> Result<&mut FreeformElement, String> {
        let element = self.element.as_mut();
        element.ok_or_else(|| format!("'{word}' outside a surface or curve"))
    }

    fn new_element(&self, line: usize, kind: SplineKind) -> Result<FreeformElement, String> {
        if let Some(begun) = self.unfinished() {
            return Err(format!("the surface or curve of line {begun} has no 'end'"));
        }
        Ok(FreeformElement {
            line,
            kind,
            is_surface: false,
            range: [[0.0; 2]; 2],
            degrees: self.degrees,
            controls: Vec::new(),
            knots: [Vec::new(), Vec::new()],
            kept: Vec::new(),
            holes: Vec::new(),
        })
    }

    fn begin_surface(
        &mut self,
        words: &[&str],
        line: usize,
        vertices: &Controls<'_>,
    ) -> Result<(), String> {
        let mut element = self.new_element(line, self.kind)?;
        element.is_surface = true;
        let (range, points) = words
            .split_at_checked(4)
            .ok_or("'surf' needs four limits of the parameters, and control points")?;
        let range = numbers(range)?;
        element.range = [[range[0], range[1]], [range[2], range[3]]];
        for word in points {
            let field = word.split('/').next().unwrap_or("");
            let n = vertices.positions.len();
            let i = resolve(field, n).ok_or_else(|| nothing(word, n, "positions"))? as usize;
            let w = match self.is_rational {
                true => vertices.weights.get(i).copied().unwrap_or(1.0),
                false => 1.0,
            };
            let p = DVec3::from_array(vertices.positions[i]);
            element.controls.push((p, w));
        }
        self.element = Some(element);
        Ok(())
    }

    fn begin_curve(&mut self, words: &[&str], line: usize) -> Result<(), String> {
        let mut element = self.new_element(line, self.kind)?;
        for word in words {
            let n = self.points.len();
            let i = resolve(word, n).ok_or_else(|| nothing(word, n, "points of 'vp'"))? as usize;
            let (p, w) = self.points[i];
            let w = if self.is_rational { w } else { 1.0 };
            element.controls.push((p.extend(0.0), w));
        }
        // It has its number from here on.
        self.curves.push(None);
        self.element = Some(element);
        Ok(())
    }

    /// Returns the curves of a loop: triples of both ends of a part, and a curve.
    fn trim_curves(&self, words: &[&str]) -> Result<Vec<TrimCurve>, String> {
        if words.is_empty() || !words.len().is_multiple_of(3) {
            return Err("a loop needs two parameters and a curve for each of its parts".into());
        }
        let part = |part: &[&str]| {
            let range = numbers(&part[..2])?;
            let n = self.curves.len();
            let i = resolve(part[2], n).ok_or_else(|| nothing(part[2], n, "curves of 'curv2'"))?;
            let curve = self.curves[i as usize].clone();
            let curve = curve.ok_or_else(|| {
                format!(
                    "curve {} is of a kind that is not read; export it as bspline",
                    i + 1
                )
            })?;
            Ok(TrimCurve {
                curve,
                range: [range[0], range[1]],
            })
        };
        words.chunks_exact(3).map(part).collect()
    }

    fn end(&mut self) -> Result<Ended, String> {
        let element = self
            .element
            .take()
            .ok_or("'end' outside a surface or curve")?;
        let is_curve = !element.is_surface;
        if element.kind == SplineKind::Other {
            return Ok(Ended::LeftOut);
        }
        let basis = |axis: usize| {
            let (degree, knots) = (element.degrees[axis], &element.knots[axis]);
            if knots.len() < 2 {
                let name = ["u", "v"][axis];
                return Err(format!(
                    "line {}: 'parm {name}' is missing, or has too few numbers",
                    element.line
                ));
            }
            Ok(match element.kind {
                SplineKind::Bezier => SplineBasis::bezier(degree, knots),
                _ => SplineBasis {
                    degree,
                    knots: knots.clone(),
                },
            })
        };
        if is_curve {
            let curve = FreeformCurve {
                basis: basis(0)?,
                controls: element
                    .controls
                    .iter()
                    .map(|(p, w)| (p.truncate(), *w))
                    .collect(),
            };
            if let Some(last) = self.curves.last_mut() {
                *last = Some(curve);
            }
            return Ok(Ended::Nothing);
        }
        let mut surface = FreeformSurface {
            place: format!("line {}", element.line),
            bases: [basis(0)?, basis(1)?],
            controls: element.controls,
            range: element.range,
            loops: Vec::new(),
        };
        surface.trim(element.kept, element.holes);
        Ok(Ended::Surface(surface))
    }
}

fn numbers(words: &[&str]) -> Result<Vec<f64>, String> {
    let number = |word: &&str| {
        let number: Result<f64, _> = word.parse();
        number.map_err(|_| format!("'{}' is not a number", shortened(word)))
    };
    words.iter().map(number).collect()
}

fn nothing(word: &str, n: usize, of: &str) -> String {
    format!(
        "'{}' points at nothing: {n} {of} are known so far",
        shortened(word)
    )
}
