//! Signals: Ctrl-C and its like end the work, in order where there is something to keep.

use std::{
    fs,
    io::{self, Write},
    process::ExitCode,
    sync::{
        OnceLock,
        atomic::{AtomicI32, Ordering},
    },
    thread,
    time::Duration,
};

use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ},
    iterator::Signals,
    low_level,
};

use crate::files::atomic::abandon;

/// Time that work which ends in order may take for it: a bit less than the two seconds that people
/// and service managers are promised.
const PATIENCE: Duration = Duration::from_millis(1800);

/// The signal that ends the work; 0 as long as there was none.
static RECEIVED: AtomicI32 = AtomicI32::new(0);
/// What the first signal does, in words, once there is something to keep.
static IN_ORDER: OnceLock<&'static str> = OnceLock::new();
/// How to go on with what is ended at once, in words.
static GO_ON: OnceLock<String> = OnceLock::new();

/// Makes SIGINT (Ctrl-C), SIGTERM and SIGHUP end the program with the exit status 128 and their number:
/// at once or, after `end_in_order`, as that says. Files are whole in any case: they take their names
/// when they are. A SIGHUP that was ignored at the start, as by `nohup`, stays so. A file that grows
/// beyond a limit of its size is an error like a full disk, and no signal.
///
/// # Errors
/// When the handler cannot be installed.
pub fn catch() -> io::Result<()> {
    let all = [SIGINT, SIGTERM, SIGHUP, SIGXFSZ];
    let mut signals = Signals::new(all.iter().filter(|&&s| s != SIGHUP || !is_ignored(s)))?;
    thread::Builder::new().name("signals".to_owned()).spawn(move || {
        for signal in signals.forever().filter(|&signal| signal != SIGXFSZ) {
            let is_first = RECEIVED.swap(signal, Ordering::Relaxed) == 0;
            match IN_ORDER.get() {
                Some(what) if is_first => {
                    let _ = writeln!(io::stderr(), "\ninterrupted: {what} (again to quit at once)");
                    thread::spawn(move || {
                        thread::sleep(PATIENCE);
                        quit(signal);
                    });
                }
                _ => quit(signal),
            }
        }
    })?;
    Ok(())
}

/// Lets the first signal from now on end the work in order, which asks [`received`]; `what` says how. What
/// has not ended after [`PATIENCE`], and a second signal, end the program at once.
pub fn end_in_order(what: &'static str) {
    // Whoever comes first has said it.
    let _ = IN_ORDER.set(what);
}

/// Lets the program say so when a signal ends it at once: how to go on with what it did.
pub fn say_at_once(how: String) {
    let _ = GO_ON.set(how);
}

/// Ends the program at once, without what is half-written.
fn quit(signal: i32) {
    abandon();
    if let Some(how) = GO_ON.get() {
        let _ = writeln!(io::stderr(), "{how}");
    }
    // Not `std::process::exit`, which runs what libraries left to be done while their threads go on.
    low_level::exit(status_of(signal));
}

/// Whether a signal was ignored when the program started; false where that cannot be known.
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// Whether a signal came that ends the work.
#[must_use]
pub fn received() -> bool {
    RECEIVED.load(Ordering::Relaxed) != 0
}

/// The exit status of a program that has not failed by itself: 0, or 128 and the number of the signal that
/// ended its work.
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
