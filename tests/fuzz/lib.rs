//! What all targets do with an input.

#[expect(dead_code, reason = "libFuzzer ends its processes, and what they leave is small")]
mod targets;

/// Hands an input to the target of this name.
pub fn run(name: &str, bytes: &[u8]) {
    let target = targets::TARGETS.iter().find(|(target, _)| *target == name);
    target.expect("a target").1(bytes);
}
