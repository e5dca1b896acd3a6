use rayburst_pipeline::{RwBuffer, ShaderTable};

fn main() {
    let buffer = RwBuffer::<u32>::new(1);
    let mut table = ShaderTable::new();
    table.ray_generation(|_| buffer.store(0, 1));
    let pipeline = table.build(1).unwrap();
    drop(buffer);
    drop(pipeline);
}
