//! The integration tests of rayburst-image, in one binary.

mod files;
mod hostile;
mod metrics;
mod pictures;
mod real_files;
