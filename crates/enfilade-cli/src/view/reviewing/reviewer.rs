//! The reviewer: a review, what of it is shown, and what keys mean for it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use enfilade::cpg::World;
use enfilade::geom::DVec3;
use enfilade::internals::bake::delaunay::{Choice, Decision, OUTDOOR_CELL};
use enfilade_render::PictureMark;

use super::legend::{LegendLine, ReviewShown};
use super::scale::{PortalClass, WeightScale};
use super::sheets::Sheets;
use crate::reviewed::{Reviewed, weight_words};
use crate::screen::At;

/// Greatest distance of a portal at the crosshair. [Units: wu]
const REACH: f64 = 200.0;
/// Depth behind a surface down to which portals count as seen: they are in the middle of a doorway, the door on one
/// side of it. [Units: wu]
const BEHIND: f64 = 0.25;

/// A key, as the reviewer understands it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ReviewKey {
    /// So many steps forwards, or back.
    Step(isize),
    /// To the decimation's own stop.
    Stop,
    Keep {
        /// The portal at the crosshair, not that of the next step.
        is_there: bool,
    },
    Join {
        is_there: bool,
    },
    Undo,
    Redo,
    /// Go before the portal of the next step.
    Visit,
    Save,
    Bake,
    /// Show the scene, or the baked rooms.
    Switch,
}

/// Consequence of a key.
pub(crate) enum ReviewOutcome {
    Said(String),
    Refused(String),
    /// The eye goes before a place, to look at it along one of two directions.
    Visit(DVec3, DVec3),
    /// Another world is shown.
    Show(Arc<World>, String),
    /// Bakes after the frame that says so.
    Bake(String),
}

/// A review in the window.
pub(crate) struct Reviewer<'a> {
    reviewed: Reviewed<'a>,
    save: PathBuf,
    output: Option<PathBuf>,
    scale: WeightScale,
    sheets: Sheets,
    /// Rooms left, and other cells.
    n_cells: [usize; 2],
    aimed: Option<usize>,
    /// The scene, and the rooms baked last.
    worlds: [Option<Arc<World>>; 2],
    /// Index of the world that is shown.
    shown: usize,
    /// Time of each step and decision, until all that shows it is ready.
    times: Vec<Duration>,
}

impl<'a> Reviewer<'a> {
    pub(crate) fn new(
        reviewed: Reviewed<'a>,
        save: PathBuf,
        output: Option<PathBuf>,
        scene: Arc<World>,
    ) -> Self {
        let scale = WeightScale::of(reviewed.review.config());
        let mut reviewer = Self {
            reviewed,
            save,
            output,
            scale,
            sheets: Sheets::default(),
            n_cells: [0; 2],
            aimed: None,
            worlds: [Some(scene), None],
            shown: 0,
            times: Vec::new(),
        };
        reviewer.renew();
        reviewer
    }

    /// Brings all that is shown to the step.
    fn renew(&mut self) {
        let review = &self.reviewed.review;
        self.aimed = None;
        self.sheets
            .show(review.session(), review.portals(), self.scale);
        self.n_cells = review.count_rooms();
    }

    /// Finds the portal at the crosshair; `wall` is the distance of the first surface there.
    pub(crate) fn look(&mut self, eye: DVec3, toward: DVec3, wall: Option<f64>) {
        let most = wall.map_or(REACH, |t| (t + BEHIND).min(REACH));
        self.aimed = self.sheets.at(eye, toward, most);
    }

    /// Returns the place of the portal of the next step, and its normal.
    pub(crate) fn next_place(&self) -> Option<[DVec3; 2]> {
        self.sheets.next()
    }

    /// Lends the marks of the portals to a frame.
    pub(crate) fn lend_marks(&mut self) -> Vec<PictureMark> {
        self.sheets.lend(self.aimed)
    }

    /// Takes the marks back.
    pub(crate) fn take_marks(&mut self, marks: Vec<PictureMark>) {
        self.sheets.give_back(marks);
    }

    /// Returns `true` if the scene is shown, which has no rooms.
    pub(crate) fn shows_scene(&self) -> bool {
        self.shown == 0
    }

