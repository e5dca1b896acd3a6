//! The lists of what can be chosen: tests and proof tools go through all of them. A choice that is
//! missing from its list does not compile.

use crate::{BuildQuality, Builder, Cull, Curve, Layout, TraceMode};

/// `ALL` for an enum: every variant must be named, and each once.
macro_rules! lists {
    ($($choice:ident: $($variant:ident),+;)+) => {$(
        impl $choice {
            /// Every choice.
            pub const ALL: [Self; [$(stringify!($variant)),+].len()] = {
                // Names every variant, so that a new one is missed here.
                fn check(choice: $choice) {
                    match choice {
                        $($choice::$variant => (),)+
                    }
                }
                let _: fn($choice) = check;
                [$(Self::$variant),+]
            };
        }
    )+};
}

lists! {
    BuildQuality: Fast, Balanced, Best;
    Builder: BinnedSah, SpatialSplits, Lbvh, Hlbvh, Ploc;
    Curve: Morton, Hilbert;
    Layout: Wide, Compressed;
    Cull: None, Front, Back, Both;
    TraceMode: Auto, Single, Interleaved, Packet, Stream;
}
