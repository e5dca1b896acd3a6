//! Warnings, gathered so that a thousand like cases make one line.

use std::collections::BTreeMap;

/// Warnings of one import: kinds with the number of times and the first place of each.
#[derive(Debug, Default)]
pub(super) struct Warnings {
    order: Vec<String>,
    kinds: BTreeMap<String, (u64, String)>,
}

impl Warnings {
    /// Notes `count` cases of `what`, seen at `location`.
    pub(super) fn add(&mut self, what: impl Into<String>, location: impl Into<String>, count: u64) {
        let what = what.into();
        if let Some((total, _)) = self.kinds.get_mut(&what) {
            *total += count;
        } else {
            self.order.push(what.clone());
            self.kinds.insert(what, (count, location.into()));
        }
    }

    /// One line a kind, in the order of first appearance.
    pub(super) fn into_lines(self) -> Vec<String> {
        let line = |what: &String| {
            let (count, location) = &self.kinds[what];
            match count {
                0 | 1 => format!("{location}: {what}"),
                _ => format!("{what} ({count} times, first at {location})"),
            }
        };
        self.order.iter().map(line).collect()
    }
}
