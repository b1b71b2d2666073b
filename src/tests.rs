//! What holds for the source as a whole: the order of the floors, the bibliography, links of the manual.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

const CRATE: &str = include_str!("lib.rs");

/// The package.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Files below a directory whose names have an ending.
fn files(directory: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let all = entries.flat_map(|path| if path.is_dir() { files(&path, ending) } else { vec![path] });
    all.filter(|path| path.extension().is_some_and(|e| e == ending)).collect()
}

/// Names between `before` and `after`, each time that `before` occurs.
fn between<'t>(text: &'t str, before: &'t str, after: &'t str) -> impl Iterator<Item = &'t str> {
    let names = text.split(before).skip(1).filter_map(move |rest| Some(rest.split_once(after)?.0));
    names.filter(|name| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
}

/// Modules that code uses: what follows `crate::`, in braces too.
fn used(code: &str) -> BTreeSet<&str> {
    let first = |path: &'_ str| path.trim_start().find(|c: char| !c.is_alphanumeric() && c != '_');
    let mut names = BTreeSet::new();
    for rest in code.split("crate::").skip(1) {
        let list = rest.strip_prefix('{').and_then(|list| list.split("};").next());
        let mut depth = 0;
        let paths = list.unwrap_or(rest).split(|c| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            c == ',' && depth == 0
        });
        let n = if list.is_some() { usize::MAX } else { 1 };
        for path in paths.take(n) {
            let path = path.trim_start();
            names.insert(&path[..first(path).unwrap_or(path.len())]);
        }
    }
    names
}

#[test]
fn every_module_has_its_place_and_uses_only_what_stands_below() {
    let floors: Vec<&str> = between(CRATE, "//! | [`", "`]").collect();
    let declared: BTreeSet<&str> = between(CRATE, "pub mod ", ";").collect();
    assert_eq!(floors.iter().copied().collect::<BTreeSet<_>>(), declared);
    for (i, floor) in floors.iter().enumerate() {
        for path in files(&root().join("src").join(floor), "rs") {
            if path.ends_with("tests.rs") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            let body = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
            let code: Vec<&str> = body.lines().map(|line| line.split("//").next().unwrap()).collect();
            let code = code.join("\n");
            let above: Vec<&str> = used(&code).into_iter().filter(|m| floors[i + 1..].contains(m)).collect();
            assert!(above.is_empty(), "{}: {floor} uses {above:?}", path.display());
        }
    }
}

#[test]
fn the_bibliography_is_what_is_cited() {
    let listed: BTreeSet<String> = between(CRATE, "//! - \\[", "\\]").map(str::to_owned).collect();
    let mut cited = BTreeSet::new();
    for directory in ["src", "tests", "benches", "examples"] {
        for path in files(&root().join(directory), "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let comments = text.lines().filter_map(|line| Some(line.split_once("//")?.1));
            for comment in comments.filter(|comment| !comment.starts_with("! - \\[")) {
                // A key in plain comments is told from an index by its capital and its year.
                let is_key = |key: &&str| {
                    key.contains(char::is_uppercase) && key.contains(|c: char| c.is_ascii_digit())
                };
                let plain = between(comment, "[", "]").filter(is_key);
                cited.extend(between(comment, "\\[", "\\]").chain(plain).map(str::to_owned));
            }
        }
    }
    assert_eq!(listed, cited);
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

#[test]
fn links_of_the_manual_lead_somewhere() {
    let mut pages = files(&root().join("docs"), "md");
    pages.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|name| root().join(name)));
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        let links = text.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0));
        for link in links.filter(|link| !link.starts_with("http")) {
            let (file, wanted) = link.split_once('#').unwrap_or((link, ""));
            let to = if file.is_empty() { page.clone() } else { page.parent().unwrap().join(file) };
            assert!(to.exists(), "{}: {link}", page.display());
            if !wanted.is_empty() {
                let text = fs::read_to_string(&to).unwrap();
                let headings = text.lines().filter_map(|line| line.strip_prefix('#'));
                let mut anchors = headings.map(|line| anchor(line.trim_start_matches('#').trim()));
                assert!(anchors.any(|found| found == wanted), "{}: {link}", page.display());
            }
        }
    }
}
