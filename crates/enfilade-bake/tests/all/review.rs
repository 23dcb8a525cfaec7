//! A decimation reviewed by a person: the portals shown, steps back and forth, decisions, undo and redo.

use std::collections::{BTreeMap, BTreeSet};

use enfilade_bake::delaunay::{Choice, Choices, JOINED, RemainingPortal, Review, Session};
use enfilade_bake::{BakeConfig, BakeContext, Method, Silent};
use enfilade_testkit::mixed::stair_hall;
use enfilade_testkit::{Generated, Variant, gjorup_cavern, gjorup_rooms};

fn review(g: &Generated) -> Review {
    let config = BakeConfig::of(Method::Delaunay);
    let context = BakeContext::new(&Silent, None);
    let session = Session::begin(&g.scene, &config, &context).unwrap();
    Review::new(session, config)
}

fn scenes() -> [Generated; 2] {
    [gjorup_rooms(Variant::Optimised, [0.0; 3]), stair_hall()]
}

/// The openings between different rooms, by the two rooms: from the record of steps alone.
fn openings_between_rooms(review: &Review) -> BTreeMap<[u32; 2], BTreeSet<u32>> {
    let session = review.session();
    let room_of_cell = session.decimation.after(review.at());
    let room = |part: u32| room_of_cell[session.cells.cell_of_part[part as usize] as usize];
    let mut out: BTreeMap<[u32; 2], BTreeSet<u32>> = BTreeMap::new();
    for (l, link) in session.space.links.iter().enumerate() {
        let [a, b] = link.parts.map(room);
        if a != b {
            let openings = out.entry([a.min(b), a.max(b)]).or_default();
            openings.insert(l as u32);
        }
    }
    out
}

// Covers T5.
#[test]
fn the_portals_shown_are_all_openings_between_rooms_and_the_next_is_the_next_step() {
    for g in scenes() {
        let mut review = review(&g);
        let n = review.steps().len();
        let stop = review.stop();
        let (mut n_next, mut seen) = (0, Vec::new());
        for at in (0..n).step_by(1 + n / 12).chain(stop.saturating_sub(3)..=n) {
            review.go_to(at);
            let portals = review.portals();
            let shown: BTreeMap<[u32; 2], BTreeSet<u32>> = portals
                .iter()
                .map(|p| (p.cells, p.links.iter().copied().collect()))
                .collect();
            assert_eq!(shown, openings_between_rooms(&review), "step {at}");
            let next: Vec<&RemainingPortal> = portals.iter().filter(|p| p.is_next).collect();
            match review.next_step() {
                None => assert!(next.is_empty()),
                Some(step) => {
                    n_next += 1;
                    let [shown] = next[..] else {
                        panic!("{} are next", next.len());
                    };
                    assert_eq!(shown.cells, [step.into, step.from]);
                    assert_eq!(shown.weight, step.weight);
                    assert_eq!(shown.is_mouth, step.is_mouth);
                    assert_eq!(shown.position, step.position);
                    assert!(portals.iter().all(|p| p.weight >= shown.weight));
                }
            }
            seen.push((at, portals));
        }
        assert!(n_next > 4);
        // The same from any side, although what is near the step before is not found anew.
        for (at, portals) in seen.into_iter().rev() {
            review.go_to(at);
            assert_eq!(review.portals(), portals, "step {at}");
        }
    }
}

// Covers T5.
#[test]
fn steps_forwards_and_back_give_the_same_portals_and_rooms() {
    let mut review = review(&gjorup_rooms(Variant::Optimised, [0.0; 3]));
    let n = review.steps().len();
    let state = |review: &Review| (review.at(), review.portals(), review.count_rooms());
    review.go_to(0);
    let mut forwards = vec![state(&review)];
    for _ in 0..n {
        review.go_by(1);
        forwards.push(state(&review));
    }
    assert_eq!(review.at(), n);
    assert!(forwards.windows(2).all(|pair| pair[0].1 != pair[1].1));
    for seen in forwards.iter().rev() {
        assert_eq!(*seen, state(&review));
        review.go_by(-1);
    }
    assert_eq!(review.at(), 0);
    review.go_by(isize::MAX);
    assert_eq!(review.at(), n);
    review.go_by(isize::MIN);
    assert_eq!(review.at(), 0);
}

