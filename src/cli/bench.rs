//! `bench`: how fast this program is, beside others.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use clap::Args;
use glam::UVec2;

use super::{
    choices::{BENCH_PARTS, PEERS, one_of},
    common::{in_pool, parse_spp},
    output::{print, print_json},
    progress::Console,
    signals,
};
use crate::{
    bench::{
        Part, Peer, efficiency,
        machine::Machine,
        peers::Mitsuba,
        python::{self, Environment, LLVM},
        rays,
        report::{self, RECORD, Report},
        scenes,
        subject::Subject,
    },
    design::Reporter,
    import,
};

/// Measure how fast this program is, beside other renderers
///
/// Renders scenes with this program and with the renderers that are installed in a Python environment, in turns
/// and on the same threads: samples and rays a second, and efficiency, one over the relative mean squared error
/// times the seconds. Medians of some rounds are told, with their range. Pictures of two programs are compared by
/// their means: where these differ by more than chance explains, the table says so.
///
/// Scenes are fruit_basket, if it is found, and three that are generated: still_life (130,000 triangles, three
/// lights), caustic_ring and cornell_box; or those of --scene. They are exported as by `export`. Each is measured
/// with lights that rays pass (Mitsuba's volpath) and with lights that stop them (Mitsuba's path, its faster way).
///
/// Nothing else should run on the machine.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lightopt-embree bench --install-peers peers\n  \
    lightopt-embree bench --python peers\n  \
    lightopt-embree bench --python peers --quick --scene cornell_box --only efficiency\n\n\
    The directory holds performance.md with everything in it, CSV for each table, a PNG for each plot,\n\
    and bench.json with every number in full precision. Efficiency takes by far the longest; with\n\
    --quick everything takes minutes.\n\
    Exit status: 0 done, 1 failed, 2 wrong usage, 130, 143 or 129 ended by a signal.")]
pub struct BenchArgs {
    /// Make a Python environment with the other renderers in DIR (mitsuba and numpy; some
    /// 300 MB), and do nothing else
    #[arg(long, value_name = "DIR", exclusive = true)]
    pub install_peers: Option<PathBuf>,

    /// Other renderers to measure [default: those that are installed]
    #[arg(long, value_name = "PEER,…", value_delimiter = ',', value_parser = one_of(&PEERS))]
    pub peers: Option<Vec<Peer>>,

    /// Python interpreter, or directory of a virtual environment, that has the other renderers [default: python3,
    /// if it has some]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    /// Scenes to measure on: Wavefront OBJ or glTF, or the name of a generated one
    #[arg(long, value_name = "SCENE,…", value_delimiter = ',')]
    pub scene: Option<Vec<String>>,

    /// Measure only these
    #[arg(long, value_name = "PART,…", value_delimiter = ',', value_parser = one_of(&BENCH_PARTS))]
    pub only: Option<Vec<Part>>,

    /// Directory to write to
    #[arg(long, value_name = "DIR", default_value = "bench")]
    pub out: PathBuf,

    /// Replace an earlier benchmark in that directory; files of others stay
    #[arg(long)]
    pub force: bool,

    /// Also write the page between the marks of FILE, such as a README.md
    #[arg(long, value_name = "FILE")]
    pub page: Option<PathBuf>,

    /// Small pictures, few samples and rounds: a look at everything, with numbers that scatter
    #[arg(long)]
    pub quick: bool,

    /// Samples per pixel of the pictures that are compared [default: 64; quick: 16]
    #[arg(long, value_name = "N", value_parser = parse_spp)]
    pub spp: Option<u32>,

    /// Rounds at the smallest size of pictures; larger ones have fewer [default: 5; quick: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub rounds: Option<u16>,

    /// Seed of the pictures
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..1 << 31))]
    pub seed: u64,

    /// Threads of all programs [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub threads: Option<u16>,

    /// Print one JSON object in full precision instead of tables
    #[arg(long)]
    pub json: bool,
}

/// Sizes of the pictures that are compared, pixels.
const SIZES: [UVec2; 3] = [UVec2::new(128, 96), UVec2::new(256, 192), UVec2::new(640, 480)];

impl BenchArgs {
    fn rounds(&self) -> usize {
        self.rounds.map_or(if self.quick { 2 } else { 5 }, usize::from)
    }

    fn efficiency(&self, threads: usize) -> efficiency::Settings {
        let rounds = self.rounds();
        // The error of a picture is known the better the more pixels it has.
        let sizes = SIZES.into_iter().zip([rounds, rounds.div_ceil(2), rounds.div_ceil(3)]);
        efficiency::Settings {
            sizes: sizes.take(if self.quick { 1 } else { SIZES.len() }).collect(),
            spp: self.spp.unwrap_or(if self.quick { 16 } else { 64 }),
            threads,
            seed: self.seed,
            scalar: !self.quick,
        }
    }

    fn rays(&self, threads: usize) -> rays::Settings {
        let spp = if self.quick { 2 } else { 8 };
        rays::Settings { size: SIZES[0], spp, rounds: self.rounds(), threads, seed: self.seed }
    }

