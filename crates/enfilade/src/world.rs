//! Queries of a living world: things, actors, paths, sound, light, contacts, moving rooms.
//!
//! A [`Space`] holds worlds that move in each other; a [`Place`] is a cell of one of its parts. [`Space::follow`] maps a step
//! through special portals:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Place};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let (a, b) = (middle(&space, 0), middle(&space, 1));
//! let place = space.locate(PartId::ROOT, a);
//! assert_eq!(place, Some(Place { part: PartId::ROOT, cell: CellId(0) }));
//! let end = space.follow(PartId::ROOT, a, b - a);
//! assert!(end.at.distance(b) < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A part rides along, at a [`Pose`]:
//!
//! ```
//! use enfilade::geom::DVec3;
//! use enfilade::world::{PartId, Pose, Space};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let mut space = Space::new(world.clone())?;
//! let ship = space.add_part(world, PartId::ROOT, Pose::from_translation(DVec3::X * 100.0))?;
//! space.set_pose(ship, Pose::about(DVec3::ZERO, DVec3::Y, 1.0))?;
//! let out = space.between(ship, PartId::ROOT);
//! assert!(out.point(DVec3::X).distance(out.inverse().point_back(DVec3::X)) < 1e-9);
//! assert_eq!(space.n_parts(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Things`] know their cells, and [`SavedThings`] keep them; a [`Shape`] is convex, a [`Tie`] says what a thing rides on:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Pose, Shape, Things, Tie};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let at = Pose::from_translation(middle(&space, 1));
//! let mut things = Things::new();
//! let ball = things.add(&space, Shape::sphere(0.2)?, PartId::ROOT, at, Tie::Carried)?;
//! let place = things.place(&space, ball)?.expect("in a room");
//! assert_eq!(place.cell, CellId(1));
//! assert_eq!(things.things_in(&space, place).collect::<Vec<_>>(), [ball]);
//! let saved = things.saved(&space);
//! assert!(Things::restored(&space, &saved).is_ok());
//! things.remove(ball)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Lights`] know what each [`Lamp`] may light; a door in between changes it:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Lamp, Lights};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let mut space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let (a, b) = (middle(&space, 0), middle(&space, 1));
//! let mut lights = Lights::new(&space);
//! let lamp = Lamp { frame: PartId::ROOT, at: a.as_vec3().to_array(), range: 20.0 };
//! let lamp = lights.add(&space, lamp)?;
//! let there = space.locate(PartId::ROOT, b).expect("a room");
//! for portal in 0..space.layout(PartId::ROOT).n_portals() {
//!     space.close(PartId::ROOT, enfilade::PortalId(portal as u32));
//! }
//! assert!(!lights.may_light(&space, lamp, there, b));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`PathSearch`] finds a [`Path`] on the [`WalkMap`] of an [`Agent`], or says why there is none ([`NoPath`], [`Blocked`]):
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Agent, NoPath, Path, PathSearch, WalkMap};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let map = WalkMap::new(&space, Agent::default());
//! let ends = [0, 1].map(|cell| (PartId::ROOT, middle(&space, cell)));
//! let (mut search, mut path) = (PathSearch::new(), Path::default());
//! search.find(&map, &space, ends, |_, _| true, &mut path)?;
//! assert!(path.length > 1.0 && path.portals.len() == 1);
//! let no_door = search.find(&map, &space, ends, |_, _| false, &mut path);
//! assert_eq!(no_door, Err(NoPath::NoWay));
//! let near = search.cells_within(&map, &space, ends[0].0, ends[0].1, 100.0, |_, _| true)?;
//! assert_eq!(near.len(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Hops`] answer at once which portal is next, on the shortest way by costs of your own:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Hops};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let mut hops = Hops::new(&space, |_, _| Some(1.0));
//! let [a, b] = [0, 1].map(|c| space.locate(PartId::ROOT, middle(&space, c)).expect("a room"));
//! let next = hops.next(&space, a, b).expect("a way");
//! assert_eq!(next.to, b);
//! hops.set_open(PartId::ROOT, next.portal, false);
//! assert_eq!(hops.distance(&space, a, b), None);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`Walker`] is stopped by walls and steps onto floors; a [`Caster`] does so for any [`Body`]:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Agent, Walker};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let agent = Agent::default();
//! let mut walker = Walker::new(agent, PartId::ROOT, middle(&space, 0));
//! for _ in 0..600 {
//!     walker.step(&space, enfilade::geom::DVec3::Z * 1.4, 1.0 / 60.0); // against the wall
//! }
//! assert_eq!(walker.place().map(|place| place.cell), Some(CellId(0)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Acoustics`] and a [`Listener`] tell what is [`Heard`] of a source, and from where, through doors that may be closed
//! ([`Transmission`]):
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Acoustics, Listener, Transmission};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let acoustics = Acoustics::new(&space, &Transmission::default());
//! let (ears, radio) = (middle(&space, 0), middle(&space, 1));
//! let [here, there] = [ears, radio].map(|p| space.locate(PartId::ROOT, p).expect("a room"));
//! let mut listener = Listener::new();
//! listener.listen(&acoustics, &space, here, ears);
//! let heard = listener.hear(&acoustics, 0, there, radio).expect("an open door");
//! assert!(heard.length >= ears.distance(radio) - 1e-6 && heard.gain > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Reverb`] and [`DiffuseFields`] tell how long rooms resound, from the materials of walls ([`Assumed`]) and a [`DecayLaw`]:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, Assumed, DecayLaw, DiffuseFields, Reverb};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let walls = |surface: &str| Assumed::of_name(surface).bands;
//! let room = space.locate(PartId::ROOT, middle(&space, 0)).expect("a room");
//! let mut rt60 = |surface: &str| {
//!     let reverb = Reverb::new(&space, DecayLaw::Eyring, |_, _| walls(surface));
//!     let mut fields = DiffuseFields::new();
//!     fields.solve(&reverb, &space, room, |_, _| 0.0);
//!     fields.rt60(room)
//! };
//! assert!(rt60("concrete") > rt60("carpet"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Actors`] live whether anybody looks or not; [`AwakeCells`] are those where somebody does. A [`Chance`] is the same in each run:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::geom::DVec3;
//! use enfilade::world::{ActorEvent, Actors, AwakeCells, Chance, PlanDraft};
//!
//! // Everybody waits, for a time of their own.
//! let mut plan = |_: &ActorEvent, chance: &mut Chance, draft: &mut PlanDraft<'_>| {
//!     draft.wait(chance.range([1.0, 5.0]));
//! };
//! let mut actors = Actors::new(2, 42);
//! let guard = actors.add(DVec3::ZERO, CellId(0), &mut plan);
//! actors.advance(60.0, &mut plan);
//! assert_eq!(actors.in_cell(CellId(0)).collect::<Vec<_>>(), [guard]);
//! assert_eq!(Chance::new(1, 2, 3).unit(), Chance::new(1, 2, 3).unit());
//!
//! let mut awake = AwakeCells::new(2, 5.0); // they linger for 5 s
//! awake.update(0.0, [CellId(1)]);
//! awake.update(4.0, []);
//! assert!(awake.is_awake(CellId(1)) && !awake.is_awake(CellId(0)));
//! ```
//!
//! [`Space::pick`] casts a [`SightRay`] through special portals, to the end that [`TraceEnd`] names:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, SightRay};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let from = middle(&space, 0);
//! let ray = SightRay::new(PartId::ROOT, from, enfilade::geom::DVec3::NEG_Y * 10.0);
//! let traced = space.pick(&ray, &mut Vec::new())?;
//! let (part, hit) = traced.surface().expect("a floor");
//! assert_eq!((*part, hit.cell), (PartId::ROOT, Some(CellId(0))));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`SpaceViewer`] sees a whole space; each [`SeenContext`] of its [`SpaceSeen`] is a part of the picture:
//!
//! ```
//! use enfilade::CellId;
//! use enfilade::world::{PartId, Space, SpaceViewer};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//! let space = Space::new(world)?;
//! let middle = |space: &Space, cell: u32| space.layout(PartId::ROOT).cell(CellId(cell)).bounds.center();
//! let view = enfilade::View::around(middle(&space, 0).as_vec3().to_array())?;
//! let mut viewer = SpaceViewer::new(&space);
//! let seen = viewer.see(&space, PartId::ROOT, &view);
//! let root = seen.of_part(PartId::ROOT).expect("it is there");
//! assert_eq!(root.cells().len(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Layout`] has the shapes of one world's cells, and the [`Opening`] of each portal; [`Pairs`] finds bodies that may touch:
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use enfilade::geom::{Aabb, DVec3};
//! use enfilade::world::{Layout, Pairs};
//! use enfilade::{CellId, PortalId};
//! # let world = enfilade_testkit::room_grid(&enfilade_testkit::GridParams::two_rooms());
//!
//! let layout = Layout::new(&world);
//! let opening = layout.opening(PortalId(0));
//! assert_eq!(layout.exits(opening.cells()[0])[0].to, opening.cells()[1]);
//! assert!(opening.area() > 1.0);
//!
//! let unit = |x: f64| Aabb::new(DVec3::X * x, DVec3::X * x + DVec3::ONE);
//! let one = [CellId(0)];
//! let bodies = [(unit(0.0), &one[..]), (unit(0.5), &one[..]), (unit(9.0), &one[..])];
//! let mut pairs = Vec::new();
//! let _ = Pairs::new().for_each(&bodies, |a, b| {
//!     pairs.push((a.min(b), a.max(b)));
//!     ControlFlow::Continue(())
//! });
//! assert_eq!(pairs, [(0, 1)]);
//! ```

