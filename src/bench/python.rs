//! The Python environment of other renderers, and the processes in it.
//!
//! A process is asked by lines of JSON and answers by lines of JSON. What its libraries print goes to a log.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::{self, BufRead, BufReader, Write},
    os::unix::process::ExitStatusExt,
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio},
};

use serde_json::Value;

/// Packages of an environment, with the versions that an installed one gets.
pub const PACKAGES: [(&str, &str); 2] = [("mitsuba", "3.9.1"), ("numpy", "2.4.6")];

/// What Mitsuba's `llvm` variants need besides, in words.
pub const LLVM: &str = "Mitsuba's variant llvm_ad_rgb also needs LLVM, of which version 15 aborts: install Debian's \
                        package libllvm19, or let DRJIT_LIBLLVM_PATH name its library";

/// Programs of ours that run in the environment, by their file names.
const PROGRAMS: [(&str, &str); 3] = [
    ("worker.py", include_str!("peers/worker.py")),
    ("mitsuba_worker.py", include_str!("peers/mitsuba_worker.py")),
    ("probe.py", include_str!("peers/probe.py")),
];

/// Why a Python environment, or a process in it, is of no use.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum PythonError {
    #[error("{path}: cannot be started; --python names an interpreter, or a directory made by \
             `bench --install-peers`", path = path.display())]
    Start { path: PathBuf, source: io::Error },
    #[error("{path}: cannot be written", path = path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("{path}: `{command}` failed, {status}", path = path.display())]
    Command { path: PathBuf, command: String, status: ExitStatus },
    #[error("{program} ended before it answered, {status}; see {log}{hint}", log = log.display())]
    Ended { program: String, status: ExitStatus, log: PathBuf, hint: String },
    #[error("{program} answered what is no JSON: {answer}")]
    Answer { program: String, answer: String },
    #[error("{program}: {fault}")]
    Failed { program: String, fault: String },
}

/// A Python interpreter with its packages.
#[derive(Clone, Debug)]
pub struct Environment {
    python: PathBuf,
    /// Directory of our programs and of what processes keep.
    directory: PathBuf,
    /// Versions of Python and of the packages that are there, by name.
    pub versions: BTreeMap<String, String>,
}

/// Interpreter that a path names: itself, or the one of a virtual environment.
fn interpreter(path: &Path) -> PathBuf {
    let inside = path.join("bin/python");
    if inside.exists() { inside } else { path.to_owned() }
}

impl Environment {
    /// The environment of an interpreter, or of the directory of a virtual environment; `directory` takes our
    /// programs.
    ///
    /// # Errors
    /// When the interpreter does not run, or the programs cannot be written.
    pub fn open(python: &Path, directory: &Path) -> Result<Self, PythonError> {
        fs::create_dir_all(directory)
            .map_err(|source| PythonError::Write { path: directory.to_owned(), source })?;
        for (name, text) in PROGRAMS {
            let path = directory.join(name);
            fs::write(&path, text).map_err(|source| PythonError::Write { path, source })?;
        }
        let mut environment =
            Self { python: interpreter(python), directory: directory.to_owned(), versions: BTreeMap::new() };
        let mut command = environment.command("probe.py");
        let output = command.args(PACKAGES.map(|(name, _)| name)).arg("drjit").output();
        let output =
            output.map_err(|source| PythonError::Start { path: environment.python.clone(), source })?;
        environment.versions = serde_json::from_slice(&output.stdout).map_err(|_| PythonError::Command {
            path: environment.python.clone(),
            command: "probe.py".to_owned(),
            status: output.status,
        })?;
        Ok(environment)
    }

    /// Whether a package is there.
    #[must_use]
    pub fn has(&self, package: &str) -> bool {
        self.versions.contains_key(package)
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(&self.python);
        // No __pycache__ beside programs that are written anew each time.
        command.arg("-B").arg(self.directory.join(program));
        command
    }

    /// Starts a program. What it keeps for later processes, such as compiled kernels, goes below `home`, a
    /// directory that is made.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(&self, program: &str, home: &str) -> Result<Process, PythonError> {
        let home = self.directory.join(home);
        let log = home.join(program).with_extension("log");
        let write = |source| PythonError::Write { path: log.clone(), source };
        fs::create_dir_all(&home).map_err(write)?;
        let errors = File::create(&log).map_err(write)?;
        let mut command = self.command(program);
        let home = std::path::absolute(&home).map_err(write)?;
        command.env("HOME", home).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(errors);
        let start = |source| PythonError::Start { path: self.python.clone(), source };
        let mut child = command.spawn().map_err(start)?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(start(io::ErrorKind::BrokenPipe.into()));
        };
        let output = BufReader::new(output);
        Ok(Process { program: program.to_owned(), child, input: Some(input), output, log })
    }
}

/// Makes a virtual environment with the packages of all peers.
///
/// # Errors
/// When Python or pip fails.
pub fn install(directory: &Path) -> Result<PathBuf, PythonError> {
    let run = |path: &Path, arguments: &[&str]| {
        let status = Command::new(path).args(arguments).arg(directory).stdout(Stdio::null()).status();
        finished(path, arguments, status)
    };
    run(Path::new("python3"), &["-m", "venv"])?;
    let python = interpreter(directory);
    let pinned = PACKAGES.map(|(name, version)| format!("{name}=={version}"));
    let mut arguments = vec!["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    arguments.extend(pinned.iter().map(String::as_str));
    let status = Command::new(&python).args(&arguments).stdout(Stdio::null()).status();
    finished(&python, &arguments, status)?;
    Ok(python)
}

/// An error unless a command succeeded.
fn finished(path: &Path, arguments: &[&str], status: io::Result<ExitStatus>) -> Result<(), PythonError> {
    let status = status.map_err(|source| PythonError::Start { path: path.to_owned(), source })?;
    if status.success() {
        return Ok(());
    }
    Err(PythonError::Command { path: path.to_owned(), command: arguments.join(" "), status })
}

/// A process of the environment, which ends when it is dropped.
#[derive(Debug)]
pub struct Process {
    program: String,
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    log: PathBuf,
}

impl Process {
    /// Directory below which the process keeps files.
    #[must_use]
    pub fn home(&self) -> &Path {
        self.log.parent().unwrap_or(Path::new("."))
    }

    /// Asks the process to do something, and waits for its answer.
    ///
    /// # Errors
    /// When it fails, or ends before it answers.
    pub fn ask(&mut self, request: &Value) -> Result<Value, PythonError> {
        let sent = self.input.as_mut().map(|input| writeln!(input, "{request}"));
        let mut answer = String::new();
        let read = match sent {
            Some(Ok(())) => self.output.read_line(&mut answer).unwrap_or(0),
            _ => 0,
        };
        if read == 0 {
            return Err(self.ended());
        }
        let program = self.program.clone();
        let value: Value = serde_json::from_str(&answer).map_err(|_| PythonError::Answer {
            program: program.clone(),
            answer: answer.trim().to_owned(),
        })?;
        match value["error"].as_str() {
            Some(fault) => Err(PythonError::Failed { program, fault: fault.to_owned() }),
            None => Ok(value),
        }
    }

    fn ended(&mut self) -> PythonError {
        let status = self.child.wait().unwrap_or(ExitStatus::from_raw(0));
        let log = fs::read_to_string(&self.log).unwrap_or_default();
        let hint = if log.contains("LLVM") { format!("; {LLVM}") } else { String::new() };
        PythonError::Ended { program: self.program.clone(), status, log: self.log.clone(), hint }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It ends by itself at the end of its input, unless it hangs.
        drop(self.input.take());
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
