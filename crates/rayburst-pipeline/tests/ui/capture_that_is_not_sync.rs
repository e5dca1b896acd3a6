use std::cell::Cell;

use rayburst_pipeline::ShaderTable;

fn main() {
    let count = Cell::new(0);
    let mut table = ShaderTable::new();
    table.ray_generation(|_| count.set(count.get() + 1));
}
