//! `--stats`: the counts of the specification.

use crate::*;

/// The keys of SPEC §8, and what the program counts besides; no more and no less.
pub(crate) const STATS_KEYS: [&str; 22] = [
    "adapter",
    "api",
    "backend",
    "bricks_tested",
    "bricks_visited",
    "driver",
    "frame_ms",
    "gpu_bytes",
    "height",
    "load_ms",
    "prepare_ms",
    "quads",
    "rasterizer",
    "sections_rasterized",
    "sections_total",
    "sheets",
    "tiles_composited",
    "tiles_total",
    "voxels_in_range",
    "voxels_shaded",
    "voxels_total",
    "width",
];

pub(crate) fn keys(stats: &Value) -> Vec<&str> {
    let mut keys: Vec<&str> = stats.as_object().unwrap().keys().map(String::as_str).collect();
    keys.sort_unstable();
    keys
}

pub(crate) fn count(stats: &Value, key: &str) -> u64 {
    stats[key].as_u64().unwrap_or_else(|| panic!("{key} in {stats}"))
}

/// Asserts counts by key.
fn assert_counts(what: &str, stats: &Value, expected: &[(&str, u64)]) {
    for &(key, expected) in expected {
        assert_eq!(count(stats, key), expected, "{what}: {key} in {stats:#}");
    }
}

#[test]
fn stats_of_a_single_voxel() {
    // The minimum is the compositing buffer and the target, 16 bytes per pixel each, plus quads' sheets.
    for (rasterizer, name, least_bytes) in [(QUADS, "quads", 8 + 16 + 16), (TILES, "tiles", 16 + 16)] {
        let folder = Folder::new();
        assert_stats_of_a_single_voxel(&folder, rasterizer, name, least_bytes);
    }
}

fn assert_stats_of_a_single_voxel(folder: &Folder, rasterizer: &str, name: &str, least_bytes: u64) {
    folder.write_nrrd("one.nrrd", [1, 1, 1], [1.0, 1.0, 1.0], &[1.0]);
    let haze = format!(
        "--set camera.direction=[0,1,0] --set transfer.opacity=[[0,0.5]] --set image.width=40 --set image.height=70 {rasterizer}"
    );
    // The voxel lies on plane 0: two slabs are before it, two behind.
    let stats = folder.stats(&format!("one.nrrd {haze}"));
    assert_eq!(keys(&stats), STATS_KEYS);
    let (tiles, sheets) = (2 * 3, 4);
    let expected = [
        ("width", 40),
        ("height", 70),
        ("voxels_total", 1),
        ("voxels_in_range", 1),
        ("voxels_shaded", 1),
        ("sections_total", 4),
        ("sections_rasterized", 4),
        ("sheets", sheets),
        ("tiles_total", tiles * sheets),
    ];
    assert_counts("one voxel", &stats, &expected);
    assert!(count(&stats, "tiles_composited") <= tiles * sheets);
    for key in ["load_ms", "prepare_ms", "frame_ms"] {
        let milliseconds = stats[key].as_f64().unwrap();
        assert!(milliseconds.is_finite() && milliseconds >= 0.0, "{key}: {milliseconds}");
    }
    assert!(count(&stats, "gpu_bytes") > 40 * 70 * least_bytes, "{stats:#}");
    assert_eq!(stats["rasterizer"], name);
    for key in ["adapter", "driver", "api"] {
        assert!(!stats[key].as_str().unwrap().is_empty(), "{key}");
    }
    assert_eq!(stats["backend"], "gpu");

    // Half a spacing off the planes there is a fifth slab. The voxel's neighbour does not take part.
    folder.write_nrrd("two.nrrd", [1, 2, 1], [1.0, 1.0, 1.0], &[1.0, 9.0]);
    let stats = folder.stats(&format!("two.nrrd {haze} --set transfer.iso_ranges=[[0,5]]"));
    let expected = [("voxels_total", 2), ("voxels_in_range", 1), ("sections_total", 5), ("sheets", 5)];
    assert_counts("half a spacing", &stats, &expected);

    // No voxel takes part.
    let stats = folder.stats(&format!("one.nrrd --set transfer.opacity=[[0,0]] {rasterizer}"));
    let none = ["voxels_in_range", "voxels_shaded", "sections_total", "sections_rasterized", "sheets", "tiles_total"];
    assert_counts("none takes part", &stats, &none.map(|key| (key, 0)));

    // Off the screen, sections are counted but not drawn.
    let stats = folder.stats(&format!("one.nrrd {haze} {WHOLE} --set camera.center=[1000,0,0]"));
    let expected = [("voxels_in_range", 1), ("sections_total", 4), ("sections_rasterized", 0), ("sheets", 4)];
    assert_counts("off the screen", &stats, &expected);
}

