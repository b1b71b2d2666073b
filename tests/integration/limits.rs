//! A small scene file takes neither much memory nor much time, whatever it says: every command here runs
//! in an address space of the stated size.

#![cfg(unix)]

use std::time::{Duration, Instant};

use assert_cmd::cargo::cargo_bin;
use lightopt_embree::import::budget::{MAX_DEPTH, MAX_OBJECTS, MEMORY_BASE, MEMORY_PER_BYTE};

use crate::room::Room;

/// Address space of the program itself, bytes: code, stacks of its threads, the allocator's arenas.
const PROGRAM: u64 = 1 << 30;
/// Longest that a file may take, on a machine that does other things too.
const PATIENCE: Duration = Duration::from_secs(10);

/// What `render` says of a glTF within its memory; it must end by itself with an error on one line.
fn refused(json: &str) -> String {
    let room = Room::new();
    room.write("s.gltf", json);
    let limit = (MEMORY_BASE + MEMORY_PER_BYTE * json.len() as u64 + PROGRAM) / 1024;
    let script = format!("ulimit -v {limit}; exec \"$0\" render --spp 1 --size 8x6 -o a.png s.gltf");
    let start = Instant::now();
    let output = std::process::Command::new("sh")
        .args(["-c", &script])
        .arg(cargo_bin("lightopt-embree"))
        .current_dir(room.directory.path())
        .output()
        .unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(start.elapsed() < PATIENCE, "{:?}: {said}", start.elapsed());
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.starts_with("error: s.gltf: ") && said.lines().count() == 1, "{said}");
    said
}

/// A glTF with these members beside its scene of node 0.
fn gltf(members: &str) -> String {
    format!(r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],{members}}}"#)
}

/// A mesh of primitives that all use accessor 0 for their positions.
fn mesh(n_primitives: usize) -> String {
    let primitives = vec![r#"{"attributes":{"POSITION":0}}"#; n_primitives].join(",");
    format!(r#""meshes":[{{"primitives":[{primitives}]}}]"#)
}

#[test]
fn accessors_that_hold_no_data_are_small() {
    let node = r#""nodes":[{"mesh":0}]"#;
    for count in [1_u64 << 20, 1 << 32, 1 << 40, u64::MAX] {
        let is_small = count < 1 << 26;
        let accessor = format!(r#""componentType":5126,"type":"VEC3","count":{count}"#);
        let sparse = format!(
            r#","sparse":{{"count":{count},"indices":{{"bufferView":0,"componentType":5125}},"values":{{"bufferView":0}}}}"#
        );
        for rest in ["", &sparse] {
            let said = refused(&gltf(&format!(r#"{node},{},"accessors":[{{{accessor}{rest}}}]"#, mesh(1))));
            let reasons = ["has no data for", "asks for more than"];
            assert!(reasons.iter().any(|r| said.contains(&format!("`accessors[0]`: {r}"))), "{said}");
        }
        let view = r#""bufferViews":[{"buffer":0,"byteLength":3}],"buffers":[{"byteLength":3,"uri":"data:;base64,AAAA"}]"#;
        let said = refused(&gltf(&format!(
            r#"{node},{},"accessors":[{{{accessor},"bufferView":0}}],{view}"#,
            mesh(1)
        )));
        let reason = if is_small { "do not fit into the 3 bytes" } else { "asks for more than" };
        assert!(said.contains(reason), "{said}");
    }
}

#[test]
fn what_is_used_often_is_counted_each_time() {
    let accessor = r#""accessors":[{"componentType":5126,"type":"VEC3","count":65535}]"#;
    let said = refused(&gltf(&format!(r#""nodes":[{{"mesh":0}}],{},{accessor}"#, mesh(2000))));
    assert!(said.contains("asks for more than"), "{said}");
    let instances =
        r#""nodes":[{"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":0}}}}]"#;
    let said = refused(&gltf(&format!("{instances},{},{accessor}", mesh(1))));
    assert!(said.contains("triangles, each instance counted"), "{said}");
}

#[test]
fn trees_of_nodes_are_not_deep_and_have_no_cycles() {
    let mesh = format!(r#"{},"accessors":[{{"componentType":5126,"type":"VEC3","count":3}}]"#, mesh(1));
    let chain = |n: usize| {
        let node = |i: usize| match i + 1 {
            next if next < n => {
                format!(r#"{{"mesh":0,"name":"a rather long name {i}","children":[{next}]}}"#)
            }
            _ => r#"{"mesh":0}"#.to_owned(),
        };
        let nodes: Vec<String> = (0..n).map(node).collect();
        gltf(&format!(r#""nodes":[{}],{mesh}"#, nodes.join(",")))
    };
    assert!(refused(&chain(100_000)).contains(&format!("more than {MAX_DEPTH} deep")));
    assert!(refused(&chain(MAX_DEPTH)).contains("no triangle"));
    let said = refused(&gltf(&format!(r#""nodes":[{{"children":[1]}},{{"children":[0]}}],{mesh}"#)));
    assert!(said.contains("stands in the tree twice"), "{said}");
}

#[test]
fn lists_of_objects_are_counted_before_they_are_read() {
    for (member, object) in [("nodes", "{}"), ("materials", "{}"), ("buffers", r#"{"byteLength":1}"#)] {
        let said = refused(&gltf(&format!(r#""{member}":[{}]"#, vec![object; MAX_OBJECTS + 1].join(","))));
        assert!(said.contains("objects in its lists"), "{said}");
    }
}
