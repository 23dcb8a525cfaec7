//! Where things come from, what they are called, and what they look like.

use enfilade_cpg::{SourceRuns, World};

use super::geometry::loose_detail;
use super::{Tampering, pick};

pub(super) const ALL: &[Tampering] = &[
    Tampering::new("a detail of another source", |w, at| {
        let (i, n) = (sourced(w, at)?, w.sources.len() as u32);
        let source = w.details[i].source?;
        // One that is called otherwise.
        let name = &w.sources[source as usize].name;
        let other = (1..n).map(|k| (source + k) % n);
        w.details[i].source = other
            .into_iter()
            .find(|&s| w.sources[s as usize].name != *name);
        w.details[i].source.map(|_| ())
    }),
    Tampering::new("names of two sources of details swapped", |w, at| {
        let of = |place| w.details[sourced(w, place)?].source;
        let [a, b] = [of(at)?, of((at + 1) % 3)?].map(|s| s as usize);
        if w.sources[a].name == w.sources[b].name {
            return None;
        }
        let name = w.sources[a].name.clone();
        w.sources[a].name = std::mem::replace(&mut w.sources[b].name, name);
        Some(())
    }),
    Tampering::new("names of two details swapped", |w, at| {
        let [a, b] = [sourced(w, at)?, sourced(w, (at + 1) % 3)?];
        if w.details[a].name == w.details[b].name {
            return None;
        }
        let name = w.details[a].name.clone();
        w.details[a].name = std::mem::replace(&mut w.details[b].name, name);
        Some(())
    }),
    Tampering::new("runs of sources shifted by a triangle", |w, at| {
        let i = pick(w.batches.len(), at, |i| torn(w, i).is_some())?;
        w.batches[i].sources = torn(w, i)?;
        Some(())
    }),
    Tampering::by_source("sources of two runs exchanged", |w, at| {
        let i = pick(w.batches.len(), at, |i| {
            w.batches[i].sources.runs().len() > 1
        })?;
        let mut runs = w.batches[i].sources.runs().to_vec();
        let [a, b] = [runs[0][0], runs[1][0]];
        (runs[0][0], runs[1][0]) = (b, a);
        w.batches[i].sources = SourceRuns::from_runs(runs);
        Some(())
    }),
    Tampering::by_source("a wall of another name", |w, at| {
        let named: Vec<u32> = w
            .batches
            .iter()
            .flat_map(|b| b.sources.runs())
            .map(|r| r[0])
            .filter(|&s| w.details.iter().all(|d| d.source != Some(s)))
            .collect();
        let i = pick(named.len(), at, |i| {
            !w.sources[named[i] as usize].name.is_empty()
        })?;
        w.sources[named[i] as usize].name.push('x');
        Some(())
    }),
    Tampering::by_source("forged extras of a source", |w, at| {
        let i = pick(w.sources.len(), at, |_| true)?;
        w.sources[i].extras = r#"{"forged":true}"#.into();
        Some(())
    }),
    Tampering::new("a source of which nothing is there", |w, at| {
        let parent = (at as u32).checked_rem(w.sources.len() as u32)?;
        let mut more = w.sources[parent as usize].clone();
        more.parent = Some(parent);
        more.name.push_str(" and more");
        w.sources.push(more);
        Some(())
    }),
    Tampering::new("a part called as no part of its whole", |w, at| {
        let i = pick(w.details.len(), at, |i| w.details[i].part_of.is_some())?;
        w.details[i].name = "curtain".into();
        Some(())
    }),
    Tampering::new("seals with a source", |w, at| {
        let i = pick(w.batches.len(), at, |i| {
            w.batches[i].is_seal && !w.batches[i].primitive.indices.is_empty()
        })?;
        let n = w.batches[i].primitive.indices.len() / 3;
        w.batches[i].sources.push(0, n as u32);
        (!w.sources.is_empty()).then_some(())
    }),
    Tampering::by_source("a wall that one sees through", |w, at| {
        let i = pick(w.batches.len(), at, |i| {
            let batch = &w.batches[i];
            !batch.is_seal && !batch.cells.is_empty() && !batch.primitive.indices.is_empty()
        })?;
        let mut clear = match w.batches[i].primitive.material {
            Some(m) => w.materials[m as usize].clone(),
            None => enfilade_geom::scene::Material::default(),
        };
        see_through(&mut clear);
        w.materials.push(clear);
        w.batches[i].primitive.material = Some(w.materials.len() as u32 - 1);
        Some(())
    }),
    Tampering::by_source("furniture that one sees through", |w, at| {
        let used = |i: usize| {
            let walls = w.batches.iter().map(|b| &b.primitive);
            let mut walls = walls.filter(|p| !p.indices.is_empty());
            let is_wall = walls.any(|p| p.material == Some(i as u32));
            !is_wall && !w.materials[i].transparent
        };
        let i = pick(w.materials.len(), at, used)?;
        see_through(&mut w.materials[i]);
        Some(())
    }),
];

/// A detail with a source, and no part of another.
fn sourced(w: &World, place: usize) -> Option<usize> {
    let i = loose_detail(w, place)?;
    w.details[i].source.map(|_| i)
}

fn see_through(material: &mut enfilade_geom::scene::Material) {
    // As a file says it.
    let name = &material.name;
    material.gltf = format!(r#"{{"name":{name:?},"alphaMode":"BLEND"}}"#);
    material.transparent = true;
}

/// The runs of a batch with the border of two of them moved by one triangle, where that parts triangles of one object.
fn torn(w: &World, i: usize) -> Option<SourceRuns> {
    let batch = &w.batches[i];
    let mut runs = batch.sources.runs().to_vec();
    let mut first = 0;
    for k in 0..runs.len().checked_sub(1)? {
        first += runs[k][1] as usize;
        let t = batch.primitive.triples();
        let joins = |a: usize, b: usize| t[a].iter().any(|v| t[b].contains(v));
        if runs[k + 1][1] > 1 && joins(first, first + 1) {
            runs[k][1] += 1;
            runs[k + 1][1] -= 1;
            return Some(SourceRuns::from_runs(runs));
        }
    }
    None
}
