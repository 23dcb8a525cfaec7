//! The choice, frame by frame, of portals that become textures, and the making of the textures that they lack.

use std::collections::BTreeSet;

use enfilade_runtime::{SightState, View};
use enfilade_world::{PartId, Place, Pose, Space};
use glam::{DVec3, Vec3};

use crate::camera::Camera;
use crate::frame::Style;
use crate::gpu::RenderError;
use crate::list::{Shot, Sparing};
use crate::portal_texture_options::PortalTextureCounts;
use crate::portal_textures::{
    Component, Doorway, DoorwayId, DoorwayPlace, HeldTexture, PortalTextures, TextureKey,
};
use crate::shown::{DrawnPart, Shown};
use crate::studio::Studio;

/// Share of the transition distance from which on doorways are watched: transitions begun at that distance end before.
pub(super) const WATCHED: f32 = 0.25;

/// Share by which a doorway must be nearer than the transition distance to turn back into geometry: an eye at that distance
/// does not make it turn again and again.
const HYSTERESIS: f64 = 0.9;

/// Pixels of the screen for one of a texture at most, along one side of a doorway. Nearer ones stay geometry.
pub(super) const COARSEST: f64 = 1.0;

/// Least height of an eye over the plane of a doorway, as a share of its distance. Lower ones see nothing of a texture.
pub(super) const GRAZING: f64 = 1e-2;

/// Time ahead for which textures are made if there is nothing else to make. [Units: frames]
const AHEAD: f64 = 20.0;

/// The frame for which textures are planned.
pub(crate) struct PlanShot<'a> {
    pub(crate) space: Option<&'a Space>,
    pub(crate) view: &'a View,
    /// In the frame of the first world. [Units: wu]
    pub(crate) eye: DVec3,
    pub(crate) fov_y: f32,
    pub(crate) size: [u32; 2],
    pub(crate) style: Style,
    pub(crate) exposure: f32,
}

/// A texture that a doorway in view lacks.
struct Lacking {
    id: DoorwayId,
    key: TextureKey,
    from: DoorwayPlace,
    weight: f64,
}

impl Studio {
    /// Chooses the stops and textures of a frame, and makes some textures.
    pub(crate) fn plan_with(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
    ) -> Result<PortalTextureCounts, RenderError> {
        let mut counts = PortalTextureCounts::default();
        self.follow_texture_lamps(own, shot.space);
        let state = state_of(shot.space, &self.state);
        own.begin(&self.world, state, &shot.style, self.day);
        own.stops.clear();
        own.stops.beyond = own.options.transition_distance * WATCHED;
        let mut asked: Vec<DoorwayId> = Vec::new();
        let mut lacking = Vec::new();
        // Each round looks on through the doorways that the last one left as geometry.
        loop {
            self.viewer.stops_mut().clone_from(&own.stops);
            let state = state_of(shot.space, &self.state);
            let seen = self.viewer.see(&self.sight, state, shot.view);
            let new = seen.stopped().iter().filter(|id| !asked.contains(id));
            let new: Vec<DoorwayId> = new.copied().collect();
            let mut is_passed = false;
            for id in new {
                asked.push(id);
                if !self.fills(own, shot, id, &mut lacking, &mut counts)? {
                    own.stops.pass(id.0, id.1);
                    is_passed = true;
                }
            }
            if !is_passed {
                break;
            }
        }
        self.make_lacking(own, shot, lacking, &mut counts)?;
        self.make_ahead(own, shot, &asked, &mut counts)?;
        if own.options.max_triangles < u64::MAX {
            self.bind_triangles(own, shot, &mut counts)?;
        }
        self.viewer.stops_mut().clear();
        own.last_eye = Some(shot.eye);
        own.n_made_triangles = counts.n_made_triangles;
        counts.n_textured = own.shown.len();
        counts.n_held = own.held.len();
        counts.n_bytes = own.n_bytes();
        Ok(counts)
    }

