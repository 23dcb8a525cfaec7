//! Joins shallow basins to deeper ones, and writes the labels.

use enfilade_geom::Sets;

use super::super::labels::Labels;
use super::basins::{Basin, STEPS, Saddle, Watershed};
use super::crests::Peak;
use super::slabs::{Contact, OUTER, merged};

/// Basins after shallow ones have joined deeper ones.
pub(super) struct Merged {
    /// Outdoors first if requested, then deepest first; without sizes.
    basins: Vec<Basin>,
    /// Label of each root.
    labels: Vec<u32>,
    /// Between labels.
    contacts: Vec<Contact>,
}

impl Merged {
    /// Joins the basins of `peaks` whose dynamics are below `h` voxels, or 0, to deeper ones. `outdoors` is the first voxel
    /// outdoors, if that is a basin.
    pub(super) fn of(
        peaks: &[Peak],
        mut contacts: Vec<Contact>,
        h: f64,
        outdoors: Option<usize>,
    ) -> Self {
        let h = (h * f64::from(STEPS)).ceil().min(f64::from(u32::MAX)) as u32;
        // Roots are numbered deepest first, so the least of a set is the deepest.
        let mut joined = Sets::new(peaks.len() + 1);
        contacts.sort_unstable_by_key(|c| (std::cmp::Reverse(c.level), c.pair));
        for contact in &contacts {
            let [a, b] = contact.pair.map(|root| joined.find(root));
            let shallow = a.max(b);
            if a != b && shallow != OUTER {
                let peak = &peaks[shallow as usize - 1];
                let dynamics = u32::from(peak.level - contact.level);
                if dynamics == 0 || dynamics < h {
                    joined.join(a, b);
                }
            }
        }
        let mut basins: Vec<Basin> = Vec::new();
        let mut labels = vec![0_u32; peaks.len() + 1];
        if let Some(first) = outdoors {
            basins.push(Basin {
                peak: f64::INFINITY,
                peak_voxel: first,
                n_voxels: 0,
            });
            labels[OUTER as usize] = 1;
        }
        for (root, peak) in (1..).zip(peaks) {
            let deepest = joined.find(root);
            if deepest == root {
                basins.push(Basin {
                    peak: f64::from(peak.level) / f64::from(STEPS),
                    peak_voxel: peak.voxel as usize,
                    n_voxels: 0,
                });
                labels[root as usize] = basins.len() as u32;
            } else {
                labels[root as usize] = labels[deepest as usize];
            }
        }
        for contact in &mut contacts {
            let [a, b] = contact.pair.map(|root| labels[root as usize]);
            contact.pair = [a.min(b), a.max(b)];
        }
        contacts.retain(|c| c.pair[0] != c.pair[1]);
        Self {
            basins,
            labels,
            contacts: merged(contacts),
        }
    }

    /// Labels the voxels, given one more than the root of each.
    pub(super) fn finish(mut self, mut labels: Labels) -> Watershed {
        let of_root = |root: u32| self.labels.get(root as usize).copied().unwrap_or(0);
        labels.relabel(|root, _| root.checked_sub(1).map_or(0, of_root));
        count(&labels, &mut self.basins);
        let mut saddles: Vec<Saddle> = self
            .contacts
            .iter()
            .map(|c| Saddle {
                a: c.pair[0],
                b: c.pair[1],
                distance: f64::from(c.level) / f64::from(STEPS),
                voxel: c.voxel as usize,
                n_faces: c.n_faces,
            })
            .collect();
        saddles.sort_by(|p, q| {
            q.distance
                .total_cmp(&p.distance)
                .then((p.a, p.b).cmp(&(q.a, q.b)))
        });
        Watershed {
            labels,
            basins: self.basins,
            saddles,
        }
    }
}

/// Fills in the sizes of the basins.
fn count(labels: &Labels, basins: &mut [Basin]) {
    let mut counts = vec![0u64; basins.len() + 1];
    labels.for_runs(0..labels.len(), |voxels, label| {
        counts[label as usize] += voxels.len() as u64;
    });
    for (basin, n) in basins.iter_mut().zip(&counts[1..]) {
        basin.n_voxels = *n;
    }
}
