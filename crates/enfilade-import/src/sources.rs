//! Sources that are not triangles: their surfaces become the only object of their file.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;

use enfilade_geom::scene::{Mesh, Primitive, Role};
use enfilade_geom::{DMat4, DVec3};
use enfilade_source::{
    AirSide, FreeformScene, HeightMap, ImplicitScene, Level, SourceLimits, Surface, Volume,
    VolumeSummary, tessellate,
};

use crate::builder::{Builder, Placement};
use crate::{ImportError, ImportOptions, ImportReport, SurfaceReport, Up, soup};

/// Reads a scene of implicit shapes.
pub(crate) fn read_implicit(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("implicit");
    let limits = limits(builder);
    let scene = ImplicitScene::parse(bytes, &limits).map_err(|e| builder.failed(e))?;
    let surface = scene.surface(&limits).map_err(|e| builder.failed(e))?;
    let unit = match builder.options.unit {
        Some(_) => 1.0,
        None => scene.unit.unwrap_or(1.0),
    };
    let to_input = DMat4::from_scale(DVec3::splat(unit));
    let step = scene.step() * unit;
    add(builder, surface, to_input, step, Told::default())
}

/// Largest distance of triangles from patches, unless the options give another. [Units: wu]
const PATCH_TOLERANCE: f64 = 0.01;

/// Returns the largest distance of triangles from patches. [Units: wu]
pub(crate) fn patch_tolerance(builder: &Builder<'_>) -> f64 {
    builder.options.patch_tolerance.unwrap_or(PATCH_TOLERANCE)
}

pub(crate) fn told_of_patches(n: usize) -> String {
    format!("{n} free-form patches as triangles (--patch-tolerance gives their largest distance)")
}

/// Reads a scene of free-form patches. Those of one name are one object.
pub(crate) fn read_patches(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("patches");
    let limits = limits(builder);
    let scene = FreeformScene::parse(bytes, &limits).map_err(|e| builder.failed(e))?;
    let unit = match builder.options.unit {
        Some(_) => 1.0,
        None => scene.unit.unwrap_or(1.0),
    };
    let meters = builder.base.transform_vector3(DVec3::X).length() * unit;
    let (mut names, mut surfaces) = (Vec::new(), Vec::new());
    for patch in scene.patches {
        names.push(patch.name);
        surfaces.push(patch.surface);
    }
    let mesh = tessellate(&surfaces, patch_tolerance(builder) / meters, &limits);
    let mesh = mesh.map_err(|e| builder.failed(e))?;
    let n: usize = mesh.triangles.iter().map(Vec::len).sum();
    builder.add_read_bytes((n * 36) as u64);
    let mut positions: Vec<[f64; 3]> = mesh.positions.iter().map(DVec3::to_array).collect();
    let offset = soup::recenter(&mut positions);
    let mut objects: BTreeMap<&str, Vec<[u32; 3]>> = BTreeMap::new();
    for (name, triangles) in names.iter().zip(&mesh.triangles) {
        objects.entry(name).or_default().extend(triangles);
    }
    let stem = soup::stem(builder);
    for (name, triangles) in objects {
        let name = if name.is_empty() { &stem } else { name };
        let place = format!("patches '{}'", soup::shortened(name));
        // Only the vertices of this object, in the order of their use.
        let mut index: HashMap<u32, u32> = HashMap::new();
        let mut primitive = Primitive::default();
        for v in triangles.into_flattened() {
            let next = primitive.positions.len() as u32;
            let i = *index.entry(v).or_insert(next);
            if i == next {
                let p = positions[v as usize].map(|c| c as f32);
                primitive.positions.push(p);
            }
            primitive.indices.push(i);
        }
        builder.charge_vertices(&place, primitive.positions.len() as u64)?;
        let mesh = builder.push_mesh(Mesh {
            name: name.to_owned(),
            primitives: vec![primitive],
        });
        let transform =
            builder.base * DMat4::from_scale(DVec3::splat(unit)) * DMat4::from_translation(offset);
        builder.place(&Placement {
            mesh,
            names: [name, ""],
            ancestors: &[],
            transforms: &[transform],
            moves: None,
            place: &place,
            source: None,
        })?;
    }
    if let Some(file) = builder.report.files.last_mut() {
        file.surface = Some(SurfaceReport {
            step: None,
            distance: mesh.distance * meters,
            n_samples: mesh.n_samples,
            enlarged: None,
            text: told_of_patches(surfaces.len()),
        });
    }
    Ok(())
}

/// Enlargement of volumes of bodies, whose ways are too narrow for a person: one millimeter becomes 0.128 m, so that the
/// narrowest opening to be found by default is one of 4.7 mm. A power of two, so that it can be taken back exactly.
const ENLARGED: f64 = 128.0;
/// Longest edge of a volume that is taken for a body. [Units: wu]
const BODY: f64 = 3.0;

