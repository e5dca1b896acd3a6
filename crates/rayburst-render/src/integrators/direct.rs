//! Light that comes from lights directly, seen in mirrors and through glass too.
//!
//! The path tracer's estimator, ended at the first surface that scatters.

use super::{
    path::{Reach, transport},
    queue::Queues,
};
use crate::batch::{Batch, Context};

pub(super) fn integrate(context: &Context<'_>, batch: &mut Batch, queues: &mut Queues) {
    transport(context, batch, queues, Reach::Direct);
}
