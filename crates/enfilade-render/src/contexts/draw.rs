//! Drawing of a tree of contexts, picture by picture.

use enfilade_world::PartId;

use super::{Content, Face, Layer, Node, Tree, TreePicture};
use crate::context_targets::ContextTarget;
use crate::formats::{BLENDED, COLOR};
use crate::frame::Paint;
use crate::gpu::{Gpu, RenderError};
use crate::panes::{PanePicture, PanePipelines};
use crate::pipelines::CHOSEN;
use crate::props::PropDraw;
use crate::renderer::Renderer;
use crate::resources::color_attachment;
use crate::shadings::Shadings;
use crate::shown::{PartView, Shown};
use crate::stage::{Exposed, Globals, GlobalsBuffer, StagedWorld};

/// The choices of pipelines of a node, by part.
type NodeShadings = Vec<Shadings>;

/// A picture being drawn.
struct Drawing<'a> {
    tree: &'a Tree,
    worlds: &'a [StagedWorld<'a>],
    shadings: &'a [(usize, NodeShadings)],
    /// Props by part.
    props: &'a [(PartId, Vec<PropDraw>)],
    /// The pictures of the tree, by number.
    pictures: &'a [usize],
    panes: &'a PanePipelines,
    size: [u32; 2],
}

/// The pictures of a frame that depend on each other, ready to be drawn.
struct DrawnTree<'a> {
    tree: &'a Tree,
    /// Format of the last picture.
    format: wgpu::TextureFormat,
    props: &'a [(PartId, Vec<PropDraw>)],
    /// Index of the texture of each picture but the last.
    pictures: &'a [usize],
}

