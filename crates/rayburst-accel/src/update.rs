//! Structures over geometry that moves from frame to frame: when to refit, when to build anew.
//!
//! A refit is many times faster than a build, but keeps the old tree, which fits the mesh less and less
//! as its triangles move apart. The surface area heuristic says what that costs (Haines, Hoffman,
//! Akenine-Möller, "Real-Time Rendering", 4th edition, chapter 26; Lauterbach, Yoon, Tuft, Manocha,
//! "RT-DEFORM: interactive ray tracing of dynamic scenes using BVHs", 2006, who rebuild where this
//! cost has grown by a limit). Which one is chosen changes time alone: hits do not depend on the tree.

use std::{sync::Arc, time::Instant};

use crate::{Blas, BuildError, BuildOptions, Geometry, GeometryKind, Layout, TriangleMesh};

/// Which frames build a moving mesh's structure anew; the others refit it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum UpdatePolicy {
    /// All.
    RebuildAlways,
    /// Those that a refit cannot serve; see [`RebuildReason`].
    RefitAlways,
    /// Every so many frames one, so that the cost is shared; 0 counts as 1.
    EveryFrames(u32),
    /// Those where, after the refit, the cost by the surface area heuristic is more than so many times
    /// that of the last build; so it never stays above. A limit that is not a number is never kept.
    QualityGrowth {
        /// How many times.
        limit: f32,
    },
    /// So many seconds a frame on average: what refits leave of them is saved, and a frame whose cost
    /// has grown noticeably (by 5 %) builds anew if what is saved covers what the last build took. No
    /// more is saved than that, and refits take place whatever they take. The choice depends on the
    /// speed of the machine; hits do not.
    TimeBudget {
        /// How many seconds.
        seconds: f64,
    },
}

/// Growth of the cost from which a build that there is time for is worth it.
const NOTICEABLE: f32 = 1.05;

impl Default for UpdatePolicy {
    /// Growth by at most 1.3.
    fn default() -> Self {
        Self::QualityGrowth { limit: 1.3 }
    }
}

/// Why a frame built anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RebuildReason {
    /// The policy says so of this frame, whatever is in it.
    Scheduled,
    /// The cost had grown beyond the limit.
    Quality,
    /// There was time for it.
    Budget,
    /// There are other geometries, or other numbers of primitives, or other ones are opaque.
    Topology,
    /// A primitive can be hit now that could not be when the structure was built.
    Reappeared,
    /// Triangles in compressed structures cannot be refitted.
    Compressed,
}

/// What a frame did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum UpdateAction {
    /// A refit.
    Refit,
    /// A build, perhaps after a refit.
    Rebuild(RebuildReason),
}

/// What [`MovingBlas::update`] did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateReport {
    /// Refit or build.
    pub action: UpdateAction,
    /// Time of all of it.
    pub seconds: f64,
    /// Cost by the surface area heuristic now, as in [`crate::BuildStats::sah_cost`].
    pub sah_cost: f32,
    /// The same right after the last build, which may be this one.
    pub sah_at_build: f32,
    /// What a refit of this frame made of the cost of the build before, as a multiple of it; 1 without
    /// one.
    pub growth: f32,
}

/// The structure of meshes and procedural primitives that move, and how it is kept.
#[derive(Clone, Debug)]
pub struct MovingBlas<'a> {
    blas: Arc<Blas>,
    options: BuildOptions<'a>,
    policy: UpdatePolicy,
    history: History,
}

/// Triangle meshes as geometries.
fn geometries_of<'a>(meshes: &[TriangleMesh<'a>]) -> Vec<Geometry<'a>> {
    meshes.iter().map(|&mesh| mesh.into()).collect()
}

/// What choices depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct History {
    /// Frames since the last build.
    frames: u32,
    /// The cost after it.
    sah_at_build: f32,
    /// What it took.
    build_seconds: f64,
    /// What refits left of a budget.
    saved: f64,
}

