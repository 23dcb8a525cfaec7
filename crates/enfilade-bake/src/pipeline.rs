//! The main flow: scene → voxels → rooms → screens → cell complex → world.
//!
//! Read this first. Each step is one call on a named intermediate; how a step works is told in its
//! own module.

use std::collections::BTreeMap;
use std::time::Duration;

use enfilade_cpg::{Provenance, Statistics, World};
use enfilade_geom::scene::{Role, Scene, TriangleSource};
use enfilade_geom::{Aabb, Bvh, DVec3, Ray, Triangle, triangle_area_normal};
use rayon::prelude::*;

use crate::assemble::{Cut, assemble};
use crate::complex::{ComplexInput, LabelSettings, Leak, Partition, Vote, build_complex};
use crate::join::{VOID, join_unparted, join_voids};
use crate::voxel::{
    BitVolume, Grid, Labels, WatershedOptions, border, distance_squared, voxelize, watershed,
};
use crate::watershed::{
    Flooded, Frame, Lids, Regions, Screen, bounds_of, connected_patches, cut_at_slabs, find_lids,
    find_matter, find_stairs, fit_screen, flood_closures, is_in, merge_basins, opening_of, plates,
    rim_caps, shallow_voids, slab_heights, split_limbs, without_corners, without_open_leaves,
};
use crate::{BakeConfig, BakeContext, BakeError};