/// Reads a volume of samples.
pub(crate) fn read_volume(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format(Volume::format(bytes));
    let limits = limits(builder);
    let volume = parse_volume(bytes, builder, &limits)?;
    let found = volume.summary();
    let level = level(&found, builder)?;
    if let Some(at) = found.first_missing {
        let place = format!("sample {}, {}, {}", at[0], at[1], at[2]);
        let text = format!(
            "{} samples have no value; they are taken for matter",
            found.n_missing
        );
        builder.note(place, text);
    }
    let surface = volume.surface(level, &limits);
    let surface = surface.map_err(|e| builder.failed(e))?;
    let side = match level.air {
        AirSide::Below => "below",
        AirSide::Above => "above",
    };
    let mut text = format!("air is {side} {}", level.value);
    if surface.n_dropped > 0 {
        let n = surface.n_dropped;
        let _ = write!(
            text,
            "; {n} pieces of less than 3 samples left out as noise"
        );
    }
    let (unit, enlarged) = unit(&volume, builder);
    if let Some(factor) = enlarged {
        let _ = write!(
            text,
            "; enlarged {factor} times, so that its ways are as wide as those of a building (--unit mm keeps its size)"
        );
    }
    let turned = match (builder.options.up, volume.is_z_up) {
        (None, true) => Up::Z.axes(),
        _ => DMat4::IDENTITY,
    };
    let to_input = turned * DMat4::from_scale(DVec3::splat(unit));
    let step = volume.step() * unit;
    add(builder, surface, to_input, step, Told { text, enlarged })
}

fn parse_volume(
    bytes: &[u8],
    builder: &mut Builder<'_>,
    limits: &SourceLimits,
) -> Result<Volume, ImportError> {
    let name = builder.path.file_name().unwrap_or_default();
    let name = name.to_string_lossy().into_owned();
    let most = builder.limits().max_file_bytes;
    let mut beside = |other: &str| {
        // The second file of a pair has the name of the first with another ending.
        let stem = name
            .rsplit_once('.')
            .map_or(name.as_str(), |(stem, _)| stem);
        let other = match other.starts_with('.') {
            true => format!("{stem}{other}"),
            false => other.to_owned(),
        };
        let read = builder.read_reference(&other, most)?;
        builder.add_read_bytes(read.len() as u64);
        Ok(read)
    };
    let volume = Volume::parse(bytes, &mut beside, limits);
    volume.map_err(|e| builder.failed(e))
}

/// Returns what to multiply lengths of a volume with, beside the unit of the options, and the enlargement in it.
fn unit(volume: &Volume, builder: &Builder<'_>) -> (f64, Option<f64>) {
    if builder.options.unit.is_some() {
        return (1.0, None);
    }
    let unit = volume.unit.unwrap_or(1.0);
    let longest = volume.edges().into_iter().fold(0.0, f64::max) * unit;
    if volume.unit.is_some() && longest < BODY {
        (unit * ENLARGED, Some(ENLARGED))
    } else {
        (unit, None)
    }
}

/// Returns the level of the options, or of a mask.
fn level(found: &VolumeSummary, builder: &Builder<'_>) -> Result<Level, ImportError> {
    let given = &builder.options.volume;
    let (value, usual) = match (given.level, Volume::level_of_mask(found)) {
        (Some(value), _) => (value, AirSide::Below),
        (None, Some(mask)) => (mask.value, mask.air),
        (None, None) => {
            let problem = format!(
                "its values go from {} to {}; give --level, the value between matter and air: -400 in computed tomography, 0 for \
                 signed distances",
                found.range[0], found.range[1]
            );
            return Err(builder.malformed("samples", problem));
        }
    };
    Ok(Level {
        value,
        air: given.air.unwrap_or(usual),
    })
}

/// Reads a height map. Its middle is the origin, unless the options give one: then the place that the file tells counts.
pub(crate) fn read_heights(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format(HeightMap::format(bytes));
    let limits = limits(builder);
    let map = HeightMap::parse(bytes, &limits).map_err(|e| builder.failed(e))?;
    let options = builder.options.heights.clone();
    let surface = map.surface(&options, &limits);
    let surface = surface.map_err(|e| builder.failed(e))?;
    let cell = map.cell(&options).map_err(|e| builder.failed(e))?;
    let n = map.samples.iter().filter(|s| s.is_nan()).count();
    let mut text = format!("{} × {} heights", map.dims[0], map.dims[1]);
    if n > 0 {
        let _ = write!(text, ", {n} of them missing: there is no ground");
    }
    let mut to_input = DMat4::IDENTITY;
    if let Some([east, north]) = map.middle() {
        if builder.options.origin == DVec3::ZERO {
            let _ = write!(
                text,
                "; its middle, {east:.1} east and {north:.1} north, is the origin (--origin {east:.0},0,{:.0} keeps its place \
                 beside models with coordinates)",
                -north
            );
        } else {
            to_input = DMat4::from_translation(DVec3::new(east, 0.0, -north));
        }
    }
    if builder.options.up == Some(Up::Z) {
        to_input = Up::Z.axes().inverse() * to_input;
    }
    let step = cell[0].max(cell[1]);
    add(
        builder,
        surface,
        to_input,
        step,
        Told {
            text,
            enlarged: None,
        },
    )
}

