//! Runs that the figures show.

use std::path::Path;

use anyhow::{Context, bail};
use image::{Rgb, RgbImage};

use super::args::{Settings, WIDEST};
use crate::{
    cli::{
        common::{ConfinementArgs, TransportArgs, load_scene},
        progress::Console,
    },
    design::{self, Gradient, Job, Reporter, RunOptions, RunReport, Subject},
    figures::{
        LOOKS, Outcome, Study,
        convergence::{SearchLog, mode, steps},
        study::{BASKET, BASKET_TITLE},
        table::Entry,
    },
    import::Loaded,
    integrator::Observer,
    lighting::Lighting,
    math::Measure,
    objective::Target,
    picture::{Picture, Purpose, Reading},
    variables::FreeKinds,
};

/// Upper bound of the memory of transport bases, bytes: the default of `run`.
const MEMORY: u64 = 2 << 30;

/// Directories, settings and options that all runs share.
#[derive(Clone, Copy)]
pub(super) struct Runner<'a> {
    /// Directory of the scenes.
    pub scenes: &'a Path,
    /// Where the files of the scenes may lie.
    pub confinement: ConfinementArgs,
    /// Directory of the figures, with the runs below it.
    pub out: &'a Path,
    /// Sizes, samples and limits.
    pub settings: Settings,
    /// Options of light transport.
    pub transport: &'a TransportArgs,
    /// Observer of the runs.
    pub console: &'a Console,
    /// Whether earlier runs are replaced.
    pub force: bool,
    /// Directory of what takes long to make, until all is done.
    pub products: &'a Path,
}

/// Results of runs for all looks, and the seconds that they took.
pub(super) struct Done<T> {
    /// Result for each look.
    pub each: Vec<T>,
    /// Rows of the table of seconds.
    pub seconds: Vec<Vec<Entry>>,
}

/// Headings of the table of seconds.
pub(super) const TIMING_HEADER: [&str; 10] = [
    "scene",
    "background",
    "look",
    "mode",
    "work_size",
    "spp",
    "threads",
    "evaluations",
    "renders",
    "seconds",
];

/// Fails after an interrupt.
pub(super) fn stop_if_interrupted(console: &Console, out: &Path) -> anyhow::Result<()> {
    if console.cancelled() {
        bail!("interrupted; what was finished is in {}", out.display());
    }
    Ok(())
}

