//! Ray flags: each alone, each pair, none and all, over a scene with everything in it.

use rayburst_accel::RayFlags;

use crate::{
    harness::{Tally, verify},
    model::{Policy, Table, flag},
    scenes::{RICH_TYPES, rays, rich, with_ends, without_ends},
};

fn check_with(flags: u32, policy: impl Fn(usize) -> Policy) -> Tally {
    let scene = rich();
    let table = Table::fit(&scene, &RICH_TYPES, policy);
    verify(&scene, &table, &rays(&scene, &table, 120, flags, u64::from(flags)))
}

fn check(flags: u32) {
    let tally = check_with(flags, without_ends);
    check_with(flags, with_ends);
    let silent = check_with(flags, |_| Policy::Absent);
    assert_eq!(silent.any_hits, 0);
    let has = |flag: u32| flags & flag != 0;
    // What the flags forbid never happens, all else does.
    let nothing = (has(flag::CULL_OPAQUE)
        && (has(flag::CULL_NON_OPAQUE) || has(flag::FORCE_OPAQUE)))
        || (has(flag::CULL_NON_OPAQUE) && has(flag::FORCE_NON_OPAQUE) && !has(flag::FORCE_OPAQUE))
        || (has(flag::SKIP_TRIANGLES) && has(flag::SKIP_PROCEDURAL));
    let procedural = !nothing && !has(flag::SKIP_PROCEDURAL);
    assert_eq!(tally.closest_hits > 0, !nothing && !has(flag::SKIP_CLOSEST_HIT), "{tally:?}");
    assert_eq!(
        tally.any_hits > 0,
        !nothing && !has(flag::FORCE_OPAQUE) && !has(flag::CULL_NON_OPAQUE)
    );
    assert_eq!(tally.intersections > 0, procedural, "{tally:?}");
    assert!(tally.misses > 0, "{tally:?}");
}

macro_rules! singles {
    ($($name:ident = $flags:expr;)*) => {
        mod one {
            use super::*;
            $(
                #[test]
                fn $name() {
                    check($flags.bits());
                }
            )*
        }
    };
}

singles! {
    none = RayFlags::empty();
    force_opaque = RayFlags::FORCE_OPAQUE;
    force_non_opaque = RayFlags::FORCE_NON_OPAQUE;
    accept_first_hit_and_end_search = RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH;
    skip_closest_hit_shader = RayFlags::SKIP_CLOSEST_HIT_SHADER;
    cull_back_facing_triangles = RayFlags::CULL_BACK_FACING_TRIANGLES;
    cull_front_facing_triangles = RayFlags::CULL_FRONT_FACING_TRIANGLES;
    cull_opaque = RayFlags::CULL_OPAQUE;
    cull_non_opaque = RayFlags::CULL_NON_OPAQUE;
    skip_triangles = RayFlags::SKIP_TRIANGLES;
    skip_procedural_primitives = RayFlags::SKIP_PROCEDURAL_PRIMITIVES;
}

/// A test for each unordered pair of names.
macro_rules! pairs {
    ($last:ident = $a:ident) => {};
    ($first:ident = $a:ident $(, $rest:ident = $b:ident)+) => {
        mod $first {
            use super::*;
            $(
                #[test]
                fn $rest() {
                    check((RayFlags::$a | RayFlags::$b).bits());
                }
            )+
        }
        pairs!($($rest = $b),+);
    };
}

mod pair_of {
    use super::*;

    pairs! {
        force_opaque = FORCE_OPAQUE,
        force_non_opaque = FORCE_NON_OPAQUE,
        accept_first_hit_and_end_search = ACCEPT_FIRST_HIT_AND_END_SEARCH,
        skip_closest_hit_shader = SKIP_CLOSEST_HIT_SHADER,
        cull_back_facing_triangles = CULL_BACK_FACING_TRIANGLES,
        cull_front_facing_triangles = CULL_FRONT_FACING_TRIANGLES,
        cull_opaque = CULL_OPAQUE,
        cull_non_opaque = CULL_NON_OPAQUE,
        skip_triangles = SKIP_TRIANGLES,
        skip_procedural_primitives = SKIP_PROCEDURAL_PRIMITIVES
    }
}

#[test]
fn shadow_ray() {
    use flag::{ACCEPT_FIRST, SKIP_CLOSEST_HIT};
    check(ACCEPT_FIRST | SKIP_CLOSEST_HIT | flag::FORCE_OPAQUE);
    check(ACCEPT_FIRST | SKIP_CLOSEST_HIT | flag::FORCE_NON_OPAQUE);
}

#[test]
fn all_flags_find_nothing() {
    let tally = check_with(0x3FF, without_ends);
    assert_eq!((tally.any_hits, tally.closest_hits, tally.intersections), (0, 0, 0));
    assert_eq!(tally.misses, 120);
}

#[test]
fn values_are_those_of_the_specification() {
    let named = [
        (RayFlags::FORCE_OPAQUE, flag::FORCE_OPAQUE),
        (RayFlags::FORCE_NON_OPAQUE, flag::FORCE_NON_OPAQUE),
        (RayFlags::ACCEPT_FIRST_HIT_AND_END_SEARCH, flag::ACCEPT_FIRST),
        (RayFlags::SKIP_CLOSEST_HIT_SHADER, flag::SKIP_CLOSEST_HIT),
        (RayFlags::CULL_BACK_FACING_TRIANGLES, flag::CULL_BACK),
        (RayFlags::CULL_FRONT_FACING_TRIANGLES, flag::CULL_FRONT),
        (RayFlags::CULL_OPAQUE, flag::CULL_OPAQUE),
        (RayFlags::CULL_NON_OPAQUE, flag::CULL_NON_OPAQUE),
        (RayFlags::SKIP_TRIANGLES, flag::SKIP_TRIANGLES),
        (RayFlags::SKIP_PROCEDURAL_PRIMITIVES, flag::SKIP_PROCEDURAL),
    ];
    for (flags, bits) in named {
        assert_eq!(flags.bits(), bits);
    }
}

#[test]
fn unknown_bits_mean_nothing() {
    let tally = check_with(0xFFFF_FC00, without_ends);
    assert!(tally.closest_hits > 0 && tally.any_hits > 0);
}