/// Returns the limits of sources that follow from those of the import.
pub(crate) fn limits(builder: &Builder<'_>) -> SourceLimits {
    let (most, usual) = (builder.limits(), SourceLimits::default());
    SourceLimits {
        max_triangles: usual.max_triangles.min(most.max_triangles),
        // Fuzzing has limits of its own.
        max_work: usual.max_work.min(most.max_file_bytes.saturating_mul(8)),
        max_voxels: usual.max_voxels.min(most.max_file_bytes / 16),
        max_samples: usual.max_samples.min(most.max_file_bytes / 4),
        max_nodes: usual.max_nodes.min(most.max_objects),
        allowance: builder.options.allowance.clone(),
        ..usual
    }
}

/// Assumptions about a source, for people.
#[derive(Default)]
pub(crate) struct Told {
    pub(crate) text: String,
    pub(crate) enlarged: Option<f64>,
}

/// Adds the surface of a source, from its space to that of the input.
pub(crate) fn add(
    builder: &mut Builder<'_>,
    mut surface: Surface,
    to_input: DMat4,
    step: f64,
    told: Told,
) -> Result<(), ImportError> {
    let place = "surface";
    let (n, n_triangles) = (surface.positions.len(), surface.triangles.len());
    // A surface is as long as it has to be, whatever the length of its source.
    let n_bytes = (n * size_of::<DVec3>() + n_triangles * size_of::<[u32; 3]>()) as u64;
    builder.add_read_bytes(n_bytes);
    builder.charge_vertices(place, n as u64)?;
    let mut positions: Vec<[f64; 3]> = surface.positions.drain(..).map(|p| p.to_array()).collect();
    let offset = soup::recenter(&mut positions);
    let primitive = Primitive {
        positions: positions.iter().map(|p| p.map(|c| c as f32)).collect(),
        indices: surface.triangles.into_flattened(),
        ..Primitive::default()
    };
    let name = soup::stem(builder);
    let mesh = builder.push_mesh(Mesh {
        name: name.clone(),
        primitives: vec![primitive],
    });
    let transform = builder.base * to_input * DMat4::from_translation(offset);
    let role = if builder.is_detail_file {
        Role::Detail
    } else {
        Role::Structural
    };
    let reason = if builder.is_detail_file {
        "from a detail file"
    } else {
        "the surface of a source"
    };
    builder.place_as(mesh, transform, &name, role, reason)?;
    let meters = builder.base.transform_vector3(DVec3::X).length();
    let scale = to_input.transform_vector3(DVec3::X).length();
    if let Some(file) = builder.report.files.last_mut() {
        file.surface = Some(SurfaceReport {
            step: Some(step * meters),
            distance: surface.distance * meters * scale,
            n_samples: surface.n_samples,
            enlarged: told.enlarged,
            text: told.text,
        });
    }
    Ok(())
}

impl ImportReport {
    /// Returns what a world tells about its input, as settings by name.
    pub(crate) fn told(&self, options: &ImportOptions) -> BTreeMap<String, String> {
        let all = || self.files.iter().filter_map(|f| f.surface.as_ref());
        let steps = all().filter_map(|s| s.step).reduce(f64::max);
        let distances = all().map(|s| s.distance).reduce(f64::max);
        let mut told: BTreeMap<_, _> = [("surface.step", steps), ("surface.distance", distances)]
            .into_iter()
            .filter_map(|(name, length)| Some((name.to_owned(), format!("{:.3e}", length?))))
            .collect();
        if let Some(factor) = all().find_map(|s| s.enlarged) {
            told.insert("surface.enlarged".into(), factor.to_string());
        }
        if let Some(repair) = &options.repair {
            told.insert("repair.weld".into(), repair.weld.to_string());
            told.insert("repair.hole".into(), repair.hole.to_string());
        }
        if options.origin != DVec3::ZERO {
            let [x, y, z] = options.origin.to_array();
            told.insert("origin".into(), format!("{x} {y} {z}"));
        }
        told
    }
}
