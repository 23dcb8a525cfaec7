//! Contents of pictures through special portals: contexts as a tree of draws.
//!
//! A context that is seen in the first pass of a special portal is drawn into the same picture, into the region of the special
//! portal's polygon, by the camera moved by the context's map and clipped to beyond the polygon's plane: depths are continuous
//! there. A later pass, which is blended over the first, and the picture of a monitor are pictures of their own, drawn before
//! the one that shows them.
//!
//! A picture holds at most [127 regions](MOST_REGIONS). What is beyond this limit, or was
//! [not looked into](enfilade_world::SpaceSeen::stopped_specials), is filled with one color, or left out if it would be blended over
//! something. The counts tell. Of a later pass the rectangle around the special portal is kept, so that the memory of all pictures
//! is bounded by [`max_apart`](enfilade_world::SpecialOptions::max_apart).

mod draw;

use std::collections::HashMap;
use std::ops::Range;

use enfilade_cpg::{Pass, SpecialId, Way};
use enfilade_geom::{DVec3, Similarity};
use enfilade_world::{PartId, Pose, SeenContext, Space, SpaceSeen};

use crate::camera::Projection;
use crate::gpu::RenderError;
use crate::list::{RenderList, Scissor, Shot, Sparing};
use crate::panes::{Pane, PaneCorner};
use crate::pipelines::REGION;
use crate::space::{SpaceCounts, SpaceShot, view_in};
use crate::stage::NO_GATE;
use crate::studio::{Studio, world_of};

/// Most contexts drawn into one picture beside its own.
const MOST_REGIONS: u32 = REGION;
/// Step of the sizes of textures that keep a part of a picture. [Units: px]
const ROOM_STEP: u32 = 64;
/// Height of the pictures of the smallest monitors. [Units: px]
const LEAST_HEIGHT: u32 = 32;
/// Linear color of a monitor that shows nothing.
const OFF: [f32; 3] = [0.01; 3];

/// The draws of a frame with special portals.
pub(crate) struct Tree {
    /// Parents before children.
    nodes: Vec<Node>,
    /// Each after those that show it.
    pictures: Vec<TreePicture>,
    corners: Vec<PaneCorner>,
    n_left_out: usize,
}

/// A context of a picture.
struct Node {
    picture: usize,
    /// Its number in the stencil; 0 for the picture's own.
    region: u32,
    /// The context of the same picture in which it is seen.
    parent: Option<usize>,
    parts: Vec<NodePart>,
    faces: Vec<Face>,
    scissor: Scissor,
    /// The projection in the frame of its view, and that frame's pose.
    sky: (Projection, Pose),
}

/// A world in a context.
struct NodePart {
    id: PartId,
    /// Index of [`RenderStage::views`](crate::stage::RenderStage::views).
    view: usize,
    projection: Projection,
    gate: [f32; 4],
    list: RenderList,
}

/// A special portal in view of a context.
struct Face {
    /// Index in [`Node::parts`].
    part: usize,
    distance: f32,
    first: Layer,
    later: Vec<Layer>,
}

/// One pass of a special portal.
struct Layer {
    content: Content,
    /// True if it changes what it shows.
    is_tinted: bool,
    corners: Range<u32>,
}

#[derive(Clone, Copy, PartialEq)]
enum Content {
    /// The cell behind it, drawn already.
    Through,
    /// A node of the same picture.
    Node(usize),
    /// A picture of the same camera.
    Seen(usize),
    /// A picture of a monitor's camera.
    Monitor(usize),
    /// The color of its vertices.
    Color,
}

struct TreePicture {
    size: [u32; 2],
    /// In the frame of its own view.
    projection: Projection,
    pose: Pose,
    exposure: f32,
    /// The part of it that is shown.
    kept: Scissor,
    n_regions: u32,
}

impl TreePicture {
    /// Returns `true` if only a part of it is shown.
    fn is_cut(&self) -> bool {
        self.kept != [0, 0, self.size[0], self.size[1]]
    }

