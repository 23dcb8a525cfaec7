//! Promises about the types of the façade that `api.txt` does not hold. It holds `Debug`, and which types are not `Send` or `Sync`.

use std::fmt::Debug;

use enfilade::bake::{BakeConfig, BakeContext, BakeError, BakeOutput, Budget, MergeSettings};
use enfilade::edit::{EditError, EditOperation, EditSession, EditedSpace};
use enfilade::geom::scene::Scene;
use enfilade::import::{CleaningOptions, ImportOptions, Imported, Limits, RoleRules};
use enfilade::kit::{Assembly, Kit, LevelSpace, Piece, PlaceOptions};
use enfilade::runtime::{SavedDoors, SeeOptions, SightOptions, SightSkeleton};
use enfilade::stream::{
    Catalog, PackedWorld, SimulatedLink, SimulatedLinkOptions, StreamOptions, Streamer,
    ThreadSource,
};
use enfilade::verify::{VerifyOptions, VerifyReport};
use enfilade::vis::{VisConfig, VisOutput};
use enfilade::world::{
    Acoustics, Actors, Agent, AwakeCells, Caster, DiffuseFields, Docking, Hops, Layout, Lights,
    Listener, PartId, Path, PathFollower, PathSearch, Reverb, Sampling, Space, SpaceViewer,
    SpecialOptions, Things, Transmission, WalkMap, Walker,
};
use enfilade::{
    DrawList, FileError, Follower, Pvs, Seen, Sight, SightState, Sightlines, View, Viewer, World,
};
use enfilade_testkit::{GridParams, room_grid};

fn shared<T: Debug + Send + Sync>() {}

/// Fails to compile if a type cannot be shared.
#[test]
fn the_main_types_can_be_shared_between_threads() {
    shared::<(World, Pvs, Scene, FileError)>();
    shared::<(Sight, SightState, SightSkeleton, SavedDoors, Sightlines)>();
    shared::<(View, Viewer, Seen<'_>, DrawList, Follower)>();
    shared::<(BakeConfig, BakeOutput, BakeError, Imported)>();
    shared::<BakeContext<'_>>();
    shared::<(Streamer, Catalog, PackedWorld, SimulatedLink, ThreadSource)>();
    shared::<(Space, SpaceViewer, Layout, Things, Lights, Caster, Walker)>();
    shared::<(Actors, AwakeCells)>();
    shared::<(Acoustics, Listener, Reverb, DiffuseFields, Transmission)>();
    shared::<(WalkMap, PathSearch, Path, PathFollower, Hops)>();
    shared::<(Kit, Piece, Assembly, LevelSpace)>();
    shared::<(EditSession, EditOperation, EditedSpace, EditError)>();
    shared::<(VisConfig, VisOutput, VerifyOptions, VerifyReport)>();
}

/// Settings can be made with `..Default::default()`: fails to compile if one has no default.
#[test]
fn settings_have_defaults() {
    fn settings<T: Default + Debug>() {}
    settings::<(BakeConfig, Budget, MergeSettings)>();
    settings::<(ImportOptions, Limits, RoleRules, CleaningOptions)>();
    settings::<(SeeOptions, SightOptions, VisConfig, VerifyOptions)>();
    settings::<(StreamOptions, SimulatedLinkOptions, PlaceOptions)>();
    settings::<(Agent, Docking, Sampling, SpecialOptions, Transmission)>();
}

#[test]
fn what_holds_a_world_does_not_print_all_of_it() {
    let world = room_grid(&GridParams::offices(12, 1));
    let space = Space::new(world).unwrap();
    let viewer = Viewer::new(space.sight(PartId::ROOT));
    for said in [format!("{space:?}"), format!("{viewer:?}")] {
        assert!(said.len() < 300 && said.ends_with(".. }"), "{said}");
    }
}
