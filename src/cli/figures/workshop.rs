//! Making of the parts, one after another, and of the files that hold them.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context;
use serde_json::json;

use super::{
    args::{FiguresArgs, Settings},
    runs::{Done, Runner, TIMING_HEADER, stop_if_interrupted},
};
use crate::{
    audit::{products::Products, write_whole},
    canvas::Canvas,
    cli::{common::load_scene, progress::Console},
    design::Reporter,
    embree,
    figures::{
        LOOKS, Outcome, Part, STUDIES, Study, convergence, flux,
        grid::{Cell, Grid, Row},
        manifest::{self, MANIFEST, Manifest, TIMINGS},
        page::{self, Block},
        published, reached,
        study::BASKET,
        table::{Entry, Table},
        tables,
    },
    integrator::RenderError,
    objective::Target,
};

/// Name of the page with everything in it.
const PAGE: &str = "index.html";

/// Figures being made.
pub(super) struct Workshop<'a> {
    runner: Runner<'a>,
    /// Manifest of the files so far.
    manifest: Manifest,
    /// Parts of the page so far.
    blocks: Vec<Block>,
    /// Rows of the table of seconds so far.
    seconds: Vec<Vec<Entry>>,
}

impl<'a> Workshop<'a> {
    /// Makes the directory of the figures, or clears it of earlier ones.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn open(
        args: &'a FiguresArgs,
        force: bool,
        parts: &[Part],
        console: &'a Console,
        products: &'a Path,
    ) -> anyhow::Result<Self> {
        let (out, settings) = (args.out.as_path(), Settings::of(args));
        fs::create_dir_all(out).with_context(|| format!("{}: cannot make the directory", out.display()))?;
        if force {
            manifest::clear(out)?;
        }
        let transport = &args.transport;
        let Settings { size, work_size, compared_size, .. } = settings;
        let manifest = Manifest {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("LIGHTOPT_COMMIT").to_owned(),
            embree: embree::version(),
            seed: transport.seed,
            parts: parts.to_vec(),
            options: json!({
                "quick": args.quick,
                "size": size.to_array(),
                "final_spp": settings.final_spp,
                "final_noise": settings.final_noise,
                "denoise": settings.denoise,
                "view": settings.view,
                "work_size": work_size.to_array(),
                "spp": settings.spp,
                "tolerance": settings.tolerance,
                "integrator": transport.integrator().kind,
                "max_depth": transport.max_depth,
                "sampler": transport.sampler,
                "convergence": {
                    "size": compared_size.to_array(),
                    "spp": settings.compared_spp,
                    "max_evaluations": settings.max_evaluations,
                },
            }),
            complete: false,
            files: Default::default(),
            timings: Vec::new(),
        };
        let runner = Runner {
            scenes: &args.scenes,
            confinement: args.confinement,
            out,
            settings,
            transport,
            console,
            force,
            products,
        };
        let workshop = Self { runner, manifest, blocks: Vec::new(), seconds: Vec::new() };
        workshop.save()?;
        Ok(workshop)
    }

    /// Makes the parts, and a page of them all; returns the path of the page.
    ///
    /// # Errors
    /// When a run fails, or is interrupted.
    pub fn make(&mut self, parts: &[Part]) -> anyhow::Result<PathBuf> {
        let mut outcomes: Vec<Outcome> = Vec::new();
        for study in STUDIES.into_iter().filter(|s| parts.iter().any(|p| p.studies().contains(s))) {
            let done = self.runner.study(study)?;
            outcomes.extend(self.took(done, &format!("runs/{}", study.directory))?);
        }
        for part in parts {
            stop_if_interrupted(self.runner.console, self.runner.out)?;
            let studies = part.studies();
            let of: Vec<&Outcome> = outcomes.iter().filter(|o| studies.contains(&o.study)).collect();
            match part {
                Part::Fig2 => self.fig2()?,
                Part::Fig3 | Part::Background | Part::Fig4 => self.pictures(*part, &studies, &of)?,
                Part::Table1 => self.table1()?,
                Part::Table2 => {
                    self.found("table2", "Table 2. Terms found; radiance and size are free.", &of)?
                }
                Part::Table3 => {
                    let caption = "Table 3. Terms found when the background's value is free as well.";
                    self.found("table3", caption, &of)?;
                }
                Part::Gaps => self.gaps(&of)?,
                Part::Convergence => self.convergence()?,
            }
        }
        self.finish()
    }

    fn save(&self) -> anyhow::Result<()> {
        let text = serde_json::to_string_pretty(&self.manifest)? + "\n";
        Ok(write_whole(&self.runner.out.join(MANIFEST), text)?)
    }

    /// Adds runs that are recorded below `directory` to the manifest and to the table of seconds.
    fn took<T>(&mut self, done: Done<T>, directory: &str) -> anyhow::Result<Vec<T>> {
        self.manifest.add(self.runner.out, directory)?;
        self.save()?;
        self.seconds.extend(done.seconds);
        Ok(done.each)
    }

    fn put(&mut self, name: &str, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
        write_whole(&self.runner.out.join(name), content)?;
        self.manifest.add(self.runner.out, name)?;
        self.save()
    }

    fn put_figure(&mut self, name: &str, canvas: &Canvas, caption: String) -> anyhow::Result<()> {
        let png = canvas.png()?;
        self.put(&format!("{name}.png"), &png)?;
        self.blocks.push(Block::Figure { png, caption });
        Ok(())
    }

    fn put_table(&mut self, name: &str, table: Table, notes: &[&str]) -> anyhow::Result<()> {
        self.put(&format!("{name}.csv"), table.csv()?)?;
        self.put(&format!("{name}.tex"), table.latex(notes)?)?;
        self.blocks.push(Block::Table(table));
        if !notes.is_empty() {
            self.blocks.push(Block::Notes(notes.iter().map(|n| (*n).to_owned()).collect()));
        }
        Ok(())
    }

    fn heading(&mut self, words: &str) {
        self.blocks.push(Block::Heading(words.to_owned()));
    }

    fn fig2(&mut self) -> anyhow::Result<()> {
        let Runner { scenes, out, settings, transport, console, .. } = self.runner;
        console.note("== One light at several sizes and fluxes");
        let path = scenes.join(BASKET);
        let loaded = load_scene(&path, &self.runner.confinement.options(), |w| console.note(w))?;
        let products = Products::new(Some(self.runner.products));
        let how = flux::Settings {
            size: settings.thumbnail(),
            // Samples are spread over all sizes.
            spp: 2 * settings.final_spp,
            integrator: transport.integrator(),
            sampler: transport.sampler,
            seed: transport.seed,
            view: settings.view,
            products: &products,
        };
        console.stage("rendering the transport basis", Some(u64::from(how.size.y)));
        let grid = match flux::grid(&loaded.scene, &loaded.constraints, &how, console) {
            Err(flux::FluxError::Render(RenderError::Cancelled)) => {
                return stop_if_interrupted(console, out);
            }
            grid => grid.with_context(|| path.display().to_string())?,
        };
        self.heading("One light");
        let caption = "Figure 2. One light alone, at several sizes (rows) and fluxes (columns, a stop apart). All \
                       pictures are recombined from one transport basis. At equal flux a larger light softens \
                       shadows and highlights, and more of it falls beside the object.";
        self.put_figure("fig2", &grid.draw()?, caption.to_owned())
    }

    /// Makes a figure with a row for each study: the start, and the lights found for each look.
    fn pictures(&mut self, part: Part, studies: &[Study], outcomes: &[&Outcome]) -> anyhow::Result<()> {
        let of_basket = part == Part::Fig4;
        let row = |study: &Study| {
            let of: Vec<&&Outcome> = outcomes.iter().filter(|o| o.study == *study).collect();
            let starts: Vec<String> = of.iter().map(|o| format!("{:.3}", o.f_q_initial)).collect();
            let start = of.first().map(|o| Cell {
                picture: o.initial.clone(),
                caption: vec![format!("f_q {}", starts.join(" / ")), LOOKS.join(" / ")],
            });
            let found = of.iter().map(|o| Cell {
                picture: o.last.clone(),
                caption: vec![
                    format!("f_q {:.3} ± {:.3}", o.found.f_q, o.error),
                    published::of(study, o.look)
                        .f_q
                        .map_or_else(String::new, |f| format!("published {f:.3}")),
                ],
            });
            let name = match (of_basket, study.background) {
                (false, _) => study.title.to_owned(),
                (true, false) => "background fixed".to_owned(),
                (true, true) => "background free".to_owned(),
            };
            Row { name, cells: start.into_iter().chain(found).collect() }
        };
        let grid = Grid {
            columns: ["start", LOOKS[0], LOOKS[1]].map(str::to_owned).to_vec(),
            rows: studies.iter().map(row).collect(),
            axes: None,
        };
        let (name, heading, title, free) = match part {
            Part::Fig4 => (
                "fig4",
                "Fruit basket",
                "Figure 4. The fruit basket",
                "Radiance and size of the lights are free; in the lower row the brightness of the background as well",
            ),
            Part::Background => (
                "background",
                "Girl and creature with the background free",
                "Girl and creature once more, which the paper does not show",
                "The brightness of the background is free besides radiance and size of the lights",
            ),
            _ => (
                "fig3",
                "Girl and creature",
                "Figure 3. Girl and creature",
                "Radiance and size of the lights are free, the background is as it is",
            ),
        };
        let caption = format!(
            "{title}: the neutral start, and the lights found. {free}. f_q is measured at the working size on \
             samples that chose nothing, freed of noise bias."
        );
        self.heading(heading);
        self.put_figure(name, &grid.draw()?, caption)?;
        let cautions = outcomes.iter().filter_map(|o| {
            let what =
                format!("{}, background {}, {}", o.study.title, o.study.background_word(), LOOKS[o.look]);
            o.caution.as_ref().map(|c| format!("{what}: {c}."))
        });
        let cautions: Vec<String> = cautions.collect();
        if !cautions.is_empty() {
            self.blocks.push(Block::Notes(cautions));
        }
        Ok(())
    }

    fn table1(&mut self) -> anyhow::Result<()> {
        let both = [Target::resolve(LOOKS[0])?, Target::resolve(LOOKS[1])?];
        self.heading("Targets");
        self.put_table("table1", tables::targets(&both), &[])
    }

    fn found(&mut self, name: &str, caption: &str, outcomes: &[&Outcome]) -> anyhow::Result<()> {
        let (heading, notes) = match name {
            "table2" => ("Terms found", &published::NOTES[..]),
            _ => ("Terms found with the background free", &published::NOTES[..3]),
        };
        self.heading(heading);
        self.put_table(name, tables::found(outcomes, caption), notes)
    }

    fn gaps(&mut self, outcomes: &[&Outcome]) -> anyhow::Result<()> {
        self.heading("What the lights can reach");
        let caption = "Terms found (dots), and what no lighting of the scene brings them to (bars), whatever \
                       becomes of the other terms. A dot at the end of its bar is as good as these lights allow.";
        self.put_figure("gaps", &reached::plot(outcomes)?, caption.to_owned())?;
        self.put_table("gaps", tables::gaps(outcomes), &[])
    }

    fn convergence(&mut self) -> anyhow::Result<()> {
        let done = self.runner.compared()?;
        let searches = self.took(done, "runs/convergence")?;
        let s = self.runner.settings;
        self.heading("Paper mode and default mode");
        let caption = format!(
            "The fruit basket, background fixed, at {} × {} pixels. Left, paper mode: fresh renders of {} samples \
             per pixel and forward differences from one start, at most {} evaluations; f_q as measured, noise \
             included. Right, default mode: the evaluations that led to the result on one transport basis, \
             freed of noise bias, from the best of some 260 starts. Smoothing of f_q is lowered in stages. \
             Seconds are in {TIMINGS}.",
            s.compared_size.x, s.compared_size.y, s.compared_spp, s.max_evaluations
        );
        self.put("convergence.csv", convergence::table(&searches).csv()?)?;
        self.put_figure("convergence", &convergence::plot(&searches)?, caption)
    }

    fn finish(&mut self) -> anyhow::Result<PathBuf> {
        if !self.seconds.is_empty() {
            let table = Table {
                caption: String::new(),
                header: TIMING_HEADER.to_vec(),
                rows: std::mem::take(&mut self.seconds),
                grouped: 0,
            };
            self.put(TIMINGS, table.csv()?)?;
        }
        let s = self.runner.settings;
        let lead = format!(
            "Automatic Aesthetics-based Lighting Design with Global Illumination (2014), on scenes of the same kind. \
             lightopt-embree {}, seed {}; pictures of {} × {} pixels, optimised at {} × {}.",
            self.manifest.version, self.manifest.seed, s.size.x, s.size.y, s.work_size.x, s.work_size.y
        );
        let html = page::html("Figures and tables of the paper, made anew", &lead, &self.blocks)?;
        self.put(PAGE, html)?;
        self.manifest.complete = true;
        self.save()?;
        Ok(self.runner.out.join(PAGE))
    }
}