/// Counts SPEC §5's slabs one by one: the sections and sheets of a volume in which every voxel takes part.
fn count_sections(dims: [u32; 3], spacing: DVec3, w: DVec3, radius: f64, slab_width: f64) -> (u64, u64) {
    let unit = spacing.min_element();
    let warped = w.normalize() * unit / spacing;
    let (width, normal) = (slab_width * warped.length(), warped.normalize());
    let (mut sections, mut first, mut last) = (0, i64::MAX, i64::MIN);
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let voxel = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                let center = (DVec3::from(dims.map(f64::from)) - 1.0) / 2.0;
                let depth = (voxel - center).dot(normal);
                let around = (depth / width) as i64;
                let reach = (radius / width) as i64 + 3;
                for k in around - reach..around + reach {
                    let overlap = (depth + radius).min((k + 1) as f64 * width) - (depth - radius).max(k as f64 * width);
                    // Overlaps must exceed rounding errors.
                    if overlap > 1e-9 {
                        sections += 1;
                        first = first.min(k);
                        last = last.max(k);
                    }
                }
            }
        }
    }
    (sections, (last - first + 1) as u64)
}

#[test]
fn stats_count_the_sections_of_the_specification() {
    let folder = Folder::new();
    let dims = [5, 4, 3];
    folder.write_nrrd("small.nrrd", dims.map(|side| side as usize), [1.0, 1.0, 1.0], &[1.0; 60]);
    let mut failures = Vec::new();
    for (direction, spacing, radius, slab_width) in [
        ([0.0, 1.0, 0.0], [1.0, 1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.0, -1.0], [1.0, 1.0, 5.0], 2.0, 1.0),
        ([0.0, 0.0, 1.0], [1.0, 1.0, 3.0], 1.4, 0.5),
        ([1.0, 0.0, 0.0], [3.2, 3.2, 1.5], 2.0, 2.0),
        ([0.6, 0.8, 0.0], [1.0, 1.0, 1.0], 2.0, 1.0),
        ([0.0, 0.6, -0.8], [2.0, 2.0, 2.0], 1.4, 0.2),
        ([0.3, 0.9, -0.2], [1.0, 1.0, 5.0], 2.0, 3.0),
        ([0.5, 0.1, 0.7], [3.2, 3.2, 1.5], 2.0, 0.5),
        ([1.0, 1.0, 1.0], [1.0, 1.0, 2.0], 4.0, 8.0),
        ([1.0, 2.0, 2.0], [1.0, 1.0, 1.0], 1.0, 0.05),
    ] {
        let (sections, sheets) = count_sections(dims, DVec3::from(spacing), DVec3::from(direction), radius, slab_width);
        let expected = [sections, sections, sheets, 60];
        for drawing in DRAWINGS {
            let sets = format!(
                "--set camera.direction={} --set volume.spacing={} --set splatting.radius={radius} \
                 --set splatting.slab_width={slab_width} {drawing}",
                format!("{direction:?}").replace(' ', ""),
                format!("{spacing:?}").replace(' ', ""),
            );
            let stats = folder.stats(&format!(
                "small.nrrd --set image.width=8 --set image.height=8 --set transfer.opacity=[[0,0.5]] \
                 --set camera.up=[0.1,0.2,1] {sets} {UNCULLED}"
            ));
            let counted =
                ["sections_total", "sections_rasterized", "sheets", "voxels_shaded"].map(|key| count(&stats, key));
            if counted != expected {
                failures.push(format!("{sets}: {counted:?}, not {expected:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "sections, on screen, sheets, shaded:\n{}", failures.join("\n"));
}

/// Light sheets are counted where there are any, and a key of theirs that has no effect is named.
#[test]
fn light_sheets_are_counted_and_idle_keys_named() {
    let folder = Folder::new();
    for drawing in DRAWINGS {
        let stats = folder.stats(&format!("{SMALL} {drawing} --set shading.occlusion=0.5"));
        assert!(stats["light_ms"].as_f64().unwrap() > 0.0 && count(&stats, "light_bytes") > 1000, "{stats:#}");
        let stats = folder.stats(&format!("{SMALL} {drawing}"));
        assert_eq!(keys(&stats), STATS_KEYS, "{drawing}");
    }
    for (sets, key) in [
        ("--set shading.occlusion=0.5 --set shading.enabled=false", "shading.occlusion has no effect"),
        ("--set shading.shadow_spread=3", "shading.shadow_spread has no effect: shading.shadow = 0"),
        ("--set shading.light_step=3", "shading.light_step has no effect"),
    ] {
        let run = folder.run(&format!("render {SMALL} {sets} --backend cpu -o idle.npy"));
        run.assert_success();
        assert_eq!(run.stderr.matches(key).count(), 1, "{sets}: {}", run.stderr);
    }
}

/// A GPU loses normals of steep kernels' gradients, which is said; the native backend loses none.
#[test]
fn normals_that_a_gpu_loses_are_told() {
    let folder = Folder::new();
    let steep = "--set shading.gradient=kernel --set splatting.classification=after --set splatting.falloff";
    for (sets, count) in [
        (format!("{steep}=9 --backend gpu"), 1),
        (format!("{steep}=8 --backend gpu"), 0),
        (format!("{steep}=9 --backend cpu"), 0),
    ] {
        let run = folder.run(&format!("render {SMALL} {sets} -o steep.npy"));
        run.assert_success();
        assert_eq!(run.stderr.matches("a GPU loses some normals").count(), count, "{sets}: {}", run.stderr);
    }
}
