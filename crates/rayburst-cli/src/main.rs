//! The rayburst command line.

fn main() {}
