//! A review of a decimation with its scene, and the files that it writes: shared by the text and the window.

use std::io::Write;
use std::path::Path;

use anyhow::Context;
use enfilade::bake::delaunay::Choices;
use enfilade::bake::{BakeContext, BakeOutput, Silent};
use enfilade::geom::scene::Scene;
use enfilade::internals::bake::bake_session;
use enfilade::internals::bake::delaunay::{JOINED, Review};

use crate::bake::Summary;
use crate::bake::delaunay::choices_text;
use crate::formats::Format;
use crate::output::{Outputs, Written, refuse_stream, write_whole};
use crate::screen::print_json;
use enfilade_cli::world::encode_whole;

/// The weight of a portal, or a word where it is not a ratio.
pub(crate) fn weight_words(weight: f64, is_mouth: bool) -> String {
    match weight {
        f64::INFINITY => "kept by decision".to_owned(),
        w if w <= JOINED => "joined by decision".to_owned(),
        w if w < 0.0 => "a crevice".to_owned(),
        w if is_mouth => format!("weight {w:.3}, a branch"),
        w => format!("weight {w:.3}"),
    }
}

/// The output of `--json`.
#[derive(serde::Serialize)]
struct WalkReport {
    steps: Vec<StepReport>,
    /// Steps taken, and steps until the decimation stops by itself.
    at: usize,
    stop: usize,
    cells_indoors: usize,
    others: usize,
    /// The world baked with `-o`.
    baked: Option<Baked>,
}

#[derive(serde::Serialize)]
struct StepReport {
    /// In words.
    weight: String,
    from: usize,
    into: usize,
    position: [f64; 3],
}

#[derive(serde::Serialize)]
struct Baked {
    #[serde(flatten)]
    written: Written,
    #[serde(flatten)]
    summary: Summary,
    notes: Vec<String>,
}

/// Refuses standard output, which the replies of a walk go to.
pub(crate) fn in_walk(option: &str, path: &Path) -> anyhow::Result<()> {
    refuse_stream(option, path, "a file beside the replies")
}

/// A review of a scene.
pub(crate) struct Reviewed<'a> {
    scene: &'a Scene,
    pub(crate) review: Review,
    /// The decisions as read or saved last.
    saved: Choices,
    /// Files that no world may overwrite, and files that no choices may overwrite.
    pub(crate) outputs: Outputs,
    choices: Outputs,
}

impl<'a> Reviewed<'a> {
    pub(crate) fn new(
        scene: &'a Scene,
        review: Review,
        outputs: Outputs,
        choices: Outputs,
    ) -> Self {
        Self {
            scene,
            saved: review.choices().clone(),
            review,
            outputs,
            choices,
        }
    }

    #[cfg(feature = "view")]
    pub(crate) fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// Returns `true` if a file has all decisions.
    pub(crate) fn is_saved(&self) -> bool {
        self.saved == *self.review.choices()
    }

    /// Writes all decisions; `option` names the file.
    pub(crate) fn save(&mut self, option: &'static str, path: &Path) -> anyhow::Result<()> {
        in_walk(option, path)?;
        self.choices.clone().write(option, Format::Choices, path)?;
        write_whole(path, choices_text(self.review.choices()).as_bytes())?;
        self.saved = self.review.choices().clone();
        Ok(())
    }

    /// Bakes the rooms left at this step, and writes their world.
    pub(crate) fn bake_to(&self, path: &Path) -> anyhow::Result<(BakeOutput, Written)> {
        let context = BakeContext::new(&Silent, None);
        let review = &self.review;
        let (session, config) = (review.session(), review.config());
        let mut baked = bake_session(self.scene, session, review.at(), config, &context)?;
        let bytes = encode_whole(&mut baked.world)
            .context("the baked world breaks an invariant (a bug)")?;
        write_whole(path, &bytes)?;
        let written = Written::new(path, &bytes);
        Ok((baked, written))
    }

    pub(crate) fn print_json(&self, out: impl Write, output: Option<&Path>) -> anyhow::Result<()> {
        let review = &self.review;
        let [cells_indoors, others] = review.count_rooms();
        let steps = review.steps().iter().map(|s| StepReport {
            weight: weight_words(s.weight, s.is_mouth),
            from: s.from as usize,
            into: s.into as usize,
            position: s.position.to_array(),
        });
        let baked = output.map(|path| self.bake_to(path)).transpose()?;
        let report = WalkReport {
            steps: steps.collect(),
            at: review.at(),
            stop: review.stop(),
            cells_indoors,
            others,
            baked: baked.map(|(baked, written)| Baked {
                written,
                summary: Summary::of(&baked.world),
                notes: baked.notes,
            }),
        };
        print_json(out, &report)
    }
}
