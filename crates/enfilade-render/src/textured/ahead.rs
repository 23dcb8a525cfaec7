//! Textures that are made ahead, for all places where a walker may stand.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::ControlFlow;

use enfilade_cpg::World;
use enfilade_geom::is_rather_level;
use enfilade_runtime::View;
use glam::{DVec3, Vec3};

use super::places::{StandingPlace, standing_places};
use super::plan::{COARSEST, GRAZING, PlanShot, WATCHED, pixels_across};
use crate::frame::{Paint, Style};
use crate::gpu::RenderError;
use crate::portal_texture_file::PortalTextureFileError;
use crate::portal_texture_options::PortalTextureCounts;
use crate::portal_textures::{
    ANCHOR_REACH, AheadTextures, DoorwayId, DoorwayPlace, PortalTextures, PtxEntry, PtxHead,
    PtxWriter, TextureConditions, TextureKey, decode_ptx, millimeters, pack, textured_light,
    textured_world,
};
use crate::studio::Studio;
use crate::viewpoints::FOV;

/// Settings of textures that are made ahead. All others are those of [portal textures](crate::PortalTextureOptions).
#[derive(Clone, Copy, Debug)]
pub struct PortalTextureMaking {
    /// The style of the pictures that they will be part of.
    pub style: Style,
    /// Largest size of the file; the textures wanted from most places are made first. [Units: byte]
    pub max_bytes: u64,
    /// Height of the pictures that they will be part of: doorways that are large there are not textures. [Units: px]
    pub lines: u32,
}

impl Default for PortalTextureMaking {
    /// 64 MiB, for pictures 720 pixels high.
    fn default() -> Self {
        Self {
            style: Style::default(),
            max_bytes: 64 << 20,
            lines: 720,
        }
    }
}

/// Progress of textures that are made ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PortalTextureProgress {
    /// Doorways are looked for.
    Looking {
        /// Places that were looked from.
        done: usize,
        /// All places.
        all: usize,
    },
    /// Textures are drawn; they end with the last, or when the budget is used up.
    Drawing {
        /// Textures drawn.
        done: usize,
        /// Textures wanted.
        all: usize,
        /// Size of the file so far. [Units: byte]
        n_bytes: u64,
    },
}

/// Textures that were made ahead.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MadePortalTextures {
    /// The file, for [`Studio::load_portal_textures`].
    pub bytes: Vec<u8>,
    /// Places that were looked from.
    pub n_places: usize,
    /// Doorways with textures.
    pub n_doorways: usize,
    /// Textures.
    pub n_textures: usize,
    /// Textures left out, because the budget was used up or the making was stopped.
    pub n_left_out: usize,
    /// Textures that cannot be made, because a special portal is in view behind their doorway.
    pub n_special: usize,
}

/// A texture that is wanted.
#[derive(Clone, Copy)]
struct Wanted {
    /// Sum of the weights with which it is part of views.
    weight: f64,
    from: DoorwayPlace,
    /// The first eye that wants it. [Units: wu]
    eye: [f32; 3],
}

/// Textures that are wanted, and the heights of the viewpoints of each doorway.
#[derive(Default)]
struct WantedTextures {
    of: BTreeMap<TextureKey, Wanted>,
    /// [Units: mm]
    anchors: BTreeMap<DoorwayId, Vec<i32>>,
}

impl WantedTextures {
    /// Returns the height of viewpoints for an eye: one that is there already if it is near. [Units: mm]
    fn anchor(&mut self, id: DoorwayId, eye: DoorwayPlace) -> i32 {
        let own = millimeters(eye.at.y);
        let all = self.anchors.entry(id).or_default();
        let near = |a: &i32| a.abs_diff(own) <= ANCHOR_REACH.unsigned_abs() / 2;
        let found = all.iter().copied().find(near);
        found.unwrap_or_else(|| {
            all.push(own);
            own
        })
    }
}

impl Studio {
    /// Makes portal textures for wherever a walker may stand, with doors, lamps, daylight and time of day as they are, and
    /// returns them as a file. `world` is the one from which the studio was made. [`Studio::add_portal_textures`] comes first.
    ///
    /// `progress` ends it early by [`ControlFlow::Break`]; the file has the textures made until then. Doorways in floors and
    /// ceilings are left out.
    ///
    /// # Errors
    ///
    /// If portal textures are off; a budget without room for a file; as [`Studio::picture`].
    #[doc(hidden)]
    pub fn make_portal_textures(
        &mut self,
        world: &World,
        making: &PortalTextureMaking,
        progress: &mut dyn FnMut(PortalTextureProgress) -> ControlFlow<()>,
    ) -> Result<MadePortalTextures, RenderError> {
        let own = self.portal_textures.take();
        let mut own = own.ok_or(PortalTextureFileError::Off)?;
        own.clear();
        // The bound is that of frames.
        let most = std::mem::replace(&mut own.options.max_triangles, u64::MAX);
        let made = self.make_with(&mut own, world, making, progress);
        own.options.max_triangles = most;
        own.clear();
        own.shown.clear();
        own.stops.clear();
        self.viewer.stops_mut().clear();
        self.portal_textures = Some(own);
        made
    }

