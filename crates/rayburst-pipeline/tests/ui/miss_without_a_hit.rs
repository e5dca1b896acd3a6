use rayburst_pipeline::ShaderTable;

fn main() {
    let mut table = ShaderTable::new();
    table.miss("miss", |miss, payload: &mut f32| *payload = miss.t());
}
