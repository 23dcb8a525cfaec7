//! Bakes that go on from pieces of earlier ones, or of other machines. Covers V13.

use std::collections::BTreeMap;
use std::sync::Mutex;

use enfilade_bake::{
    BakeConfig, BakeContext, BakeError, Budget, Method, Pieces, Progress, Stage, bake, bake_pieces,
    is_piece, piece_keys,
};
use enfilade_cpg::wire::encode_glb;
use enfilade_geom::DMat4;
use enfilade_geom::scene::Scene;
use enfilade_testkit::mixed::rooms_with_closet;

/// Two buildings, far apart.
fn two_buildings() -> Scene {
    let mut scene = rooms_with_closet().scene;
    for mut object in scene.objects.clone() {
        object.transform = DMat4::from_translation([300.0, 0.0, 40.0].into()) * object.transform;
        object.name += " there";
        scene.objects.push(object);
    }
    scene
}

#[derive(Default)]
struct InMemory(Mutex<BTreeMap<String, Vec<u8>>>);

impl InMemory {
    fn all(&self) -> BTreeMap<String, Vec<u8>> {
        self.0.lock().unwrap().clone()
    }
}

impl Pieces for InMemory {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.all().get(key).cloned()
    }

    fn put(&self, key: &str, bytes: &[u8]) {
        self.0
            .lock()
            .unwrap()
            .insert(key.to_owned(), bytes.to_vec());
    }
}

/// Remembers the stages.
#[derive(Default)]
struct Stages(Mutex<Vec<Stage>>);

impl Progress for Stages {
    fn stage(&self, stage: Stage) {
        self.0.lock().unwrap().push(stage);
    }
}

/// The bytes of the world baked with some pieces, and the stages.
fn baked(scene: &Scene, config: &BakeConfig, pieces: &InMemory) -> (Vec<u8>, Vec<Stage>) {
    let stages = Stages::default();
    let context = BakeContext::new(&stages, None).keeping(pieces);
    let world = bake(scene, config, &context).unwrap().world;
    (encode_glb(&world).unwrap(), stages.0.into_inner().unwrap())
}

fn whole(scene: &Scene, config: &BakeConfig) -> Vec<u8> {
    let world = bake(scene, config, &BakeContext::default()).unwrap().world;
    encode_glb(&world).unwrap()
}

#[test]
fn a_bake_goes_on_from_whole_pieces_and_makes_the_same_world() {
    let (scene, config) = (two_buildings(), BakeConfig::default());
    let expected = whole(&scene, &config);
    let pieces = InMemory::default();
    let (first, stages) = baked(&scene, &config, &pieces);
    assert!(first == expected);
    assert_eq!(stages.iter().filter(|s| **s == Stage::Flood).count(), 2);
    // Basins and rooms of two buildings.
    let all = pieces.all();
    assert_eq!(all.len(), 4);
    let (second, stages) = baked(&scene, &config, &pieces);
    assert!(second == expected);
    assert!(!stages.contains(&Stage::Voxelize) && !stages.contains(&Stage::Rooms));
    for (key, bytes) in &all {
        let spoilt = [
            bytes[..bytes.len() / 2].to_vec(),
            [&bytes[..bytes.len() - 1], &[!bytes[bytes.len() - 1]]].concat(),
            Vec::new(),
        ];
        for spoilt in spoilt {
            assert!(!is_piece(key, &spoilt));
            pieces.put(key, &spoilt);
            // Rooms are found again from basins; spoilt basins are not needed.
            let (again, stages) = baked(&scene, &config, &pieces);
            assert!(again == expected && !stages.contains(&Stage::Flood));
            assert_eq!(stages.contains(&Stage::Rooms), is_piece(key, bytes));
            pieces.put(key, bytes);
        }
    }
    let rooms: Vec<_> = all
        .iter()
        .filter(|(key, bytes)| is_piece(key, bytes))
        .collect();
    assert_eq!(rooms.len(), 2);
    // A bit that is wrong anywhere.
    for at in (0..rooms[0].1.len()).step_by(rooms[0].1.len() / 50) {
        let mut spoilt = rooms[0].1.clone();
        spoilt[at] ^= 4;
        assert!(!is_piece(rooms[0].0, &spoilt), "byte {at}");
    }
}