    /// Loads textures that [were made ahead](Studio::make_portal_textures) to host memory, instead of those loaded before;
    /// returns their number. Those whose doors stand as at the making are taken from there instead of drawn, in frames of
    /// the same style and time of day, and where no lamp has changed since. [`Studio::add_portal_textures`], which drops them,
    /// comes first; lamps and daylight, too.
    ///
    /// # Errors
    ///
    /// If portal textures are off; a file that is damaged, of another version, for another world or light, or of textures
    /// with another side or other viewpoints.
    #[doc(hidden)]
    pub fn load_portal_textures(&mut self, bytes: &[u8]) -> Result<usize, RenderError> {
        let own = self.portal_textures.as_mut();
        let own = own.ok_or(PortalTextureFileError::Off)?;
        let (head, entries) = decode_ptx(bytes)?;
        let (found, wanted) = (head.side, own.options.side);
        let light = textured_light(self.stage.light.is_known(), &self.lamps.lights);
        let refused = if head.world != textured_world(&self.world) {
            Some(PortalTextureFileError::OtherWorld)
        } else if found != wanted {
            Some(PortalTextureFileError::OtherSide { found, wanted })
        } else if head.viewpoints != own.options.viewpoints {
            Some(PortalTextureFileError::OtherViewpoints)
        } else if head.light != light {
            Some(PortalTextureFileError::OtherLight)
        } else {
            None
        };
        if let Some(why) = refused {
            return Err(why.into());
        }
        let lamps = self.lamps.lights.clone();
        let ahead = AheadTextures::new(head.conditions, lamps, entries);
        let n = ahead.len();
        own.clear();
        own.ahead = Some(ahead);
        Ok(n)
    }

    fn make_with(
        &mut self,
        own: &mut PortalTextures,
        world: &World,
        making: &PortalTextureMaking,
        progress: &mut dyn FnMut(PortalTextureProgress) -> ControlFlow<()>,
    ) -> Result<MadePortalTextures, RenderError> {
        let style = self.drawable(Style {
            paint: Paint::Lit,
            ..making.style
        });
        self.follow_state();
        self.follow_sun(&style);
        own.begin(&self.world, &self.state, &style, self.day);
        let head = PtxHead {
            side: own.options.side,
            viewpoints: own.options.viewpoints.clone(),
            world: textured_world(&self.world),
            light: textured_light(self.stage.light.is_known(), &self.lamps.lights),
            conditions: TextureConditions::now(&self.state, &style, self.day),
        };
        let mut file = PtxWriter::new(&head, making.max_bytes)?;
        let places = standing_places(world, &self.sight);
        let mut wanted = WantedTextures::default();
        let mut is_stopped = false;
        for (done, place) in places.iter().enumerate() {
            let all = places.len();
            if progress(PortalTextureProgress::Looking { done, all }).is_break() {
                is_stopped = true;
                break;
            }
            self.look_from(own, place, making.lines, &mut wanted)?;
        }
        let mut wanted: Vec<(TextureKey, Wanted)> = wanted.of.into_iter().collect();
        wanted.sort_by(|a, b| b.1.weight.total_cmp(&a.1.weight).then(a.0.cmp(&b.0)));
        let mut made = MadePortalTextures {
            n_places: places.len(),
            ..MadePortalTextures::default()
        };
        let mut doorways = BTreeSet::new();
        let all = wanted.len();
        for (done, (key, one)) in wanted.iter().enumerate() {
            let n_bytes = file.n_bytes();
            let now = PortalTextureProgress::Drawing { done, all, n_bytes };
            if is_stopped || progress(now).is_break() {
                break;
            }
            let Some(entry) = self.draw_ahead(own, style, *key, one)? else {
                made.n_special += 1;
                continue;
            };
            if !file.add(&entry) {
                break;
            }
            doorways.insert(entry.id);
            made.n_textures += 1;
        }
        made.n_left_out = all - made.n_textures - made.n_special;
        made.n_doorways = doorways.len();
        made.bytes = file.finish();
        Ok(made)
    }

