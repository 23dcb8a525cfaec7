//! Bakes in shards: the same bytes in any order, and the time that two workers take.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::bake::{BakeConfig, BakeContext, Pieces, bake};
use enfilade::cpg::World;
use enfilade::cpg::wire::encode_glb;
use enfilade::geom::DVec3;
use enfilade::geom::scene::Scene;
use enfilade::internals::bake::{bake_pieces, piece_keys};

use super::bakes::on_land;
use crate::rows::Figure;

/// Places of buildings, far apart on a square kilometer.
const PLACES: [[f64; 2]; 4] = [
    [-300.0, -320.0],
    [320.0, -300.0],
    [300.0, 310.0],
    [-320.0, 300.0],
];
/// Two workers take at most this share of the time of one: a bar of 1.7 times the speed.
const MOST_TIME: f64 = 1.0 / 1.7;

#[derive(Default)]
struct InMemory(Mutex<BTreeMap<String, Vec<u8>>>);

impl Pieces for InMemory {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.0.lock().ok()?.get(key).cloned()
    }

    fn put(&self, key: &str, bytes: &[u8]) {
        if let Ok(mut pieces) = self.0.lock() {
            pieces.insert(key.to_owned(), bytes.to_vec());
        }
    }
}

/// Copies of a building, and the keys of their shards.
fn town(alone: &World, name: &str) -> anyhow::Result<(Scene, Vec<String>)> {
    let places = PLACES.map(|[x, z]| DVec3::new(x, 0.0, z));
    let scene = on_land(alone, name, &places)?;
    let nowhere = InMemory::default();
    let context = BakeContext::default().keeping(&nowhere);
    let keys = piece_keys(&scene, &BakeConfig::default(), &context)?;
    ensure!(keys.len() == PLACES.len(), "{} sites", keys.len());
    Ok((scene, keys))
}

/// Makes the shards of some keys on one thread.
fn work(scene: &Scene, keys: &[String], pieces: &InMemory) -> anyhow::Result<()> {
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let context = BakeContext::default().keeping(pieces);
    let is_wanted = |key: &str| keys.iter().any(|k| k == key);
    alone.install(|| bake_pieces(scene, &BakeConfig::default(), &context, is_wanted))?;
    Ok(())
}

/// 1 if a bake from shards differs from one in one piece: made last first by a worker each, the second one spoilt.
pub(super) fn differing(alone: &World, name: &str) -> anyhow::Result<Figure> {
    let (scene, keys) = town(alone, name)?;
    let pieces = InMemory::default();
    for key in keys.iter().rev() {
        let own = InMemory::default();
        work(&scene, std::slice::from_ref(key), &own)?;
        let mut bytes = own.get(key).context("the shard is there")?;
        if *key == keys[1] {
            bytes.truncate(bytes.len() / 3);
        }
        pieces.put(key, &bytes);
    }
    let baked = |context: BakeContext<'_>| {
        let world = bake(&scene, &BakeConfig::default(), &context)?.world;
        anyhow::Ok(encode_glb(&world)?)
    };
    let whole = baked(BakeContext::default())?;
    let parts = baked(BakeContext::default().keeping(&pieces))?;
    let note = format!("{} shards", keys.len());
    Ok(Figure::new(f64::from(u8::from(whole != parts)), 0.0, note))
}

/// Share of the time of one worker that two take.
pub(super) fn time_of_two(alone: &World, name: &str) -> anyhow::Result<Figure> {
    let (scene, keys) = town(alone, name)?;
    let start = Instant::now();
    work(&scene, &keys, &InMemory::default())?;
    let one = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let (first, second) = keys.split_at(keys.len() / 2);
    let both: Vec<anyhow::Result<()>> = std::thread::scope(|scope| {
        let workers = [first, second].map(|keys| {
            let scene = &scene;
            scope.spawn(move || work(scene, keys, &InMemory::default()))
        });
        let ended = workers.map(std::thread::ScopedJoinHandle::join);
        let failed = || Err(anyhow::anyhow!("a worker panicked"));
        ended.map(|w| w.unwrap_or_else(|_| failed())).into()
    });
    both.into_iter().collect::<anyhow::Result<()>>()?;
    let value = start.elapsed().as_secs_f64() / one;
    let note = format!("{one:.1} s by one worker of one thread");
    Ok(Figure::new(value, MOST_TIME, note))
}
