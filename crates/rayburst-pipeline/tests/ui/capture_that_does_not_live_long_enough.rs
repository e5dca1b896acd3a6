use rayburst_pipeline::{Pipeline, ShaderTable};

fn pipeline<'s>() -> Pipeline<'s> {
    let colour = 1.0f32;
    let mut table = ShaderTable::new();
    table.miss("sky", |_, payload: &mut f32| *payload = colour);
    table.build(1).unwrap()
}

fn main() {
    pipeline();
}
