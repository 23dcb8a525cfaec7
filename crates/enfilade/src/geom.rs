//! Boxes, planes, polygons, poses, and the input scene.
//!
//! Boxes:
//!
//! ```
//! use enfilade::geom::{Aabb, DVec3};
//!
//! let room = Aabb::new(DVec3::ZERO, DVec3::new(4.0, 3.0, 5.0));
//! assert_eq!(room.volume(), 60.0);
//! assert!(room.contains(room.center()) && !room.contains(DVec3::NEG_ONE));
//! assert_eq!(Aabb::of_points(&[DVec3::ZERO]).union(room), room);
//! ```
//!
//! A [`Winding`] is a convex polygon, counter-clockwise seen from the side of its normal; a [`Plane`] has a positive side:
//!
//! ```
//! use enfilade::geom::{DVec3, Plane, Winding};
//!
//! let door = [[0., 0.], [0.9, 0.], [0.9, 2.], [0., 2.]].map(|[x, y]| DVec3::new(x, y, 0.0));
//! let door = Winding::new(door.to_vec());
//! assert!((door.area() - 1.8).abs() < 1e-9);
//! let plane = Plane::through(door.centroid(), door.area_normal());
//! assert!(plane.signed_distance(DVec3::Z) > 0.99);
//! ```
//!
//! A [`Similarity`] turns, scales and moves, or reflects; special portals map points by it:
//!
//! ```
//! use enfilade::geom::{DQuat, DVec3, Similarity};
//!
//! let turn = Similarity::rigid(DQuat::from_rotation_y(1.0), DVec3::X);
//! let back = turn.inverse().after(&turn);
//! assert!(back.point(DVec3::ONE).distance(DVec3::ONE) < 1e-12);
//! let mirror = Similarity::reflection(DVec3::ZERO, DVec3::X);
//! assert!(mirror.is_reflection());
//! assert_eq!(mirror.point(DVec3::new(2.0, 1.0, 0.0)), DVec3::new(-2.0, 1.0, 0.0));
//! ```
//!
//! A [`ConvexSolid`] is a brush, the common back of planes:
//!
//! ```
//! use enfilade::geom::{ConvexSolid, DVec3, Plane, SolidError};
//!
//! let faces = [DVec3::X, DVec3::Y, DVec3::Z].map(|n| [n, -n]).into_iter().flatten();
//! let faces: Vec<Plane> = faces.map(|n| Plane::through(n, n)).collect();
//! let cube = ConvexSolid::from_planes(&faces, 100.0, 1e-6)?;
//! assert_eq!(cube.aabb().size(), DVec3::splat(2.0));
//! let open = ConvexSolid::from_planes(&faces[..5], 100.0, 1e-6);
//! assert_eq!(open.unwrap_err(), SolidError::Unbounded);
//! # Ok::<(), SolidError>(())
//! ```
//!
//! An [`Allowance`] bounds the work of a call; its [`AllowanceEnd`] is the reason why it is used up:
//!
//! ```
//! use std::sync::Arc;
//! use std::sync::atomic::AtomicBool;
//!
//! use enfilade::geom::{Allowance, AllowanceEnd};
//!
//! let cancel = Arc::new(AtomicBool::new(true));
//! let allowance = Allowance::new(u64::MAX, None).unless(Some(cancel));
//! assert_eq!(allowance.end(), Some(AllowanceEnd::Cancelled));
//! ```

pub use enfilade_geom::{
    Aabb, Allowance, AllowanceEnd, ConvexSolid, MemoryProbe, Plane, Shown, Similarity, SolidError,
    Triangle, Winding, shown,
};
pub use glam::{DMat3, DMat4, DQuat, DVec2, DVec3, DVec4};

pub mod scene {
    //! The input scene: meshes, and objects that place them.
    //!
    //! A [`Scene`] made in code: an [`Object`] places a [`Mesh`], and its [`Role`] tells walls from furniture:
    //!
    //! ```
    //! use enfilade::geom::scene::{Mesh, Object, Primitive, Role, Scene};
    //! use enfilade::geom::{DMat4, DVec3};
    //!
    //! let floor = Primitive {
    //!     positions: vec![[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [4.0, 0.0, 5.0], [4.0, 0.0, 0.0]],
    //!     indices: vec![0, 1, 2, 0, 2, 3],
    //!     ..Primitive::default()
    //! };
    //! let scene = Scene {
    //!     meshes: vec![Mesh { primitives: vec![floor], ..Mesh::default() }],
    //!     objects: vec![Object {
    //!         name: "floor".to_owned(),
    //!         mesh: 0,
    //!         transform: DMat4::from_translation(DVec3::X),
    //!         role: Role::Structural,
    //!         reason: "made here".to_owned(),
    //!         node: None,
    //!         filling: None,
    //!     }],
    //!     ..Scene::default()
    //! };
    //! assert_eq!(scene.triangle_sources(Role::Structural).count(), 2);
    //! assert_eq!(scene.object_aabb(0).max, DVec3::new(5.0, 0.0, 5.0));
    //! ```

    pub use enfilade_geom::scene::{
        About, Entity, Filling, Fixture, FixtureKind, GivenPortal, Image, Mark, MarkKind, Material,
        Mesh, Object, Primitive, Role, RoomName, Scene, SourceNode, Texture, TriangleSource,
    };
}
