//! Tables 2 to 4, and a table of the economies of §8.

use sheetsplat::SceneView;
use sheetsplat::headless::GpuHeadless;
use sheetsplat::settings::{Economies, Method, Order, Rasterizer, Splatting};
use sheetsplat::stats::{Counts, Stats};

use crate::common::{median, timed};
use crate::measures::difference;
use crate::scenes::Row;

/// Table 2's columns by quads, as in the paper, and its last two by tiles: sheets, order, visibility test, tiles.
const TABLE_2: [(Method, Order, bool, bool, Rasterizer); 7] = [
    (Method::ImageAligned, Order::BackToFront, false, false, Rasterizer::Quads),
    (Method::AxisAligned, Order::BackToFront, false, false, Rasterizer::Quads),
    (Method::ImageAligned, Order::FrontToBack, true, false, Rasterizer::Quads),
    (Method::ImageAligned, Order::FrontToBack, true, true, Rasterizer::Quads),
    (Method::AxisAligned, Order::FrontToBack, true, true, Rasterizer::Quads),
    (Method::ImageAligned, Order::FrontToBack, true, true, Rasterizer::Tiles),
    (Method::AxisAligned, Order::FrontToBack, true, true, Rasterizer::Tiles),
];

/// The column of [`TABLE_2`] that Table 4 counts.
const COUNTED: usize = 3;

/// The ratios that the paper derives from Table 2's columns: its two ratios, and the effects of visibility test and tiles on the
/// image-aligned time.
fn ratios(&[all, all_axis_aligned, visible, tiled, axis_aligned]: &[f64; 5]) -> [f64; 4] {
    [all / all_axis_aligned, all / visible, all / tiled, tiled / axis_aligned]
}

pub(crate) fn tables_2_and_4(headless: &GpuHeadless, frames: usize, rows: &[Row]) {
    let (mut shares, mut times, mut counts) = (String::new(), String::new(), String::new());
    for row in rows {
        let mut view = headless.view(row.scene.load_volume().unwrap(), &row.scene).unwrap();
        let default = row.scene.splatting;
        let settings = TABLE_2.map(|(method, order, culling, tiles, rasterizer)| Splatting {
            method,
            order,
            culling,
            tiles,
            rasterizer,
            ..default
        });
        let runs = interleaved(headless, &mut view, &settings, frames);
        let quads: [f64; 5] = std::array::from_fn(|at| runs[at].0 / 1e3);
        let [image_aligned, axis_aligned] = [5, 6].map(|at| runs[at].0 / 1e3);
        let cells = beside(&ratios(&quads), row.table_2.as_ref().map(ratios), 1);
        shares += &format!("| {} | {cells} | {:.1} |\n", row.name, image_aligned / axis_aligned);
        let cells = beside(&quads, row.table_2, 2);
        times += &format!("| {} | {cells} | {image_aligned:.2} | {axis_aligned:.2} |\n", row.name);
        counts += &table_4(row.name, &runs[COUNTED].1.counts, row.table_4);
    }
    print(
        "Table 2, ratios; ours (the paper's). By quads, as in the paper, except the last column, which is by the tile rasterizer, the default.",
        &[
            "back-to-front: img./axis-align.",
            "img.-align.: + vis. test saves",
            "+ vis. test + tiles save",
            "front-to-back: img./axis-align.",
            "by tiles",
        ],
        &shares,
    );
    print(
        "Table 2, seconds; ours (the paper's).",
        &[
            "back-to-front: img.-align.",
            "axis-align.",
            "front-to-back: img.-align. + vis. test",
            "img.-align. + vis. test + tiles",
            "axis-align. + vis. test + tiles",
            "by tiles: img.-align.",
            "axis-align.",
        ],
        &times,
    );
    let columns = [
        "total # voxels",
        "# voxels in iso-range",
        "",
        "# shaded voxels",
        "",
        "total # kernel sections",
        "# rasterized kernel sections",
        "",
    ];
    print("Table 4; ours (the paper's). By quads.", &columns, &counts);
}

/// A row of Table 4. Percentages refer to the quantity to their left.
fn table_4(name: &str, counts: &Counts, paper: Option<[&str; 8]>) -> String {
    let &Counts { voxels_total, voxels_in_range, voxels_shaded, sections_total, sections_rasterized, .. } = counts;
    let percent = |part: u64, whole: u64| format!("{:.0} %", 100.0 * part as f64 / whole as f64);
    let ours = [
        magnitude(voxels_total),
        magnitude(voxels_in_range),
        percent(voxels_in_range, voxels_total),
        magnitude(voxels_shaded),
        percent(voxels_shaded, voxels_in_range),
        magnitude(sections_total),
        magnitude(sections_rasterized),
        percent(sections_rasterized, sections_total),
    ];
    let cells: Vec<String> =
        (0..8).map(|at| paper.map_or(ours[at].clone(), |paper| format!("{} ({})", ours[at], paper[at]))).collect();
    format!("| {name} | {} |\n", cells.join(" | "))
}

/// A number in Table 4's notation.
fn magnitude(count: u64) -> String {
    match count {
        1_000_000.. => format!("{:.1} M", count as f64 / 1e6),
        _ => format!("{:.0} k", count as f64 / 1e3),
    }
}

