//! Tests of the structures against brute force in `f64`, and of the rules that hold for every
//! structure.

#![allow(unreachable_pub)] // one binary: nothing is reachable from outside

mod build;
mod fuzzed;
mod instances;
mod meshes;
mod mixed;
mod modes;
mod nearest;
mod oracle;
mod oracle_tests;
mod procedural;
mod ray_query;
mod refit;
mod refit_changed;
mod refit_procedural;
mod rules;
mod skipping;
mod small;
mod splits;
mod update;
mod update_policy;
mod watertight;