    /// Returns `true` if a doorway is filled by textures in this frame, and composes them.
    fn fills(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        id: DoorwayId,
        lacking: &mut Vec<Lacking>,
        counts: &mut PortalTextureCounts,
    ) -> Result<bool, RenderError> {
        let (frame, last) = (own.frame, own.options.transition_frames);
        let far = f64::from(own.options.transition_distance);
        let side = f64::from(own.options.side);
        let state = own.doorway(&self.world, id);
        let was_shown = std::mem::replace(&mut state.frame, frame) + 1 == frame;
        let (turn, is_special) = (state.turn, state.is_special);
        let Some(doorway) = state.doorway.clone().filter(|_| !is_special) else {
            return Ok(false);
        };
        let eye = doorway.place(shot.eye);
        if !was_shown {
            let ahead = own.anchor_ahead(id, eye);
            own.doorway(&self.world, id).anchor_at(eye, ahead);
        }
        let distance = doorway.distance(eye);
        let is_near = distance < far * if turn == 0 { HYSTERESIS } else { 1.0 };
        let is_coarse = pixels_across(&doorway, eye, shot.fov_y, shot.size[1]) > COARSEST * side;
        let is_geometry = is_near || is_coarse || eye.height < GRAZING * distance;
        let to = if is_geometry { last } else { 0 };
        let turn = if was_shown && own.may_turn(id) {
            to.clamp(turn.saturating_sub(1), turn.saturating_add(1))
        } else {
            to
        };
        own.doorway(&self.world, id).turn = turn;
        if is_geometry && turn >= last {
            return Ok(false);
        }
        let is_made = self.compose(own, shot, id, &doorway, lacking, counts)?;
        // Parts behind it may move, and its own view would stop here.
        let has_guest = |space: &Space, cell| {
            let part = PartId::ROOT;
            !space.guests(Place { part, cell }).is_empty()
        };
        let is_still = shot.space.is_none_or(|space| {
            let mut cells = own.of_doorway(id).flat_map(|held| &held.cells);
            !cells.any(|cell| has_guest(space, *cell))
        });
        if !is_still {
            own.shown.remove(&id);
            return Ok(false);
        }
        if is_made && turn > 0 {
            self.turn(own, shot, id, &doorway, eye, counts)?;
        }
        Ok(is_made)
    }

    /// Composes a doorway of the textures that there are, and of one that is made if there is none. Returns `true` if there
    /// is one.
    fn compose(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        id: DoorwayId,
        doorway: &Doorway,
        lacking: &mut Vec<Lacking>,
        counts: &mut PortalTextureCounts,
    ) -> Result<bool, RenderError> {
        let eye = doorway.place(shot.eye);
        let viewpoints = own.options.viewpoints.clone();
        let state = own.doorway(&self.world, id);
        let Some(composed) = viewpoints.of(doorway, state.lattice_place(eye), state.anchor) else {
            return Ok(false);
        };
        let mut components = Vec::new();
        let mut missing = Vec::new();
        for (index, weight) in composed.iter() {
            let key = (id, Some(index));
            if let Some(held) = own.want(key) {
                components.push(component(held, weight));
            } else {
                let from = viewpoints.place(doorway, index);
                missing.push(Lacking {
                    id,
                    key,
                    from,
                    weight,
                });
            }
        }
        missing.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let mut missing = missing.into_iter();
        // A viewpoint with hardly any weight cannot stand in for the others.
        let is_enough = |components: &[Component]| {
            components.iter().map(|c| c.weight).sum::<f64>() >= LEAST_WEIGHT
        };
        while !is_enough(&components) {
            let Some(first) = missing.next() else { break };
            if !self.make(own, shot, first.key, doorway, first.from, counts)? {
                return Ok(false);
            }
            if let Some(held) = own.want(first.key) {
                components.push(component(held, first.weight));
            }
        }
        lacking.extend(missing);
        own.shown.insert(id, components);
        Ok(is_enough(&own.shown[&id]))
    }

    /// Makes the texture of a transition, and mixes it into the doorway.
    fn turn(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        id: DoorwayId,
        doorway: &Doorway,
        eye: DoorwayPlace,
        counts: &mut PortalTextureCounts,
    ) -> Result<(), RenderError> {
        let turn = own.doorway(&self.world, id).turn;
        let share = f64::from(turn) / f64::from(own.options.transition_frames.max(1));
        let is_warped = own.options.viewpoints.are_warped();
        let parts = own.shown.get(&id).cloned().unwrap_or_default();
        let heaviest = |a: &&Component, b: &&Component| a.weight.total_cmp(&b.weight);
        let Some(first) = parts.iter().max_by(heaviest) else {
            return Ok(());
        };
        // Warped textures are where they belong already; flat ones move there with their viewpoint.
        let from = if is_warped {
            eye
        } else {
            first.from.lerp(eye, share)
        };
        if !self.draw_texture(own, shot, (id, None), doorway, from, counts)? {
            return Ok(());
        }
        counts.n_turning += 1;
        let Some(held) = own.want((id, None)) else {
            return Ok(());
        };
        let mut mixed = Vec::new();
        if is_warped {
            let total: f64 = parts.iter().map(|c| c.weight).sum();
            // At the first moment, weights are exactly those of the texture.
            mixed.extend(parts.iter().map(|c| Component {
                weight: c.weight * (1.0 - share),
                ..*c
            }));
            mixed.push(component(held, share * total));
        } else {
            mixed.push(component(held, 1.0));
        }
        own.shown.insert(id, mixed);
        Ok(())
    }

