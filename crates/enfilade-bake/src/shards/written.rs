//! Basins and rooms as pieces.

use std::collections::BTreeMap;

use enfilade_cpg::{Fact, Reason, Why};
use enfilade_geom::{Aabb, DVec3, Winding};
use serde::{Deserialize, Serialize};

use crate::Resolution;
use crate::complex::{Label, Vote};
use crate::pieces::KeptPiece;
use crate::proposal::{FoundPlace, Proposal};
use crate::rooms::{self, Basins};
use crate::structure::Candidate;
use crate::voxel::Labels;

/// The rooms of a site, as written.
#[derive(Serialize, Deserialize)]
pub(crate) struct WrittenRooms {
    bounds: [[f64; 3]; 2],
    candidates: Vec<WrittenCandidate>,
    votes: Vec<([f64; 3], WrittenLabel, f32)>,
    voids: Vec<([f64; 3], u32)>,
    places: Vec<([f64; 3], WrittenWhy)>,
    whys: Vec<(u32, WrittenWhy)>,
    tubes: [f64; 2],
    counts: Vec<(String, f64)>,
    notes: Vec<String>,
    settings: BTreeMap<String, String>,
}

#[derive(Serialize, Deserialize)]
struct WrittenCandidate {
    polygon: Vec<[f64; 3]>,
    closed: f64,
    why: WrittenWhy,
}

/// A decision in a form without optional fields.
#[derive(Serialize, Deserialize)]
struct WrittenWhy {
    reason: Reason,
    limit: Option<f32>,
    facts: Vec<(Fact, f32)>,
}

impl WrittenWhy {
    fn of(why: &Why) -> Self {
        Self {
            reason: why.reason,
            limit: why.limit,
            facts: why
                .facts
                .iter()
                .map(|(&fact, &value)| (fact, value))
                .collect(),
        }
    }

    fn read(self) -> Why {
        Why {
            reason: self.reason,
            limit: self.limit,
            facts: self.facts.into_iter().collect(),
        }
    }
}

#[derive(Serialize, Deserialize)]
enum WrittenLabel {
    Region(u32),
    Void(u32),
    Beyond,
    Solid,
}

impl KeptPiece for Proposal {
    type Written = WrittenRooms;

    fn written(&self) -> WrittenRooms {
        let candidate = |c: &Candidate| WrittenCandidate {
            polygon: c.winding.points.iter().map(DVec3::to_array).collect(),
            closed: c.closed,
            why: WrittenWhy::of(&c.why),
        };
        let place = |p: &FoundPlace| (p.at.to_array(), WrittenWhy::of(&p.why));
        let vote = |v: &Vote| {
            let label = match v.label {
                Label::Region(region) => WrittenLabel::Region(region),
                Label::Void(region) => WrittenLabel::Void(region),
                Label::Beyond => WrittenLabel::Beyond,
                Label::Solid => WrittenLabel::Solid,
            };
            (v.point.to_array(), label, v.weight)
        };
        let count = |(name, n): &(&'static str, f64)| ((*name).to_owned(), *n);
        WrittenRooms {
            bounds: [self.bounds.min, self.bounds.max].map(|p| p.to_array()),
            candidates: self.candidates.iter().map(candidate).collect(),
            votes: self.votes.iter().map(vote).collect(),
            voids: self.voids.iter().map(|v| (v.0.to_array(), v.1)).collect(),
            places: self.places.iter().map(place).collect(),
            whys: (self.whys.iter())
                .map(|(region, why)| (*region, WrittenWhy::of(why)))
                .collect(),
            tubes: self.tubes,
            counts: self.counts.iter().map(count).collect(),
            notes: self.notes.clone(),
            settings: self.settings.clone(),
        }
    }

    fn read(written: WrittenRooms) -> Option<Self> {
        let [min, max] = written.bounds.map(DVec3::from_array);
        let vote = |(point, label, weight)| Vote {
            point: DVec3::from_array(point),
            label: match label {
                WrittenLabel::Region(region) => Label::Region(region),
                WrittenLabel::Void(region) => Label::Void(region),
                WrittenLabel::Beyond => Label::Beyond,
                WrittenLabel::Solid => Label::Solid,
            },
            weight,
        };
        let candidate = |c: WrittenCandidate| Candidate {
            winding: Winding::new(c.polygon.into_iter().map(DVec3::from_array).collect()),
            closed: c.closed,
            why: c.why.read(),
        };
        let place = |(at, why): ([f64; 3], WrittenWhy)| FoundPlace {
            at: DVec3::from_array(at),
            why: why.read(),
        };
        let count = |(name, n): (String, f64)| {
            let known = rooms::COUNTS.into_iter().find(|known| *known == name);
            known.map(|name| (name, n))
        };
        let votes = written.votes.into_iter().map(vote).collect();
        let voids = written.voids.into_iter();
        Some(Self {
            candidates: written.candidates.into_iter().map(candidate).collect(),
            voids: voids.map(|(p, r)| (DVec3::from_array(p), r)).collect(),
            places: written.places.into_iter().map(place).collect(),
            whys: (written.whys.into_iter())
                .map(|(region, why)| (region, why.read()))
                .collect(),
            tubes: written.tubes,
            counts: written
                .counts
                .into_iter()
                .map(count)
                .collect::<Option<_>>()?,
            notes: written.notes,
            settings: written.settings,
            // Known before the work, and not part of it.
            resolution: Resolution::Planes,
            ..Self::new(Aabb::new(min, max), votes)
        })
    }
}

/// The parts of a site's air, as written.
#[derive(Serialize, Deserialize)]
pub(crate) struct WrittenBasins {
    dims: [usize; 3],
    labels: Vec<Vec<u8>>,
    peaks: Vec<f32>,
    saddles: Vec<((u32, u32), f32)>,
    n_basins: usize,
}

impl KeptPiece for Basins {
    type Written = WrittenBasins;

    fn written(&self) -> WrittenBasins {
        WrittenBasins {
            dims: self.labels.dims(),
            labels: self.labels.packed(),
            peaks: self.peaks.clone(),
            saddles: self.saddles.iter().map(|(&pair, &d)| (pair, d)).collect(),
            n_basins: self.n_basins,
        }
    }

    fn read(written: WrittenBasins) -> Option<Self> {
        Some(Self {
            labels: Labels::unpacked(written.dims, &written.labels)?,
            peaks: written.peaks,
            saddles: written.saddles.into_iter().collect(),
            n_basins: written.n_basins,
        })
    }
}