impl UpdatePolicy {
    /// Whether a frame is to be built anew before anything is known of it.
    fn before_refit(self, history: &History) -> bool {
        match self {
            Self::RebuildAlways => true,
            Self::EveryFrames(frames) => history.frames + 1 >= frames,
            Self::RefitAlways | Self::QualityGrowth { .. } | Self::TimeBudget { .. } => false,
        }
    }

    /// Whether a frame is to be built anew after a refit that made the cost grow so.
    fn after_refit(self, history: &History, growth: f32) -> Option<RebuildReason> {
        match self {
            Self::QualityGrowth { limit } if limit.is_nan() || growth > limit => {
                Some(RebuildReason::Quality)
            }
            Self::TimeBudget { .. } => {
                let due = growth > NOTICEABLE && history.saved >= history.build_seconds;
                due.then_some(RebuildReason::Budget)
            }
            _ => None,
        }
    }
}

impl History {
    fn of(blas: &Blas) -> Self {
        let stats = blas.stats();
        Self { frames: 0, sah_at_build: stats.sah_cost, build_seconds: stats.seconds, saved: 0.0 }
    }

    /// Adds what a refit left of a frame's seconds.
    fn save(&mut self, policy: UpdatePolicy, refit_seconds: f64) {
        let UpdatePolicy::TimeBudget { seconds } = policy else { return };
        // A budget that is not a number leaves nothing.
        let left = (self.saved + seconds - refit_seconds).max(0.0);
        self.saved = left.min(self.build_seconds.max(0.0));
    }

    /// A cost as a multiple of that of the last build.
    fn growth(&self, sah_cost: f32) -> f32 {
        if sah_cost == self.sah_at_build { 1.0 } else { sah_cost / self.sah_at_build }
    }
}