    /// Returns the size of the texture that keeps it, in steps, so that those of one frame serve the next.
    fn room(&self) -> [u32; 2] {
        let [.., w, h] = self.kept;
        let step = |n: u32, most: u32| n.max(1).next_multiple_of(ROOM_STEP).min(most);
        if self.is_cut() {
            [step(w, self.size[0]), step(h, self.size[1])]
        } else {
            self.size
        }
    }
}

/// Key of a context: that of its parent, part, special portal, pass.
type ViaKey = (usize, PartId, SpecialId, usize);

impl Studio {
    /// Lists the draws of an answer; `None` if no special portal is in view. `is_whole` draws everything of all parts in
    /// the direct view.
    pub(crate) fn tree(
        &mut self,
        shot: &SpaceShot<'_>,
        answer: SpaceSeen<'_>,
        is_whole: bool,
        size: [u32; 2],
    ) -> Result<Option<Tree>, RenderError> {
        let projection = shot.camera.projection(size[0] as f32 / size[1] as f32)?;
        let mut tree = Tree {
            nodes: Vec::new(),
            pictures: vec![TreePicture {
                size,
                projection,
                pose: *shot.space.pose(shot.frame),
                exposure: self.exposure(shot, shot.frame, projection.exact_origin()),
                kept: [0, 0, size[0], size[1]],
                n_regions: 0,
            }],
            corners: Vec::new(),
            n_left_out: answer.stopped_specials().len(),
        };
        let mut children: HashMap<ViaKey, usize> = HashMap::new();
        let mut node_of: Vec<Option<usize>> = Vec::new();
        for (index, context) in answer.contexts().enumerate() {
            let node =
                self.add_node(&mut tree, shot, &context, &node_of, is_whole && index == 0)?;
            tree.n_left_out += usize::from(node.is_none());
            node_of.push(node);
            if let (Some(via), Some(node)) = (context.via(), node) {
                children.insert((via.parent, via.part, via.special, via.pass), node);
            }
        }
        for (index, context) in answer.contexts().enumerate() {
            if let Some(node) = node_of[index] {
                self.add_faces(
                    &mut tree,
                    shot.space,
                    &context,
                    (index, node),
                    &children,
                    answer,
                );
            }
        }
        let has_faces = tree.nodes.iter().any(|node| !node.faces.is_empty());
        Ok(has_faces.then_some(tree))
    }