    /// Adds the textures that are wanted from a place.
    fn look_from(
        &mut self,
        own: &mut PortalTextures,
        place: &StandingPlace,
        lines: u32,
        wanted: &mut WantedTextures,
    ) -> Result<(), RenderError> {
        let view = View::around(place.eye)?;
        own.stops.clear();
        own.stops.beyond = own.options.transition_distance * WATCHED;
        let mut tried = BTreeSet::new();
        // As frames do: each round looks on through the doorways that are geometry.
        loop {
            self.viewer.stops_mut().clone_from(&own.stops);
            let seen = self.viewer.see(&self.sight, &self.state, &view);
            let new: Vec<DoorwayId> = seen.stopped().to_vec();
            let mut is_passed = false;
            for id in new {
                if tried.insert(id) && self.is_looked_through(own, place, id, lines, wanted) {
                    own.stops.pass(id.0, id.1);
                    is_passed = true;
                }
            }
            if !is_passed {
                return Ok(());
            }
        }
    }

    /// Adds the textures of a doorway that are wanted from a place. Returns `true` if it may be geometry there.
    fn is_looked_through(
        &self,
        own: &mut PortalTextures,
        place: &StandingPlace,
        id: DoorwayId,
        lines: u32,
        wanted: &mut WantedTextures,
    ) -> bool {
        let far = f64::from(own.options.transition_distance);
        let side = f64::from(own.options.side);
        let viewpoints = own.options.viewpoints.clone();
        let Some(doorway) = own.doorway(&self.world, id).doorway.clone() else {
            return true;
        };
        // A walker's height over its plane changes with each step.
        let is_level = is_rather_level(doorway.axes[2]);
        let mut is_geometry = false;
        for eye in &place.around {
            let at = doorway.place(Vec3::from(*eye).as_dvec3());
            let distance = doorway.distance(at);
            let is_coarse = pixels_across(&doorway, at, FOV, lines) > COARSEST * side;
            let is_near_plane = at.height < GRAZING * distance;
            is_geometry |= distance < far || is_coarse || is_near_plane;
            if distance < far * NEAREST || is_coarse || is_near_plane || is_level {
                continue;
            }
            let mut lattice = at;
            let mut anchor = 0;
            if viewpoints.are_warped() {
                anchor = wanted.anchor(id, at);
                lattice.at.y = f64::from(anchor) * 1e-3;
            }
            let Some(composed) = viewpoints.of(&doorway, lattice, anchor) else {
                continue;
            };
            for (index, weight) in composed.iter() {
                let one = wanted
                    .of
                    .entry((id, Some(index)))
                    .or_insert_with(|| Wanted {
                        weight: 0.0,
                        from: viewpoints.place(&doorway, index),
                        eye: *eye,
                    });
                one.weight += weight;
            }
        }
        is_geometry
    }

    /// Draws a texture and packs it; `None` if it cannot be drawn.
    fn draw_ahead(
        &mut self,
        own: &mut PortalTextures,
        style: Style,
        key: TextureKey,
        one: &Wanted,
    ) -> Result<Option<PtxEntry>, RenderError> {
        let (id, Some(index)) = key else {
            return Ok(None);
        };
        let state = own.doorway(&self.world, id);
        let Some(doorway) = state.doorway.clone().filter(|_| !state.is_special) else {
            return Ok(None);
        };
        let view = View::around(one.eye)?;
        let shot = PlanShot {
            space: None,
            view: &view,
            eye: DVec3::from(one.eye.map(f64::from)),
            fov_y: FOV,
            size: [own.options.side; 2],
            style,
            exposure: if style.daylight {
                self.stage.light.exposure(one.eye.into(), 1.0)
            } else {
                1.0
            },
        };
        // Each frame may replace the textures of the last.
        own.frame += 1;
        let mut counts = PortalTextureCounts::default();
        if !self.draw_texture(own, &shot, key, &doorway, one.from, &mut counts)? {
            return Ok(None);
        }
        let Some(held) = own.held.get(&key) else {
            return Ok(None);
        };
        let texels = own.arrays.read(&self.gpu, held.layer)?;
        let side = own.options.side as usize;
        let packed = pack(&texels, side, own.arrays.is_blue_first());
        Ok(packed.map(|packed| PtxEntry {
            id,
            index,
            exposure: held.exposure,
            n_triangles: counts.n_made_triangles,
            cells: held.cells.clone(),
            packed,
        }))
    }
}

/// Share of the transition distance from which on textures are wanted: a walker comes nearer while one turns into geometry.
const NEAREST: f64 = 0.8;