    /// Makes the missing textures of doorways in view, the weightiest first.
    fn make_lacking(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        mut lacking: Vec<Lacking>,
        counts: &mut PortalTextureCounts,
    ) -> Result<(), RenderError> {
        lacking.sort_by(|a, b| b.weight.total_cmp(&a.weight).then(a.id.cmp(&b.id)));
        for one in lacking {
            let Some(doorway) = own.doorways.get(&one.id).and_then(|d| d.doorway.clone()) else {
                continue;
            };
            if !own.shown.contains_key(&one.id) {
                continue;
            }
            if !self.make(own, shot, one.key, &doorway, one.from, counts)? {
                return Ok(());
            }
            // A texture enters with the weight that it has, which is least for the last.
            if let (Some(held), Some(shown)) = (
                own.held.get(&one.key).cloned(),
                own.shown.get_mut(&one.id).filter(|s| s.len() < 4),
            ) {
                shown.push(component(&held, one.weight));
            }
        }
        Ok(())
    }

    /// Makes textures for where the eye will be soon, if the frame's share is not used up.
    fn make_ahead(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        asked: &[DoorwayId],
        counts: &mut PortalTextureCounts,
    ) -> Result<(), RenderError> {
        let Some(last) = own.last_eye else {
            return Ok(());
        };
        let step = shot.eye - last;
        // A leap is not a motion.
        if step.length() > 1.0 {
            return Ok(());
        }
        let viewpoints = own.options.viewpoints.clone();
        for share in [0.5, 1.0] {
            let soon = shot.eye + step * (AHEAD * share);
            for id in asked
                .iter()
                .filter(|id| own.shown.contains_key(id))
                .copied()
                .collect::<Vec<_>>()
            {
                let state = own.doorway(&self.world, id);
                let Some(doorway) = state.doorway.clone() else {
                    continue;
                };
                let place = state.lattice_place(doorway.place(soon));
                let Some(composed) = viewpoints.of(&doorway, place, state.anchor) else {
                    continue;
                };
                for (index, _) in composed.iter() {
                    let key = (id, Some(index));
                    if own.held.contains_key(&key) {
                        continue;
                    }
                    let from = viewpoints.place(&doorway, index);
                    if !self.make(own, shot, key, &doorway, from, counts)? {
                        return Ok(());
                    }
                }
            }
        }
        Ok(())
    }

    /// Turns more portals into textures, or into one color, until the bound on triangles holds.
    fn bind_triangles(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        counts: &mut PortalTextureCounts,
    ) -> Result<(), RenderError> {
        let mut n_more = 1;
        let mut stopped = BTreeSet::new();
        loop {
            self.viewer.stops_mut().clone_from(&own.stops);
            let state = state_of(shot.space, &self.state);
            let seen = self.viewer.see(&self.sight, state, shot.view);
            let visits = seen.visits().iter();
            let ways: Vec<DoorwayId> = visits.filter_map(|v| Some((v.via?, v.cell))).collect();
            let own_shot = Shot {
                view: shot.view,
                state,
                size: shot.size,
                has_scissors: true,
            };
            let list = self
                .lister
                .seen(&self.world, &self.sight, &seen, &own_shot, &self.sparing);
            if list.n_triangles() + counts.n_made_triangles <= own.options.max_triangles {
                return Ok(());
            }
            // The farthest first.
            let mut passed: Vec<(f64, DoorwayId)> = Vec::new();
            for id in ways {
                if stopped.contains(&id) {
                    continue;
                }
                let Some(doorway) = own.doorway(&self.world, id).doorway.clone() else {
                    continue;
                };
                let eye = doorway.place(shot.eye);
                passed.push((doorway.distance(eye), id));
            }
            if passed.is_empty() {
                return Ok(());
            }
            passed.sort_by(|a, b| b.0.total_cmp(&a.0));
            passed.dedup_by_key(|p| p.1);
            for (_, id) in passed.into_iter().take(n_more) {
                stopped.insert(id);
                own.stops.stop(id.0, id.1);
                let Some(doorway) = own.doorway(&self.world, id).doorway.clone() else {
                    continue;
                };
                let is_special = own.doorway(&self.world, id).is_special;
                let mut none = Vec::new();
                let is_made =
                    !is_special && self.compose(own, shot, id, &doorway, &mut none, counts)?;
                if !is_made {
                    own.shown.remove(&id);
                    counts.n_plain += 1;
                }
            }
            n_more *= 2;
        }
    }

    /// Makes a texture unless the frame's share is used up: takes one that was made ahead, or draws it. Returns `true` if it
    /// was made.
    fn make(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        key: TextureKey,
        doorway: &Doorway,
        from: DoorwayPlace,
        counts: &mut PortalTextureCounts,
    ) -> Result<bool, RenderError> {
        // A texture that was made ahead counts half.
        let used = 2 * counts.n_made + counts.n_loaded;
        let rest = (2 * own.options.max_made as usize).saturating_sub(used);
        if rest >= 1 && own.load(&self.gpu, &self.world, key, from) {
            counts.n_loaded += 1;
            return Ok(true);
        }
        if rest < 2 {
            return Ok(false);
        }
        let is_made = self.draw_texture(own, shot, key, doorway, from, counts)?;
        counts.n_made += usize::from(is_made);
        Ok(is_made)
    }