#[test]
fn pieces_under_the_keys_of_others_are_made_anew() {
    let config = BakeConfig::default();
    let scene = two_buildings();
    let (own, others) = (InMemory::default(), InMemory::default());
    let (expected, _) = baked(&scene, &config, &own);
    baked(&rooms_with_closet().scene, &config, &others);
    let foreign = others.all().into_values().chain(own.all().into_values());
    for foreign in foreign {
        let spoilt = InMemory::default();
        for key in own.all().keys().filter(|key| own.all()[*key] != foreign) {
            assert!(!is_piece(key, &foreign));
            spoilt.put(key, &foreign);
        }
        assert!(baked(&scene, &config, &spoilt).0 == expected);
    }
}

#[test]
fn other_scenes_and_settings_have_other_pieces() {
    let (scene, config) = (two_buildings(), BakeConfig::default());
    let keys = |scene: &Scene, config: &BakeConfig| {
        let pieces = InMemory::default();
        let context = BakeContext::default().keeping(&pieces);
        let keys = piece_keys(scene, config, &context).unwrap();
        assert!(pieces.all().is_empty());
        keys
    };
    let mine = keys(&scene, &config);
    assert_eq!(mine.len(), 2);
    assert_eq!(keys(&scene, &config), mine);
    let mut moved = scene.clone();
    moved.meshes[0].primitives[0].positions[0][1] += 0.001;
    let narrow = BakeConfig {
        min_opening: 0.5,
        ..config.clone()
    };
    // In the same voxels.
    let rough = BakeConfig {
        noise: 2.0 * config.noise,
        ..config.clone()
    };
    // Few voxels are larger ones.
    let coarse = BakeConfig {
        max_voxels: 200_000,
        ..config.clone()
    };
    let little = BakeConfig {
        budget: Budget {
            memory: Some(1_000_000),
            ..Budget::default()
        },
        ..config.clone()
    };
    for others in [
        keys(&scene, &little),
        keys(&moved, &config),
        keys(&scene, &rough),
        keys(&scene, &narrow),
        keys(&scene, &coarse),
    ] {
        assert!(others.iter().all(|key| !mine.contains(key)));
    }
    let by_planes = BakeConfig {
        method: Some(Method::Bsp),
        ..config
    };
    let pieces = InMemory::default();
    let context = BakeContext::default().keeping(&pieces);
    let baked = bake(&scene, &by_planes, &context).unwrap();
    assert!(baked.notes.iter().any(|n| n.starts_with("no pieces kept")) && pieces.all().is_empty());
    let refused = piece_keys(&scene, &by_planes, &BakeContext::default());
    assert!(matches!(
        refused,
        Err(BakeError::Setting { name: "method", .. })
    ));
}

#[test]
fn pieces_made_anywhere_in_any_order_make_the_same_world() {
    let (scene, config) = (two_buildings(), BakeConfig::default());
    let together = InMemory::default();
    let context = BakeContext::default().keeping(&together);
    let mut keys = piece_keys(&scene, &config, &context).unwrap();
    keys.reverse();
    for key in &keys {
        // A machine of its own.
        let alone = InMemory::default();
        let context = BakeContext::default().keeping(&alone);
        bake_pieces(&scene, &config, &context, |k| k == key).unwrap();
        let made = alone.all();
        let rooms: Vec<_> = made
            .iter()
            .filter(|(key, bytes)| is_piece(key, bytes))
            .collect();
        assert!(rooms.len() == 1 && rooms[0].0 == key);
        together.put(key, rooms[0].1);
    }
    let (world, stages) = baked(&scene, &config, &together);
    assert!(world == whole(&scene, &config) && !stages.contains(&Stage::Voxelize));
}
