//! Covers W14: sessions are undone to the same bytes, and killed processes lose at most an operation.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, OnceLock};

use enfilade_bake::{BakeConfig, BakeContext, bake};
use enfilade_cpg::wire::encode_glb;
use enfilade_cpg::{PortalKind, World};
use enfilade_edit::random::random_operation;
use enfilade_edit::{
    EditError, EditGround, EditOperation, EditSession, HandEditKind, JournalError, Resumed,
    journal_of,
};
use enfilade_geom::DVec3;
use enfilade_kit::{Choice, DEFAULT_TOLERANCE, InstanceId, Kit, Piece};
use enfilade_testkit::{Rng, dungeon_kit};
use enfilade_verify::{VerifyOptions, verify_world};
use enfilade_world::Pose;

fn kit() -> Arc<Kit> {
    static KIT: OnceLock<Arc<Kit>> = OnceLock::new();
    let made = KIT.get_or_init(|| {
        let pieces = dungeon_kit().into_iter().map(|piece| {
            let (config, context) = (BakeConfig::default(), BakeContext::default());
            let world = bake(&piece.scene, &config, &context).unwrap().world;
            Piece::new(piece.name, world, &Choice::Doorways).unwrap()
        });
        Arc::new(Kit::new(pieces.collect()).unwrap())
    });
    Arc::clone(made)
}

fn begun() -> EditSession {
    EditSession::new(kit(), EditGround::Open).unwrap()
}

fn bytes(session: &EditSession) -> Vec<u8> {
    encode_glb(&session.world().unwrap().world).unwrap()
}

/// Everything of a session but its history, without making its world.
fn state(session: &EditSession) -> String {
    let instances: Vec<_> = session.level().instances().collect();
    format!("{instances:?} {:?}", session.hand_edits())
}

/// Makes, takes back, or makes again, by chance; returns `false` if nothing changed.
fn step(session: &mut EditSession, rng: &mut Rng) -> bool {
    match rng.below(100) {
        0..15 => session.undo().unwrap(),
        15..25 => session.redo().unwrap(),
        _ => {
            let operation = random_operation(session, &mut |n| rng.below(n));
            session.apply(operation).is_ok()
        }
    }
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    if dir.exists() {
        std::fs::remove_dir_all(&dir).unwrap();
    }
    std::fs::create_dir_all(&dir).unwrap();
    dir
}

fn opened(path: &Path) -> Result<(EditSession, Resumed), EditError> {
    EditSession::open(path, kit(), EditGround::Open, "-", DEFAULT_TOLERANCE)
}

#[test]
fn ten_thousand_operations_are_undone_to_the_same_bytes_and_redone_too() {
    let (mut session, mut rng) = (begun(), Rng::new(4));
    let (mut n_changed, mut kinds) = (0, [0; 2]);
    for _ in 0..10_000 {
        n_changed += usize::from(step(&mut session, &mut rng));
        kinds[0] = kinds[0].max(session.level().len());
        kinds[1] = kinds[1].max(session.hand_edits().len());
    }
    assert!(
        n_changed > 5_000 && kinds[0] > 10 && kinds[1] > 3,
        "{n_changed} {kinds:?}"
    );
    // From the end to the start, and again: every state is the same, and some also as bytes.
    let mut past = Vec::new();
    let seen = |session: &EditSession, n: usize| {
        let bytes = n.is_multiple_of(101).then(|| bytes(session));
        (state(session), bytes)
    };
    while session.n_steps()[0] > 0 {
        past.push(seen(&session, past.len()));
        assert!(session.undo().unwrap());
    }
    assert!(session.level().is_empty() && session.hand_edits().is_empty());
    assert!(past.len() > 3_000, "{}", past.len());
    for (n, then) in past.iter().enumerate().rev() {
        assert!(session.redo().unwrap());
        assert!(seen(&session, n) == *then, "step {n} from the end");
    }
    while session.redo().unwrap() {}
    // A world by the same operations, made anew.
    let mut rng = Rng::new(4);
    let mut again = begun();
    for _ in 0..10_000 {
        step(&mut again, &mut rng);
    }
    while again.redo().unwrap() {}
    assert!(bytes(&again) == bytes(&session));
}

