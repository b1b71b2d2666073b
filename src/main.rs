//! Command-line entry point. Exit codes: 0 done, 1 failed, 2 usage, 128 and the number of a signal
//! that ended the work.

use std::process::ExitCode;

use clap::Parser;
use lightopt_embree::cli::{Cli, catch_signals, exit_code, interrupted, run, say_error};

fn main() -> ExitCode {
    // Usage errors and --help end here, with 2 and 0.
    let cli = Cli::parse();
    match catch_signals().map_err(Into::into).and_then(|()| run(&cli)) {
        Ok(()) => exit_code(),
        Err(error) => {
            say_error(&error);
            if interrupted() { exit_code() } else { ExitCode::FAILURE }
        }
    }
}
