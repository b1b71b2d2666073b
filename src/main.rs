//! Command-line entry point. Exit codes: 0 done, 1 failed, 2 usage, 128 and the number of a signal
//! that ended the work.

use std::process::ExitCode;

use clap::Parser;
use lightopt_embree::cli::{Cli, catch_signals, exit_code, interrupted, run, say_error};

fn main() -> ExitCode {
    return_large_arrays();
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

/// Has arrays of a megabyte and more returned to the system when they are dropped. Otherwise glibc keeps what
/// the basis had while the pictures need as much again: a run of the fruit basket takes 362 MB so, and 446
/// without.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn return_large_arrays() {
    // SAFETY: This sets a number of the allocator, before there is another thread.
    unsafe { libc::mallopt(libc::M_MMAP_THRESHOLD, 1 << 20) };
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn return_large_arrays() {}