// Covers T5.
#[test]
fn every_portal_shown_can_be_kept_or_joined_instead_and_that_is_undone_and_made_again() {
    let mut n_decided = 0;
    for g in [gjorup_cavern([0.0; 3]), stair_hall()] {
        let mut review = review(&g);
        let stop = review.stop();
        for at in [stop, stop.saturating_sub(2)] {
            review.go_to(at);
            for portal in review.portals().iter().filter(|p| p.weight > 0.0) {
                n_decided += 1;
                let before = (review.choices().clone(), review.at());
                let of = |portals: &[RemainingPortal]| {
                    let first = portal.links[0];
                    let is_it = |p: &&RemainingPortal| p.links.contains(&first);
                    portals.iter().find(is_it).cloned()
                };
                // Kept, it outlasts the rooms that remain, and all that are not kept.
                let kept = review.decide(portal, Choice::Keep).unwrap();
                assert_eq!(kept.position, portal.position);
                assert_eq!(review.at(), review.stop());
                let shown = of(&review.portals()).expect("it stays");
                assert_eq!(shown.choice, Some(Choice::Keep));
                assert_eq!(shown.weight, f64::INFINITY);
                assert_eq!(shown.decided_at, [portal.position]);
                assert_eq!(review.steps().last().unwrap().weight, f64::INFINITY);
                assert!(review.decide(&shown, Choice::Keep).is_none());
                let after = (review.choices().clone(), review.at());

                // Joined instead, it goes, and nothing is left of the decision before.
                review.decide(&shown, Choice::Join).unwrap();
                assert_eq!(review.choices().keep, before.0.keep);
                assert_eq!(review.choices().join.len(), before.0.join.len() + 1);
                assert!(of(&review.portals()).is_none());
                assert_eq!(review.at(), review.stop());

                assert_eq!(review.n_decisions(), [2, 0]);
                assert_eq!(review.undo().unwrap().choice, Choice::Join);
                assert_eq!((review.choices().clone(), review.at()), after);
                assert_eq!(review.undo(), Some(kept));
                assert_eq!((review.choices().clone(), review.at()), before);
                assert_eq!(review.n_decisions(), [0, 2]);
                assert_eq!(review.redo(), Some(kept));
                assert_eq!((review.choices().clone(), review.at()), after);
                review.undo();
                assert_eq!(of(&review.portals()).as_ref(), Some(portal));
            }
        }
    }
    assert!(n_decided > 8, "{n_decided}");
}

// Covers T5.
#[test]
fn a_hundred_decisions_are_undone_to_the_choices_that_were_read() {
    let g = gjorup_rooms(Variant::Optimised, [0.0; 3]);
    let first = review(&g).next_step().unwrap().position;
    let mut config = BakeConfig::of(Method::Delaunay);
    config.delaunay.choices.keep.push(first);
    let context = BakeContext::new(&Silent, None);
    let session = Session::begin(&g.scene, &config, &context).unwrap();
    let mut review = Review::new(session, config);
    let read = Choices {
        keep: vec![first],
        join: Vec::new(),
    };
    let mut seen = vec![(read.clone(), review.at())];
    for k in 0..100 {
        let portals = review.portals();
        let portal = &portals[k % portals.len()];
        let choice = match portal.choice {
            Some(Choice::Keep) => Choice::Join,
            _ => Choice::Keep,
        };
        review.decide(portal, choice).unwrap();
        seen.push((review.choices().clone(), review.at()));
        if review.portals().is_empty() {
            review.go_to(0);
        }
    }
    for (choices, _) in seen[..100].iter().rev() {
        review.undo().unwrap();
        assert_eq!(review.choices(), choices);
    }
    assert_eq!(review.choices(), &read);
    assert!(review.undo().is_none());
    for (choices, _) in &seen[1..] {
        review.redo().unwrap();
        assert_eq!(review.choices(), choices);
    }
    assert!(review.redo().is_none());
    // A decision ends what could be made again.
    review.undo();
    let portals = review.portals();
    let portal = portals.iter().find(|p| p.choice.is_none()).unwrap();
    review.decide(portal, Choice::Keep).unwrap();
    assert_eq!(review.n_decisions(), [100, 0]);
}

// Covers T5.
#[test]
fn a_join_waits_until_nothing_else_goes_by_itself() {
    let mut review = review(&gjorup_rooms(Variant::Optimised, [0.0; 3]));
    let joined = review.decide_next(Choice::Join).unwrap();
    let at = review.steps().iter().position(|s| s.weight == JOINED);
    let at = at.unwrap();
    assert_eq!(review.stop(), at + 1);
    for (n_steps, weight) in [(at, JOINED), (at - 1, f64::NAN)] {
        review.go_to(n_steps);
        let portals = review.portals();
        let shown = portals.iter().find(|p| p.choice == Some(Choice::Join));
        let shown = shown.unwrap();
        assert_eq!(shown.decided_at, [joined.position]);
        assert_eq!(shown.weight == JOINED, weight == JOINED);
        assert_eq!(shown.is_next, weight == JOINED);
    }
}
