//! Sources that are not triangles: their surfaces become the only object of their file.

use std::collections::BTreeMap;

use enfilade_geom::scene::{Mesh, Primitive, Role};
use enfilade_geom::{DMat4, DVec3};
use enfilade_source::{ImplicitScene, SourceError, SourceLimits, Surface};

use crate::builder::Builder;
use crate::{ImportError, ImportReport, SurfaceReport, soup};

/// Reads a scene of implicit shapes.
pub(crate) fn read_implicit(bytes: &[u8], builder: &mut Builder<'_>) -> Result<(), ImportError> {
    builder.set_format("implicit");
    let limits = limits(builder);
    let bad = |builder: &Builder<'_>, e: SourceError| builder.malformed(e.place, e.problem);
    let scene = ImplicitScene::parse(bytes, &limits).map_err(|e| bad(builder, e))?;
    let surface = scene.surface(&limits).map_err(|e| bad(builder, e))?;
    let unit = match builder.options.unit {
        Some(_) => 1.0,
        None => scene.unit.unwrap_or(1.0),
    };
    add(
        builder,
        surface,
        DMat4::from_scale(DVec3::splat(unit)),
        scene.step(),
    )
}

/// Returns the limits of sources that follow from those of the import.
fn limits(builder: &Builder<'_>) -> SourceLimits {
    let (most, usual) = (builder.limits(), SourceLimits::default());
    SourceLimits {
        max_triangles: usual.max_triangles.min(most.max_triangles),
        // Fuzzing has limits of its own.
        max_work: usual.max_work.min(most.max_file_bytes.saturating_mul(8)),
        max_samples: usual.max_samples.min(most.max_file_bytes / 4),
        max_nodes: usual.max_nodes.min(most.max_objects),
        ..usual
    }
}

/// Adds the surface of a source, from its space to that of the input.
fn add(
    builder: &mut Builder<'_>,
    mut surface: Surface,
    to_input: DMat4,
    step: f64,
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
    let meters = transform.transform_vector3(DVec3::X).length();
    if let Some(file) = builder.report.files.last_mut() {
        file.surface = Some(SurfaceReport {
            step: step * meters,
            distance: surface.distance * meters,
        });
    }
    Ok(())
}

impl ImportReport {
    /// Returns what a world tells about surfaces that were extracted from its input, as settings by name: the largest
    /// step, and the largest distance of a surface from its source. Empty without such input.
    #[must_use]
    pub fn surface_settings(&self) -> BTreeMap<String, String> {
        let all = || self.files.iter().filter_map(|f| f.surface.as_ref());
        let largest = |of: fn(&SurfaceReport) -> f64| all().map(of).fold(0.0, f64::max);
        if all().next().is_none() {
            return BTreeMap::new();
        }
        [
            ("surface.step", largest(|s| s.step)),
            ("surface.distance", largest(|s| s.distance)),
        ]
        .map(|(name, length)| (name.to_owned(), format!("{length:.3e}")))
        .into()
    }
}