    /// Returns the words about the portal at the crosshair.
    pub(crate) fn aimed_words(&self) -> Option<String> {
        let portal = &self.sheets.portals()[self.aimed?];
        let [a, b] = portal.cells.map(|cell| match cell {
            OUTDOOR_CELL => "the outdoors".to_owned(),
            cell => format!("cell {cell}"),
        });
        let weight = match portal.choice {
            Some(Choice::Keep) => "kept by decision".into(),
            Some(Choice::Join) => "joined by decision".into(),
            None => weight_words(portal.weight, portal.is_mouth),
        };
        let next = if portal.is_next { ", next" } else { "" };
        Some(format!("{a} and {b}: {weight}{next}"))
    }

    /// Returns what is to be told at the end.
    pub(crate) fn farewell(&self) -> Vec<String> {
        let mut times = self.times.clone();
        times.sort_unstable();
        let told = times.last().map(|worst| {
            let [median, worst] = [times[times.len() / 2], *worst].map(|t| t.as_secs_f64() * 1e3);
            let n = times.len();
            format!(
                "{n} steps and decisions took {median:.1} ms in the middle, {worst:.1} ms at most"
            )
        });
        let unsaved = (!self.reviewed.is_saved()).then(|| {
            let save = self.save.display();
            format!("the last decisions were not saved to {save}; F2 saves them")
        });
        told.into_iter().chain(unsaved).collect()
    }

    /// Returns what the panel shows.
    pub(crate) fn shown(&self) -> ReviewShown {
        let review = &self.reviewed.review;
        let portals = self.sheets.portals();
        let [rooms, others] = self.n_cells;
        let mut lines = vec![
            format!(
                "step {} of {}; stops by itself after {}",
                review.at(),
                review.steps().len(),
                review.stop()
            ),
            format!("{rooms} cells left indoors besides {others} crevices and insides of walls"),
            match review.next_step() {
                None => "no portal is left".to_owned(),
                Some(s) => {
                    let weight = weight_words(s.weight, s.is_mouth);
                    format!("next: {weight}, at {}", At(s.position.to_array()))
                }
            },
            self.words_of_weights(),
        ];
        let [n_made, n_undone] = review.n_decisions();
        let saved = if self.reviewed.is_saved() {
            ""
        } else {
            ", not saved"
        };
        lines.push(format!("Z: undo {n_made}; Y: redo {n_undone}{saved}"));
        let legend = PortalClass::all().map(|class| LegendLine {
            color: class.color(),
            n: portals
                .iter()
                .filter(|p| self.scale.class(p) == class)
                .count(),
            words: self.scale.words(class),
        });
        ReviewShown {
            is_without_map: self.shows_scene(),
            lines,
            legend: legend.collect(),
        }
    }

    /// The number of portals left, and their weights from the least to the greatest.
    fn words_of_weights(&self) -> String {
        let portals = self.sheets.portals();
        let weights = portals.iter().map(|p| p.weight);
        let weights = weights.filter(|w| *w >= 0.0 && w.is_finite());
        let ends = weights.fold(None, |ends: Option<[f64; 2]>, w| {
            Some(ends.map_or([w; 2], |[a, b]| [a.min(w), b.max(w)]))
        });
        let n = portals.len();
        match ends {
            Some([a, b]) => format!("{n} portals left, of weights {a:.2} to {b:.2}"),
            None => format!("{n} portals left"),
        }
    }

