//! Progress of long work: bars on a terminal, plain lines elsewhere; always on standard error, so that
//! standard output holds nothing but results.

use std::{
    io::IsTerminal,
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::{output, report, signals};
use crate::{
    design::{Progress, Reporter},
    integrator::Observer,
};

/// An observer that shows progress on standard error.
pub struct Console {
    /// Whether standard error is a terminal.
    is_terminal: bool,
    /// Bar of the present stage, on a terminal.
    bar: Mutex<Option<ProgressBar>>,
    /// Present stage.
    stage: Mutex<Stage>,
    /// Number of rows of pixels done in the present stage.
    rows: AtomicU64,
    /// Whether runs get their reports.
    with_reports: bool,
}

/// A stage of the work.
struct Stage {
    name: String,
    /// Number of rows of pixels to be done, if known.
    total: Option<u64>,
    start: Instant,
    /// Number of tenths that were written as lines.
    reported: u64,
}

impl Default for Console {
    fn default() -> Self {
        Self::new()
    }
}

impl Console {
    /// A console with bars if standard error is a terminal, else with lines.
    #[must_use]
    pub fn new() -> Self {
        let stage = Stage { name: String::new(), total: None, start: Instant::now(), reported: 0 };
        Self {
            is_terminal: std::io::stderr().is_terminal(),
            bar: Mutex::new(None),
            stage: Mutex::new(stage),
            rows: AtomicU64::new(0),
            with_reports: false,
        }
    }

    /// A console that also writes the reports of the runs that it observes.
    #[must_use]
    pub fn with_reports() -> Self {
        Self { with_reports: true, ..Self::new() }
    }

    /// Removes the bar of the present stage.
    pub fn finish(&self) {
        self.replace_bar(None);
    }

    fn replace_bar(&self, new: Option<ProgressBar>) {
        let Ok(mut bar) = self.bar.lock() else { return };
        if let Some(old) = std::mem::replace(&mut *bar, new) {
            old.finish_and_clear();
        }
        if let Some(bar) = &*bar {
            // Shown only now that it is complete.
            bar.set_draw_target(ProgressDrawTarget::stderr());
            bar.enable_steady_tick(Duration::from_millis(200));
        }
    }

    fn line(&self, text: &str) {
        let write = || {
            output::say(text);
        };
        match self.bar.lock().as_deref() {
            Ok(Some(bar)) => bar.suspend(write),
            _ => write(),
        }
    }
}

impl Observer for Console {
    fn advance(&self, rows: u64) {
        let done = self.rows.fetch_add(rows, Ordering::Relaxed) + rows;
        if self.is_terminal {
            if let Ok(Some(bar)) = self.bar.try_lock().as_deref() {
                bar.set_position(done);
            }
            return;
        }
        let Ok(mut stage) = self.stage.try_lock() else { return };
        let Some(total) = stage.total.filter(|&t| t > 0) else { return };
        let tenths = 10 * done / total;
        // Short stages are not worth a line a tenth.
        if tenths > stage.reported && tenths < 10 && stage.start.elapsed() > Duration::from_secs(5) {
            stage.reported = tenths;
            let left = stage.start.elapsed().as_secs_f64() * (total as f64 / done as f64 - 1.0);
            let text = format!("{}: {} %, {left:.0} s left", stage.name, 10 * tenths);
            drop(stage);
            self.line(&text);
        }
    }

    fn cancelled(&self) -> bool {
        signals::received()
    }
}

impl Reporter for Console {
    fn note(&self, text: &str) {
        self.line(text);
    }

    fn stage(&self, name: &str, rows: Option<u64>) {
        self.rows.store(0, Ordering::Relaxed);
        if let Ok(mut stage) = self.stage.lock() {
            *stage = Stage { name: name.to_owned(), total: rows, start: Instant::now(), reported: 0 };
        }
        if !self.is_terminal {
            self.line(name);
            return;
        }
        let template = match rows {
            Some(_) => "{msg} [{bar:20}] {percent} %, {eta} left",
            None => "{spinner} {wide_msg}",
        };
        let bar = ProgressBar::with_draw_target(rows, ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_message(output::one_line(name).into_owned());
        self.replace_bar(Some(bar));
    }

    fn progress(&self, text: &str) {
        if !self.is_terminal {
            self.line(text);
        } else if let Ok(Some(bar)) = self.bar.lock().as_deref() {
            bar.set_message(output::one_line(text).into_owned());
        }
    }

    fn recorded(&self, directories: &[&Path], is_done: bool) {
        if self.with_reports {
            report::refresh(directories, !is_done, &|text: &str| self.line(text));
        }
    }

    fn evaluated(&self, p: &Progress) {
        let elapsed = self.stage.lock().map_or(0.0, |s| s.start.elapsed().as_secs_f64());
        let left = elapsed / f64::from(p.evaluation) * f64::from(p.max_evaluations - p.evaluation);
        // Short enough for a terminal of 80 columns.
        let text = format!(
            "evaluation {}/{}: f_q {:.4}, best {:.4}, {} renders, at most {left:.0} s left",
            p.evaluation, p.max_evaluations, p.f_q, p.best, p.renders
        );
        Reporter::progress(self, &text);
    }
}