    /// Adds the node of a context; `None` if it is beyond a limit.
    fn add_node(
        &mut self,
        tree: &mut Tree,
        shot: &SpaceShot<'_>,
        context: &SeenContext<'_>,
        node_of: &[Option<usize>],
        is_whole: bool,
    ) -> Result<Option<usize>, RenderError> {
        let space = shot.space;
        let frame = context.frame();
        let (mut picture, mut parent) = (0, None);
        if let Some(via) = context.via() {
            let Some(above) = node_of[via.parent] else {
                return Ok(None);
            };
            let side = &space.world(via.part).graph.specials[via.special.idx()];
            let own = &tree.pictures[tree.nodes[above].picture];
            let made = match &side.passes[via.pass].way {
                Way::Monitor(camera) => {
                    let [_, right, up] = space.layout(via.part).special_rectangle(via.special);
                    let aspect = (right.length() / up.length()) as f32;
                    let Some(projection) = Projection::of_monitor(camera, aspect) else {
                        return Ok(None);
                    };
                    let height = monitor_height(tree, space, above, via.part, via.special);
                    let width = (height as f32 * aspect).round().clamp(1.0, 4096.0);
                    let eye = projection.exact_origin();
                    Some(TreePicture {
                        size: [width as u32, height],
                        projection,
                        pose: *space.pose(via.part),
                        exposure: self.exposure(shot, via.part, eye),
                        kept: [0, 0, width as u32, height],
                        n_regions: 0,
                    })
                }
                _ if via.pass > 0 => Some(TreePicture {
                    kept: scissor(context.rectangle(), own.size),
                    n_regions: 0,
                    ..*own
                }),
                _ => None,
            };
            if let Some(made) = made {
                if self.gpu.check_picture(made.size).is_err() {
                    return Ok(None);
                }
                picture = tree.pictures.len();
                tree.pictures.push(made);
            } else {
                picture = tree.nodes[above].picture;
                let own = &mut tree.pictures[picture];
                if own.n_regions == MOST_REGIONS {
                    return Ok(None);
                }
                own.n_regions += 1;
                parent = Some(above);
            }
        }
        let own = &tree.pictures[picture];
        let (size, base, region) = (own.size, own.projection, own.n_regions);
        let region = if parent.is_some() { region } else { 0 };
        let mut parts = Vec::new();
        for (id, list) in self.context_lists(space, context, size, is_whole) {
            let to_frame: Similarity = space.between(id, frame).into();
            let tolerance = space.layout(id).tolerance();
            let gate = context.plane().map_or(NO_GATE, |(n, h)| {
                let n = to_frame.turn.conjugate() * n;
                // A wall in the plane itself is before it.
                let h = h + 2.0 * tolerance + 4e-7 * h.abs();
                n.as_vec3().extend(h as f32).to_array()
            });
            let is_same = |n: &&Node| n.picture == picture && n.parts.iter().any(|p| p.id == id);
            parts.push(NodePart {
                id,
                view: tree.nodes.iter().filter(is_same).count(),
                projection: base.of_appearing(&context.map().after(&to_frame)),
                gate,
                list,
            });
        }
        tree.nodes.push(Node {
            picture,
            region,
            parent,
            parts,
            faces: Vec::new(),
            scissor: scissor(context.rectangle(), size),
            sky: (base.of_appearing(context.map()), *space.pose(frame)),
        });
        Ok(Some(tree.nodes.len() - 1))
    }

    /// Lists the draws of each part in view of a context.
    fn context_lists(
        &mut self,
        space: &Space,
        context: &SeenContext<'_>,
        size: [u32; 2],
        is_whole: bool,
    ) -> Vec<(PartId, RenderList)> {
        if is_whole {
            let ids = (0..space.n_parts() as u32).map(PartId);
            let lists = ids.map(|id| (id, self.everything_of(Some(space), id)));
            return lists.collect();
        }
        let sparing = Sparing {
            stop_below: 0.0,
            ..self.sparing
        };
        let lists = context.parts().map(|(id, seen)| {
            let world = world_of(&self.world, &self.parts, id);
            let own = view_in(space, id, context.frame(), context.view());
            let of_part = Shot {
                view: &own,
                state: space.state(id),
                size,
                has_scissors: true,
            };
            (self.lister).seen(world, space.sight(id), &seen, &of_part, &sparing);
            (id, self.lister.take())
        });
        lists.collect()
    }

    /// Adds the special portals in view of a node.
    fn add_faces(
        &self,
        tree: &mut Tree,
        space: &Space,
        context: &SeenContext<'_>,
        (index, node): (usize, usize),
        children: &HashMap<ViaKey, usize>,
        answer: SpaceSeen<'_>,
    ) {
        for (id, seen) in context.parts() {
            let graph = &space.world(id).graph;
            let part = tree.nodes[node].parts.iter().position(|p| p.id == id);
            let Some(part) = part.filter(|_| !graph.specials.is_empty()) else {
                continue;
            };
            let counts = seen.counts();
            let is_everywhere = counts.is_eye_lost || counts.is_capped;
            let is_seen = |special: &SpecialId| {
                let cell = graph.specials[special.idx()].cell;
                is_everywhere || seen.cells().contains(&cell)
            };
            for special in graph.special_ids().filter(is_seen) {
                if !context.never_meets(space, id, special) {
                    self.add_face(
                        tree,
                        space,
                        context,
                        (node, part),
                        index,
                        id,
                        special,
                        children,
                        answer,
                    );
                }
            }
        }
    }