/// What a bake gives besides the world.
#[derive(Clone, Debug)]
pub struct BakeOutput {
    /// Cells, portals, geometry.
    pub world: World,
    /// Edge of a voxel. [Units: wu]
    pub voxel: f64,
    /// Voxels along each axis.
    pub dims: [usize; 3],
    /// Wall time of each stage.
    pub times: Vec<(&'static str, Duration)>,
    /// Where cells meet though no opening was foreseen: cracks and holes of the model.
    pub leaks: Vec<Leak>,
    /// What the builder assumed or decided in doubt, one sentence each.
    pub notes: Vec<String>,
}

/// Finds the rooms and doorways of a scene.
///
/// Deterministic: equal input and settings give an equal world on any number of threads. Time is
/// linear in voxels and about linear in triangles; memory about 3 bytes a voxel plus the scene.
///
/// # Errors
/// When there is nothing structural, a setting is out of limits, the scene is too large for the
/// budget of voxels, or the caller cancels.
pub fn bake(
    scene: &Scene,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    // 1. What bounds rooms.
    context.stage(0)?;
    let (sources, triangles) = structural_triangles(scene);
    if triangles.is_empty() {
        return Err(BakeError::NothingStructural {
            n_objects: scene.objects.len(),
        });
    }
    // The voxels lie along the walls, however the building is turned.
    let frame = Frame::of(&triangles);
    let turned = frame.triangles_to_grid(&triangles);
    let bvh = Bvh::build(&turned);
    let grid = config.grid(&bounds_of(&turned))?;
    // Stairs stand in rooms and bound none.
    let is_stair = find_stairs(&sources, &turned);
    let part = |stairs: bool| -> Vec<Triangle> {
        turned
            .iter()
            .zip(&is_stair)
            .filter(|t| *t.1 == stairs)
            .map(|t| *t.0)
            .collect()
    };
    let (walls, stairs) = (part(false), part(true));
    let occupied = voxelize(&grid, &walls);
    let plates = plates(scene);
    let plates = plates
        .iter()
        .map(|p| frame.triangles_to_grid(p).into_owned());
    let closures = voxelize(&grid, &without_open_leaves(plates.collect(), &bvh).concat());
    // Where a building has no roof or floor or a tube just ends, a lid or a cap takes its place.
    let lids = find_lids(&grid, &occupied);
    let mut shut = voxelize(&grid, &rim_caps(&walls, config.min_opening.powi(2)));
    shut.union_with(&closures);
    for voxels in lids.lids.iter().chain(&lids.floors) {
        shut.union_with(voxels);
    }
    let mut notes = lids.notes(&grid);

    // 2. How far every voxel of air is from a surface; door leaves count as surfaces here.
    context.stage(1)?;
    let mut blocked = occupied.clone();
    blocked.union_with(&shut);
    let distances = distance_squared(&blocked);
    drop(blocked);

    // 3. Basins, cut where a slab ends a storey.
    context.stage(2)?;
    let options = WatershedOptions {
        h: config.noise / grid.voxel,
        outdoors: Some(border(grid.dims)), // which the padding keeps empty
    };
    let flood = watershed(grid.dims, distances, options);
    let mut labels = flood.labels;
    let mut peaks: Vec<f32> = std::iter::once(0.0)
        .chain(flood.basins.iter().map(|b| b.peak as f32))
        .collect();
    let n_basins = flood.basins.len();
    let saddles: BTreeMap<(u32, u32), f32> = flood
        .saddles
        .iter()
        .map(|s| ((s.a, s.b), s.distance as f32))
        .collect();
    flood_closures(grid.dims, &mut labels, &occupied);
    let slabs = slab_heights(&walls);
    for parent in cut_at_slabs(&grid, &mut labels, peaks.len(), &slabs) {
        peaks.push(peaks[parent as usize]);
    }
    let n_occupied = occupied.count();
    drop(occupied);

    // 4. Rooms.
    context.stage(3)?;
    let flooded = Flooded {
        grid: &grid,
        labels: &labels,
        peaks: &peaks,
        closures: Some(&shut),
        slabs: &slabs,
    };
    let mut regions = merge_basins(flooded, &saddles, &config.merge);
    split_limbs(
        &grid,
        &mut labels,
        &mut regions,
        &mut peaks,
        &shut,
        &config.merge,
    );
    drop(shut);
    let matter = find_matter(
        &grid,
        &labels,
        &regions,
        &peaks,
        &bvh,
        config.merge.min_radius,
    );
    notes.extend(matter.notes);

    // 5. Where rooms meet: a screen in each real opening.
    context.stage(4)?;
    let mut screens = fit_screens(
        &grid,
        &labels,
        &regions,
        &closures,
        &lids,
        &walls,
        config.merge.closed_share,
    );
    drop((closures, lids));
    let ballots = Ballots::cast(
        &grid,
        &labels,
        &regions,
        &matter.regions,
        &inside_of(&stairs, &grid, &bvh),
    );
    let mut voids = Vec::new();
    if matter.fronts_face_air {
        voids = shallow_voids(&walls, &bvh, &|p| {
            grid.voxel_at(p).map_or(0, |[x, y, z]| {
                regions.region_of_basin[labels.get(grid.index(x, y, z)) as usize]
            })
        });
    }
    drop((walls, labels));
    // From here on all is where the scene has it.
    for screen in &mut screens {
        screen.winding = frame.winding_to_scene(&screen.winding);
    }
    for (p, _) in &mut voids {
        *p = frame.to_scene(*p);
    }
    let bvh = if frame.is_scene() {
        bvh
    } else {
        Bvh::build(&triangles)
    };
    drop(turned);

    // 6. Screens and triangles cut space into convex pieces, exactly.
    context.stage(5)?;
    let windings: Vec<_> = screens.iter().map(|s| s.winding.clone()).collect();
    let complex = build_complex(&ComplexInput {
        triangles: &triangles,
        screens: &windings,
        bounds: frame.aabb_to_scene(&grid.aabb()),
        gap: config.smallest_hole.gap(),
        has_seals: config.smallest_hole.has_seals(),
    });

    // 7. The pieces become cells by the rooms' votes; what is open between cells are the portals.
    context.stage(6)?;
    let mut votes = ballots.count(&grid, &frame);
    let mut partition = complex.partition(&votes, &LabelSettings::default());
    while join_unparted(&partition, &mut votes, &mut voids) {
        partition = complex.partition(&votes, &LabelSettings::default());
    }
    // What rays found above ceilings and no room's votes reached.
    let unreached: Vec<Vote> = voids
        .into_iter()
        .filter(|(p, _)| partition.locator.locate(*p).is_none())
        .map(|(point, region)| Vote {
            point,
            label: VOID | region,
            weight: 1e-3,
        })
        .collect();
    if !unreached.is_empty() {
        let n = votes.len();
        votes.extend(unreached);
        partition = complex.partition(&votes, &LabelSettings::default());
        // What opens to something is a cavity of the construction, not a void: left as it was.
        let opens = portalled_cells(&partition);
        let mut rest = votes.split_off(n);
        let n_voids = rest.len();
        rest.retain(|v| {
            partition
                .locator
                .locate(v.point)
                .is_none_or(|c| !opens[c.0 as usize])
        });
        let is_final = rest.len() == n_voids;
        votes.extend(rest);
        if !is_final {
            partition = complex.partition(&votes, &LabelSettings::default());
        }
        join_voids(&mut partition);
    }
    drop(votes);
    let outward = complex.opening_tolerance();
    let counts = [
        ("voxel_size", grid.voxel),
        ("grid_turn_degrees", frame.degrees()),
        ("voxels", grid.n_voxels() as f64),
        ("occupied_voxels", n_occupied as f64),
        ("basins", n_basins as f64),
        ("screens", screens.len() as f64),
        ("leaves", complex.n_leaves() as f64),
    ];
    drop(complex);

    // 8. Geometry to the cells that see it.
    context.stage(7)?;
    let leaks = partition.leaks.clone();
    let world = Cut {
        scene,
        sources: &sources,
        triangles: &triangles,
        bvh: &bvh,
        partition,
        screens: &screens,
        outward,
        closed_share: config.merge.closed_share,
    }
    .into_world("watershed", config.to_settings(), &counts);
    context.end_stage();
    Ok(BakeOutput {
        world,
        voxel: grid.voxel,
        dims: grid.dims,
        times: context.times(),
        leaks,
        notes,
    })
}

impl Cut<'_> {
    /// Hands out the geometry, and says how the world came to be.
    pub(crate) fn into_world(
        self,
        method: &str,
        settings: BTreeMap<String, String>,
        counts: &[(&str, f64)],
    ) -> World {
        let n_detail = self.scene.triangle_sources(Role::Detail).count();
        let common = [
            ("input_triangles", (self.sources.len() + n_detail) as f64),
            ("structural_triangles", self.sources.len() as f64),
            ("leaks", self.partition.leaks.len() as f64),
            ("seals", self.partition.seals.len() as f64),
            (
                "seal_area",
                self.partition.seals.iter().map(|s| s.outline.area()).sum(),
            ),
        ];
        let counts = common.iter().chain(counts);
        let provenance = Provenance {
            generator: concat!("enfilade ", env!("CARGO_PKG_VERSION")).to_owned(),
            method: method.to_owned(),
            input_hash: input_hash(self.triangles, &settings),
            settings,
        };
        let statistics = Statistics {
            counts: counts.map(|&(k, v)| (k.to_owned(), v)).collect(),
        };
        assemble(&self, provenance, statistics)
    }
}

