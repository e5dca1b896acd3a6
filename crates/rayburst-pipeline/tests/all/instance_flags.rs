//! Instance flags: every combination on all instances, under rays that cull and rays that override.

use crate::{
    harness::verify,
    model::{Scene, Table, flag},
    scenes::{RICH_TYPES, rays, rich, with_ends, without_ends},
};

fn flagged(cull_disable: bool, front_clockwise: bool, force_opaque: Option<bool>) -> Scene {
    let mut scene = rich();
    for instance in &mut scene.instances {
        instance.cull_disable = cull_disable;
        instance.front_clockwise = front_clockwise;
        instance.force_opaque = force_opaque;
    }
    scene
}

fn check(cull_disable: bool, front_clockwise: bool, force_opaque: Option<bool>) {
    use flag::{
        CULL_BACK, CULL_FRONT, CULL_NON_OPAQUE, CULL_OPAQUE, FORCE_NON_OPAQUE, FORCE_OPAQUE,
        SKIP_PROCEDURAL,
    };
    let scene = flagged(cull_disable, front_clockwise, force_opaque);
    for flags in [
        0,
        CULL_BACK,
        CULL_FRONT,
        CULL_BACK | CULL_FRONT | SKIP_PROCEDURAL,
        FORCE_OPAQUE,
        FORCE_NON_OPAQUE,
        CULL_OPAQUE,
        CULL_NON_OPAQUE,
    ] {
        let table = Table::fit(&scene, &RICH_TYPES, without_ends);
        let tally = verify(&scene, &table, &rays(&scene, &table, 60, flags, 3));
        let opaque = if flags & FORCE_OPAQUE != 0 {
            Some(true)
        } else if flags & FORCE_NON_OPAQUE != 0 {
            Some(false)
        } else {
            force_opaque
        };
        let culled = (flags & CULL_OPAQUE != 0 && opaque == Some(true))
            || (flags & CULL_NON_OPAQUE != 0 && opaque == Some(false))
            || (flags & CULL_BACK != 0 && flags & CULL_FRONT != 0 && !cull_disable);
        assert_eq!(tally.closest_hits > 0, !culled, "{flags:#x}: {tally:?}");
        let asks = !culled && opaque != Some(true) && flags & CULL_NON_OPAQUE == 0;
        assert_eq!(tally.any_hits > 0, asks, "{flags:#x}: {tally:?}");
        let table = Table::fit(&scene, &RICH_TYPES, with_ends);
        verify(&scene, &table, &rays(&scene, &table, 60, flags, 4));
    }
}

macro_rules! combinations {
    ($($name:ident = ($cull_disable:literal, $front_clockwise:literal, $force_opaque:expr);)*) => {
        $(
            #[test]
            fn $name() {
                check($cull_disable, $front_clockwise, $force_opaque);
            }
        )*
    };
}

combinations! {
    none = (false, false, None);
    cull_disable = (true, false, None);
    front_clockwise = (false, true, None);
    cull_disable_and_front_clockwise = (true, true, None);
    force_opaque = (false, false, Some(true));
    force_opaque_and_cull_disable = (true, false, Some(true));
    force_opaque_and_front_clockwise = (false, true, Some(true));
    force_opaque_cull_disable_and_front_clockwise = (true, true, Some(true));
    force_non_opaque = (false, false, Some(false));
    force_non_opaque_and_cull_disable = (true, false, Some(false));
    force_non_opaque_and_front_clockwise = (false, true, Some(false));
    force_non_opaque_cull_disable_and_front_clockwise = (true, true, Some(false));
}
