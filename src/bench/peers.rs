//! Other renderers, as processes that render what was exported.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde_json::json;

use super::{
    BenchError,
    python::{Environment, Process},
    subject::Rendered,
};

/// Variants of Mitsuba: the one that is fast without a graphics card, and the plain one.
pub const VARIANTS: [&str; 2] = ["llvm_ad_rgb", "scalar_rgb"];

/// Mitsuba, with a process for each variant that was asked for.
#[derive(Debug)]
pub struct Mitsuba {
    environment: Environment,
    threads: usize,
    processes: Vec<(String, MitsubaProcess)>,
}

impl Mitsuba {
    /// Version of LLVM that its processes use; `None` before one has started that does.
    #[must_use]
    pub fn llvm(&self) -> Option<String> {
        self.processes.iter().find_map(|(_, process)| process.llvm.clone())
    }

    /// Mitsuba of an environment, on some threads.
    #[must_use]
    pub fn new(environment: Environment, threads: usize) -> Self {
        Self { environment, threads, processes: Vec::new() }
    }

    /// The process of a variant, started when it is first asked for.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn variant(&mut self, variant: &str) -> Result<&mut MitsubaProcess, BenchError> {
        let at = match self.processes.iter().position(|(name, _)| name == variant) {
            Some(at) => at,
            None => {
                let process = MitsubaProcess::start(&self.environment, variant, self.threads)?;
                self.processes.push((variant.to_owned(), process));
                self.processes.len() - 1
            }
        };
        Ok(&mut self.processes[at].1)
    }
}

/// A process of Mitsuba with one variant.
#[derive(Debug)]
pub struct MitsubaProcess {
    process: Process,
    /// File through which pictures come.
    picture: PathBuf,
    /// Version of LLVM, where the variant uses it.
    llvm: Option<String>,
}

impl MitsubaProcess {
    /// Starts Mitsuba on some threads; its pictures and kernels go into a directory of the variant's name.
    ///
    /// # Errors
    /// When it cannot be started, or does not have the variant.
    pub fn start(environment: &Environment, variant: &str, threads: usize) -> Result<Self, BenchError> {
        let mut process = environment.start("mitsuba_worker.py", variant)?;
        let answer = process.ask(&json!({"op": "start", "variant": variant, "threads": threads}))?;
        let llvm = answer["llvm"].as_str().map(str::to_owned);
        let picture = absolute(&process.home().join("picture.f32"))?;
        Ok(Self { process, picture, llvm })
    }

    /// Renders a picture of an exported scene with a sampler and an integrator. Scenes stay loaded until
    /// another one is asked for.
    ///
    /// # Errors
    /// When Mitsuba fails.
    pub fn render(
        &mut self,
        scene: &Path,
        [sampler, integrator]: [&str; 2],
        spp: u32,
        seed: u64,
    ) -> Result<Rendered, BenchError> {
        let request = json!({
            "op": "render",
            "path": absolute(scene)?,
            "sampler": sampler,
            "integrator": integrator,
            "spp": spp,
            "seed": seed,
            "out": self.picture,
        });
        let answer = self.process.ask(&request)?;
        let path = || self.picture.clone();
        let bytes = fs::read(&self.picture).map_err(|source| BenchError::File {
            path: path(),
            action: "read",
            source,
        })?;
        let (Some(seconds), Some(spp)) = (answer["seconds"].as_f64(), answer["spp"].as_u64()) else {
            return Err(BenchError::Answer { path: path(), fault: "no `seconds` or `spp`".to_owned() });
        };
        let rgb = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        Ok(Rendered { rgb, spp: spp as u32, seconds })
    }
}

/// A path that holds in any directory.
fn absolute(path: &Path) -> Result<PathBuf, BenchError> {
    std::path::absolute(path).map_err(|source| BenchError::File {
        path: path.to_owned(),
        action: "find the directory of",
        source,
    })
}
