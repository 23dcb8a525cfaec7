//! From a proposal to a world: an exact cut of space into convex leaves, cells by votes, portals where cells are open
//! to each other, and geometry assigned to the cells that see it. The same for all builders.

use enfilade_cpg::{DecidedPlace, Provenance, Reason, Statistics, Why, World};
use enfilade_geom::scene::Role;
use enfilade_geom::{Allowance, Triangle};

use crate::assemble::{Cut, assemble};
use crate::complex::{Complex, ComplexInput, LabelInput, Partition, build_complex_within};
use crate::join::{join_enclosed, join_voids};
use crate::proposal::{FoundPlace, Proposal};
use crate::structure::{OUTDOORS, Structure};
use crate::void::mark_voids;
use crate::{BakeConfig, BakeContext, BakeError, BakeOutput, Method, SmallestHole, Stage};

/// Turns a method's proposal into a world.
///
/// # Errors
/// If the caller cancels.
pub(crate) fn realize(
    structure: Structure<'_>,
    method: Method,
    mut proposal: Proposal,
    config: &BakeConfig,
    context: &BakeContext<'_>,
) -> Result<BakeOutput, BakeError> {
    context.begin(Stage::Complex)?;
    let structure = structure.into_scene();
    let hole = structure.hole;
    if config.smallest_hole == SmallestHole::Auto && hole.gap() > SmallestHole::LEAST {
        proposal.notes.push(format!(
            "triangles that should meet do not: closing gaps up to {:.0} mm instead of {:.0} (--smallest-hole)",
            hole.gap() * 1e3,
            SmallestHole::LEAST * 1e3
        ));
    }
    let settings = &mut proposal.settings;
    settings.insert("smallest_hole".to_owned(), hole.to_string());
    let windings: Vec<_> = proposal
        .candidates
        .iter()
        .map(|c| c.winding.clone())
        .collect();
    let input = ComplexInput {
        triangles: &structure.triangles,
        candidates: &windings,
        // Exact, independent of the candidates that the method fitted there.
        missing: &structure.missing,
        bounds: proposal.bounds,
        gap: hole.gap(),
        has_seals: hole.has_seals(),
    };
    let complex = build_complex_within(&input, context.allowance());
    context.begin(Stage::Partition)?;
    let Divided { partition, whys } = part(&complex, &proposal, context.allowance());
    proposal.counts.push(("leaves", complex.n_leaves() as f64));
    proposal.votes = Vec::new();
    let outward = complex.opening_tolerance();
    drop(complex);

    context.begin(Stage::Geometry)?;
    let leaks = partition.leaks.clone();
    let cut = Cut {
        structure: &structure,
        partition,
        whys: &whys,
        candidates: &proposal.candidates,
        outward,
        land: proposal.land.clone(),
        closed_share: config.merge.closed_share,
        allowance: context.allowance(),
    };
    let mut world = world_of(&cut, method, &proposal);
    world.graph.places = places_of(&proposal);
    context.check()?;
    context.end_stage();
    Ok(BakeOutput {
        world,
        method,
        resolution: proposal.resolution,
        times: context.times(),
        work: context.work(),
        leaks,
        notes: proposal.notes,
    })
}

/// Returns the close decisions of a proposal, as a world has them.
pub(crate) fn places_of(proposal: &Proposal) -> Vec<DecidedPlace> {
    let place = |place: &FoundPlace| DecidedPlace {
        at: place.at.as_vec3().to_array(),
        why: place.why.clone(),
    };
    proposal.places.iter().map(place).collect()
}

/// Space divided among cells.
pub(crate) struct Divided {
    pub(crate) partition: Partition,
    /// Why each cell is there.
    pub(crate) whys: Vec<Vec<Why>>,
}

/// Divides the leaves of the complex among cells.
pub(crate) fn part(complex: &Complex<'_>, proposal: &Proposal, allowance: &Allowance) -> Divided {
    let is_tree = proposal.is_tree();
    let Proposal {
        votes,
        voids,
        land,
        label,
        joins_unparted,
        whys,
        ..
    } = proposal;
    // The outdoors and open land stay apart: a model full of holes must not lose its rooms to them.
    let may_join = |region| *joins_unparted && region != OUTDOORS && !land.contains(&region);
    let cells = complex.label(&LabelInput {
        votes,
        voids,
        may_join: &may_join,
        settings: *label,
    });
    let mut partition = complex.realize(cells);
    join_enclosed(&mut partition);
    let mut of_cell = if is_tree {
        vec![Why::given(Reason::Unscaled); partition.label_of_cell.len()]
    } else {
        mark_voids(&mut partition, allowance)
    };
    // Methods whose regions are never joined make the cells that they are asked for.
    if *joins_unparted {
        let kept = join_voids(&mut partition);
        of_cell = kept.into_iter().map(|c| of_cell[c].clone()).collect();
    }
    let whys = (0..).zip(of_cell).map(|(cell, why)| {
        let region = partition.label_of_cell[cell as usize].region();
        let is_land = region.is_some_and(|r| land.contains(&r));
        if partition.outside == Some(cell) {
            return vec![Why::given(Reason::Outside)];
        } else if is_land {
            return vec![Why::given(Reason::Land)];
        }
        let found = whys.binary_search_by_key(&region, |w| Some(w.0));
        let closed = found.ok().map(|i| whys[i].1.clone());
        std::iter::once(why).chain(closed).collect()
    });
    Divided {
        whys: whys.collect(),
        partition,
    }
}

/// Assigns the geometry and records the provenance of the world.
fn world_of(cut: &Cut<'_>, method: Method, proposal: &Proposal) -> World {
    let n_detail = cut.structure.scene.triangle_sources(Role::Detail).count();
    let seals = &cut.partition.seals;
    let common = [
        (
            "input_triangles",
            (cut.structure.sources.len() + n_detail) as f64,
        ),
        ("structural_triangles", cut.structure.sources.len() as f64),
        ("leaks", cut.partition.leaks.len() as f64),
        ("seals", seals.len() as f64),
        ("seal_area", seals.iter().map(|s| s.outline.area()).sum()),
    ];
    let counts = common.iter().chain(&proposal.counts);
    let provenance = Provenance {
        generator: concat!("enfilade ", env!("CARGO_PKG_VERSION")).to_owned(),
        method: method.name().to_owned(),
        input_hash: input_hash(&cut.structure.triangles, &proposal.settings),
        settings: proposal.settings.clone(),
    };
    let statistics = Statistics {
        counts: counts.map(|&(k, v)| (k.to_owned(), v)).collect(),
    };
    assemble(cut, provenance, statistics)
}

/// Returns the FNV-1a hash of the triangles and settings, as 16 hexadecimal digits.
pub(crate) fn input_hash(
    triangles: &[Triangle],
    settings: &std::collections::BTreeMap<String, String>,
) -> String {
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
