//! Hostile images and scenes: each is read whole or refused, without panicking or hanging, and without using more memory than its size warrants.
//! Volumes are the matter of `crates/volume/tests/hostile`, whose helpers this program shares.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../../crates/volume/tests/hostile/bounded.rs"]
mod bounded;
#[path = "../../crates/volume/tests/hostile/fuzzing.rs"]
mod fuzzing;
mod images;
#[path = "../../crates/volume/tests/fuzz/input.rs"]
mod input;
#[path = "../../crates/volume/tests/hostile/mutate.rs"]
mod mutate;
mod scenes;
#[path = "../fuzz/targets.rs"]
mod targets;

use std::path::Path;

#[test]
fn no_target_panics() {
    let _alone = bounded::alone();
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus");
    fuzzing::run(&targets::TARGETS, |target| fuzzing::files(&corpus.join(target)));
}
