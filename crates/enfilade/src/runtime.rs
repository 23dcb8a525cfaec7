//! Visibility per frame: what a view sees, doors, following, picking and lines of sight.
//!
//! A [`View`] looks ahead, or around; bad numbers are a [`ViewError`]:
//!
//! ```
//! use enfilade::{View, ViewError};
//!
//! let ahead = View::perspective([0.0, 1.6, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 1.0, 1.6)?;
//! assert_eq!(ahead.with_far(50.0)?.eye(), [0.0, 1.6, 0.0]);
//! assert!(View::around([f32::NAN; 3]).is_err());
//! # Ok::<(), ViewError>(())
//! ```
//!
//! A [`Follower`] follows a point through portals, step by step; each [`Step`] says what happened:
//!
//! ```
//! use enfilade::{Follower, PortalId, Step};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let door = &world.graph.portals[0];
//! let (middle, n) = (door.center(), door.normal);
//! let beside = |d: f32| [0, 1, 2].map(|k| middle[k] + d * n[k]);
//! let mut follower = Follower::new(&sight, beside(-0.3));
//! assert_eq!(follower.step(&sight, beside(-0.2)), Step::Stayed);
//! follower.step(&sight, beside(0.3));
//! assert_eq!(follower.crossed(), [PortalId(0)]);
//! assert_eq!(follower.cell(), Some(door.cells[1]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`SightState`] opens, closes and locks; [`SavedDoors`] keep it:
//!
//! ```
//! use enfilade::{CellId, PortalId, SightState, Viewer, View};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let [low, high] = world.graph.cells[0].aabb;
//! let view = View::around([0, 1, 2].map(|k| (low[k] + high[k]) / 2.0))?;
//! let mut viewer = Viewer::new(&sight);
//! assert_eq!(viewer.see(&sight, &state, &view).cells().len(), 2);
//! let saved = state.saved();
//! state.close(PortalId(0)); // hides the other room
//! assert_eq!(viewer.see(&sight, &state, &view).cells(), [CellId(0)]);
//! state.restore(&saved)?;
//! assert!(state.is_open(PortalId(0)));
//! state.lock(CellId(1), true); // not loaded, for example
//! assert_eq!(viewer.see(&sight, &state, &view).cells(), [CellId(0)]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Seen`] tells whether a box of yours is in view:
//!
//! ```
//! use enfilade::{CellId, View, Viewer};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let [low, high] = world.graph.cells[0].aabb;
//! let eye = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
//! let view = View::perspective(eye, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5, 1.0)?;
//! let mut viewer = Viewer::new(&sight);
//! let seen = viewer.see(&sight, &state, &view);
//! let ball = |x: f32| [[x - 0.1, eye[1] - 0.1, eye[2] - 0.1], [x + 0.1, eye[1] + 0.1, eye[2] + 0.1]];
//! assert!(seen.sees_box(&[CellId(0)], ball(eye[0] + 1.0)));
//! assert!(!seen.sees_box(&[CellId(0)], ball(eye[0] - 1.0))); // behind the eye
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`SeeOptions`] of a [`Viewer`], and its [`Stops`], portals at which the view ends:
//!
//! ```
//! use enfilade::runtime::{Narrowing, SeeOptions};
//! use enfilade::{CellId, PortalId, View, Viewer};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let options = SeeOptions { narrowing: Narrowing::Rectangle, ..SeeOptions::default() };
//! let mut viewer = Viewer::with_options(&sight, options);
//! let [low, high] = world.graph.cells[0].aabb;
//! let view = View::around([0, 1, 2].map(|k| (low[k] + high[k]) / 2.0))?;
//! viewer.stops_mut().stop(PortalId(0), CellId(1));
//! let seen = viewer.see(&sight, &state, &view);
//! assert_eq!(seen.stopped(), [(PortalId(0), CellId(1))]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Sightlines`] are prepared once; [`pick_where`](Sightlines::pick_where) ignores what you choose. A coordinate that is not a number
//! is a [`NotFinite`]:
//!
//! ```
//! use enfilade::{Sightlines, Target};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let lines = Sightlines::build(&world);
//! let [low, high] = world.graph.cells[0].aabb;
//! let eye = [0, 1, 2].map(|k| (low[k] + high[k]) / 2.0);
//! let below = [eye[0], low[1] - 1.0, eye[2]];
//! let hit = lines.pick_where(&state, eye, below, |_detail| false)?.expect("a floor");
//! assert!(matches!(hit.target, Target::Wall { .. }));
//! assert!(lines.pick(&state, eye, [f32::NAN; 3]).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`Start`] is a place to begin a walk:
//!
//! ```
//! use enfilade::runtime::Start;
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! # let sight = enfilade::Sight::build(&world)?;
//! # let mut state = enfilade::SightState::new(&sight);
//!
//! let start = Start::find(&world, &sight, &state).expect("a room");
//! assert!(sight.locate(start.eye).is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use enfilade_runtime::{
    Chunk, ChunkId, DetailId, Draw, DrawList, Follower, Hit, Leaf, Narrowing, NotFinite,
    SavedDoors, SavedDoorsError, SeeCounts, SeeOptions, Seen, Sight, SightError, SightOptions,
    SightSkeleton, SightState, Sightlines, SkeletonError, Start, Step, Stops, Target, View,
    ViewError, Viewer, Visit,
};
