//! Props as drawn: those that stand in special portals are on both sides, cut at the plane.

use enfilade_geom::{DMat3, DVec3, Similarity};
use enfilade_world::{Space, SpecialImage};
use glam::{Mat4, Quat, Vec3};

use crate::prop::{Prop, PropMesh};
use crate::scene::{Corner, Instance, Span};

/// A prop, or its image beyond a special portal.
#[derive(Clone, Debug)]
pub(crate) struct PropCopy {
    pub(crate) prop: Prop,
    /// Map from the prop to this copy, in the frame of its part.
    map: Similarity,
    /// Planes, by normal and height, before which it is drawn: `normal · p <= height`.
    pub(crate) cuts: Vec<(DVec3, f64)>,
}

/// Returns props and their images beyond special portals. `sphere` returns the sphere around a mesh.
pub(crate) fn copies(
    space: &Space,
    props: &[Prop],
    sphere: impl Fn(PropMesh) -> (DVec3, f64),
) -> Vec<PropCopy> {
    let mut out = Vec::with_capacity(props.len());
    let mut images: Vec<SpecialImage> = Vec::new();
    for prop in props {
        images.clear();
        if prop.part.0 < space.n_parts() as u32 {
            let (middle, radius) = sphere(prop.mesh);
            let size = Vec3::from(prop.size).as_dvec3();
            let center = prop.pose.point(middle * size);
            space.images(
                prop.part,
                center,
                radius * size.abs().max_element(),
                &mut images,
            );
        }
        out.push(PropCopy {
            prop: *prop,
            map: Similarity::IDENTITY,
            cuts: images.iter().map(|image| image.near).collect(),
        });
        out.extend(images.iter().map(|image| PropCopy {
            prop: *prop,
            map: image.map,
            cuts: vec![(-image.far.0, -image.far.1)],
        }));
    }
    out
}

impl PropCopy {
    /// Returns the map from the mesh to the part: a linear part and an offset.
    fn placed(&self) -> (DMat3, DVec3) {
        let size = DMat3::from_diagonal(Vec3::from(self.prop.size).as_dvec3());
        let linear = self.map.linear() * DMat3::from_quat(self.prop.pose.turn) * size;
        (linear, self.map.point(self.prop.pose.at))
    }

    pub(crate) fn instance(&self) -> Instance {
        let placed = if self.map == Similarity::IDENTITY {
            let turn: Quat = self.prop.pose.turn.as_quat();
            let at = self.prop.pose.at.as_vec3();
            Mat4::from_scale_rotation_translation(self.prop.size.into(), turn, at)
        } else {
            let (linear, at) = self.placed();
            let at = at.as_vec3();
            Mat4::from_mat3(linear.as_mat3()) + Mat4::from_cols_array_2d(&offset(at))
        };
        Instance::of_prop(&placed, self.prop.color, self.prop.glow)
    }

    /// Appends the triangles of a mesh that are before all cuts.
    pub(crate) fn cut(&self, mesh: &Span, corners: &mut Vec<Corner>, indices: &mut Vec<u32>) {
        let (linear, at) = self.placed();
        let planes: Vec<(DVec3, f64)> = (self.cuts.iter())
            .map(|(normal, height)| (linear.transpose() * *normal, height - normal.dot(at)))
            .collect();
        let range = mesh.first as usize..(mesh.first + mesh.n) as usize;
        for at in range.step_by(3) {
            let mut polygon: Vec<Corner> = [0, 1, 2]
                .map(|k| corners[indices[at + k] as usize])
                .to_vec();
            for (normal, height) in &planes {
                polygon = clipped(&polygon, |p| height - normal.dot(Vec3::from(p).as_dvec3()));
            }
            let base = corners.len() as u32;
            for k in 2..polygon.len() as u32 {
                indices.extend([base, base + k - 1, base + k]);
            }
            if polygon.len() > 2 {
                corners.append(&mut polygon);
            }
        }
    }
}

/// Returns the matrix that, added to a linear map, translates.
fn offset(at: Vec3) -> [[f32; 4]; 4] {
    let mut out = [[0.0; 4]; 4];
    out[3][..3].copy_from_slice(&at.to_array());
    out
}

/// Returns the part of a convex polygon where `height` of the position is at least 0.
fn clipped(polygon: &[Corner], height: impl Fn([f32; 3]) -> f64) -> Vec<Corner> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, b) in polygon.iter().enumerate() {
        let a = &polygon[(i + polygon.len() - 1) % polygon.len()];
        let (from, to) = (height(a.position()), height(b.position()));
        if (from < 0.0) != (to < 0.0) {
            out.push(a.between(b, (from / (from - to)) as f32));
        }
        if to >= 0.0 {
            out.push(*b);
        }
    }
    out
}