/// Which cells have a portal.
fn portalled_cells(partition: &Partition) -> Vec<bool> {
    let mut opens = vec![false; partition.label_of_cell.len()];
    for p in &partition.portals {
        p.cells.iter().for_each(|&c| opens[c as usize] = true);
    }
    opens
}

/// Structural triangles that have an area, with where they came from.
pub(crate) fn structural_triangles(scene: &Scene) -> (Vec<TriangleSource>, Vec<Triangle>) {
    scene
        .triangle_sources(Role::Structural)
        .map(|s| (s, scene.world_triangle(s)))
        .filter(|(_, t)| {
            t.iter().all(|p| p.is_finite()) && triangle_area_normal(t).length_squared() > 0.0
        })
        .unzip()
}

/// The triangles in an order of their own, each from its least corner on, for builders whose result would
/// depend on how a file lists them.
pub(crate) fn in_own_order(triangles: &[Triangle]) -> Vec<Triangle> {
    let order = |a: &DVec3, b: &DVec3| {
        let by = |k: usize| a[k].total_cmp(&b[k]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    };
    let mut out: Vec<Triangle> = triangles
        .iter()
        .map(|t| {
            let least = (0..3).min_by(|&i, &j| order(&t[i], &t[j])).unwrap_or(0);
            [t[least], t[(least + 1) % 3], t[(least + 2) % 3]]
        })
        .collect();
    out.sort_unstable_by(|a, b| {
        let by = |k: usize| order(&a[k], &b[k]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    });
    out
}

/// Openings smaller than this many voxel faces are left to the complex, which finds them as cracks.
const MIN_FACES: usize = 4;

fn fit_screens(
    grid: &Grid,
    labels: &Labels,
    regions: &Regions,
    closures: &BitVolume,
    lids: &Lids,
    triangles: &[Triangle],
    closed_share: f64,
) -> Vec<Screen> {
    let bvh = Bvh::build(triangles);
    let is_shut = |faces: &[u64]| {
        let n = faces.iter().filter(|&&f| is_in(grid, closures, f)).count();
        n as f64 >= closed_share * faces.len() as f64
    };
    let openings: Vec<([u32; 2], Vec<u64>)> = regions
        .contacts
        .iter()
        .flat_map(|(&(a, b), faces)| {
            connected_patches(grid, faces)
                .into_iter()
                .flat_map(|patch| {
                    if is_shut(&patch) {
                        without_corners(grid, patch)
                    } else {
                        vec![patch]
                    }
                })
                .filter(|patch| patch.len() >= MIN_FACES)
                .map(|patch| ([a, b], patch))
                .collect::<Vec<_>>()
        })
        .collect();
    openings
        .into_par_iter()
        .map(|(pair, faces)| {
            if let Some(lid) = lids.screen_of(grid, &faces, pair) {
                return lid;
            }
            let is_lesser = |i: usize| regions.region_of_basin[labels.get(i) as usize] == pair[0];
            let opening = opening_of(grid, faces, &is_lesser, Some(closures));
            let near = |bounds: &Aabb| {
                let mut found = Vec::new();
                bvh.for_each_in_box(bounds, |t| found.push(t));
                found.sort_unstable();
                found
            };
            fit_screen(grid, &opening, pair, triangles, &near)
        })
        .collect()
}

/// At most about this many voxels vote.
const MAX_VOTES: usize = 1_000_000;
/// Voxels this close to where two regions meet do not vote: a screen may lie on either side of
/// them. [Units: wu]
const UNSURE: f64 = 0.35;

/// Votes as they are cast: as small as can be, for they are many, and the labels are still there.
struct Ballots {
    /// Voxels along each edge of a block.
    block: usize,
    /// Blocks along each axis.
    dims: [usize; 3],
    /// Region that each block votes for; 0 is none.
    region: Vec<u32>,
    /// Which voxel of the block it is that votes: 17³ of them at most, with 2³² voxels in all.
    voter: Vec<u16>,
}

impl Ballots {
    /// One voxel of each block of `block`³ speaks for its region.
    fn cast(
        grid: &Grid,
        labels: &Labels,
        regions: &Regions,
        hollow: &[u32],
        solid: &BitVolume,
    ) -> Self {
        let mut unsure = BitVolume::new(grid.dims);
        let reach = (UNSURE / grid.voxel).ceil() as usize;
        for faces in regions.contacts.values() {
            let mut last = u64::MAX;
            for &face in faces {
                if face / 4 == last {
                    continue;
                }
                last = face / 4;
                let at = grid.coords(last as usize);
                let range =
                    |k: usize| at[k].saturating_sub(reach)..(at[k] + reach + 1).min(grid.dims[k]);
                for z in range(2) {
                    for y in range(1) {
                        for x in range(0) {
                            unsure.set(x, y, z, true);
                        }
                    }
                }
            }
        }
        let mut block = 1;
        while grid.n_voxels() / (block * block * block) > MAX_VOTES {
            block += 1;
        }
        let dims = grid.dims.map(|n| n.div_ceil(block));
        let n_blocks = dims.iter().product();
        let mut ballots = Self {
            block,
            dims,
            region: vec![0; n_blocks],
            voter: vec![0; n_blocks],
        };
        let region_of = |[x, y, z]: [usize; 3]| {
            let region = regions.region_of_basin[labels.get(grid.index(x, y, z)) as usize];
            let votes = region != 0
                && !unsure.get(x, y, z)
                && !solid.get(x, y, z)
                && hollow.binary_search(&region).is_err();
            votes.then_some(region)
        };
        ballots
            .region
            .par_iter_mut()
            .zip(&mut ballots.voter)
            .enumerate()
            .with_min_len(4096)
            .for_each(|(b, (region, voter))| {
                let [bx, by, bz] = [b % dims[0], b / dims[0] % dims[1], b / (dims[0] * dims[1])];
                let found = (0..block * block * block).find_map(|k| {
                    let at = voter_at([bx, by, bz], block, k);
                    let is_inside = (0..3).all(|axis| at[axis] < grid.dims[axis]);
                    is_inside.then(|| region_of(at)).flatten().map(|of| (k, of))
                });
                if let Some((k, of)) = found {
                    (*voter, *region) = (k as u16, of);
                }
            });
        ballots
    }

    fn count(self, grid: &Grid, frame: &Frame) -> Vec<Vote> {
        let weight = (grid.voxel * self.block as f64).powi(3) as f32;
        let [nx, ny, _] = self.dims;
        // One after the other into a list of the right size: in parallel they would be there twice.
        let n = self.region.iter().filter(|&&region| region != 0).count();
        let mut votes = Vec::with_capacity(n);
        for (b, (label, k)) in self.region.into_iter().zip(self.voter).enumerate() {
            if label == 0 {
                continue;
            }
            let at = [b % nx, b / nx % ny, b / (nx * ny)];
            let [x, y, z] = voter_at(at, self.block, usize::from(k));
            votes.push(Vote {
                point: frame.to_scene(grid.center(x, y, z)),
                label,
                weight,
            });
        }
        votes
    }
}

/// Voxel number `k` of a block, along x first.
fn voter_at(of: [usize; 3], block: usize, k: usize) -> [usize; 3] {
    let within = [k % block, k / block % block, k / (block * block)];
    [0, 1, 2].map(|axis| of[axis] * block + within[axis])
}

/// Voxels that stairs fill: those that they touch, and those between from which one sees backs.
fn inside_of(stairs: &[Triangle], grid: &Grid, bvh: &Bvh) -> BitVolume {
    let mut filled = voxelize(grid, stairs);
    let bounds = bounds_of(stairs);
    let (Some(lo), Some(hi)) = (grid.voxel_at(bounds.min), grid.voxel_at(bounds.max)) else {
        return filled;
    };
    let up_and_down = [
        DVec3::new(0.013, 1.0, 0.007),
        DVec3::new(-0.007, -1.0, 0.013),
    ];
    let inner: Vec<[usize; 3]> = (lo[2]..=hi[2])
        .into_par_iter()
        .flat_map_iter(|z| {
            let filled = &filled;
            (lo[1]..=hi[1]).flat_map(move |y| {
                (lo[0]..=hi[0])
                    .filter(move |&x| !filled.get(x, y, z))
                    .filter_map(move |x| {
                        let origin = grid.center(x, y, z);
                        let sees_back = |direction: DVec3| {
                            let ray = Ray {
                                origin,
                                direction,
                                t_max: f64::INFINITY,
                            };
                            bvh.closest_hit(&ray, |_| false).is_some_and(|h| !h.front)
                        };
                        up_and_down
                            .iter()
                            .all(|&d| sees_back(d))
                            .then_some([x, y, z])
                    })
            })
        })
        .collect();
    for [x, y, z] in inner {
        filled.set(x, y, z, true);
    }
    filled
}

/// FNV-1a over the triangles and settings, as 16 hexadecimal digits.
fn input_hash(triangles: &[Triangle], settings: &BTreeMap<String, String>) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        for &b in bytes {
            hash = (hash ^ u64::from(b)).wrapping_mul(0x100_0000_01b3);
        }
    };
    for p in triangles.iter().flatten() {
        for v in p.as_vec3().to_array() {
            add(&v.to_le_bytes());
        }
    }
    for (k, v) in settings {
        add(k.as_bytes());
        add(&[0]);
        add(v.as_bytes());
        add(&[0]);
    }
    format!("{hash:016x}")
}