#[test]
fn a_world_with_all_changes_by_hand_keeps_its_promises_and_they_move_with_their_rooms() {
    let mut session = begun();
    let mut put = |name: &str, at: [f64; 3]| {
        let pose = Pose::from_translation(DVec3::from_array(at));
        session.apply(EditOperation::put(name, None, pose)).unwrap();
    };
    put("chamber", [0.0; 3]);
    put("corridor", [0.0, 0.0, 6.0]);
    let make = |session: &mut EditSession, kind: HandEditKind| {
        let edit = session.hosted(&kind);
        assert_eq!(edit.host, Some(InstanceId(0)));
        session.apply(EditOperation::Make(edit)).unwrap();
    };
    let doorway = DVec3::new(0.0, 1.0, 3.0);
    make(&mut session, HandEditKind::Door(doorway));
    make(&mut session, HandEditKind::Lamp(DVec3::new(1.0, 2.5, 1.0)));
    let wall = [[0.5, 1.0], [2.0, 1.0], [2.0, 2.0], [0.5, 2.0]];
    let mirror = wall.map(|[z, y]| DVec3::new(-2.8, y, z + 0.3)).to_vec();
    make(&mut session, HandEditKind::Mirror(mirror));
    let across = [[-3.0, -0.1], [3.0, -0.1], [3.0, 3.1], [-3.0, 3.1]];
    let across = across.map(|[x, y]| DVec3::new(x, y, -1.5)).to_vec();
    make(&mut session, HandEditKind::Portal(across));
    // The last, so that nothing counts the triangles of cells anew.
    make(
        &mut session,
        HandEditKind::Crate(DVec3::new(1.5, 0.0, 1.5), 0.3),
    );
    let checked = |session: &EditSession| {
        let edited = session.world().unwrap();
        assert_eq!(edited.resting, []);
        let options = VerifyOptions {
            rays: 50_000,
            ..VerifyOptions::default()
        };
        let report = verify_world(&edited.world, None, &options);
        assert!(report.holds(), "{:?}", report.problems);
        edited.world.clone()
    };
    let world = checked(&session);
    // As made change by change, and as made at once.
    let before = bytes(&session);
    assert!(session.undo().unwrap() && bytes(&session) != before);
    assert!(session.redo().unwrap() && bytes(&session) == before);
    assert_eq!(world.graph.indoor_cells().count(), 3);
    assert_eq!(world.graph.specials.len(), 1);
    assert_eq!((world.fixtures.len(), world.details.len()), (1, 1));
    let doors = |world: &World| {
        let portals = world.graph.portals.iter();
        let doors = portals.filter(|p| p.kind == PortalKind::Door);
        doors.map(enfilade_cpg::Portal::center).collect::<Vec<_>>()
    };
    assert_eq!(doors(&world).len(), 1);
    // The corridor's own doorway is where the chamber stands afterwards.
    let turn = Pose::about(DVec3::ZERO, DVec3::Y, std::f64::consts::PI);
    let to = Pose::from_translation(DVec3::new(0.0, 0.0, 12.0)).after(&turn);
    session
        .apply(EditOperation::Move(InstanceId(0), to))
        .unwrap();
    let moved = checked(&session);
    let lamp = moved.fixtures[0].transform.w_axis.truncate();
    assert!(lamp.distance(DVec3::new(-1.0, 2.5, 11.0)) < 1e-9, "{lamp}");
    assert!((doors(&moved)[0][2] - 9.0).abs() < 1e-3);
    // Where its room is gone, it rests, and is back with it.
    session.apply(EditOperation::Take(InstanceId(0))).unwrap();
    assert_eq!(session.world().unwrap().resting.len(), 5);
    session.undo().unwrap();
    checked(&session);
}

