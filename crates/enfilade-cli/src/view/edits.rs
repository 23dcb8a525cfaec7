//! Keys of the editor in the window, and the world that is saved.

use std::sync::Arc;

use anyhow::Context;
use enfilade::cpg::PortalId;
use enfilade::geom::DVec3;
use enfilade::world::PartId;
use enfilade_render::{PictureMark, portal_looked_at};

use super::app::App;
use super::editing::{EditKey, EditRay, Outcome};
use super::open::Open;
use super::pointed::{FAR, Pointed};
use crate::formats::Format;
use crate::output::write_whole;
use enfilade_cli::world::encode_whole;

impl App<'_> {
    /// Finds what the pointer means for the editor; returns the marks that show it.
    pub(super) fn look_at_edits(&mut self) -> Vec<PictureMark> {
        let (Some(editor), Some(open)) = (&mut self.editor, &mut self.open) else {
            return Vec::new();
        };
        editor.look(&edit_ray(open));
        open.shown.edit = editor.shown();
        if let Err(why) = editor.tick() {
            open.warn(why.to_string());
        }
        editor.marks()
    }

    /// Lets the editor have a key; returns `false` if it means nothing to it.
    pub(super) fn edit(&mut self, key: EditKey) -> anyhow::Result<bool> {
        let (Some(editor), Some(open)) = (&mut self.editor, &mut self.open) else {
            return Ok(false);
        };
        match editor.press(key, &edit_ray(open)) {
            Outcome::Quiet(is_taken) => return Ok(is_taken),
            Outcome::Said(words) => open.say(words),
            Outcome::Refused(why) => open.warn(why),
            Outcome::Go { eye, toward, words } => {
                open.go(eye, toward);
                open.say(words);
            }
            Outcome::Edited(words) => {
                if open.is_in_parts {
                    open.follow_edit(editor)?;
                } else {
                    self.world = Arc::new(editor.world()?.world.clone());
                    open.show_world(&self.world)?;
                }
                open.say(words);
            }
        }
        if let Some(notes) = editor.take_notes() {
            open.say(notes);
        }
        Ok(true)
    }

    /// Writes the world as edited.
    pub(super) fn save(&mut self) {
        let (Some(editor), Some(open)) = (&mut self.editor, &mut self.open) else {
            return;
        };
        let path = editor.save().to_owned();
        let world = editor.world().map_err(anyhow::Error::from);
        let bytes = world.and_then(|edited| {
            // The window goes on showing its own.
            let bytes = encode_whole(&mut edited.world.clone());
            let bytes = bytes.context("the world breaks an invariant (a bug)")?;
            Ok((bytes, edited.world.graph.rooms().count()))
        });
        let written = bytes.and_then(|(bytes, n)| {
            self.outputs.write("--save", Format::World, &path)?;
            write_whole(&path, &bytes)?;
            Ok(n)
        });
        match written {
            Ok(n) => {
                editor.saved();
                open.say(format!("wrote {}, {n} rooms", path.display()));
            }
            Err(why) => open.warn(format!("not saved: {why:#}")),
        }
    }
}

/// Returns the ray through the pointer, for the editor.
fn edit_ray(open: &Open) -> EditRay<'_> {
    let vector = |p: [f32; 3]| DVec3::from(p.map(f64::from));
    let (ray, space) = (open.pointer(), &open.lived.space);
    let length = vector(ray.toward).length().max(1e-9);
    let pointed = Pointed::at(space, &ray, FAR / length as f32);
    let portal = portal_looked_at(space, &pointed.ray);
    let center = |(part, portal, _): (PartId, PortalId, f32)| {
        let own = space.world(part).graph[portal].center();
        space.pose(part).point(vector(own))
    };
    EditRay {
        eye: vector(pointed.ray.eye),
        toward: vector(pointed.ray.toward).normalize_or(DVec3::X),
        hit: pointed.hit.map(|h| [h.at, h.normal]),
        portal: portal.map(center),
        space,
    }
}