    /// Does what a key means.
    pub(crate) fn press(&mut self, key: ReviewKey) -> ReviewOutcome {
        match key {
            ReviewKey::Step(by) => self.timed(|it| {
                it.reviewed.review.go_by(by);
                None
            }),
            ReviewKey::Stop => self.timed(|it| {
                let review = &mut it.reviewed.review;
                review.go_to(review.stop());
                None
            }),
            ReviewKey::Keep { is_there } => self.decide(Choice::Keep, is_there),
            ReviewKey::Join { is_there } => self.decide(Choice::Join, is_there),
            ReviewKey::Undo => self.timed(|it| {
                let undone = it.reviewed.review.undo();
                let words = |d| format!("undone: {}", decision_words(d));
                Some(undone.map_or_else(|| "nothing to undo".into(), words))
            }),
            ReviewKey::Redo => self.timed(|it| {
                let made = it.reviewed.review.redo();
                let words = |d| format!("made again: {}", decision_words(d));
                Some(made.map_or_else(|| "nothing to redo".into(), words))
            }),
            ReviewKey::Visit => match self.next_place() {
                Some([position, normal]) => ReviewOutcome::Visit(position, normal),
                None => ReviewOutcome::Said("no portal is left".into()),
            },
            ReviewKey::Save => {
                let path = self.save.clone();
                match self.reviewed.save("--save", &path) {
                    Ok(()) => {
                        let name = path.display();
                        ReviewOutcome::Said(format!(
                            "wrote {name}; `enfilade bake --method delaunay --choices {name}` applies it"
                        ))
                    }
                    Err(why) => ReviewOutcome::Refused(format!("not saved: {why:#}")),
                }
            }
            ReviewKey::Bake => match &self.output {
                Some(path) => ReviewOutcome::Bake(format!(
                    "baking the rooms of step {} to {}",
                    self.reviewed.review.at(),
                    path.display()
                )),
                None => ReviewOutcome::Refused(
                    "there is no file to bake to; give -o OUT.glb to `enfilade decimate`".into(),
                ),
            },
            ReviewKey::Switch => {
                let other = 1 - self.shown;
                match &self.worlds[other] {
                    Some(world) => {
                        let world = Arc::clone(world);
                        self.shown = other;
                        let words = ["the scene", "the rooms baked last"][other];
                        ReviewOutcome::Show(world, words.into())
                    }
                    None => ReviewOutcome::Said("no rooms are baked; F3 bakes them".into()),
                }
            }
        }
    }

    /// Takes a step, and brings all that is shown to it; tells the step, and what else there is to tell.
    fn timed(&mut self, act: impl FnOnce(&mut Self) -> Option<String>) -> ReviewOutcome {
        let begin = Instant::now();
        let words = act(self);
        self.renew();
        self.times.push(begin.elapsed());
        let words = words.map_or_else(String::new, |w| w + "; ");
        ReviewOutcome::Said(words + &self.step_words())
    }

    /// Returns a line about the step.
    pub(crate) fn step_words(&self) -> String {
        let review = &self.reviewed.review;
        let n = review.steps().len();
        format!(
            "step {} of {n}, {} cells left indoors",
            review.at(),
            self.n_cells[0]
        )
    }

    fn decide(&mut self, choice: Choice, is_there: bool) -> ReviewOutcome {
        let mut portals = self.sheets.portals().iter();
        let portal = if is_there {
            self.aimed.map(|k| &self.sheets.portals()[k])
        } else {
            portals.find(|p| p.is_next)
        };
        let Some(portal) = portal.cloned() else {
            let words = ["no portal is left to decide about", "no portal there"];
            return ReviewOutcome::Refused(words[usize::from(is_there)].into());
        };
        if portal.choice == Some(choice) {
            return ReviewOutcome::Refused("that is decided already".into());
        }
        self.timed(|it| {
            let made = it.reviewed.review.decide(&portal, choice);
            made.map(decision_words)
        })
    }

    /// Bakes the rooms of the step, which are shown from now on.
    pub(crate) fn bake(&mut self) -> anyhow::Result<(Arc<World>, String)> {
        let Some(path) = &self.output else {
            anyhow::bail!("there is no file to bake to");
        };
        let (baked, written) = self.reviewed.bake_to(path)?;
        let n = baked.world.graph.indoor_cells().count();
        let world = Arc::new(baked.world);
        self.worlds[1] = Some(Arc::clone(&world));
        self.shown = 1;
        Ok((world, format!("{written}, {n} cells indoors")))
    }
}

/// A decision in words.
fn decision_words(decision: Decision) -> String {
    let verb = match decision.choice {
        Choice::Keep => "keeps",
        Choice::Join => "joins",
    };
    let at = At(decision.position.to_array());
    format!("{verb} the portal at {at}")
}
