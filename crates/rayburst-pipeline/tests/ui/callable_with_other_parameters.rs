use rayburst_pipeline::ShaderTable;

fn main() {
    let mut table = ShaderTable::new();
    let callable = table.callable(|_, _: &mut u32| {});
    table.ray_generation(move |launch| {
        let mut data = String::new();
        launch.call_shader(callable, &mut data);
    });
}
