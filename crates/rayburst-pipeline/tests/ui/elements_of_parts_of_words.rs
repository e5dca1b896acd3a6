use rayburst_pipeline::RwBuffer;

fn main() {
    RwBuffer::<u16>::new(4);
}
