//! The entry point of all libFuzzer targets.

#[expect(dead_code, reason = "libFuzzer ends its processes, and what they leave is small")]
#[path = "../../crates/volume/tests/fuzz/input.rs"]
mod input;
mod targets;

/// Passes an input to the target with this name.
pub fn run(name: &str, bytes: &[u8]) {
    let target = targets::TARGETS.iter().find(|(target, _)| *target == name);
    target.expect("a target").1(bytes);
}