impl Runner<'_> {
    fn options(&self, directory: &str, free: FreeKinds) -> anyhow::Result<RunOptions> {
        let jobs = LOOKS.iter().map(|look| {
            let out = self.out.join(directory).join(look);
            Ok(Job { target: Target::resolve(look)?, out })
        });
        Ok(RunOptions {
            jobs: jobs.collect::<anyhow::Result<_>>()?,
            gradient: Gradient::Basis,
            global: false,
            tolerance: self.settings.tolerance,
            time_limit: None,
            cache: None,
            memory: MEMORY,
            integrator: self.transport.integrator(),
            sampler: self.transport.sampler,
            weights: None,
            measure: Measure { view: self.settings.view, ..Measure::default() },
            size: self.settings.size,
            work_size: self.settings.work_size,
            spp: Some(self.settings.spp),
            final_spp: self.settings.final_spp,
            final_noise: self.settings.final_noise,
            denoise: self.settings.denoise,
            free,
            seed: self.transport.seed,
            max_evaluations: self.settings.max_evaluations,
            force: self.force,
            products: Some(self.products.to_owned()),
            basis_file: None,
            live_file: None,
            alternatives: false,
            command: Vec::new(),
        })
    }

    fn run(&self, scene: &str, options: &RunOptions) -> anyhow::Result<Vec<RunReport>> {
        let path = self.scenes.join(scene);
        let loaded = load_scene(&path, &self.confinement.options(), |w| self.console.note(w))?;
        let Loaded { scene, constraints, .. } = &loaded;
        let authored = Lighting::authored(scene);
        let subject =
            Subject { scene, path: &path, authored: &authored, constraints, rig: None, time_left: None };
        let reports =
            design::run(subject, options, self.console).with_context(|| path.display().to_string())?;
        stop_if_interrupted(self.console, self.out)?;
        Ok(reports)
    }

    /// Row of the table of seconds; `before` is the number of renders of the looks before this one.
    fn seconds(
        &self,
        scene: &str,
        background: &str,
        look: usize,
        o: &RunOptions,
        r: &RunReport,
        before: u64,
    ) -> Vec<Entry> {
        let count = |n: f64| Entry::Number(n, 0);
        vec![
            scene.into(),
            background.into(),
            LOOKS[look].into(),
            mode(o.gradient).into(),
            format!("{}x{}", o.work_size.x, o.work_size.y).into(),
            o.spp.map_or_else(|| "by tolerance".into(), |spp| count(f64::from(spp))),
            count(rayon::current_num_threads() as f64),
            count(f64::from(r.evaluations)),
            count((r.renders - before) as f64),
            Entry::Number((r.seconds * 10.0).round() / 10.0, 1),
        ]
    }

    /// Lights a study's scene for both looks, from one transport basis.
    ///
    /// # Errors
    /// When the run fails, or is interrupted.
    pub fn study(&self, study: Study) -> anyhow::Result<Done<Outcome>> {
        let background = study.background_word();
        self.console.note(&format!("== {}, background {background}", study.title));
        let options = self.options(&format!("runs/{}", study.directory), study.free())?;
        let reports = self.run(study.scene, &options)?;
        let mut done = Done { each: Vec::new(), seconds: Vec::new() };
        let mut before = 0;
        for (look, (report, job)) in reports.iter().zip(&options.jobs).enumerate() {
            done.seconds.push(self.seconds(study.title, background, look, &options, report, before));
            before = report.renders;
            done.each.push(Outcome {
                study,
                look,
                f_q_initial: report.initial.evaluation.f_q,
                found: report.check.evaluation.clone(),
                error: report.check.error_bar(),
                f_q_final: report.last.as_ref().map_or(f64::NAN, |last| last.estimate.evaluation.f_q),
                reach: report.reach_with_found(),
                caution: report.caution.clone(),
                initial: picture(&job.out.join("initial.png"))?,
                last: picture(&job.out.join("final.png"))?,
            });
        }
        Ok(done)
    }

    /// Lights the fruit basket for both looks in paper mode and in default mode, both at the
    /// same small size.
    ///
    /// # Errors
    /// When the run fails, or is interrupted.
    pub fn compared(&self) -> anyhow::Result<Done<SearchLog>> {
        let mut done = Done { each: Vec::new(), seconds: Vec::new() };
        for gradient in [Gradient::Fd, Gradient::Basis] {
            self.console.note(&format!("== {BASKET_TITLE}, {} mode", mode(gradient)));
            let s = &self.settings;
            let directory = format!("runs/convergence/{}", mode(gradient));
            let free = FreeKinds::named(&["radiance", "size"]);
            let mut options = RunOptions {
                gradient,
                size: s.compared_size,
                work_size: s.compared_size,
                final_spp: s.compared_spp,
                ..self.options(&directory, free)?
            };
            if gradient == Gradient::Fd {
                options.spp = Some(s.compared_spp);
            }
            let reports = self.run(BASKET, &options)?;
            let mut before = 0;
            for (look, (report, job)) in reports.iter().zip(&options.jobs).enumerate() {
                done.seconds.push(self.seconds(BASKET_TITLE, "fixed", look, &options, report, before));
                before = report.renders;
                done.each.push(SearchLog {
                    gradient,
                    look,
                    steps: steps(&job.out)?,
                    check: [report.check.evaluation.f_q, report.check.error_bar()],
                });
            }
        }
        Ok(done)
    }
}

/// Reads a picture of a run, reduced to at most [`WIDEST`].
fn picture(path: &Path) -> anyhow::Result<RgbImage> {
    let reading = Reading { kept: 3, ..Reading::of(Purpose::RawTexture) };
    let picture = Picture::read(path, &reading)?;
    let image = RgbImage::from_fn(picture.width as u32, picture.height as u32, |x, y| {
        let [r, g, b, _] = picture.stored(y as usize * picture.width + x as usize);
        Rgb([r, g, b].map(|v| (v * 255.0).round() as u8))
    });
    if image.width() <= WIDEST {
        return Ok(image);
    }
    let height = (image.height() * WIDEST).div_ceil(image.width());
    Ok(image::imageops::thumbnail(&image, WIDEST, height))
}
