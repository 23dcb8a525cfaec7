//! Undo: random sessions taken back to the same bytes, and processes killed while they edit.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, ensure};
use enfilade::cpg::wire::encode_glb;
use enfilade::edit::{EditGround, EditOperation, EditSession, HandEditKind, Resumed};
use enfilade::geom::DVec3;
use enfilade::internals::edit::journal_of;
use enfilade::internals::edit::random::random_operation;
use enfilade::kit::{DEFAULT_TOLERANCE, InstanceId, Kit};
use enfilade::world::Pose;
use enfilade_testkit::{Rng, dungeon_kit, office_kit};

use super::bad::not_refused;
use super::scenes::kit_of;
use crate::rows::Figure;

/// Operations, undos and redos of a session.
const OPERATIONS: usize = 10_000;
/// Sessions of each kit that are taken back, and times that one is killed.
const SESSIONS: u64 = 3;
const KILLS: usize = 20;
/// Steps from one comparison of bytes to the next.
const APART: usize = 101;

fn kit(scene: &str) -> anyhow::Result<Arc<Kit>> {
    let models = match scene {
        "office-kit" => office_kit(),
        _ => dungeon_kit(),
    };
    Ok(Arc::new(kit_of(&models)?))
}

/// Makes, takes back or makes again by chance; returns `true` if something changed.
fn step(session: &mut EditSession, rng: &mut Rng) -> anyhow::Result<bool> {
    Ok(match rng.below(100) {
        0..15 => session.undo()?,
        15..25 => session.redo()?,
        _ => {
            let operation = random_operation(session, &mut |n| rng.below(n));
            session.apply(operation).is_ok()
        }
    })
}

fn bytes(session: &EditSession) -> anyhow::Result<Vec<u8>> {
    Ok(encode_glb(&session.world()?.world)?)
}

/// Worlds that have other bytes when all operations are taken back to them, or made again up to them.
pub(super) fn other_bytes(scene: &str) -> anyhow::Result<Figure> {
    let kit = kit(scene)?;
    let (mut n_other, mut n_compared, mut n_undone) = (0, 0, 0);
    for seed in 1..=SESSIONS {
        let mut session = EditSession::new(Arc::clone(&kit), EditGround::Open)?;
        let mut rng = Rng::new(seed);
        // Indexed by the number of operations made; those that are taken back are forgotten.
        let mut past: Vec<Option<Vec<u8>>> = vec![Some(bytes(&session)?)];
        for k in 0..OPERATIONS {
            if step(&mut session, &mut rng)? {
                let n = session.n_steps()[0];
                past.truncate(n);
                past.resize(n, None);
                past.push(
                    k.is_multiple_of(APART)
                        .then(|| bytes(&session))
                        .transpose()?,
                );
            }
        }
        let mut compare = |session: &EditSession| -> anyhow::Result<()> {
            if let Some(Some(then)) = past.get(session.n_steps()[0]) {
                n_compared += 1;
                n_other += usize::from(bytes(session)? != *then);
            }
            Ok(())
        };
        while session.undo()? {
            n_undone += 1;
            compare(&session)?;
        }
        while session.redo()? {
            compare(&session)?;
        }
    }
    let note = format!(
        "of {n_compared} worlds of {SESSIONS} sessions of {OPERATIONS} operations, {n_undone} of them taken back"
    );
    Ok(Figure::new(n_other as f64, 0.0, note))
}

