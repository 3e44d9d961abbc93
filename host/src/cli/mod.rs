//! The command line: what was typed, checked and carried out. It prints; the rest of the library does not.

mod config;
mod demo;
mod error;
mod evaluate;
mod frames;
mod localize;
mod progress;
mod run;
mod simulate;

use std::io::{self, Write};

use clap::{CommandFactory, Parser, Subcommand};

pub use error::CliError;

const AFTER_HELP: &str = "\
Exit codes: 0 done; 1 the program failed; 2 the command line is wrong; 3 the input data is missing or broken;
4 an output cannot be written or exists already; 5 the configuration is not valid.

Try it with nothing but this program:  sdslam demo";

/// SD-SLAM: semantic LiDAR SLAM for dynamic scenes. Labelled LiDAR scans in; trajectory, what moves, and a static
/// semantic map out.
///
/// Drives are in KITTI odometry layout with SemanticKITTI labels: the folders velodyne and labels and the files calib.txt
/// and times.txt in DATASET/sequences/NN and, for ground truth, DATASET/poses/NN.txt.
#[derive(Debug, Parser)]
#[command(name = "sdslam", version, after_help = AFTER_HELP)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Args),
    Localize(localize::Args),
    Evaluate(evaluate::Args),
    Simulate(simulate::Args),
    Demo(demo::Args),
    Config(config::Args),
    Completions(CompletionArgs),
}

/// Print a completion script for a shell.
///
/// Example: sdslam completions bash > ~/.local/share/bash-completion/completions/sdslam
#[derive(Debug, clap::Args)]
struct CompletionArgs {
    /// The shell.
    shell: clap_complete::Shell,
}

impl Cli {
    /// Carries out the command.
    pub fn execute(self) -> Result<(), CliError> {
        match self.command {
            Command::Run(args) => args.execute(),
            Command::Localize(args) => args.execute(),
            Command::Evaluate(args) => args.execute(),
            Command::Simulate(args) => args.execute(),
            Command::Demo(args) => args.execute(),
            Command::Config(args) => args.execute(),
            Command::Completions(args) => args.execute(),
        }
    }
}

impl CompletionArgs {
    fn execute(&self) -> Result<(), CliError> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "sdslam", &mut script);
        print(script)
    }
}

/// Writes to stdout; a reader that has seen enough (`sdslam config | head`) is no failure.
fn print(text: impl AsRef<[u8]>) -> Result<(), CliError> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_ref()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(CliError::Stdout(error)),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