    /// The command that measures the same again on another machine: without paths of this one.
    fn command(&self) -> String {
        let mut words = vec!["lightopt-embree bench".to_owned()];
        let list = |name: &str, values: Vec<&str>| format!("{name} {}", values.join(","));
        words
            .extend(self.peers.as_ref().map(|peers| list("--peers", peers.iter().map(Peer::name).collect())));
        words.extend(self.scene.as_ref().map(|s| list("--scene", s.iter().map(String::as_str).collect())));
        words.extend(self.only.as_ref().map(|only| list("--only", only.iter().map(Part::name).collect())));
        words.extend(self.quick.then(|| "--quick".to_owned()));
        words.extend(self.spp.map(|n| format!("--spp {n}")));
        words.extend(self.rounds.map(|n| format!("--rounds {n}")));
        words.extend((self.seed != 0).then(|| format!("--seed {}", self.seed)));
        words.extend(self.threads.map(|n| format!("--threads {n}")));
        words.join(" ")
    }
}

/// Runs the subcommand.
///
/// # Errors
/// When the directory is taken, a scene or a peer is missing, or a measurement fails.
pub fn bench(args: &BenchArgs) -> anyhow::Result<()> {
    let console = Console::new();
    if let Some(directory) = &args.install_peers {
        console.stage("installing mitsuba and numpy", None);
        let python = python::install(directory);
        console.finish();
        console.note(LLVM);
        return print(&format!("{}\n", python?.display()));
    }
    if args.out.join(RECORD).exists() && !args.force {
        bail!("{}: an earlier benchmark is here; --force replaces it", args.out.display());
    }
    let work = args.out.join("work");
    fs::create_dir_all(&work).with_context(|| format!("{}: cannot make the directory", work.display()))?;
    signals::end_in_order("nothing is kept of a benchmark that is not whole");
    let report = in_pool(args.threads, || measure(args, &work, &console));
    console.finish();
    let _ = fs::remove_dir_all(&work);
    let report = report?;
    report.write(&args.out)?;
    if let Some(page) = &args.page {
        report::into_page(page, &report.markdown())?;
    }
    if args.json {
        return print_json(&report.record());
    }
    print(&(report.text() + &format!("\n{}\n", args.out.join(report::PAGE).display())))
}

/// The Python environment with the peers asked for; `None` where none is asked for, and none is there.
fn environment(args: &BenchArgs, work: &Path, console: &Console) -> anyhow::Result<Option<Environment>> {
    let python = args.python.as_deref().unwrap_or(Path::new("python3"));
    let lacks = |what: &str| {
        format!(
            "{}: has no {what}; `bench --install-peers DIR` makes an environment for --python",
            python.display()
        )
    };
    let opened = Environment::open(python, &work.join("peers"));
    if args.python.is_none() && args.peers.is_none() {
        let found = opened.ok().filter(|e| Peer::ALL.iter().any(|peer| peer.is_in(e)));
        if found.is_none() {
            console.note(&lacks("other renderer"));
        }
        return Ok(found);
    }
    let environment = opened?;
    let missing = |peer: Peer| peer.packages().iter().find(|package| !environment.has(package));
    if let Some(package) = args.peers.iter().flatten().find_map(|&peer| missing(peer)) {
        bail!(lacks(&format!("package `{package}`")));
    }
    if Peer::ALL.iter().all(|&peer| missing(peer).is_some()) {
        bail!(lacks("other renderer"));
    }
    Ok(Some(environment))
}

/// Loads the scenes, and measures all parts on them.
fn measure(args: &BenchArgs, work: &Path, console: &Console) -> anyhow::Result<Report> {
    let environment = environment(args, work, console)?;
    let threads = rayon::current_num_threads();
    let mut subjects = subjects(args, work, console)?;
    let is_wanted = |peer: Peer| args.peers.as_ref().is_none_or(|peers| peers.contains(&peer));
    let has = |peer: Peer| environment.as_ref().filter(|e| is_wanted(peer) && peer.is_in(e)).cloned();
    let mut mitsuba = has(Peer::Mitsuba).map(|environment| Mitsuba::new(environment, threads));
    let mut parts = args.only.clone().unwrap_or_else(|| Part::ALL.to_vec());
    parts.sort_unstable();
    parts.dedup();
    let mut sections = Vec::new();
    for part in parts {
        sections.push(match part {
            Part::Efficiency => {
                efficiency::measure(&subjects, &args.efficiency(threads), &mut mitsuba, work, console)
            }
            Part::Rays => rays::measure(&mut subjects, &args.rays(threads), console),
        }?);
    }
    let mut versions = environment.map_or_else(BTreeMap::new, |environment| environment.versions);
    versions.extend(mitsuba.and_then(|mitsuba| mitsuba.llvm()).map(|llvm| ("llvm".to_owned(), llvm)));
    Ok(Report { machine: Machine::here(&versions), command: args.command(), sections })
}

/// Scenes asked for; otherwise the generated ones and, where it is found, the fruit basket.
fn subjects(args: &BenchArgs, work: &Path, console: &Console) -> anyhow::Result<Vec<Subject>> {
    let directory = work.join("scenes");
    fs::create_dir_all(&directory)
        .with_context(|| format!("{}: cannot make the directory", directory.display()))?;
    let names = args.scene.clone().unwrap_or_else(|| {
        let basket = import::find(Path::new("fruit_basket.obj")).ok();
        if basket.is_none() {
            console.note("fruit_basket.obj is not found here, nor in scenes/: it is left out");
        }
        let basket = basket.map(|path| path.to_string_lossy().into_owned());
        basket.into_iter().chain(scenes::NAMES.map(str::to_owned)).collect()
    });
    Ok(names.iter().map(|name| Subject::load(name, &directory)).collect::<Result<_, _>>()?)
}
