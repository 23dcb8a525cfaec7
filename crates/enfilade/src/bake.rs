//! Scene → [`World`](crate::World): finds cells and portals, and changes finished worlds.
//!
//! A bake of a scene made in code, with progress and a limit. The [`BakeConfig`] of a [`Method`] and a [`Budget`]:
//!
//! ```
//! use std::sync::atomic::{AtomicU32, Ordering};
//!
//! use enfilade::bake::{BakeConfig, BakeContext, Budget, Method, Progress, Stage, bake};
//!
//! #[derive(Default)]
//! struct Stages(AtomicU32);
//!
//! impl Progress for Stages {
//!     fn stage(&self, _stage: Stage) {
//!         self.0.fetch_add(1, Ordering::Relaxed);
//!     }
//! }
//!
//! # let scene = enfilade_testkit::furnished_house().scene;
//! let config = BakeConfig {
//!     budget: Budget { memory: Some(1 << 30), ..Budget::default() },
//!     ..BakeConfig::of(Method::Watershed)
//! };
//! let stages = Stages::default();
//! let output = bake(&scene, &config, &BakeContext::new(&stages, None))?;
//! assert_eq!((output.n_indoors(), output.method), (12, Method::Watershed));
//! assert!(stages.0.into_inner() > 3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`BakeError`] says what to do; here, somebody pressed a button:
//!
//! ```
//! use std::sync::Arc;
//! use std::sync::atomic::AtomicBool;
//!
//! use enfilade::bake::{BakeConfig, BakeContext, BakeError, Silent, bake};
//! # let scene = enfilade_testkit::furnished_house().scene;
//!
//! let button = Arc::new(AtomicBool::new(true));
//! let result = bake(&scene, &BakeConfig::default(), &BakeContext::new(&Silent, Some(button)));
//! assert!(matches!(result, Err(BakeError::Cancelled)));
//! ```

pub use enfilade_bake::complex::Leak;
pub use enfilade_bake::{
    BakeConfig, BakeContext, BakeError, BakeOutput, Budget, MergeSettings, Method, Outdoors,
    Pieces, Progress, Resolution, RoomAnswer, RoomDecision, Silent, SmallestHole, Stage, bake,
};

pub mod bsp {
    //! Settings of the binary space partition, and leaks of its solids.

    pub use enfilade_bake::bsp::{BspConfig, Guide, Heuristic, Rooms};
}

pub mod delaunay {
    //! Settings of the Delaunay builder.

    pub use enfilade_bake::delaunay::{Choices, DelaunayConfig, DelaunayError, Weight};
}

pub mod edit {
    //! Portals, mirrors and links added to finished worlds.
    //!
    //! A finished world gets a [portal](add_portal), across a room:
    //!
    //! ```
    //! use enfilade::bake::edit::add_portal;
    //! use enfilade::geom::DVec3;
    //! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
    //!
    //! let [low, high] = world.graph.cells[0].aabb.map(|p| DVec3::from_array(p.map(f64::from)));
    //! let x = (low.x + high.x) / 2.0;
    //! let (low, high) = (low - DVec3::ONE, high + DVec3::ONE);
    //! let across = [[low.y, low.z], [high.y, low.z], [high.y, high.z], [low.y, high.z]];
    //! let added = add_portal(&world, &across.map(|[y, z]| DVec3::new(x, y, z)))?;
    //! assert_eq!(added.world.graph.cells.len(), world.graph.cells.len() + 1);
    //! # Ok::<(), Box<dyn std::error::Error>>(())
    //! ```

    pub use enfilade_bake::edit::{AddPortalError, Added, add_portal};

    pub mod special {
        //! Mirrors, monitors and links.
        //!
        //! A [`SpecialSpot`] becomes a [`mirror`], and [`plain`] takes it away:
        //!
        //! ```
        //! use enfilade::{CellId, PortalId};
        //! use enfilade::bake::edit::special::{SpecialSpot, mirror, plain};
        //! use enfilade::cpg::Way;
        //! # let mut world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
        //!
        //! let spot = SpecialSpot::Doorway { portal: PortalId(0), cell: Some(CellId(0)) };
        //! let id = mirror(&mut world, &spot)?;
        //! assert!(world.graph.specials[id.idx()].passes.iter().any(|pass| pass.way == Way::Mirror));
        //! plain(&mut world, id)?;
        //! assert!(world.graph.specials.is_empty());
        //! # Ok::<(), Box<dyn std::error::Error>>(())
        //! ```

        pub use enfilade_bake::edit::special::{
            LinkOptions, SpecialError, SpecialSpot, link, mirror, monitor, plain, reflect, tint,
        };
    }
}

pub mod leak {
    //! The widest path from a room to the outdoors.
    //!
    //! The trail of a house that is closed is an error, [`NoTrail`]:
    //!
    //! ```
    //! use enfilade::bake::leak::{NoTrail, find_leak_trail};
    //! use enfilade::bake::{BakeConfig, BakeContext};
    //! # let scene = enfilade_testkit::furnished_house().scene;
    //!
    //! let trail = find_leak_trail(&scene, &BakeConfig::default(), None, &BakeContext::default());
    //! match trail {
    //!     Ok(trail) => println!("{:.1} m to {}", trail.length(), trail.exit),
    //!     Err(NoTrail::Closed { hole, .. }) => println!("no hole wider than {hole} m"),
    //!     Err(other) => return Err(other.into()),
    //! }
    //! # Ok::<(), Box<dyn std::error::Error>>(())
    //! ```

    pub use enfilade_bake::leak::{LeakTrail, NoTrail, find_leak_trail};
}

pub mod names {
    //! Names of cells.
    //!
    //! Names are made unique:
    //!
    //! ```
    //! use enfilade::CellId;
    //! use enfilade::bake::names::rename_cells;
    //! # let mut world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
    //!
    //! let names = [0, 1].map(|i| (CellId(i), "office".to_owned()));
    //! rename_cells(&mut world.graph, &names);
    //! assert_eq!(world.graph.cells[0].name, "office");
    //! assert_ne!(world.graph.cells[1].name, "office");
    //! ```

    pub use enfilade_bake::names::rename_cells;
}

pub mod rebake {
    //! Bakes of the part of a scene that changed.

    pub use enfilade_bake::rebake::{RebakeError, Rebaked, WholeBecause, rebake};
}

pub mod simplify {
    //! Cells merged where a portal costs more than it hides.
    //!
    //! [`simplify`] merges cells; here, until one is left:
    //!
    //! ```
    //! use enfilade::bake::simplify::{SimplifySettings, simplify};
    //! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
    //!
    //! let settings = SimplifySettings { max_cells: Some(1), ..SimplifySettings::default() };
    //! let simplified = simplify(&world, &settings);
    //! assert_eq!(simplified.world.graph.indoor_cells().count(), 1);
    //! assert_eq!(simplified.cell_of.len(), 2); // where each cell went
    //! ```

    pub use enfilade_bake::simplify::{
        CostModel, Metric, Simplified, SimplifySettings, UnknownMaterial, delete_portal, simplify,
    };
}
