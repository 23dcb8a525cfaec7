//! A scene under construction together with its truth.

use enfilade_geom::scene::{Image, Material, Mesh, Object, Role, Scene, Texture};
use enfilade_geom::{Aabb, DMat4, DVec3};

use crate::solid::MeshBuilder;
use crate::truth::{Convex, Opening, OpeningKind, Room, Side, Truth};

/// A generated scene and its truth by construction.
#[derive(Clone, Debug, Default)]
pub struct Generated {
    /// The scene.
    pub scene: Scene,
    /// Its rooms and openings.
    pub truth: Truth,
}

impl Generated {
    /// Returns the number of triangles of the objects with `role`.
    #[must_use]
    pub fn n_triangles(&self, role: Role) -> usize {
        let per_mesh: Vec<usize> = self
            .scene
            .meshes
            .iter()
            .map(|m| m.primitives.iter().map(|p| p.indices.len() / 3).sum())
            .collect();
        let objects = self.scene.objects.iter().filter(|o| o.role == role);
        objects.map(|o| per_mesh[o.mesh as usize]).sum()
    }

    /// Returns the truth as `truth.json`.
    #[must_use]
    pub fn truth_json(&self) -> String {
        self.truth.to_json(self.n_triangles(Role::Structural))
    }

    /// Returns the scene with objects of `role` only, and only the meshes that they place.
    #[must_use]
    pub fn only(&self, role: Role) -> Scene {
        let mut scene = self.scene.clone();
        scene.objects.retain(|o| o.role == role);
        let mut kept = vec![None; scene.meshes.len()];
        let mut meshes = Vec::new();
        for o in &mut scene.objects {
            let slot = &mut kept[o.mesh as usize];
            o.mesh = *slot.get_or_insert_with(|| {
                meshes.push(std::mem::take(&mut scene.meshes[o.mesh as usize]));
                meshes.len() as u32 - 1
            });
        }
        scene.meshes = meshes;
        scene
    }
}

/// Builds a scene and its truth side by side, so that they stay consistent.
#[derive(Clone, Debug, Default)]
pub struct Site {
    generated: Generated,
    textured: Vec<u32>,
}

impl Site {
    /// Makes an empty site.
    #[must_use]
    pub fn new(name: &str) -> Self {
        let mut site = Self::default();
        site.generated.truth.scene = name.into();
        site
    }

    /// Adds an opaque, rough material.
    pub fn material(&mut self, name: &str, [r, g, b]: [f32; 3]) -> u32 {
        self.add_material(name, [r, g, b, 1.0], "", |m| m)
    }

    /// Adds an opaque material that is seen from both sides.
    pub fn sheet_material(&mut self, name: &str, [r, g, b]: [f32; 3]) -> u32 {
        self.add_material(name, [r, g, b, 1.0], ",\"doubleSided\":true", |m| {
            Material {
                double_sided: true,
                ..m
            }
        })
    }

    /// Adds a transparent material (`alphaMode` `BLEND`).
    pub fn glass(&mut self, name: &str, color: [f32; 4]) -> u32 {
        let extra = ",\"alphaMode\":\"BLEND\",\"doubleSided\":true";
        self.add_material(name, color, extra, |m| Material {
            transparent: true,
            double_sided: true,
            ..m
        })
    }

