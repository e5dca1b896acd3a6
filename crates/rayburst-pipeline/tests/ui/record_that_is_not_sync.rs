use std::cell::Cell;

use rayburst_pipeline::{HitGroup, ShaderTable};

fn main() {
    let mut table = ShaderTable::new();
    let group = HitGroup::<u32, _, Cell<u32>>::triangles("triangles");
    table.hit(&group, Cell::new(1));
}
