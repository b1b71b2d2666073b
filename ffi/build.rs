//! Finds Embree's headers, compiles the shim against them and reads its header.

use std::env;
use std::path::PathBuf;
use std::process::exit;

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    for file in ["build.rs", "probe.c", "shim.c", "shim.h"] {
        println!("cargo::rerun-if-changed={file}");
    }

    let embree = Embree::find().unwrap_or_else(|reason| {
        println!("cargo::error={reason}");
        exit(1);
    });
    // An upgraded package must be noticed: its soname and structures differ.
    println!("cargo::rerun-if-changed={}", embree.header);
    println!("cargo::metadata=VERSION={}", embree.version);
    println!("cargo::rustc-env=EMBREE_VERSION={}", embree.version);

    cc::Build::new()
        .file("shim.c")
        .std("gnu11")
        // The hot path: optimised in every profile.
        .opt_level(3)
        .flag_if_supported("-fno-plt")
        .flag_if_supported("-fno-math-errno")
        .warnings(true)
        .extra_warnings(true)
        .warnings_into_errors(env::var_os("CI").is_some())
        .compile("embree_shim");
    println!("cargo::rustc-link-lib=dylib=embree{}", embree.major);

    bindgen::builder()
        .header("shim.h")
        .allowlist_item("(lo|LO)_.*")
        .derive_default(true)
        .generate()
        .map_err(|e| e.to_string())
        .and_then(|b| b.write_to_file(out.join("shim.rs")).map_err(|e| e.to_string()))
        .unwrap_or_else(|reason| {
            println!("cargo::error=cannot read shim.h with libclang: {reason}");
            exit(1);
        });
}

/// The installed Embree, as its headers describe it.
struct Embree {
    major: String,
    version: String,
    header: String,
}

impl Embree {
    /// Runs the preprocessor over `probe.c`, which prefers version 4 to 3.
    fn find() -> Result<Self, String> {
        let text = cc::Build::new()
            .file("probe.c")
            .cargo_warnings(false)
            .try_expand()
            .map_err(|e| format!("cannot run the C preprocessor (is gcc installed?): {e}"))?;
        let text = String::from_utf8_lossy(&text);
        let (markers, code): (Vec<_>, Vec<_>) = text.lines().partition(|l| l.starts_with('#'));
        // The macros of `embree_version 4 "4.3.3"` may be spread over several lines.
        let mut words = code
            .iter()
            .flat_map(|line| line.split_whitespace())
            .skip_while(|word| *word != "embree_version")
            .skip(1);
        let (Some(major), Some(version)) = (words.next(), words.next()) else {
            return Err("Embree's headers are missing: neither <embree4/rtcore.h> nor \
                 <embree3/rtcore.h> is installed. On Debian: apt-get install libembree-dev"
                .to_owned());
        };
        // Line marker: `# 1 "/usr/include/embree4/rtcore_config.h" 1 3 4`
        let header = markers
            .iter()
            .filter_map(|line| line.split('"').nth(1))
            .find(|path| path.ends_with("rtcore_config.h"))
            .ok_or("the C preprocessor printed no line markers")?;
        Ok(Embree {
            major: major.to_owned(),
            version: version.trim_matches('"').to_owned(),
            header: header.to_owned(),
        })
    }
}