impl Renderer {
    /// Draws a tree to `output`, a texture of the renderer's format and of the size of its first picture. `worlds` by part.
    pub(crate) fn draw_tree(
        &mut self,
        gpu: &Gpu,
        worlds: &mut [StagedWorld<'_>],
        tree: &Tree,
        shown: &Shown<'_>,
        output: &wgpu::TextureView,
    ) -> Result<(), RenderError> {
        let mut ids: Vec<PartId> = tree.parts().collect();
        ids.sort_unstable();
        ids.dedup();
        for id in &ids {
            let light = &mut worlds[id.0 as usize].1.light;
            self.lamps.write_lit(gpu, *id, shown.lamps, light);
        }
        let props = self.props.write(gpu, shown.props, ids.iter().copied());
        let props: Vec<(PartId, Vec<PropDraw>)> = ids.into_iter().zip(props).collect();
        let corners = bytemuck::cast_slice(&tree.corners);
        self.contexts.corners.write(gpu, corners);
        let format = if tree.blends() && shown.style.paint != Paint::Overdraw {
            BLENDED
        } else {
            self.format()
        };
        for format in [COLOR, self.format(), format] {
            self.contexts.prepare(gpu, &self.layouts, format);
        }
        let sizes = tree.pictures[1..].iter().map(TreePicture::room);
        let pictures = (self.contexts).place(gpu, &self.layouts, format, sizes);
        let drawn = DrawnTree {
            tree,
            format,
            props: &props,
            pictures: &pictures,
        };
        for picture in (0..tree.pictures.len()).rev() {
            gpu.check_picture(tree.pictures[picture].size)?;
            self.draw_tree_picture(gpu, worlds, &drawn, picture, shown, output);
        }
        Ok(())
    }

    fn draw_tree_picture(
        &mut self,
        gpu: &Gpu,
        worlds: &mut [StagedWorld<'_>],
        &DrawnTree {
            tree,
            format,
            props,
            pictures,
        }: &DrawnTree<'_>,
        picture: usize,
        shown: &Shown<'_>,
        output: &wgpu::TextureView,
    ) {
        let own = &tree.pictures[picture];
        let size = own.size;
        let exposed = Exposed {
            style: &shown.style,
            size,
            sun: self.sun,
            exposure: own.exposure,
            day: shown.day,
            lamps: shown.lamps,
        };
        let globals = Globals::new(&own.projection, &own.pose, &exposed);
        self.camera.write(gpu, &globals);
        let is_its = |(_, node): &(usize, &Node)| node.picture == picture;
        let nodes: Vec<(usize, &Node)> = tree.nodes.iter().enumerate().filter(is_its).collect();
        let blends = format == BLENDED;
        let shadings = self.prepare_nodes(gpu, worlds, &nodes, &exposed, props, blends);
        let marks = (picture == 0).then(|| self.write_marks(gpu, &[], shown, size));
        self.contexts.resize(gpu, &self.layouts, size);
        let is_rounded = picture == 0 && format != self.format();
        if own.is_cut() || is_rounded {
            self.contexts.add_whole(gpu, &self.layouts, format);
        }
        let Some(targets) = self.contexts.targets.last() else {
            return;
        };
        let is_count = shown.style.paint == Paint::Overdraw;
        let in_two = is_count || shown.style.dark_corners;
        let kept = picture.checked_sub(1);
        let kept = kept.map(|i| &self.contexts.pictures[pictures[i]]);
        let whole = targets.whole.as_ref();
        let whole = whole.filter(|_| own.is_cut() || is_rounded);
        let result = output;
        let output = whole.or(kept).map_or(output, |picture| &picture.view);
        let formats = [if in_two { COLOR } else { format }, format];
        let [Some(first), Some(second)] = formats.map(|f| self.contexts.panes(f)) else {
            return;
        };
        let mut drawing = Drawing {
            tree,
            worlds,
            shadings: &shadings,
            props,
            pictures,
            panes: first,
            size,
        };
        let mut encoder = gpu
            .device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let surfaces = if in_two { &targets.color } else { output };
        let mut pass = begin_pass(&mut encoder, surfaces, &targets.depth, true);
        for k in 0..shadings.len() {
            self.draw_context(&mut pass, &drawing, k, !is_count);
        }
        if in_two {
            drop(pass);
            let pipeline = if is_count {
                &self.pipelines.heat_map
            } else {
                &second.post
            };
            self.finish_surfaces(&mut encoder, targets, pipeline, output);
            pass = begin_pass(&mut encoder, output, &targets.depth, false);
        }
        drawing.panes = second;
        if !is_count {
            self.draw_glass_of_all(&mut pass, &drawing, &nodes);
        }
        if let Some(marks) = marks {
            self.draw_marks(
                &mut pass,
                &marks,
                size,
                [&second.marks, &second.marks_on_top],
            );
        }
        drop(pass);
        match (kept, whole) {
            (Some(kept), Some(whole)) => kept.copy(&mut encoder, whole, own.kept),
            (None, Some(whole)) => self.round_picture(&mut encoder, whole, result),
            _ => {}
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Copies a picture of finer colors to `output`.
    fn round_picture(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        whole: &PanePicture,
        output: &wgpu::TextureView,
    ) {
        let Some(panes) = self.contexts.panes(self.format()) else {
            return;
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("rounded"),
            color_attachments: &[Some(color_attachment(output, Some(wgpu::Color::BLACK)))],
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_pipeline(&panes.copy);
        pass.set_bind_group(0, &self.camera.group, &[]);
        pass.set_bind_group(1, &whole.group, &[]);
        pass.draw(0..3, 0..1);
    }

    /// Draws the transparent surfaces of all contexts of a picture, and gives regions back, children before parents.
    fn draw_glass_of_all(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        drawing: &Drawing<'_>,
        nodes: &[(usize, &Node)],
    ) {
        let closes = closing(drawing.tree, nodes);
        for (k, node) in nodes.iter().enumerate().rev() {
            self.draw_context_glass(pass, drawing, k);
            if closes[k] {
                self.close_context(pass, drawing, node.0);
            }
        }
    }

    /// Writes the parameters of all nodes of a picture, and prepares their pipelines.
    fn prepare_nodes(
        &mut self,
        gpu: &Gpu,
        worlds: &mut [StagedWorld<'_>],
        nodes: &[(usize, &Node)],
        exposed: &Exposed<'_>,
        props: &[(PartId, Vec<PropDraw>)],
        blends: bool,
    ) -> Vec<(usize, NodeShadings)> {
        let mut shadings = Vec::new();
        for (k, (index, node)) in nodes.iter().enumerate() {
            if k == self.contexts.skies.len() {
                let sky = GlobalsBuffer::new(gpu, &self.layouts);
                self.contexts.skies.push(sky);
            }
            let sky = Globals::new(&node.sky.0, &node.sky.1, exposed);
            self.contexts.skies[k].write(gpu, &sky);
            let mut of_node = Vec::new();
            for part in &node.parts {
                let (world, stage) = &mut worlds[part.id.0 as usize];
                while stage.views.len() <= part.view {
                    let view = self.stage_view(gpu, &stage.light, stage.explanation.as_ref());
                    stage.views.push(view);
                }
                stage.write_globals_of(gpu, part.view, &part.projection, exposed, part.gate);
                stage.write_instances_of(gpu, part.view, world, &part.list);
                let own = Shadings::of(exposed.style, &part.list, stage, exposed.lamps.len());
                let own = own.in_context(blends);
                own.prepare(gpu, &self.layouts, &mut self.pipelines, &part.list);
                for prop in props_of(props, part.id) {
                    let variant = own.prop(prop.span.is_smooth);
                    self.pipelines.prepare(gpu, &self.layouts, variant);
                }
                of_node.push(own);
            }
            shadings.push((*index, of_node));
        }
        shadings
    }

    /// Draws the image of the surfaces to `output`, with ambient occlusion or as counts.
    fn finish_surfaces(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        targets: &ContextTarget,
        pipeline: &wgpu::RenderPipeline,
        output: &wgpu::TextureView,
    ) {
        let mut post = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("picture"),
            color_attachments: &[Some(color_attachment(output, Some(wgpu::Color::BLACK)))],
            ..wgpu::RenderPassDescriptor::default()
        });
        post.set_pipeline(pipeline);
        post.set_bind_group(0, &self.camera.group, &[]);
        post.set_bind_group(1, &targets.post, &[]);
        post.draw(0..3, 0..1);
    }

    /// Draws the opaque surfaces of a context, opens the regions of those seen in it, and paints its sky.
    fn draw_context(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        drawing: &Drawing<'_>,
        k: usize,
        has_sky: bool,
    ) {
        let (index, shadings) = &drawing.shadings[k];
        let (tree, size, panes) = (drawing.tree, drawing.size, drawing.panes);
        let node = &tree.nodes[*index];
        pass.set_stencil_reference(node.region);
        for (i, (part, shadings)) in node.parts.iter().zip(shadings).enumerate() {
            let view = drawing.part(node, i);
            self.draw_surfaces(pass, view, shadings, size);
            let props = props_of(drawing.props, part.id);
            self.draw_props(pass, view, shadings, props, size);
        }
        if has_sky {
            for face in &node.faces {
                match face.first.content {
                    Content::Color => {
                        self.draw_pane(pass, drawing, node, face, &face.first, &panes.fill);
                    }
                    Content::Monitor(_) => {
                        self.draw_pane(pass, drawing, node, face, &face.first, &panes.monitor);
                    }
                    _ => {}
                }
            }
        }
        // All at their depths first, so that the nearest wins.
        for (_, face) in tree.children(*index) {
            self.draw_pane(pass, drawing, node, face, &face.first, &panes.depth);
        }
        for (child, face) in tree.children(*index) {
            pass.set_stencil_reference(CHOSEN | node.region);
            self.draw_pane(pass, drawing, node, face, &face.first, &panes.choose);
            pass.set_stencil_reference(tree.nodes[child].region);
            self.draw_screen(pass, &tree.nodes[child], &panes.open);
        }
        if has_sky {
            pass.set_stencil_reference(node.region);
            pass.set_bind_group(0, &self.contexts.skies[k].group, &[]);
            let [x, y, w, h] = node.scissor;
            pass.set_scissor_rect(x, y, w, h);
            pass.set_pipeline(&panes.sky);
            pass.draw(0..3, 0..1);
        }
    }

    /// Draws the transparent surfaces of a context, far to near, with the special portals through which one sees.
    fn draw_context_glass(&self, pass: &mut wgpu::RenderPass<'_>, drawing: &Drawing<'_>, k: usize) {
        let (index, shadings) = &drawing.shadings[k];
        let node = &drawing.tree.nodes[*index];
        pass.set_stencil_reference(node.region);
        // Distance; part, or none for a special portal; index.
        let mut order: Vec<(f32, Option<usize>, usize)> = Vec::new();
        for (i, part) in node.parts.iter().enumerate() {
            let runs = part.list.transparent.iter().enumerate();
            order.extend(runs.map(|(n, run)| (run.distance, Some(i), n)));
        }
        let panes = node.faces.iter().enumerate();
        let panes = panes.filter(|(_, face)| face.is_blended());
        order.extend(panes.map(|(n, face)| (face.distance, None, n)));
        // Stable: the lists are sorted already.
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        for group in order.chunk_by(|a, b| a.1 == b.1) {
            if let Some(part) = group[0].1 {
                let runs = group.iter().map(|g| g.2);
                let view = drawing.part(node, part);
                self.draw_panes(pass, view, &shadings[part], runs, drawing.size);
                continue;
            }
            for (.., n) in group {
                let face = &node.faces[*n];
                if face.first.content == Content::Through && face.first.is_tinted {
                    let tint = &drawing.panes.tint;
                    self.draw_pane(pass, drawing, node, face, &face.first, tint);
                }
                self.draw_later(pass, drawing, node, face);
            }
        }
    }

    /// Gives a context's region back to the context in which it is seen, with the special portal's depth, tint and later passes.
    fn close_context(&self, pass: &mut wgpu::RenderPass<'_>, drawing: &Drawing<'_>, index: usize) {
        let (tree, panes) = (drawing.tree, drawing.panes);
        let node = &tree.nodes[index];
        let Some(parent) = node.parent else { return };
        let above = &tree.nodes[parent];
        let Some((_, face)) = tree.children(parent).find(|(child, _)| *child == index) else {
            return;
        };
        pass.set_stencil_reference(CHOSEN | node.region);
        self.draw_screen(pass, node, &panes.choose_region);
        pass.set_stencil_reference(above.region);
        self.draw_pane(pass, drawing, above, face, &face.first, &panes.close);
        self.draw_later(pass, drawing, above, face);
    }

    fn draw_later(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        drawing: &Drawing<'_>,
        node: &Node,
        face: &Face,
    ) {
        for layer in &face.later {
            let pipeline = match layer.content {
                Content::Monitor(_) => &drawing.panes.over_monitor,
                _ => &drawing.panes.over,
            };
            self.draw_pane(pass, drawing, node, face, layer, pipeline);
        }
    }

    /// Draws the polygon of a special portal as a node sees it.
    fn draw_pane(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        drawing: &Drawing<'_>,
        node: &Node,
        face: &Face,
        layer: &Layer,
        pipeline: &wgpu::RenderPipeline,
    ) {
        let [x, y, w, h] = match layer.content {
            Content::Node(child) => drawing.tree.nodes[child].scissor,
            Content::Seen(picture) => drawing.tree.pictures[picture].kept,
            _ => node.scissor,
        };
        pass.set_scissor_rect(x, y, w, h);
        let view = drawing.part(node, face.part).view;
        pass.set_bind_group(0, &view.globals.group, &[]);
        if let Content::Seen(picture) | Content::Monitor(picture) = layer.content {
            let picture = &self.contexts.pictures[drawing.pictures[picture - 1]];
            pass.set_bind_group(1, &picture.group, &[]);
        }
        pass.set_vertex_buffer(0, self.contexts.corners.buffer.slice(..));
        pass.set_pipeline(pipeline);
        pass.draw(layer.corners.clone(), 0..1);
    }

    /// Draws to the whole part of the screen in which a node is seen.
    fn draw_screen(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        node: &Node,
        pipeline: &wgpu::RenderPipeline,
    ) {
        let [x, y, w, h] = node.scissor;
        pass.set_scissor_rect(x, y, w, h);
        pass.set_bind_group(0, &self.camera.group, &[]);
        pass.set_pipeline(pipeline);
        pass.draw(0..3, 0..1);
    }
}

impl<'a> Drawing<'a> {
    /// Returns a part of a node, ready to draw.
    fn part(&self, node: &'a Node, part: usize) -> PartView<'a> {
        let part = &node.parts[part];
        let (world, stage) = &self.worlds[part.id.0 as usize];
        PartView {
            world,
            view: &stage.views[part.view],
            list: &part.list,
        }
    }
}

impl Face {
    /// Returns `true` if something is blended over it at its turn among transparent surfaces. What is seen in a region of
    /// its own is followed by its later passes when that region is closed.
    fn is_blended(&self) -> bool {
        match self.first.content {
            Content::Node(_) => false,
            Content::Through => true,
            _ => !self.later.is_empty(),
        }
    }
}

/// Returns for each node of a picture whether its region goes back to its parent: where something is drawn over it.
fn closing(tree: &Tree, nodes: &[(usize, &Node)]) -> Vec<bool> {
    let mut out: Vec<bool> = Vec::new();
    for (index, node) in nodes {
        let closes = node.parent.is_some_and(|parent| {
            let above = &tree.nodes[parent];
            let at = nodes.iter().position(|n| n.0 == parent);
            let mut children = tree.children(parent);
            let face = children.find(|(child, _)| child == index);
            at.is_some_and(|at| out[at])
                || above.parts.iter().any(|p| !p.list.transparent.is_empty())
                || above.faces.iter().any(Face::is_blended)
                || face.is_some_and(|(_, f)| f.first.is_tinted || !f.later.is_empty())
        });
        out.push(closes);
    }
    out
}

fn props_of(props: &[(PartId, Vec<PropDraw>)], part: PartId) -> &[PropDraw] {
    let own = props.iter().find(|p| p.0 == part);
    own.map_or(&[], |p| &p.1)
}

/// Begins the pass of the surfaces of a picture, which clears it, or that of what is transparent.
fn begin_pass<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    color: &wgpu::TextureView,
    depth: &wgpu::TextureView,
    is_first: bool,
) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(if is_first {
            "contexts"
        } else {
            "context glass"
        }),
        color_attachments: &[Some(color_attachment(
            color,
            is_first.then_some(wgpu::Color::TRANSPARENT),
        ))],
        depth_stencil_attachment: Some(depth_stencil_attachment(depth, is_first)),
        ..wgpu::RenderPassDescriptor::default()
    })
}

fn depth_stencil_attachment(
    view: &wgpu::TextureView,
    clears: bool,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: if clears {
                wgpu::LoadOp::Clear(0.0)
            } else {
                wgpu::LoadOp::Load
            },
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: Some(wgpu::Operations {
            load: if clears {
                wgpu::LoadOp::Clear(0)
            } else {
                wgpu::LoadOp::Load
            },
            store: wgpu::StoreOp::Store,
        }),
    }
}