#[test]
fn changes_by_hand_that_cannot_be_made_are_refused_with_place_and_reason() {
    let mut session = begun();
    let chamber = EditOperation::put("chamber", None, Pose::IDENTITY);
    session.apply(chamber).unwrap();
    let before = bytes(&session);
    let doorway = DVec3::new(0.0, 1.0, 3.0);
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    for (kind, says) in [
        (HandEditKind::NoPortal(doorway), "would be outdoors"),
        (
            HandEditKind::Door(DVec3::ZERO),
            "no portal is at 0.00,0.00,0.00; portal-",
        ),
        (
            HandEditKind::Lamp(DVec3::new(0.0, -0.1, 0.0)),
            "a lamp needs air",
        ),
        // In the slab, but in no cell of the piece.
        (
            HandEditKind::Crate(corner(0.0, -0.4), 0.0),
            "a crate needs air",
        ),
        (HandEditKind::Lamp(DVec3::NAN), "finite"),
        (
            HandEditKind::Portal(vec![corner(0.0, 1.0), corner(1.0, 1.0), corner(0.0, 2.0)]),
            "a way leads around it",
        ),
        (
            HandEditKind::Mirror(vec![
                corner(0.0, -0.11),
                corner(1.0, -0.11),
                corner(1.0, -0.1),
            ]),
            "no place for a special portal",
        ),
    ] {
        let edit = session.hosted(&kind);
        let why = session.apply(EditOperation::Make(edit)).unwrap_err();
        assert!(why.to_string().contains(says), "{why}");
    }
    let why = session.apply(EditOperation::Unmake(0)).unwrap_err();
    assert!(why.to_string().contains("there are 0"), "{why}");
    assert!(bytes(&session) == before && session.n_steps() == [1, 0]);
}

/// Environment variable that makes the next test the child of the one after it: its journal.
const CHILD: &str = "ENFILADE_EDIT_CHILD";

/// Edits without end, and says each time how many entries it has written.
#[test]
fn child_that_edits_until_it_is_killed() {
    let Some(path) = std::env::var_os(CHILD) else {
        return;
    };
    let (mut session, resumed) = opened(Path::new(&path)).unwrap();
    let mut rng = Rng::new(resumed.n_entries as u64);
    let mut n = resumed.n_entries;
    let mut out = std::io::stdout().lock();
    writeln!(out, "\nbegun").unwrap();
    loop {
        n += usize::from(step(&mut session, &mut rng));
        writeln!(out, "made {n}").unwrap();
    }
}

