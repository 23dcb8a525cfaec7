//! The queue of visits: drops those contained in others, joins those that are alike.

use std::cmp::Reverse;

use glam::DVec3;

use super::traversal::Traversal;
use super::viewer::{Mark, Pending, Stage};
use super::window::NONE;
use crate::region::Region;

/// Maximum number of visits of one cell that wait at the same time; further ones are joined.
const MAX_QUEUED: u8 = 4;
/// Visits of one cell entered unchanged.
const MAX_ENTERED: u8 = 12;
/// Further visits that join all regions so far; the next one takes the whole screen.
const MAX_JOINED: u8 = 3;
/// Waiting visits are joined if the rectangle around both exceeds their areas by less than this
/// fraction. Below 0.1 doors side by side stay apart; above 0.5 rooms behind walls appear.
const WASTE: f64 = 0.25;

impl Traversal<'_, '_> {
    #[inline]
    pub(super) fn mark(&mut self, cell: u32) -> Mark {
        let stamp = self.viewer.face_stamp;
        let mark = &mut self.viewer.marks[cell as usize];
        if mark.stamp != stamp {
            *mark = Mark {
                stamp,
                head: NONE,
                n_waiting: 0,
                n_entered: 0,
            };
        }
        *mark
    }

    /// Queues a visit unless it adds nothing; joins it to another if that is cheaper.
    pub(super) fn push(
        &mut self,
        cell: u32,
        via: u32,
        mut region: Region,
        mut entry: Option<(DVec3, f64)>,
        mut near: f64,
    ) {
        let mark = self.mark(cell);
        let narrowing = self.viewer.options.narrowing;
        let (mut best, mut least_waste) = (NONE, f64::INFINITY);
        let mut at = mark.head;
        let mut n_waiting = mark.n_waiting;
        while at != NONE {
            let other = &self.viewer.pending[at as usize];
            let next = other.next;
            if other.state != Stage::Gone {
                if self.covers(&other.region, other.entry, &region, entry) {
                    // The waiting visit covers it. If the new one is nearer, only the order of drawing may
                    // differ a little.
                    self.viewer.out.counts.spared += 1;
                    self.viewer.marks[cell as usize].n_waiting = n_waiting;
                    return;
                }
                if other.state == Stage::Waiting {
                    let waste = other.region.waste_of_joining(&region);
                    if self.covers(&region, entry, &other.region, other.entry) {
                        near = near.min(other.near);
                        self.viewer.pending[at as usize].state = Stage::Gone;
                        self.viewer.out.counts.spared += 1;
                        n_waiting -= 1;
                    } else if waste < least_waste {
                        (best, least_waste) = (at, waste);
                    }
                }
            }
            at = next;
        }
        if mark.n_entered >= MAX_ENTERED {
            // Join everything so far; at last take the whole screen.
            let mut at = mark.head;
            while at != NONE {
                let other = &mut self.viewer.pending[at as usize];
                region = region.rectangle_around(&other.region);
                if other.state == Stage::Waiting {
                    near = near.min(other.near);
                    other.state = Stage::Gone;
                    self.viewer.out.counts.spared += 1;
                }
                at = other.next;
            }
            if mark.n_entered >= MAX_ENTERED + MAX_JOINED {
                region = Region::screen();
            }
            entry = self.viewer.stepping.entry();
            n_waiting = 0;
        } else if best != NONE && (least_waste < WASTE || n_waiting >= MAX_QUEUED) {
            let gate = self.viewer.stepping.entry();
            let other = &mut self.viewer.pending[best as usize];
            other.region = other.region.joined(&region, narrowing);
            // Begin beyond the nearer of two parallel planes; without a common direction, drop the bound.
            other.entry = match (other.entry, entry) {
                (Some((n, h)), Some((m, k))) if n.dot(m) > 1.0 - 1e-9 => Some((n, h.min(k))),
                _ => gate,
            };
            self.viewer.out.counts.spared += 1;
            if near < other.near {
                other.near = near;
                self.viewer
                    .queue
                    .push(Reverse((near.max(0.0).to_bits(), best)));
            }
            self.viewer.marks[cell as usize].n_waiting = n_waiting;
            return;
        }
        let index = self.viewer.pending.len() as u32;
        self.viewer.pending.push(Pending {
            cell,
            via,
            region,
            entry,
            near,
            next: mark.head,
            state: Stage::Waiting,
        });
        let mark = &mut self.viewer.marks[cell as usize];
        mark.head = index;
        mark.n_waiting = n_waiting + 1;
        // Positive floats are ordered as their bits are.
        self.viewer
            .queue
            .push(Reverse((near.max(0.0).to_bits(), index)));
    }

    /// Returns `true` if one visit of a cell contains everything that another sees.
    fn covers(
        &self,
        region: &Region,
        entry: Option<(DVec3, f64)>,
        other: &Region,
        other_entry: Option<(DVec3, f64)>,
    ) -> bool {
        if !other.is_within(region) {
            return false;
        }
        let Some((n, h)) = entry else { return true };
        let Some((m, k)) = other_entry else {
            return false;
        };
        if n == m && h <= k {
            return true;
        }
        // The depth along a ray r is h / (n · r): the entry must not be farther along any ray of the
        // other's region, including its widened rim.
        let (n, m) = (self.face.normals * n, self.face.normals * m);
        let difference = n * k - m * h;
        let rim = other.widened() * difference.truncate().length();
        other.corners().iter().all(|c| {
            let ray = c.extend(1.0);
            n.dot(ray) > 0.0 && m.dot(ray) > 0.0 && difference.dot(ray) >= rim
        })
    }
}