    /// Adds a special portal as a part of a node sees it, unless it shows nothing of its own.
    #[expect(
        clippy::too_many_arguments,
        reason = "one place of a tree, and the answer that it is made from"
    )]
    fn add_face(
        &self,
        tree: &mut Tree,
        space: &Space,
        context: &SeenContext<'_>,
        (node, part): (usize, usize),
        index: usize,
        id: PartId,
        special: SpecialId,
        children: &HashMap<ViaKey, usize>,
        answer: SpaceSeen<'_>,
    ) {
        let pane = pane_of(tree, space, (node, part), context, special);
        if pane.height() < -2.0 * pane.tolerance {
            return;
        }
        let key = |pass| (index, id, special, pass);
        let side = &space.world(id).graph.specials[special.idx()];
        let child = |pass: usize, it: &Pass| {
            let node = *children.get(&key(pass))?;
            Some(match it.way {
                Way::Monitor(_) => Content::Monitor(tree.nodes[node].picture),
                _ if pass > 0 => Content::Seen(tree.nodes[node].picture),
                _ => Content::Node(node),
            })
        };
        let first = match &side.passes[0].way {
            Way::Through => Some(Content::Through),
            way => child(0, &side.passes[0]).or_else(|| {
                let is_shut = match way {
                    Way::Lead { to, .. } => space.state(id).is_locked(*to),
                    Way::Monitor(_) => true,
                    _ => false,
                };
                // Those that are left out are in view; of others, nothing is.
                (is_shut || is_left_out(answer, key(0))).then_some(Content::Color)
            }),
        };
        let Some(first) = first else { return };
        let mut layers = Vec::new();
        for (pass, it) in side.passes.iter().enumerate() {
            let content = if pass == 0 {
                Some(first)
            } else {
                child(pass, it)
            };
            let Some(content) = content else { continue };
            let mut color = it.tint;
            if content == Content::Color {
                let looks = &world_of(&self.world, &self.parts, id).cell_looks;
                let to = side.leads_to().map_or(side.cell, |(to, _)| to);
                let look = match it.way {
                    Way::Monitor(_) => OFF,
                    _ => looks.get(to.idx()).copied().unwrap_or_default(),
                };
                for k in 0..3 {
                    color[k] *= look[k];
                }
            }
            if pass == 0 {
                color[3] = 1.0;
            }
            let corners = match content {
                Content::Seen(picture) => pane.corners_at(color, tree.pictures[picture].kept),
                _ => pane.corners(color),
            };
            layers.push((content, it.tint[..3] != [1.0; 3], corners));
        }
        let eye = pane.projection.exact_origin();
        let distance = pane.opening.center().distance(eye) as f32;
        if layers[0].2.is_empty() {
            return;
        }
        let mut layers = layers.into_iter().map(|(content, is_tinted, corners)| {
            let start = tree.corners.len() as u32;
            tree.corners.extend(corners);
            Layer {
                content,
                is_tinted,
                corners: start..tree.corners.len() as u32,
            }
        });
        let Some(first) = layers.next() else { return };
        let later: Vec<Layer> = layers.collect();
        if first.content == Content::Through && !first.is_tinted && later.is_empty() {
            return;
        }
        tree.nodes[node].faces.push(Face {
            part,
            distance,
            first,
            later,
        });
    }
}

/// Returns `true` if a pass of a special portal is in view, and too small or one too many.
fn is_left_out(answer: SpaceSeen<'_>, key: ViaKey) -> bool {
    let stopped = answer.stopped_specials().iter().map(|s| s.via);
    let mut all = stopped.chain(answer.contexts().filter_map(|c| c.via()));
    all.any(|v| (v.parent, v.part, v.special, v.pass) == key)
}

