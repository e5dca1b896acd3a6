//! What portable intersection shaders return.

use bytemuck::Pod;

/// As many hits a portable intersection shader can report of one primitive.
pub const MAX_PORTABLE_REPORTS: usize = 8;

/// A hit that a portable intersection shader reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortableReport<A> {
    /// Distance in units of the ray's direction.
    pub t: f32,
    /// A kind of 0 to 127; greater bits are dropped.
    pub kind: u8,
    /// The attributes.
    pub attributes: A,
}

/// The hits that a portable intersection shader reports of a primitive, in the order in which they are
/// considered: of those in the interval that no any hit shader ignores, each shortens it, so that the nearest
/// is what remains. Nearest first saves calls of any hit shaders.
#[derive(Clone, Copy, Debug)]
pub struct PortableReports<A> {
    reports: [PortableReport<A>; MAX_PORTABLE_REPORTS],
    count: usize,
}

impl<A: Pod> PortableReports<A> {
    /// No hit.
    pub fn none() -> Self {
        let none = PortableReport { t: f32::NAN, kind: 0, attributes: A::zeroed() };
        Self { reports: [none; MAX_PORTABLE_REPORTS], count: 0 }
    }

    /// One hit.
    pub fn one(t: f32, kind: u8, attributes: A) -> Self {
        Self::none().and(t, kind, attributes)
    }

    /// These hits and another. Beyond [`MAX_PORTABLE_REPORTS`] it is not added.
    #[must_use]
    pub fn and(mut self, t: f32, kind: u8, attributes: A) -> Self {
        if let Some(slot) = self.reports.get_mut(self.count) {
            *slot = PortableReport { t, kind, attributes };
            self.count += 1;
        }
        self
    }

    /// The hits.
    pub fn as_slice(&self) -> &[PortableReport<A>] {
        &self.reports[..self.count]
    }
}

impl<A: Pod> Default for PortableReports<A> {
    fn default() -> Self {
        Self::none()
    }
}

impl<A: Pod> FromIterator<PortableReport<A>> for PortableReports<A> {
    /// The first [`MAX_PORTABLE_REPORTS`] of some hits.
    fn from_iter<I: IntoIterator<Item = PortableReport<A>>>(hits: I) -> Self {
        let hits = hits.into_iter().take(MAX_PORTABLE_REPORTS);
        hits.fold(Self::none(), |all, hit| all.and(hit.t, hit.kind, hit.attributes))
    }
}
