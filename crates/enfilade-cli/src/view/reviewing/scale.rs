//! Weights of portals as colors: classes around the weight at which the decimation stops by itself.
//!
//! Bluish portals go by themselves, yellow to red ones stay: the further from the stop, the darker. These colors are
//! told apart by those who do not tell red from green. Decisions have colors of their own.

use enfilade::bake::BakeConfig;
use enfilade::internals::bake::delaunay::{Choice, RemainingPortal, default_stop};

/// Upper ends of the classes of weights, the last of which has none. [Units: the weight of the stop]
const ENDS: [f64; 6] = [0.75, 0.9, 1.0, 1.25, 2.0, 4.0];
/// Number of classes of weights.
const N_WEIGHTS: usize = ENDS.len() + 1;

/// Colors of the classes of weights, as sRGB.
const WEIGHTS: [[u8; 3]; N_WEIGHTS] = [
    [30, 80, 170],
    [70, 140, 210],
    [150, 205, 235],
    [255, 225, 110],
    [250, 160, 50],
    [225, 85, 35],
    [150, 15, 40],
];
const CREVICE: [u8; 3] = [150, 150, 150];
const KEPT: [u8; 3] = [40, 200, 90];
const JOINED: [u8; 3] = [215, 70, 215];

/// A class of portals that are shown alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum PortalClass {
    Kept,
    Joined,
    /// One of the classes of weights.
    Weight(usize),
    Crevice,
}

impl PortalClass {
    /// All classes, in the order of the legend: those that stay longest first.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let weights = (0..N_WEIGHTS).rev().map(Self::Weight);
        let decided = [Self::Kept, Self::Joined].into_iter();
        decided.chain(weights).chain([Self::Crevice])
    }

    /// Returns its color, as sRGB.
    pub(super) fn color(self) -> [u8; 3] {
        match self {
            Self::Kept => KEPT,
            Self::Joined => JOINED,
            Self::Weight(k) => WEIGHTS[k],
            Self::Crevice => CREVICE,
        }
    }

    /// Returns its color, linear.
    pub(super) fn linear(self) -> [f32; 3] {
        self.color().map(|c| {
            let c = f32::from(c) / 255.0;
            if c <= 0.04045 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        })
    }
}

/// The classes for the weight of a decimation.
#[derive(Clone, Copy)]
pub(super) struct WeightScale {
    stop: f64,
}

impl WeightScale {
    pub(super) fn of(config: &BakeConfig) -> Self {
        let own = &config.delaunay;
        Self {
            stop: own.stop.unwrap_or_else(|| default_stop(own.weight)),
        }
    }

    /// Returns the class of a portal.
    pub(super) fn class(&self, portal: &RemainingPortal) -> PortalClass {
        match portal.choice {
            Some(Choice::Keep) => PortalClass::Kept,
            Some(Choice::Join) => PortalClass::Joined,
            None if portal.weight < 0.0 => PortalClass::Crevice,
            None => {
                // A portal of the very weight of the stop goes by itself.
                let is_below = |end: &&f64| portal.weight > **end * self.stop;
                PortalClass::Weight(ENDS.iter().take_while(is_below).count())
            }
        }
    }

    /// Returns the words of the legend for a class.
    pub(super) fn words(&self, class: PortalClass) -> String {
        let end = |k: usize| ENDS[k] * self.stop;
        match class {
            PortalClass::Kept => "kept by decision".into(),
            PortalClass::Joined => "joined by decision".into(),
            PortalClass::Crevice => "of crevices".into(),
            PortalClass::Weight(0) => format!("weight up to {:.2}", end(0)),
            PortalClass::Weight(k) if k < ENDS.len() => {
                format!("weight {:.2} to {:.2}", end(k - 1), end(k))
            }
            PortalClass::Weight(k) => format!("weight above {:.2}", end(k - 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade::geom::DVec3;

    fn portal(weight: f64, choice: Option<Choice>) -> RemainingPortal {
        RemainingPortal {
            cells: [1, 2],
            weight,
            is_mouth: false,
            position: DVec3::ZERO,
            choice,
            decided_at: Vec::new(),
            is_next: false,
            links: Vec::new(),
        }
    }

    // Covers T5.
    #[test]
    fn each_weight_is_in_the_class_whose_words_have_it_and_decisions_in_theirs() {
        let scale = WeightScale { stop: 1.5 };
        for (weight, words) in [
            (-0.5, "of crevices"),
            (0.0, "weight up to 1.12"),
            (1.3, "weight 1.12 to 1.35"),
            (1.49, "weight 1.35 to 1.50"),
            (1.5, "weight 1.35 to 1.50"),
            (1.51, "weight 1.50 to 1.88"),
            (2.9, "weight 1.88 to 3.00"),
            (3.1, "weight 3.00 to 6.00"),
            (1e9, "weight above 6.00"),
        ] {
            let class = scale.class(&portal(weight, None));
            assert_eq!(scale.words(class), words, "{weight}");
            let kept = scale.class(&portal(weight, Some(Choice::Keep)));
            let joined = scale.class(&portal(weight, Some(Choice::Join)));
            assert_eq!([kept, joined], [PortalClass::Kept, PortalClass::Joined]);
        }
        let mut colors: Vec<[u8; 3]> = PortalClass::all().map(PortalClass::color).collect();
        assert_eq!(colors.len(), N_WEIGHTS + 3);
        colors.sort_unstable();
        colors.dedup();
        assert_eq!(colors.len(), N_WEIGHTS + 3, "two classes look alike");
    }
}
