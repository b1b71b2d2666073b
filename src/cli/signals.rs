//! Ctrl-C and its like: the first ends the work in order, the second the program.

use std::{
    io::{self, Write},
    process::ExitCode,
    sync::atomic::{AtomicI32, Ordering},
    thread,
};

use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM},
    iterator::Signals,
};

/// The signal that ends the work; 0 as long as there was none.
static RECEIVED: AtomicI32 = AtomicI32::new(0);

/// Makes SIGINT (Ctrl-C), SIGTERM and SIGHUP end the work in order, as `what` says; a second signal
/// ends the program at once. Files are whole in both cases: they take their names when they are.
///
/// # Errors
/// When the handler cannot be installed.
pub fn catch(what: &'static str) -> io::Result<()> {
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    thread::Builder::new().name("signals".to_owned()).spawn(move || {
        for signal in signals.forever() {
            if RECEIVED.swap(signal, Ordering::Relaxed) != 0 {
                std::process::exit(status_of(signal));
            }
            let _ = writeln!(io::stderr(), "\ninterrupted: {what} (again to quit at once)");
        }
    })?;
    Ok(())
}

/// Whether a signal came.
#[must_use]
pub fn received() -> bool {
    RECEIVED.load(Ordering::Relaxed) != 0
}

/// The exit status of a program that ends without an error: 0, or 128 and the number of the signal
/// that ended its work.
#[must_use]
pub fn exit_code() -> ExitCode {
    match RECEIVED.load(Ordering::Relaxed) {
        0 => ExitCode::SUCCESS,
        signal => ExitCode::from(status_of(signal) as u8),
    }
}

fn status_of(signal: i32) -> i32 {
    128 + signal
}
