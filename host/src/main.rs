//! The `sdslam` command.

use std::error::Error;
use std::io::{self, Write};
use std::process::ExitCode;

use clap::Parser;
use sdslam::cli::Cli;

fn main() -> ExitCode {
    match Cli::parse().execute() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nobody is left to be told when stderr is closed.
            let _ = report(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

/// Prints an error and what caused it, one a line.
fn report(error: &dyn Error) -> io::Result<()> {
    let mut stderr = io::stderr().lock();
    writeln!(stderr, "error: {error}")?;
    let mut cause = error.source();
    while let Some(error) = cause {
        writeln!(stderr, "  because: {error}")?;
        cause = error.source();
    }
    Ok(())
}
