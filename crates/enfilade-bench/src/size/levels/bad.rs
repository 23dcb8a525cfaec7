//! Bad input: what must be refused, with place and reason.

use enfilade::cpg::PortalId;
use enfilade::geom::{DQuat, DVec3};
use enfilade::kit::{Assembly, Choice, Chosen, End, Kit, Piece, PlaceOptions, Spot};
use enfilade::world::Pose;
use enfilade_testkit::dungeon_kit;

use super::scenes::kit_of;
use crate::rows::{Figure, baked};

/// Bad inputs that are taken, or refused in other words.
pub(super) fn taken(_scene: &str) -> anyhow::Result<Figure> {
    let mut said: Vec<(&str, Option<String>)> = Vec::new();
    let models = dungeon_kit();
    let chamber = baked(&models[0].scene)?;
    let named = |name: &str, portal| Chosen {
        name: name.into(),
        spot: Spot::Portal(PortalId(portal)),
    };
    let mut refuse = |words, refused: Option<String>| said.push((words, refused));
    let twice = Choice::Only(vec![named("a", 0), named("a", 1)]);
    let refused = Piece::new("p", chamber.clone(), &twice).err();
    refuse("named \"a\"", refused.map(|e| e.to_string()));
    let lost = Choice::Only(vec![named("a", 99)]);
    let refused = Piece::new("p", chamber.clone(), &lost).err();
    refuse("portal-99", refused.map(|e| e.to_string()));
    // An opening of the same place, 8 cm narrower.
    let mut narrow = chamber.clone();
    for portal in &mut narrow.graph.portals {
        let corners = portal
            .pieces
            .iter_mut()
            .flatten()
            .chain(&mut portal.outline);
        let k = usize::from(portal.normal[0].abs() > 0.5) * 2;
        corners.for_each(|p| p[k] -= 0.04 * p[k].signum());
        portal.area *= 1.12 / 1.2;
    }
    let narrow = Piece::new("narrow", narrow, &Choice::Doorways)?;
    let mut pieces = kit_of(&models)?.pieces().to_vec();
    let refused = Kit::new([&pieces[..], &pieces[..1]].concat()).err();
    refuse("\"chamber\"", refused.map(|e| e.to_string()));
    pieces.push(narrow);
    let mut level = Assembly::new(Kit::new(pieces)?);
    let options = PlaceOptions::default();
    let first = level.put(0, Pose::IDENTITY, &options)?;
    let end = |attachment| End {
        instance: first,
        attachment,
    };
    let n = level.kit().pieces().len();
    let refused = level.place(n - 1, 0, end(0), &options).err();
    refuse("differ by 0.0", refused.map(|e| e.to_string()));
    let refused = level.place(0, 9, end(0), &options).err();
    refuse("no attachment", refused.map(|e| e.to_string()));
    let refused = level.put(n, Pose::IDENTITY, &options).err();
    refuse("no piece", refused.map(|e| e.to_string()));
    let refused = level
        .put(0, Pose::from_translation(DVec3::X * 3.0), &options)
        .err();
    refuse(
        "overlap chamber-1 by at least",
        refused.map(|e| e.to_string()),
    );
    let refused = level
        .put(
            0,
            Pose::from_translation(DVec3::new(6.0, 0.0, 2.6)),
            &options,
        )
        .err();
    refuse("% of the opening", refused.map(|e| e.to_string()));
    let leaning = Pose {
        turn: DQuat::from_rotation_x(0.1),
        at: DVec3::X * 30.0,
    };
    refuse(
        "tilted by 5.7°",
        level.put(0, leaning, &options).err().map(|e| e.to_string()),
    );
    let lost = Pose::from_translation(DVec3::X * f64::INFINITY);
    refuse(
        "not a rigid motion",
        level.put(0, lost, &options).err().map(|e| e.to_string()),
    );
    refuse(
        "6.000 m apart",
        level.close(end(0), end(2)).err().map(|e| e.to_string()),
    );
    let niche = level.kit().named("niche").unwrap_or_default();
    level.place(niche, 0, end(0), &options)?;
    let refused = level.place(niche, 0, end(0), &options).err();
    refuse(
        "in use: it leads to niche-2.south",
        refused.map(|e| e.to_string()),
    );
    Ok(not_refused(&said))
}

/// Counts the cases that were taken, or refused without the expected words. Each is these words, and the refusal.
pub(super) fn not_refused(said: &[(&str, Option<String>)]) -> Figure {
    let is_wrong = |(words, refused): &&(&str, Option<String>)| {
        !refused.as_ref().is_some_and(|why| why.contains(words))
    };
    let wrong = said.iter().filter(is_wrong);
    let wrong: Vec<String> = wrong
        .map(|(words, refused)| format!("{words}: {refused:?}"))
        .collect();
    let note = format!("of {}; {}", said.len(), wrong.join("; "));
    Figure::new(wrong.len() as f64, 0.0, note)
}
