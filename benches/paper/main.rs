//! The paper's results (§7): Tables 2, 3 and 4 with its rows and columns, and its figures beside ours; the savings and costs of the
//! economies of its §8; and its pictures.
//!
//! `cargo bench --bench paper -- [FRAMES] [PART]… [ROW]…` prints `tables-2-and-4`, `table-3` and `economies`, or only the named ones, with
//! all rows or only the named ones; times are medians over FRAMES frames, with settings in turn. The part `gallery` makes everything in
//! `assets/paper` except the scenes, and only when named: `cargo bench --bench paper -- gallery`.

#![expect(clippy::unwrap_used, reason = "a bench")]

#[path = "../common/mod.rs"]
#[expect(dead_code, reason = "not every bench needs all of it")]
mod common;
mod gallery;
mod measures;
mod plot;
mod scenes;
mod tables;

use sheetsplat::headless::{GpuHeadless, HeadlessOptions};

const TABLES: [&str; 3] = ["tables-2-and-4", "table-3", "economies"];
const GALLERY: &str = "gallery";

fn main() {
    let (frames, names) = common::arguments(3);
    let (mut parts, wanted): (Vec<&str>, Vec<&str>) =
        names.iter().map(String::as_str).partition(|name| TABLES.contains(name) || *name == GALLERY);
    if parts.is_empty() {
        parts = TABLES.to_vec();
    }
    let rows = scenes::rows(&wanted);
    let headless = GpuHeadless::new(&HeadlessOptions::default()).unwrap();
    for part in parts {
        match part {
            "tables-2-and-4" => tables::tables_2_and_4(&headless, frames, &rows),
            "table-3" => tables::table_3(&headless, frames, &rows),
            "economies" => tables::economies(&headless, frames, &rows),
            _ => gallery::make(&headless),
        }
    }
    let info = headless.device().adapter_info();
    println!("\nMedians of {frames} frames; {} ({} {})", info.name, info.driver, info.driver_info);
}
