//! The worlds of this benchmark: each is baked once, and all rows use it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;

use anyhow::Context;
use serde_json::Value;

use super::cases::{Found, SmallCase};
use super::merged::merged_bake;
use super::score::{Score, inspect, score_world};
use crate::measure::{self, imported};
use crate::process::{bake_command, generate, output_of, scenes_and, target_dir};
use crate::rows::{Chosen, RowPrinter};

/// A building as it is, spoilt, or baked by another method.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Form {
    Clean,
    /// Name, and arguments of the test kit's `generate`.
    Spoilt(&'static str, &'static [&'static str]),
    /// All objects as one mesh, named as its first object.
    Merged,
    Method(&'static str),
}

impl Form {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Clean => "clean",
            Self::Spoilt(name, _) | Self::Method(name) => name,
            Self::Merged => "merged",
        }
    }
}

/// The longest bake by a method that is not the default. [Units: s]
const LONGEST: &str = "600";

/// A bake that was tried.
pub(super) struct TriedBake {
    pub(super) world: PathBuf,
    /// The output of `inspect --json`, or why there is no world.
    pub(super) graph: Result<Value, String>,
    /// The score of a building; `None` of a level.
    pub(super) score: Option<Score>,
}

impl TriedBake {
    /// Returns the path of the world, or why there is none.
    pub(super) fn world(&self) -> Result<&Path, &str> {
        self.graph
            .as_ref()
            .map(|_| &*self.world)
            .map_err(|why| &**why)
    }
}

/// The bakes so far.
pub(crate) struct Worlds {
    /// Segments that `verify` tries.
    pub(super) rays: u64,
    is_kept: bool,
    folder: PathBuf,
    baked: BTreeMap<(Form, String), Rc<TriedBake>>,
    cases: BTreeMap<&'static str, Rc<Found>>,
}

/// The rows of this benchmark.
pub(super) type RoomRows<'a> = RowPrinter<'a, Worlds>;

impl RoomRows<'_> {
    /// Returns the chosen buildings with truth.
    pub(super) fn buildings(&self) -> Vec<PathBuf> {
        buildings(self.chosen)
    }
}

impl Worlds {
    /// With `is_kept`, worlds of an earlier run are not baked again.
    pub(crate) fn new(rays: u64, is_kept: bool) -> anyhow::Result<Self> {
        let folder = target_dir().join("rooms");
        std::fs::create_dir_all(&folder)?;
        Ok(Self {
            rays,
            is_kept,
            folder,
            baked: BTreeMap::new(),
            cases: BTreeMap::new(),
        })
    }

    /// Returns a building's bake.
    pub(super) fn building(&mut self, dir: &Path, form: Form) -> Rc<TriedBake> {
        let name = measure::name(dir);
        let spoilt = self.folder.join(form.name()).join(&name);
        let mut baked = self.bake(&name, form, |world| {
            Ok(match form {
                Form::Clean => bake_command(dir, world),
                Form::Spoilt(_, how) => {
                    let from = dir.display().to_string();
                    generate(&[&[from.as_str()], how].concat(), &spoilt)?;
                    bake_command(&spoilt, world)
                }
                Form::Merged => merged_bake(&imported(dir)?, &name, "obj", world)?,
                Form::Method(method) => {
                    let mut command = bake_command(dir, world);
                    command.args(["--method", method, "--max-time", LONGEST]);
                    command
                }
            })
        });
        if baked.score.is_none()
            && let Ok(graph) = &baked.graph
        {
            let score = score_world(dir, &baked.world, graph);
            let whole = TriedBake {
                world: baked.world.clone(),
                graph: score.as_ref().map(|_| graph.clone()).map_err(cause),
                score: score.ok(),
            };
            baked = Rc::new(whole);
            self.baked.insert((form, name), Rc::clone(&baked));
        }
        baked
    }

    /// Returns the bake of a level's file.
    pub(super) fn level(&mut self, file: &Path) -> Rc<TriedBake> {
        self.bake(&measure::name(file), Form::Clean, |world| {
            Ok(bake_command(file, world))
        })
    }

    /// Returns what a small case gave.
    pub(super) fn case(&mut self, case: &SmallCase, file: &Path) -> anyhow::Result<Rc<Found>> {
        if !self.cases.contains_key(case.file) {
            let found = Rc::new(Found::of(case, file)?);
            self.cases.insert(case.file, found);
        }
        Ok(Rc::clone(&self.cases[case.file]))
    }

    fn bake(
        &mut self,
        name: &str,
        form: Form,
        command: impl FnOnce(&Path) -> anyhow::Result<Command>,
    ) -> Rc<TriedBake> {
        let key = (form, name.to_owned());
        if let Some(baked) = self.baked.get(&key) {
            return Rc::clone(baked);
        }
        let world = self.folder.join(format!("{name}-{}.glb", form.name()));
        let made = || -> anyhow::Result<Value> {
            if !(self.is_kept && world.is_file()) {
                // No world of an earlier run stays where this bake fails.
                let _ = std::fs::remove_file(&world);
                output_of(&mut command(&world)?, None).context("bake")?;
            }
            inspect(&world)
        };
        let graph = made().map_err(|error| cause(&error));
        let baked = Rc::new(TriedBake {
            world,
            graph,
            score: None,
        });
        self.baked.insert(key, Rc::clone(&baked));
        baked
    }
}

/// Returns the folders of the chosen buildings with truth.
pub(super) fn buildings(chosen: &Chosen) -> Vec<PathBuf> {
    let mut all = scenes_and(&["scenes2", "scenes3"]);
    all.retain(|dir| dir.join("truth.json").is_file() && chosen.has_scene(&measure::name(dir)));
    all
}

/// Returns the last line of an error, which tells the cause.
fn cause(error: &anyhow::Error) -> String {
    let text = format!("{error:#}");
    let last = text.lines().rfind(|line| !line.trim().is_empty());
    last.unwrap_or_default().chars().take(300).collect()
}