    /// Draws a texture to a free layer. Returns `false` if there is none, if the bound on triangles would not hold, or if a
    /// special portal is in view.
    pub(super) fn draw_texture(
        &mut self,
        own: &mut PortalTextures,
        shot: &PlanShot<'_>,
        key: TextureKey,
        doorway: &Doorway,
        from: DoorwayPlace,
        counts: &mut PortalTextureCounts,
    ) -> Result<bool, RenderError> {
        let side = [own.options.side; 2];
        let Ok(view) = doorway.view(from) else {
            return Ok(false);
        };
        self.viewer.stops_mut().clear();
        let state = state_of(shot.space, &self.state);
        let seen = (self.viewer).see_from(&self.sight, state, &view, doorway.into);
        if !seen.specials().is_empty() {
            own.doorway(&self.world, key.0).is_special = true;
            return Ok(false);
        }
        let mut cells: Box<[_]> = seen.cells().into();
        cells.sort_unstable();
        let of_texture = Shot {
            view: &view,
            state,
            size: side,
            has_scissors: true,
        };
        let sparing = Sparing {
            lod: self.sparing.lod,
            ..Sparing::default()
        };
        (self.lister).seen(&self.world, &self.sight, &seen, &of_texture, &sparing);
        let mut list = self.lister.take();
        list.leave_out_glass_of(&self.world, doorway.before);
        own.doorway(&self.world, key.0).n_behind = list.n_triangles();
        // Half of the bound is left for what is not a texture.
        let rest = (own.options.max_triangles / 2).saturating_sub(counts.n_made_triangles);
        if list.n_triangles() > rest {
            self.lister.give(list);
            return Ok(false);
        }
        let Some(layer) = own.free_layer() else {
            self.lister.give(list);
            return Ok(false);
        };
        counts.n_made_triangles += list.n_triangles();
        let projection = doorway.projection(from);
        let lamps = self.active_lamps(shot.space, &shot.style, projection.exact_origin(), None);
        let shown = Shown {
            projection,
            pose: Pose::IDENTITY,
            style: shot.style,
            marks: &[],
            props: &[],
            lamps: &lamps,
            exposure: shot.exposure,
            day: self.day,
            textures: None,
        };
        let mut part = [DrawnPart {
            id: PartId::ROOT,
            world: &self.world,
            stage: &mut self.stage,
            list: &list,
        }];
        std::mem::swap(&mut self.renderer.targets, &mut own.arrays.targets);
        let color = own.arrays.color(layer);
        let drawn = (self.renderer).draw(&self.gpu, &mut part, &shown, color, side);
        std::mem::swap(&mut self.renderer.targets, &mut own.arrays.targets);
        self.lister.give(list);
        drawn?;
        let globals = &self.stage.first().globals.group;
        own.arrays.store_depth(&self.gpu, globals, layer);
        let exposure = shot.exposure;
        own.put(
            key,
            HeldTexture {
                layer,
                from,
                exposure,
                cells,
            },
        );
        Ok(true)
    }
}

/// Least sum of the weights of the textures that a doorway is composed of; while there is less, it stays geometry.
const LEAST_WEIGHT: f64 = 0.25;

fn component(held: &HeldTexture, weight: f64) -> Component {
    Component {
        layer: held.layer,
        from: held.from,
        weight,
        exposure: held.exposure,
    }
}

pub(crate) fn state_of<'a>(space: Option<&'a Space>, own: &'a SightState) -> &'a SightState {
    space.map_or(own, |space| space.state(PartId::ROOT))
}

/// Returns the extent of a doorway on a screen of an angle and a number of lines, along its longer side. [Units: px]
pub(super) fn pixels_across(doorway: &Doorway, eye: DoorwayPlace, fov_y: f32, lines: u32) -> f64 {
    let size = doorway.high - doorway.low;
    let per_meter = f64::from(lines) / (2.0 * (f64::from(fov_y) * 0.5).tan());
    // Seen from the side, it is narrower.
    let facing = (eye.height / doorway.distance(eye).max(1e-6)).min(1.0);
    let wide = (size.x * facing).max(size.y);
    per_meter * wide / doorway.distance(eye).max(1e-6)
}

/// Returns the eye of a camera in the frame of the first world.
pub(crate) fn eye_of(space: Option<&Space>, frame: PartId, camera: &Camera) -> DVec3 {
    let eye = Vec3::from(camera.eye).as_dvec3();
    space.map_or(eye, |space| space.pose(frame).point(eye))
}
