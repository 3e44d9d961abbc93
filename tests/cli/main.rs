//! The command line as its users meet it: what it says, what it writes, what it refuses and with which exit code.

mod commands;
mod faults;
mod runs;
mod segmentation;
mod simulation;
mod support;
