//! Intervals of a line that lie inside a solid, and a list of them.

use glam::{Vec2, Vec3};

/// Where a line crosses the surface of a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Distance in units of the ray's direction; double precision decides which of two surfaces
    /// comes first.
    pub t: f64,
    /// The unit normal in object space, outwards.
    pub normal: Vec3,
    /// Coordinates on the surface, as the documentation of its shape says.
    pub uv: Vec2,
}

/// A stretch of a line inside a solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Where the line goes in.
    pub entry: Crossing,
    /// Where the line comes out, beyond the entry.
    pub exit: Crossing,
}

/// How many intervals a list holds without memory of its own.
const INLINE: usize = 8;

const NOTHING: Crossing = Crossing { t: 0.0, normal: Vec3::ZERO, uv: Vec2::ZERO };

/// Disjoint intervals in increasing order.
///
/// Eight fit without an allocation; with more the list moves to the heap, and none is lost.
#[derive(Clone, Debug)]
pub struct IntervalList {
    inline: [Interval; INLINE],
    /// How many are in `inline`; none once `spilled` holds any.
    len: usize,
    spilled: Vec<Interval>,
}

impl IntervalList {
    /// A list without intervals.
    pub const fn new() -> Self {
        let nothing = Interval { entry: NOTHING, exit: NOTHING };
        Self { inline: [nothing; INLINE], len: 0, spilled: Vec::new() }
    }

    /// Removes all intervals; memory on the heap is kept for the next ones.
    #[inline]
    pub fn clear(&mut self) {
        self.len = 0;
        self.spilled.clear();
    }

    /// Appends an interval, which must begin where the last one ends or later. An empty one, or one
    /// with a NaN, is left out.
    #[inline]
    pub fn push(&mut self, entry: Crossing, exit: Crossing) {
        if entry.t < exit.t {
            self.append(Interval { entry, exit });
        }
    }

    #[inline]
    fn append(&mut self, interval: Interval) {
        if self.spilled.is_empty() && self.len < INLINE {
            self.inline[self.len] = interval;
            self.len += 1;
            return;
        }
        if self.spilled.is_empty() {
            self.spilled.extend_from_slice(&self.inline);
            self.len = 0;
        }
        self.spilled.push(interval);
    }

    /// The intervals.
    #[inline]
    pub fn as_slice(&self) -> &[Interval] {
        if self.spilled.is_empty() { &self.inline[..self.len] } else { &self.spilled }
    }

    /// How many crossings there are: two an interval.
    #[inline]
    pub(crate) fn crossing_count(&self) -> usize {
        2 * self.as_slice().len()
    }

    /// The crossing with an index: entries have even ones, exits odd ones.
    #[inline]
    pub(crate) fn crossing(&self, index: usize) -> &Crossing {
        let interval = &self.as_slice()[index / 2];
        if index.is_multiple_of(2) { &interval.entry } else { &interval.exit }
    }
}

impl Default for IntervalList {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(count: u32) -> IntervalList {
        let mut list = IntervalList::new();
        for i in 0..count {
            let t = f64::from(i);
            list.push(Crossing { t, ..NOTHING }, Crossing { t: t + 0.5, ..NOTHING });
        }
        list
    }

    #[test]
    fn no_interval_is_lost_when_a_list_spills() {
        for count in 0..40 {
            let list = filled(count);
            let starts: Vec<f64> = list.as_slice().iter().map(|i| i.entry.t).collect();
            assert_eq!(starts, (0..count).map(f64::from).collect::<Vec<_>>());
            assert_eq!(list.crossing_count(), 2 * count as usize);
            for index in 0..list.crossing_count() {
                assert_eq!(list.crossing(index).t, 0.5 * index as f64);
            }
        }
    }

    #[test]
    fn a_list_can_be_used_again() {
        let mut list = filled(20);
        list.clear();
        assert!(list.as_slice().is_empty());
        list.push(NOTHING, Crossing { t: 1.0, ..NOTHING });
        assert_eq!(list.as_slice().len(), 1);
    }

    #[test]
    fn empty_intervals_are_left_out() {
        let mut list = IntervalList::new();
        list.push(NOTHING, NOTHING);
        list.push(Crossing { t: f64::NAN, ..NOTHING }, NOTHING);
        assert!(list.as_slice().is_empty());
    }
}