#[test]
fn a_killed_session_goes_on_where_it_was_and_loses_at_most_one_operation() {
    let path = folder("killed").join("level.journal");
    let program = std::env::current_exe().unwrap();
    let mut rng = Rng::new(9);
    let mut n_before = 0;
    for _ in 0..6 {
        let mut child = Command::new(&program)
            .args([
                "--exact",
                "sessions::child_that_edits_until_it_is_killed",
                "--nocapture",
            ])
            .env(CHILD, &path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let least = n_before + 50 + rng.below(400);
        let mut told = 0;
        while told < least {
            let line = lines.next().expect("it goes on").unwrap();
            if let Some(n) = line.strip_prefix("made ") {
                told = n.parse().unwrap();
            }
        }
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        let mut last = told;
        for line in lines.map_while(Result::ok) {
            let n = line.strip_prefix("made ").and_then(|n| n.parse().ok());
            last = n.unwrap_or(last);
        }
        let (session, resumed) = opened(&path).unwrap();
        assert!(
            [last, last + 1].contains(&resumed.n_entries),
            "{last} told, {resumed:?}"
        );
        let lines = std::fs::read_to_string(&path).unwrap();
        assert_eq!(lines.lines().count(), 1 + resumed.n_entries);
        drop(session);
        // The same entries give the same world, and its whole history.
        let [(first, _), (mut again, _)] = [(); 2].map(|()| {
            let copy = path.with_extension(format!("copy-{}", rng.below(1 << 30)));
            std::fs::copy(&path, &copy).unwrap();
            opened(&copy).unwrap()
        });
        assert!(bytes(&first) == bytes(&again) && first.n_steps() == again.n_steps());
        while again.undo().unwrap() {}
        assert!(again.level().is_empty());
        n_before = resumed.n_entries;
    }
}

#[test]
fn a_torn_line_is_cut_and_told_and_damage_is_refused_with_its_line() {
    let dir = folder("torn");
    let path = dir.join("level.journal");
    let (mut session, resumed) = opened(&path).unwrap();
    assert_eq!(resumed, Resumed::default());
    session
        .apply(EditOperation::put("chamber", None, Pose::IDENTITY))
        .unwrap();
    session.undo().unwrap();
    session.redo().unwrap();
    let before = bytes(&session);
    assert!(matches!(
        opened(&path).unwrap_err(),
        EditError::Journal(JournalError::InUse)
    ));
    drop(session);
    let whole = std::fs::read(&path).unwrap();
    // Whatever the end of the last line, what came before is there.
    let torn = b"put\thall\t0.0 0.0";
    for n in 1..torn.len() {
        std::fs::write(&path, [&whole, &torn[..n]].concat()).unwrap();
        let (session, resumed) = opened(&path).unwrap();
        assert_eq!(resumed.cut.as_deref(), std::str::from_utf8(&torn[..n]).ok());
        assert_eq!(resumed.n_entries, 3);
        assert!(bytes(&session) == before);
        drop(session);
        assert!(std::fs::read(&path).unwrap() == whole, "it is cut off");
    }
    // A header that was not written whole begins anew.
    std::fs::write(&path, &whole[..7]).unwrap();
    assert_eq!(opened(&path).unwrap().1.cut.as_deref(), Some("enfilad"));
    let text = String::from_utf8(whole.clone()).unwrap();
    for (bad, says) in [
        (
            journal_of("-", ["put\tcellar\t0 0 0 0 0 0 1"]),
            "line 2 of the journal: the kit has no piece \"cellar\"",
        ),
        (
            journal_of("-", ["undo", "undoo"]),
            "line 3 of the journal: 'undoo'",
        ),
        (
            text.replace("put\tchamber", "put\tcellar"),
            "line 2 of the journal: it or one before it was changed",
        ),
        (
            text.replace("undo", "redo"),
            "line 3 of the journal: it or one before it was changed",
        ),
        (
            text.replace("edits 2\t-", "edits 2\tother"),
            "begun over another world",
        ),
        (text.replace("edits 2", "edits 1"), "no journal"),
        ("a letter to a friend\n".into(), "no journal"),
        ("a letter".into(), "no journal"),
    ] {
        std::fs::write(&path, &bad).unwrap();
        let why = opened(&path).unwrap_err().to_string();
        assert!(why.contains(says), "{why}");
        assert!(std::fs::read_to_string(&path).unwrap() == bad, "it stays");
    }
    // A bit of any byte, and lines that are missing, exchanged, or of another journal.
    let lines: Vec<&str> = text.lines().collect();
    let joined = |at: &[usize]| at.iter().map(|k| format!("{}\n", lines[*k])).collect();
    let other = journal_of("other", ["undo"])
        .lines()
        .nth(1)
        .unwrap()
        .to_owned();
    let mut spoilt: Vec<Vec<u8>> = [joined(&[0, 2]), joined(&[0, 1, 3]), joined(&[0, 1, 3, 2])]
        .map(String::into_bytes)
        .to_vec();
    spoilt.push(format!("{}\n{other}\n", lines[0]).into_bytes());
    // The last byte is the end of a line: without it, the line is cut off.
    for at in 0..whole.len() - 1 {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        spoilt.push(bytes);
    }
    for spoilt in spoilt {
        std::fs::write(&path, &spoilt).unwrap();
        let why = opened(&path).err();
        let text = String::from_utf8_lossy(&spoilt);
        assert!(matches!(why, Some(EditError::Journal(_))), "{text}");
        assert!(std::fs::read(&path).unwrap() == spoilt, "it stays");
    }
}

#[test]
fn a_world_without_a_kit_is_edited_by_hand_alone() {
    let chamber = kit().pieces()[0].world().clone();
    let ground = EditGround::World(chamber.clone());
    let mut session = EditSession::new(Arc::default(), ground).unwrap();
    let put = EditOperation::put("chamber", None, Pose::IDENTITY);
    let why = session.apply(put).unwrap_err();
    assert!(why.to_string().contains("without a kit"), "{why}");
    let edit = session.hosted(&HandEditKind::Lamp(DVec3::new(0.0, 1.0, 0.0)));
    assert_eq!(edit.host, None);
    session.apply(EditOperation::Make(edit)).unwrap();
    assert_eq!(session.world().unwrap().world.fixtures.len(), 1);
    session.undo().unwrap();
    assert!(bytes(&session) == encode_glb(&chamber).unwrap());
}

#[test]
fn a_house_is_a_piece_to_build_onto_that_is_not_undone() {
    let mut session = EditSession::new(kit(), EditGround::Piece(0)).unwrap();
    let before = bytes(&session);
    let corridor = Pose::from_translation(DVec3::new(0.0, 0.0, 6.0));
    session
        .apply(EditOperation::put("corridor", None, corridor))
        .unwrap();
    assert_eq!(session.world().unwrap().world.graph.rooms().count(), 2);
    assert!(session.undo().unwrap() && !session.undo().unwrap());
    assert!(bytes(&session) == before && session.level().len() == 1);
}