pub use enfilade_world::{
    Acoustics, ActorEvent, ActorId, ActorPlace, Actors, Agent, Arrival, Assumed, AwakeCells,
    Blocked, Body, Cast, Caster, Cause, CellShape, Chance, Contact, Corner, DecayLaw,
    DiffuseFields, Docking, Errands, Flood, Floors, Followed, Geodesics, Heard, Hop, Hops, Impact,
    KeptMapError, Lamp, LampError, LampId, Layout, LayoutExit, LengthSearch, Lights, Listener,
    Moved, NoPath, OCTAVES, Obstacle, Opening, Pairs, PartId, PassedPortal, Passing, Path,
    PathFollower, PathPoint, PathPortal, PathSearch, Place, PlanDraft, Pose, Posted, Reverb,
    SPEED_OF_SOUND, Sampling, SavedActor, SavedActors, SavedError, SavedPose, SavedSpace,
    SavedThing, SavedThings, SavedTie, SeenContext, SeenVia, Shape, ShapeError, SightRay, Space,
    SpaceError, SpaceSeen, SpaceViewer, SpecialImage, SpecialOptions, StoppedSpecial, ThingError,
    ThingId, Things, Tie, TraceEnd, Traced, Transmission, WalkMap, WalkMapKey, WalkPatch,
    WalkProgress, Walker, WayPoint, Ways,
};