    /// Adds a material with a repeated texture; one repeat per meter.
    pub fn textured_material(&mut self, name: &str, png: Vec<u8>) -> u32 {
        let scene = &mut self.generated.scene;
        let image = scene.images.len() as u32;
        scene.images.push(Image {
            name: name.into(),
            mime: "image/png".into(),
            bytes: png,
        });
        let texture = scene.textures.len();
        scene.textures.push(Texture {
            image: Some(image),
            sampler: "{\"magFilter\":9729,\"minFilter\":9987,\"wrapS\":10497,\"wrapT\":10497}"
                .into(),
        });
        let id = scene.materials.len() as u32;
        scene.materials.push(Material {
            name: name.into(),
            gltf: format!(
                "{{\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":{texture}}},\
                 \"metallicFactor\":0,\"roughnessFactor\":0.8}}}}"
            ),
            double_sided: false,
            transparent: false,
            base_color: [1.0; 4],
        });
        self.textured.push(id);
        id
    }

    fn add_material(
        &mut self,
        name: &str,
        color: [f32; 4],
        extra: &str,
        finish: impl Fn(Material) -> Material,
    ) -> u32 {
        let [r, g, b, a] = color;
        let gltf = format!(
            "{{\"name\":\"{name}\",\"pbrMetallicRoughness\":{{\"baseColorFactor\":[{r},{g},{b},{a}],\
             \"metallicFactor\":0,\"roughnessFactor\":0.9}}{extra}}}"
        );
        let plain = Material {
            name: name.into(),
            gltf,
            double_sided: false,
            transparent: false,
            base_color: color,
        };
        self.generated.scene.materials.push(finish(plain));
        self.generated.scene.materials.len() as u32 - 1
    }

    /// Adds a mesh without placing it.
    pub fn mesh(&mut self, name: &str, builder: MeshBuilder) -> u32 {
        let mesh = builder.build(name, &self.textured);
        self.add_mesh(mesh)
    }

    /// Adds a finished mesh without placing it.
    pub fn add_mesh(&mut self, mesh: Mesh) -> u32 {
        self.generated.scene.meshes.push(mesh);
        self.generated.scene.meshes.len() as u32 - 1
    }

    /// Adds a structural object that is modelled in place. Ignores an empty mesh.
    pub fn structure(&mut self, name: &str, builder: MeshBuilder) {
        if builder.n_triangles() > 0 {
            let mesh = self.mesh(name, builder);
            self.place(name, mesh, DMat4::IDENTITY, Role::Structural);
        }
    }

    /// Adds a detail object that is modelled in place. Ignores an empty mesh.
    pub fn detail(&mut self, name: &str, builder: MeshBuilder) {
        if builder.n_triangles() > 0 {
            let mesh = self.mesh(name, builder);
            self.place(name, mesh, DMat4::IDENTITY, Role::Detail);
        }
    }

    /// Places a mesh as a detail object at `at`, rotated by `yaw` degrees about +Y.
    pub fn furnish(&mut self, name: &str, mesh: u32, at: DVec3, yaw: f64) {
        let turned = DMat4::from_rotation_y(yaw.to_radians());
        self.place(
            name,
            mesh,
            DMat4::from_translation(at) * turned,
            Role::Detail,
        );
    }

    /// Places a mesh.
    pub fn place(&mut self, name: &str, mesh: u32, transform: DMat4, role: Role) {
        let reason = "generated".into();
        self.generated.scene.objects.push(Object {
            name: name.into(),
            mesh,
            transform,
            role,
            reason,
            filling: None,
            node: None,
        });
    }

    /// Adds a storey and returns its index.
    pub fn storey(&mut self, name: &str, elevation: f64) -> usize {
        self.generated.truth.storeys.push((name.into(), elevation));
        self.generated.truth.storeys.len() - 1
    }

    /// Adds a room of one box to the truth.
    pub fn room(&mut self, name: &str, storey: usize, air: Aabb) -> Side {
        self.add_room(Room::new(name, storey, vec![Convex::of_aabb(&air)], &[]))
    }

    /// Adds a room to the truth.
    pub fn add_room(&mut self, room: Room) -> Side {
        self.generated.truth.rooms.push(room);
        Side::Room(self.generated.truth.rooms.len() - 1)
    }

    /// Adds an opening to the truth: the air box `hole` across `axis` (0, 1, 2 for x, y, z), `rooms` in
    /// ascending order along it.
    pub fn opening(&mut self, kind: OpeningKind, hole: Aabb, axis: usize, rooms: [Side; 2]) {
        let truth = &mut self.generated.truth;
        let label = |s: Side| match s {
            Side::Room(i) => truth.rooms[i].name.clone(),
            Side::Outside => "outside".into(),
        };
        let name = format!(
            "{}-{} {} to {}",
            kind.as_str(),
            truth.openings.len(),
            label(rooms[0]),
            label(rooms[1])
        );
        truth
            .openings
            .push(Opening::of_hole(kind, &name, &hole, axis, rooms));
    }

    /// Adds an opening to the truth that is not along an axis.
    pub fn add_opening(&mut self, opening: Opening) {
        self.generated.truth.openings.push(opening);
    }

    /// Adds a point in solid matter to the truth.
    pub fn matter(&mut self, point: DVec3) {
        self.generated.truth.matter.push(point);
    }

    /// Returns the scene and its truth.
    #[must_use]
    pub fn finish(self) -> Generated {
        self.generated
    }
}