impl<'a> MovingBlas<'a> {
    /// Builds the structure of the first frame of triangle meshes.
    pub fn build(
        geometries: &[TriangleMesh<'_>],
        options: &BuildOptions<'a>,
        policy: UpdatePolicy,
    ) -> Result<Self, BuildError> {
        Self::of_geometries(&geometries_of(geometries), options, policy)
    }

    /// Builds the structure of the first frame of geometries of either kind.
    pub fn of_geometries(
        geometries: &[Geometry<'_>],
        options: &BuildOptions<'a>,
        policy: UpdatePolicy,
    ) -> Result<Self, BuildError> {
        let blas = Blas::of_geometries(geometries, options)?;
        let history = History::of(&blas);
        Ok(Self { blas: Arc::new(blas), options: *options, policy, history })
    }

    /// The structure of the last frame.
    pub fn blas(&self) -> &Arc<Blas> {
        &self.blas
    }

    /// How it is kept.
    pub fn policy(&self) -> UpdatePolicy {
        self.policy
    }

    /// The structure of the next frame, of any geometries, though those of the last one in other places
    /// are what it is for. Structures in use elsewhere, as by a [`crate::Tlas`], are left as they are:
    /// a copy is refitted, which takes longer.
    ///
    /// After an error the structure is that of the last frame, or that of this one if it was refitted
    /// before a build was cancelled.
    pub fn update(&mut self, geometries: &[TriangleMesh<'_>]) -> Result<UpdateReport, BuildError> {
        self.update_geometries(&geometries_of(geometries))
    }

    /// The same with geometries of either kind. Costs are the sums of those of both trees.
    pub fn update_geometries(
        &mut self,
        geometries: &[Geometry<'_>],
    ) -> Result<UpdateReport, BuildError> {
        let begin = Instant::now();
        if let Some(reason) = self.needs_build(geometries) {
            return self.rebuild(geometries, reason, 1.0, begin);
        }
        let refit = match Arc::make_mut(&mut self.blas).refit_geometries(geometries) {
            Err(BuildError::Reappeared { .. } | BuildError::BoxReappeared { .. }) => {
                return self.rebuild(geometries, RebuildReason::Reappeared, 1.0, begin);
            }
            refit => refit?,
        };
        let growth = self.history.growth(refit.sah_after);
        self.history.frames = self.history.frames.saturating_add(1);
        self.history.save(self.policy, begin.elapsed().as_secs_f64());
        if let Some(reason) = self.policy.after_refit(&self.history, growth) {
            return self.rebuild(geometries, reason, growth, begin);
        }
        Ok(self.report(UpdateAction::Refit, growth, begin))
    }

    /// Why a refit would not do, or is not to be tried.
    fn needs_build(&self, geometries: &[Geometry<'_>]) -> Option<RebuildReason> {
        let infos = self.blas.geometries();
        let is_same = geometries.len() == infos.len()
            && geometries.iter().zip(infos).all(|(geometry, built)| geometry.info() == *built);
        let has_triangles = infos.iter().any(|info| info.kind == GeometryKind::Triangles);
        if !is_same {
            Some(RebuildReason::Topology)
        } else if self.options.layout == Layout::Compressed && has_triangles {
            Some(RebuildReason::Compressed)
        } else {
            self.policy.before_refit(&self.history).then_some(RebuildReason::Scheduled)
        }
    }

    fn rebuild(
        &mut self,
        geometries: &[Geometry<'_>],
        reason: RebuildReason,
        growth: f32,
        begin: Instant,
    ) -> Result<UpdateReport, BuildError> {
        *self = Self::of_geometries(geometries, &self.options, self.policy)?;
        Ok(self.report(UpdateAction::Rebuild(reason), growth, begin))
    }

    fn report(&self, action: UpdateAction, growth: f32, begin: Instant) -> UpdateReport {
        UpdateReport {
            action,
            seconds: begin.elapsed().as_secs_f64(),
            sah_cost: self.blas.stats().sah_cost,
            sah_at_build: self.history.sah_at_build,
            growth,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HISTORY: History =
        History { frames: 0, sah_at_build: 10.0, build_seconds: 0.125, saved: 0.0 };

    #[test]
    fn a_schedule_counts_frames() {
        let after = |frames| History { frames, ..HISTORY };
        let every = UpdatePolicy::EveryFrames(3);
        assert_eq!([0, 1, 2, 3].map(|f| every.before_refit(&after(f))), [false, false, true, true]);
        assert!([0, 1].iter().all(|&n| UpdatePolicy::EveryFrames(n).before_refit(&HISTORY)));
        assert!(!UpdatePolicy::RefitAlways.before_refit(&after(1000)));
        assert_eq!(UpdatePolicy::RefitAlways.after_refit(&HISTORY, f32::INFINITY), None);
    }

    #[test]
    fn quality_is_kept_within_the_limit() {
        let policy = |limit| UpdatePolicy::QualityGrowth { limit };
        assert_eq!(policy(1.3).after_refit(&HISTORY, 1.29), None);
        assert_eq!(policy(1.3).after_refit(&HISTORY, 1.31), Some(RebuildReason::Quality));
        assert_eq!(policy(f32::NAN).after_refit(&HISTORY, 1.0), Some(RebuildReason::Quality));
        // Nothing to be hit, before and now.
        let empty = History { sah_at_build: 0.0, ..HISTORY };
        assert_eq!((empty.growth(0.0), HISTORY.growth(15.0)), (1.0, 1.5));
    }

    #[test]
    fn a_budget_is_saved_until_it_covers_a_build() {
        let policy = UpdatePolicy::TimeBudget { seconds: 0.046875 };
        let mut history = HISTORY;
        let mut built = vec![];
        for _ in 0..6 {
            history.save(policy, 0.015625);
            built.push(policy.after_refit(&history, 1.2).is_some());
        }
        assert_eq!(built, [false, false, false, true, true, true]);
        assert_eq!(policy.after_refit(&history, 1.01), None, "not worth it");
        for _ in 0..100 {
            history.save(policy, 0.01);
        }
        assert_eq!(history.saved, history.build_seconds, "no more than a build takes");
        history.save(policy, 9.0);
        assert_eq!(history.saved, 0.0, "and never a debt");
        history.save(UpdatePolicy::TimeBudget { seconds: f64::NAN }, 0.01);
        assert_eq!(history.saved, 0.0);
    }
}