/// Operations of a session that are gone after its process is killed, at most; all that it told of count.
pub(super) fn lost(scene: &str) -> anyhow::Result<Figure> {
    let folder = std::env::temp_dir().join(format!("enfilade-undo-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let lost = lost_in(scene, &folder);
    std::fs::remove_dir_all(&folder)?;
    lost
}

fn lost_in(scene: &str, folder: &Path) -> anyhow::Result<Figure> {
    let path = folder.join(scene);
    let program: PathBuf = std::env::current_exe().context("this program has no path")?;
    let mut rng = Rng::new(1);
    let (mut most, mut n_entries, mut slowest) = (0, 0, 0.0_f64);
    for _ in 0..KILLS {
        let mut child = Command::new(&program)
            .args(["level-step", "edit"])
            .arg(&path)
            .stdout(Stdio::piped())
            .spawn()?;
        let out = child.stdout.take().context("its output is piped")?;
        let mut lines = BufReader::new(out).lines();
        let more = 1 + rng.below(2 * OPERATIONS / KILLS);
        let mut told = 0_usize;
        for line in lines.by_ref().take(more) {
            told = line?.parse()?;
        }
        child.kill()?;
        child.wait()?;
        for line in lines.map_while(Result::ok) {
            told = line.parse().unwrap_or(told);
        }
        let start = Instant::now();
        let resumed = opened(&path)?.1;
        slowest = slowest.max(start.elapsed().as_secs_f64());
        ensure!(resumed.n_entries > 0, "nothing was written");
        most = most.max(told.saturating_sub(resumed.n_entries));
        n_entries = resumed.n_entries;
    }
    let note = format!(
        "killed {KILLS} times; {n_entries} operations at the end are made again in {slowest:.2} s, bakes of the kit included"
    );
    Ok(Figure::new(most as f64, 1.0, note))
}

fn opened(path: &Path) -> anyhow::Result<(EditSession, Resumed)> {
    let scene = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(EditSession::open(
        path,
        kit(&scene)?,
        EditGround::Open,
        "-",
        DEFAULT_TOLERANCE,
    )?)
}

/// Edits with a journal until it is killed; prints the number of entries after each that is written.
pub(super) fn edit_without_end(path: &Path) -> anyhow::Result<()> {
    let (mut session, resumed) = opened(path)?;
    let mut n = resumed.n_entries;
    let mut rng = Rng::new(n as u64);
    let mut out = std::io::stdout().lock();
    loop {
        if step(&mut session, &mut rng)? {
            n += 1;
            writeln!(out, "{n}")?;
        }
    }
}

/// Bad edits and journals that are taken, or refused in other words.
pub(super) fn bad_edits_taken(scene: &str) -> anyhow::Result<Figure> {
    let folder = std::env::temp_dir().join(format!("enfilade-bad-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let taken = taken_in(scene, &folder);
    std::fs::remove_dir_all(&folder)?;
    taken
}

fn taken_in(scene: &str, folder: &Path) -> anyhow::Result<Figure> {
    let mut said: Vec<(&str, Option<String>)> = Vec::new();
    let mut session = EditSession::new(kit(scene)?, EditGround::Open)?;
    session.apply(EditOperation::put("chamber", None, Pose::IDENTITY))?;
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let doorway = DVec3::new(0.0, 1.0, 3.0);
    for (words, kind) in [
        ("would be outdoors", HandEditKind::NoPortal(doorway)),
        ("no portal is at", HandEditKind::Door(DVec3::ZERO)),
        ("needs air", HandEditKind::Lamp(corner(0.0, -0.1))),
        ("needs air", HandEditKind::Crate(corner(0.0, -0.4), 0.0)),
        (
            "a way leads around it at",
            HandEditKind::Portal(
                [[0.0, 1.0], [1.0, 1.0], [0.0, 2.0]]
                    .map(|[x, y]| corner(x, y))
                    .to_vec(),
            ),
        ),
        (
            "one line",
            HandEditKind::Mirror([0.0, 1.0, 2.0].map(|x| corner(x, 1.0)).to_vec()),
        ),
    ] {
        let edit = session.hosted(&kind);
        let refused = session.apply(EditOperation::Make(edit)).err();
        said.push((words, refused.map(|e| e.to_string())));
    }
    for (words, operation) in [
        (
            "no piece \"cellar\"",
            EditOperation::put("cellar", None, Pose::IDENTITY),
        ),
        ("no instance", EditOperation::Take(InstanceId(9))),
        ("there are 0", EditOperation::Unmake(0)),
    ] {
        let refused = session.apply(operation).err();
        said.push((words, refused.map(|e| e.to_string())));
    }
    // The file's name is that of the kit.
    let path = folder.join(scene);
    for (words, text) in [
        ("no journal", "a letter to a friend\n".to_owned()),
        ("another world", journal_of("other", [])),
        ("line 2 of the journal: 'erase'", journal_of("-", ["erase"])),
        (
            "line 3 of the journal: there is no instance",
            journal_of("-", ["undo", "take\t4"]),
        ),
    ] {
        std::fs::write(&path, text)?;
        said.push((words, opened(&path).err().map(|e| e.to_string())));
    }
    Ok(not_refused(&said))
}
