//! Who is due when: a hashed timing wheel.
//!
//! After Varghese and Lauck, "Hashed and hierarchical timing wheels" (SOSP 1987), scheme 6: a slot for each tick, the ticks modulo the
//! number of slots; entries of later rounds stay where they are. Entries are the actors themselves, linked, so that nothing is
//! allocated. O(1) to set, and for each tick that passes O(entries of its slot); whatever time goes by, no more than all entries
//! once.

/// Ticks in a second; each has a slot.
const TICKS: f64 = 64.0;
/// Slots: a round is 64 seconds, longer than most legs.
const SLOTS: usize = 4096;
/// Of no entry.
const NONE: u32 = u32::MAX;

/// All entries by the time that they are due.
#[derive(Clone, Debug)]
pub(super) struct Wheel {
    heads: Vec<u32>,
    entries: Vec<Entry>,
}

#[derive(Clone, Copy, Debug)]
struct Entry {
    /// Infinite where it is in no slot. [Units: s]
    due: f64,
    before: u32,
    after: u32,
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
            entries: Vec::new(),
        }
    }

    /// Adds one that is never due.
    pub(super) fn add(&mut self) {
        self.entries.push(Entry {
            due: f64::INFINITY,
            before: NONE,
            after: NONE,
        });
    }

    /// Sets when one is due, in place of what was; never where that is infinite.
    pub(super) fn set(&mut self, id: u32, due: f64) {
        let Entry {
            due: was,
            before,
            after,
        } = self.entries[id as usize];
        if was.is_finite() {
            match before {
                NONE => self.heads[slot(tick(was))] = after,
                b => self.entries[b as usize].after = after,
            }
            if after != NONE {
                self.entries[after as usize].before = before;
            }
        }
        let mut entry = Entry {
            due,
            before: NONE,
            after: NONE,
        };
        if due.is_finite() {
            let head = &mut self.heads[slot(tick(due))];
            entry.after = *head;
            *head = id;
            if entry.after != NONE {
                self.entries[entry.after as usize].before = id;
            }
        }
        self.entries[id as usize] = entry;
    }

    /// Adds all to `due` that are due between two times, both included; they stay in their slots until set anew.
    pub(super) fn due(&self, from: f64, until: f64, due: &mut Vec<u32>) {
        let first = tick(from);
        let n = tick(until).saturating_sub(first).saturating_add(1);
        for k in 0..n.clamp(0, SLOTS as i64) {
            let mut at = self.heads[slot(first.wrapping_add(k))];
            while at != NONE {
                let entry = &self.entries[at as usize];
                if entry.due <= until {
                    due.push(at);
                }
                at = entry.after;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use enfilade_testkit::Rng;

    /// W13: who is due is who a list would say, over rounds and jumps.
    #[test]
    fn due_are_those_whose_time_has_come() {
        let mut rng = Rng::new(3);
        let mut wheel = Wheel::new();
        let mut times = vec![f64::INFINITY; 300];
        for _ in 0..300 {
            wheel.add();
        }
        let mut now = -10.0;
        for round in 0..4000 {
            let id = rng.below(300);
            times[id] = if rng.chance(0.1) {
                f64::INFINITY
            } else {
                now + rng.range(0.0, 200.0)
            };
            wheel.set(id as u32, times[id]);
            let then = now
                + if round % 100 == 0 {
                    500.0
                } else {
                    rng.range(0.0, 0.3)
                };
            let mut due = Vec::new();
            wheel.due(now, then, &mut due);
            due.sort_unstable();
            let expected: Vec<u32> = (0..300).filter(|&i| times[i as usize] <= then).collect();
            assert_eq!(due, expected);
            for id in due {
                times[id as usize] = f64::INFINITY;
                wheel.set(id, f64::INFINITY);
            }
            now = then;
        }
    }
}
