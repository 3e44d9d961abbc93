//! The `sdslam` command.
fn main() {}
