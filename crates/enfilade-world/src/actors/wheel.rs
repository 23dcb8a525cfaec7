//! A hashed timing wheel of due actors.
//!
//! After Varghese and Lauck, "Hashed and hierarchical timing wheels" (SOSP 1987), scheme 6: a slot for each tick, the ticks
//! modulo the number of slots; entries of later rounds stay where they are. Slots are chains of blocks of one cache line, from
//! one pool: linked actors would cost a cache miss each, one after another. Setting a new time leaves the old entry behind,
//! which is dropped when its slot comes up. O(1) to set, and O(entries of its slot) for each tick that passes; at most all
//! entries once, however much time passes.

/// Ticks per second; each has a slot.
const TICKS: f64 = 64.0;
/// Number of slots: a round is 256 seconds, longer than most stays.
const SLOTS: usize = 16_384;
/// Stands for no block.
const NONE: u32 = u32::MAX;
/// Entries per block: with their number and the next block, 64 bytes.
const ENTRIES: usize = 14;

/// All entries by due time. The caller knows the exact time of each.
#[derive(Clone, Debug)]
pub(super) struct Wheel {
    heads: Vec<u32>,
    blocks: Vec<WheelBlock>,
    /// Blocks of no slot.
    free: u32,
}

#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct WheelBlock {
    ids: [u32; ENTRIES],
    n: u32,
    next: u32,
}

fn tick(time: f64) -> i64 {
    (time * TICKS).floor() as i64
}

fn slot(tick: i64) -> usize {
    tick.rem_euclid(SLOTS as i64) as usize
}

impl Wheel {
    pub(super) fn new() -> Self {
        Self {
            heads: vec![NONE; SLOTS],
            blocks: Vec::new(),
            free: NONE,
        }
    }

    /// Enters an actor with its due time; an infinite one is ignored.
    pub(super) fn set(&mut self, id: u32, due: f64) {
        if due.is_finite() {
            self.add(slot(tick(due)), id);
        }
    }

    fn add(&mut self, slot: usize, id: u32) {
        let head = self.heads[slot];
        if head == NONE || self.blocks[head as usize].n as usize == ENTRIES {
            let block = WheelBlock {
                ids: [NONE; ENTRIES],
                n: 0,
                next: head,
            };
            let at = self.free;
            if at == NONE {
                self.heads[slot] = self.blocks.len() as u32;
                self.blocks.push(block);
            } else {
                self.free = self.blocks[at as usize].next;
                self.blocks[at as usize] = block;
                self.heads[slot] = at;
            }
        }
        let block = &mut self.blocks[self.heads[slot] as usize];
        block.ids[block.n as usize] = id;
        block.n += 1;
    }

    /// Appends to `due` all entries due between two times, both included, and removes them; `when` returns the due time of an
    /// actor, which it may change.
    pub(super) fn due(
        &mut self,
        from: f64,
        until: f64,
        mut when: impl FnMut(u32) -> f64,
        due: &mut Vec<u32>,
    ) {
        let first = tick(from);
        let n = tick(until).saturating_sub(first).saturating_add(1);
        for k in 0..n.clamp(0, SLOTS as i64) {
            let this = slot(first.wrapping_add(k));
            let mut at = std::mem::replace(&mut self.heads[this], NONE);
            while at != NONE {
                let block = self.blocks[at as usize];
                self.blocks[at as usize].next = self.free;
                self.free = at;
                for &id in &block.ids[..block.n as usize] {
                    let time = when(id);
                    if time <= until {
                        due.push(id);
                    } else if time.is_finite() && slot(tick(time)) == this {
                        self.add(this, id);
                    }
                }
                at = block.next;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;

    /// Covers W13: due actors equal those of a plain list, over rounds and jumps.
    #[test]
    fn due_actors_equal_those_of_a_list() {
        let mut rng = Rng::new(3);
        let mut wheel = Wheel::new();
        let mut times = vec![f64::INFINITY; 300];
        let mut now = -10.0;
        for round in 0..4000 {
            let id = rng.below(300);
            times[id] = if rng.chance(0.1) {
                f64::INFINITY
            } else {
                now + rng.range(0.0, 600.0)
            };
            wheel.set(id as u32, times[id]);
            let far = round % 100 == 0;
            let then = now + if far { 900.0 } else { rng.range(0.0, 0.3) };
            let expected: Vec<u32> = (0..300).filter(|&i| times[i as usize] <= then).collect();
            let mut due = Vec::new();
            let when = |id: u32| {
                let time = &mut times[id as usize];
                let was = *time;
                if was <= then {
                    *time = f64::INFINITY;
                }
                was
            };
            wheel.due(now, then, when, &mut due);
            due.sort_unstable();
            assert_eq!(due, expected);
            now = then;
        }
        // Blocks are reused.
        assert!(wheel.blocks.len() < 600, "{}", wheel.blocks.len());
    }
}