/// Returns the polygon of a special portal as a part of a node sees it.
fn pane_of<'a>(
    tree: &'a Tree,
    space: &'a Space,
    (node, part): (usize, usize),
    context: &SeenContext<'_>,
    special: SpecialId,
) -> Pane<'a> {
    let own = &tree.nodes[node].parts[part];
    let layout = space.layout(own.id);
    let to_frame = space.between(own.id, context.frame());
    Pane {
        opening: layout.special_opening(special),
        rectangle: layout.special_rectangle(special),
        projection: &own.projection,
        gate: (context.plane()).map(|(n, h)| (to_frame.turn.conjugate() * n, h)),
        tolerance: layout.tolerance(),
    }
}

/// Returns the height of a monitor's picture: a power of two, at least that of the monitor as a node sees it, and at most
/// about that of the node's picture. [Units: px]
fn monitor_height(
    tree: &Tree,
    space: &Space,
    node: usize,
    part: PartId,
    special: SpecialId,
) -> u32 {
    let node = &tree.nodes[node];
    let size = tree.pictures[node.picture].size;
    let whole = size[1].next_power_of_two().min(2048);
    let Some(own) = node.parts.iter().find(|p| p.id == part) else {
        return LEAST_HEIGHT;
    };
    let [corner, right, up] = space.layout(part).special_rectangle(special);
    let eye = own.projection.exact_origin();
    let place = |p: DVec3| {
        let q = own.projection.clip_from_relative * (p - eye).as_vec3().extend(1.0);
        (q.w > 1e-3).then(|| [q.x / q.w * size[0] as f32, q.y / q.w * size[1] as f32])
    };
    let mut most = 0.0_f32;
    for (from, to) in [(corner, corner + up), (corner + right, corner + right + up)] {
        let (Some(a), Some(b)) = (place(from), place(to)) else {
            return whole;
        };
        most = most.max((a[0] - b[0]).hypot(a[1] - b[1]) * 0.5);
    }
    (most.ceil().clamp(1.0, 2048.0) as u32)
        .next_power_of_two()
        .clamp(LEAST_HEIGHT.min(whole), whole)
}

/// Returns the pixels of a part of the screen, with a margin for rounding.
fn scissor([left, bottom, right, top]: [f64; 4], size: [u32; 2]) -> Scissor {
    let [w, h] = size.map(f64::from);
    let low = |x: f64, n: f64| ((x * 0.5 + 0.5) * n - 1.0).floor().clamp(0.0, n) as u32;
    let high = |x: f64, n: f64| ((x * 0.5 + 0.5) * n + 1.0).ceil().clamp(0.0, n) as u32;
    let (x0, x1) = (low(left, w), high(right, w));
    let (y0, y1) = (low(-top, h), high(-bottom, h));
    [x0, y0, x1.saturating_sub(x0), y1.saturating_sub(y0)]
}

impl Tree {
    /// Returns the contents of the frame.
    pub(crate) fn counts(&self) -> SpaceCounts {
        let mut parts: Vec<PartId> = self.parts().collect();
        parts.sort_unstable();
        parts.dedup();
        let lists = || {
            self.nodes
                .iter()
                .flat_map(|n| n.parts.iter().map(|p| &p.list))
        };
        SpaceCounts {
            n_parts: parts.len(),
            n_triangles: lists().map(RenderList::n_triangles).sum(),
            n_draws: lists().map(RenderList::n_draws).sum(),
            n_contexts: self.nodes.len(),
            n_left_out: self.n_left_out,
        }
    }

    /// Returns `true` if layers are blended over each other.
    fn blends(&self) -> bool {
        let faces = || self.nodes.iter().flat_map(|n| &n.faces);
        faces().any(|f| f.first.is_tinted || !f.later.is_empty())
    }

    fn parts(&self) -> impl Iterator<Item = PartId> {
        self.nodes.iter().flat_map(|n| n.parts.iter().map(|p| p.id))
    }

    /// Returns a node's children in the same picture, with the special portals in which they are seen.
    fn children(&self, node: usize) -> impl Iterator<Item = (usize, &Face)> {
        self.nodes[node]
            .faces
            .iter()
            .filter_map(|face| match face.first.content {
                Content::Node(child) => Some((child, face)),
                _ => None,
            })
    }
}
