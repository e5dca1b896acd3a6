use rayburst_pipeline::ShaderTable;

fn main() {
    let mut table = ShaderTable::new();
    table.ray_generation(|launch| {
        launch.world_ray();
    });
}