/// Table 3's columns: their names and settings.
pub(crate) fn accelerations(default: Splatting) -> [(&'static str, Splatting); 5] {
    [
        ("default", default),
        ("kernel radius=1.4", Splatting { radius: 1.4, ..default }),
        ("slab width=2.0", Splatting { slab_width: 2.0, ..default }),
        ("slab width=3.0", Splatting { slab_width: 3.0, ..default }),
        ("opacity threshold=0.8", Splatting { opacity_threshold: 0.8, ..default }),
    ]
}

pub(crate) fn table_3(headless: &GpuHeadless, frames: usize, rows: &[Row]) {
    let columns = accelerations(Splatting::default()).map(|(name, _)| name);
    let speedups = |seconds: &[f64; 5]| seconds.map(|other| seconds[0] / other);
    let (mut shares, mut times) = (String::new(), String::new());
    // Columns change the slab width, so rows have the default settings.
    let at_default = |row: &&Row| row.scene.splatting == Splatting::default();
    for row in rows.iter().filter(at_default).filter(|row| row.table_3.is_some() || row.table_2.is_none()) {
        let mut view = headless.view(row.scene.load_volume().unwrap(), &row.scene).unwrap();
        for rasterizer in [Rasterizer::Quads, Rasterizer::Tiles] {
            let settings = accelerations(Splatting { rasterizer, ..row.scene.splatting }).map(|(_, settings)| settings);
            let runs = interleaved(headless, &mut view, &settings, frames);
            let seconds: [f64; 5] = std::array::from_fn(|at| runs[at].0 / 1e3);
            let of_paper = row.table_3.filter(|_| rasterizer == Rasterizer::Quads);
            let name = format!("{}, {}", row.name, runs[0].1.rasterizer);
            shares += &format!("| {name} | {} |\n", beside(&speedups(&seconds), of_paper.as_ref().map(speedups), 1));
            times += &format!("| {name} | {} |\n", beside(&seconds, of_paper, 2));
        }
    }
    print("Table 3, speedups; ours (the paper's).", &columns, &shares);
    print("Table 3, seconds; ours (the paper's).", &columns, &times);
}

/// The paper's future work: the error against the image without economies, sections, and time.
pub(crate) fn economies(headless: &GpuHeadless, frames: usize, rows: &[Row]) {
    let none = Economies::default();
    let whole = [0.005, 0.02, 0.1]
        .map(|whole_below| (format!("whole_below = {whole_below}"), Economies { whole_below, ..none }));
    let beta = [0.95, 0.8, 0.5].map(|beta| (format!("beta = {beta}"), Economies { beta, ..none }));
    let resolution =
        [1e-4, 1e-3, 4e-3].map(|resolution| (format!("resolution = {resolution}"), Economies { resolution, ..none }));
    let (names, economies): (Vec<String>, Vec<Economies>) =
        std::iter::once(("none".to_owned(), none)).chain(whole).chain(beta).chain(resolution).unzip();
    let mut cells = String::new();
    for row in rows.iter().filter(|row| row.table_2.is_some()) {
        let mut view = headless.view(row.scene.load_volume().unwrap(), &row.scene).unwrap();
        let default = Splatting { rasterizer: Rasterizer::Tiles, ..row.scene.splatting };
        let settings: Vec<Splatting> =
            economies.iter().map(|&economies| Splatting { experimental: economies, ..default }).collect();
        let runs = interleaved(headless, &mut view, &settings, frames);
        let images: Vec<_> = settings
            .iter()
            .map(|&settings| {
                view.set_splatting(settings).unwrap();
                headless.draw(&mut view).unwrap().image
            })
            .collect();
        for at in 1..runs.len() {
            let (psnr, largest) = difference(&images[at], &images[0]);
            let drawn = |at: usize| runs[at].1.counts.sections_rasterized as f64;
            let speedup = runs[0].0 / runs[at].0;
            let sections = 100.0 * drawn(at) / drawn(0);
            cells += &format!(
                "| {}, {} | {psnr:.1} | {largest:.4} | {sections:.0} % | {speedup:.2} |\n",
                row.name, names[at]
            );
        }
    }
    print(
        "Economies (§8), by the tile rasterizer; against the image without.",
        &["PSNR, dB", "largest error", "sections drawn, relative to those without", "speedup"],
        &cells,
    );
}

/// Prints a table whose rows are already formatted.
fn print(title: &str, columns: &[&str], rows: &str) {
    println!("\n{title}\n\n| | {} |\n|{}\n{}", columns.join(" | "), "---|".repeat(columns.len() + 1), rows.trim_end());
}

/// The median time in milliseconds of frames with each of some settings. Settings are drawn in turn, so that other work on the machine
/// affects all alike.
fn interleaved(
    headless: &GpuHeadless,
    view: &mut SceneView,
    settings: &[Splatting],
    frames: usize,
) -> Vec<(f64, Stats)> {
    let mut runs: Vec<Vec<(f64, Stats)>> = settings.iter().map(|_| Vec::new()).collect();
    for _ in 0..frames {
        for (settings, runs) in settings.iter().zip(&mut runs) {
            view.set_splatting(*settings).unwrap();
            runs.push(timed(headless, view));
        }
    }
    runs.into_iter().map(median).collect()
}

/// Our figures as cells, with the paper's in parentheses.
fn beside<const N: usize>(ours: &[f64; N], paper: Option<[f64; N]>, digits: usize) -> String {
    let cell = |at: usize| match paper {
        Some(paper) => format!("{:.digits$} ({:.1})", ours[at], paper[at]),
        None => format!("{:.digits$}", ours[at]),
    };
    (0..N).map(cell).collect::<Vec<_>>().join(" | ")
}
