//! The shaders parse, validate as WebGPU core (except one), and need no more than WebGPU's default limits. Needs no GPU.

mod lanes;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Block, Expression, Function, Handle, Module, ShaderStage, Statement, TypeInner};
use sheetsplat::internals::gpu::shaders::{self, Shader};

/// The capabilities of WebGPU core beyond naga's minimum: `pack2x16float` and its inverse, which WGSL always has.
const WEBGPU_CORE: Capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;

/// What a shader needs beyond WebGPU core: subgroups where the lanes of a patch are one, and their barriers. Each such stage has a variant that needs
/// neither.
fn beyond_core(shader: &Shader) -> Capabilities {
    let has = |file: &str| shader.files.iter().any(|&(path, _)| path == file);
    let mut needed = Capabilities::empty();
    needed.set(Capabilities::SUBGROUP, has("gather/subgroup_lanes.wgsl"));
    needed.set(Capabilities::SUBGROUP_BARRIER, has("gather/subgroup_barrier.wgsl"));
    needed
}

fn validated(shader: &Shader) -> Result<(Module, ModuleInfo), String> {
    let failed = |line: Option<u32>, message: String| {
        let (path, line) = shader.origin(line.unwrap_or(1));
        format!("shaders/{path}:{line}: {message}")
    };
    let module = naga::front::wgsl::parse_str(&shader.source()).map_err(|error| {
        let line = error.location(&shader.source()).map(|location| location.line_number);
        failed(line, error.emit_to_string_with_path(&shader.source(), shader.stage))
    })?;
    let capabilities = WEBGPU_CORE | beyond_core(shader);
    let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module).map_err(|error| {
        let line = error.location(&shader.source()).map(|location| location.line_number);
        failed(line, error.emit_to_string_with_path(&shader.source(), shader.stage))
    })?;
    Ok((module, info))
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The files with an extension in a folder and the folders below it.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found
}

/// Asserts that nothing failed, and reports all failures, not only the first.
fn assert_none(failures: &[String]) {
    assert!(failures.is_empty(), "{} failures:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_shader_validates() {
    let failures: Vec<_> = shaders::ALL.iter().filter_map(|shader| validated(shader).err()).collect();
    assert_none(&failures);
    let needs: Vec<Capabilities> = shaders::GATHER.iter().chain(&shaders::GATHER_PLANES).map(beyond_core).collect();
    let [first, planes] = [&needs[..3], &needs[3..]];
    let expected =
        [Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER, Capabilities::SUBGROUP, Capabilities::empty()];
    assert_eq!([first, planes], [&expected; 2], "in the order of `Lanes`");
}

#[test]
fn errors_name_the_file_and_the_line() {
    let broken = Shader {
        stage: "broken",
        variant: &[],
        files: &[
            ("shared/one.wgsl", "fn first() {}\n\n"),
            ("broken.wgsl", "fn second() {}\nfn third() { nothing(); }\n"),
        ],
    };
    let error = validated(&broken).unwrap_err();
    assert!(error.starts_with("shaders/broken.wgsl:2: "), "{error}");
    assert_eq!(broken.origin(1), ("shared/one.wgsl", 1));
    assert_eq!(broken.origin(3), ("broken.wgsl", 1));
    assert_eq!(
        broken.explain("at wgsl:4:7, and wgsl:1:2"),
        "at shaders/broken.wgsl:2:7, and shaders/shared/one.wgsl:1:2"
    );
    for shader in shaders::ALL {
        // Every file ends with a line break, or else lines would be counted wrongly.
        assert!(shader.files.iter().all(|(_, text)| text.ends_with('\n')), "{}", shader.stage);
    }
}

#[test]
fn every_file_is_used() {
    let files = files(&root().join("shaders"), "wgsl");
    assert!(files.len() >= shaders::ALL.len());
    let is_used = |file: &PathBuf| {
        let text = std::fs::read_to_string(file).unwrap();
        shaders::ALL.iter().any(|shader| shader.source().contains(&text))
    };
    let unused: Vec<_> = files.iter().filter(|file| !is_used(file)).map(|file| file.display().to_string()).collect();
    assert_none(&unused);
    let names = |shader: &Shader| (shader.stage, shader.files.iter().map(|&(path, _)| path).collect::<Vec<_>>());
    let stages: BTreeSet<_> = shaders::ALL.iter().map(names).collect();
    assert_eq!(stages.len(), shaders::ALL.len(), "every stage has a name of its own, and its variants other files");
}

/// A shader is used by one file of `src/pass`, whose names of entry points and overrides only the shader can check. (Creating the pipelines
/// checks that the shader has all that the file names.)
#[test]
fn entry_points_and_overrides_are_those_of_the_passes() {
    let passes = files(&root().join("src/pass"), "rs");
    let sources: Vec<String> = passes.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect();
    // The quads of all shaders have the same layout.
    let splat_slots = std::fs::read_to_string(root().join("src/pass/splat.rs")).unwrap();
    // Classify has the bindings and constants of composite, and its own.
    let composite = std::fs::read_to_string(root().join("src/pass/composite.rs")).unwrap();
    let mut failures = Vec::new();
    for shader in shaders::ALL {
        let (module, _) = validated(shader).unwrap();
        let constant = format!("shaders::{}", shader.stage.to_uppercase());
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        let uses = |text: &str| text.split(&constant).skip(1).any(|rest| !rest.starts_with(is_name));
        let passes: Vec<&String> = sources.iter().filter(|text| uses(text)).collect();
        let [pass] = passes[..] else {
            failures.push(format!("{}: {} files of src/pass use it", shader.stage, passes.len()));
            continue;
        };
        for entry in &module.entry_points {
            // Fragment shaders of groups of sheets end in their number.
            let family = entry.name.trim_end_matches(|c: char| c.is_ascii_digit());
            let is_used = pass.contains(&format!("\"{}\"", entry.name))
                || family != entry.name && pass.contains(&format!("\"{family}{{sheets}}\""));
            if !is_used {
                failures.push(format!("{}: the pass does not use {}", shader.stage, entry.name));
            }
        }
        // Bindings are matched by name, when a layout is made and when resources are bound.
        for (_, global) in module.global_variables.iter() {
            let (Some(binding), Some(name)) = (&global.binding, &global.name) else { continue };
            if shader.binding(name) != Some(binding.binding) {
                failures.push(format!("{}: {name} is not found at binding {}", shader.stage, binding.binding));
            }
            let declares = |text: &str| text.contains(&format!("(\"{name}\", "));
            if *shader == shaders::CLASSIFY && !declares(pass) && declares(&composite) {
                continue;
            }
            let layouts = if shader.source().contains("var footprints:") { &splat_slots } else { pass };
            if [layouts, pass].iter().any(|text| !declares(text)) {
                failures.push(format!("{}: the pass does not bind {name}", shader.stage));
            }
        }
        for (_, constant) in module.overrides.iter() {
            let name = constant.name.as_deref().unwrap_or("without a name");
            let sets = |text: &str| text.contains(&format!("(\"{name}\", "));
            if !(sets(pass) || *shader == shaders::CLASSIFY && sets(&composite)) {
                failures.push(format!("{}: the pass does not set {name}", shader.stage));
            }
        }
    }
    assert_none(&failures);
}

#[test]
fn bindings_stay_within_default_limits() {
    let limits = wgpu::Limits::default();
    assert_eq!(limits.max_storage_buffers_per_shader_stage, 8, "WebGPU's default");
    let mut failures = Vec::new();
    for shader in shaders::ALL {
        let (module, _) = validated(shader).unwrap();
        let globals = || module.global_variables.iter().map(|(_, global)| global);
        // A layout may make every binding visible to every stage, so all of them count for each.
        let count =
            |counts: &dyn Fn(&naga::GlobalVariable) -> bool| globals().filter(|global| counts(global)).count() as u32;
        let inner = |global: &naga::GlobalVariable| module.types[global.ty].inner.clone();
        let group = |global: &naga::GlobalVariable| global.binding.map(|binding| binding.group);
        let used = [
            ("groups", globals().filter_map(group).max().map_or(0, |group| group + 1), limits.max_bind_groups),
            (
                "bindings in a group",
                globals().filter_map(|global| global.binding).map(|binding| binding.binding + 1).max().unwrap_or(0),
                limits.max_bindings_per_bind_group,
            ),
            (
                "storage buffers",
                count(&|global| matches!(global.space, AddressSpace::Storage { .. })),
                limits.max_storage_buffers_per_shader_stage,
            ),
            (
                "uniform buffers",
                count(&|global| global.space == AddressSpace::Uniform),
                limits.max_uniform_buffers_per_shader_stage,
            ),
            (
                "textures",
                count(&|global| matches!(inner(global), TypeInner::Image { .. })),
                limits.max_sampled_textures_per_shader_stage,
            ),
            (
                "samplers",
                count(&|global| matches!(inner(global), TypeInner::Sampler { .. })),
                limits.max_samplers_per_shader_stage,
            ),
            (
                "bytes of a uniform buffer",
                globals()
                    .filter(|global| global.space == AddressSpace::Uniform)
                    .map(|global| inner(global).size(module.to_ctx()))
                    .max()
                    .unwrap_or(0),
                u32::try_from(limits.max_uniform_buffer_binding_size).unwrap(),
            ),
            (
                "bytes of workgroup memory",
                globals()
                    .filter(|global| global.space == AddressSpace::WorkGroup)
                    .map(|global| inner(global).size(module.to_ctx()))
                    .sum(),
                limits.max_compute_workgroup_storage_size,
            ),
        ];
        for (what, used, allowed) in used {
            if used > allowed {
                failures.push(format!("{}: {used} {what}, allowed: {allowed}", shader.stage));
            }
        }
    }
    assert_none(&failures);
}

#[test]
fn entry_points_stay_within_default_limits() {
    let limits = wgpu::Limits::default();
    let mut failures = Vec::new();
    for shader in shaders::ALL {
        let (module, _) = validated(shader).unwrap();
        for entry in &module.entry_points {
            let [x, y, z] = workgroup_size(&module, entry);
            let locations = entry.function.result.iter().map(|result| location_count(&module, result.ty)).sum::<u32>();
            let mut allow = |what: &str, used: u32, allowed: u32| {
                if used > allowed {
                    failures.push(format!("{} {}: {used} {what}, allowed: {allowed}", shader.stage, entry.name));
                }
            };
            match entry.stage {
                ShaderStage::Compute => {
                    allow("invocations", x * y * z, limits.max_compute_invocations_per_workgroup);
                    allow("invocations in x", x, limits.max_compute_workgroup_size_x);
                    allow("invocations in y", y, limits.max_compute_workgroup_size_y);
                    allow("invocations in z", z, limits.max_compute_workgroup_size_z);
                }
                ShaderStage::Vertex => {
                    allow("inter-stage variables", locations, limits.max_inter_stage_shader_variables);
                }
                ShaderStage::Fragment => allow("colour attachments", locations, limits.max_color_attachments),
                _ => {}
            }
        }
    }
    assert_none(&failures);
}

/// Lavapipe inserts the values of uniforms that alone decide a branch into a stage, and compiles it again for every draw (`start` in
/// `shaders/shared/frame.wgsl`).
#[test]
fn no_branch_depends_on_uniforms_alone() {
    let mut failures = Vec::new();
    for shader in shaders::ALL {
        let (module, _) = validated(shader).unwrap();
        let functions = module.functions.iter().map(|(_, function)| function);
        for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
            let mut conditions = Vec::new();
            add_conditions(&function.body, &mut conditions);
            for condition in conditions {
                if (Decided { of_uniform: true, of_other: false }) != decided(&module, function, condition) {
                    continue;
                }
                let span = function.expressions.get_span(condition);
                let (path, line) = shader.origin(span.location(&shader.source()).line_number);
                failures.push(format!("shaders/{path}:{line}: a branch in {:?}", function.name));
            }
        }
    }
    failures.sort();
    failures.dedup();
    assert_none(&failures);
}

/// The expressions that decide which statements of a block are executed. An `&&` is a branch, too.
fn add_conditions(block: &Block, conditions: &mut Vec<Handle<Expression>>) {
    for statement in block {
        match statement {
            Statement::Block(inner) => add_conditions(inner, conditions),
            Statement::If { condition, accept, reject } => {
                conditions.push(*condition);
                add_conditions(accept, conditions);
                add_conditions(reject, conditions);
            }
            Statement::Switch { selector, cases } => {
                conditions.push(*selector);
                cases.iter().for_each(|case| add_conditions(&case.body, conditions));
            }
            Statement::Loop { body, continuing, break_if } => {
                conditions.extend(break_if);
                add_conditions(body, conditions);
                add_conditions(continuing, conditions);
            }
            _ => {}
        }
    }
}

/// What the value of an expression depends on, apart from constants and local variables, which may count a loop that is unrolled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Decided {
    /// On a uniform's value at a place that is known.
    of_uniform: bool,
    of_other: bool,
}

impl Decided {
    const OTHER: Self = Self { of_uniform: false, of_other: true };

    fn or(self, other: Self) -> Self {
        Self { of_uniform: self.of_uniform | other.of_uniform, of_other: self.of_other | other.of_other }
    }
}

fn decided(module: &Module, function: &Function, expression: Handle<Expression>) -> Decided {
    let of = |expression: &Handle<Expression>| decided(module, function, *expression);
    match &function.expressions[expression] {
        Expression::Literal(_) | Expression::Constant(_) | Expression::Override(_) | Expression::ZeroValue(_) => {
            Decided::default()
        }
        Expression::LocalVariable(_) => Decided::default(),
        Expression::GlobalVariable(global) => match module.global_variables[*global].space {
            AddressSpace::Uniform => Decided { of_uniform: true, of_other: false },
            _ => Decided::OTHER,
        },
        Expression::Load { pointer } => of(pointer),
        Expression::Access { base, index } => of(base).or(of(index)),
        Expression::AccessIndex { base, .. } => of(base),
        Expression::Splat { value, .. } => of(value),
        Expression::Swizzle { vector, .. } => of(vector),
        Expression::Compose { components, .. } => components.iter().map(of).fold(Decided::default(), Decided::or),
        Expression::Unary { expr, .. } | Expression::As { expr, .. } => of(expr),
        Expression::Binary { left, right, .. } => of(left).or(of(right)),
        Expression::Select { condition, accept, reject } => of(condition).or(of(accept)).or(of(reject)),
        Expression::Relational { argument, .. } => of(argument),
        Expression::Math { arg, arg1, arg2, arg3, .. } => [Some(arg), arg1.as_ref(), arg2.as_ref(), arg3.as_ref()]
            .into_iter()
            .flatten()
            .map(of)
            .fold(Decided::default(), Decided::or),
        _ => Decided::OTHER,
    }
}

/// An entry point's workgroup size with the shader's own values of its overrides; the passes set the same.
fn workgroup_size(module: &Module, entry: &naga::EntryPoint) -> [u32; 3] {
    let mut size = entry.workgroup_size;
    for (side, overridden) in size.iter_mut().zip(entry.workgroup_size_overrides.into_iter().flatten()) {
        let Some(expression) = overridden else { continue };
        let naga::Expression::Override(constant) = module.global_expressions[expression] else {
            panic!("{}: a workgroup size that is no plain override", entry.name);
        };
        let default = module.overrides[constant].init.map(|init| &module.global_expressions[init]);
        let Some(&naga::Expression::Literal(naga::Literal::U32(default))) = default else {
            panic!("{}: a workgroup size without a plain default", entry.name);
        };
        *side = default;
    }
    size
}

/// The `@location`s of an entry point's result.
fn location_count(module: &Module, ty: naga::Handle<naga::Type>) -> u32 {
    match &module.types[ty].inner {
        TypeInner::Struct { members, .. } => {
            members.iter().filter(|member| matches!(member.binding, Some(naga::Binding::Location { .. }))).count()
                as u32
        }
        _ => 1,
    }
}

/// The value of a constant's expression: literals and constants of the same file, multiplied and divided.
fn evaluated(expression: &str, known: &BTreeMap<String, f64>) -> Option<f64> {
    let operand = |text: &str| {
        let text = text.trim().replace('_', "");
        text.parse().ok().or_else(|| known.get(text.as_str()).copied())
    };
    let mut value = 1.0;
    for factor in expression.split('*') {
        let mut parts = factor.split('/').map(operand);
        value *= parts.next()??;
        for divisor in parts {
            value /= divisor?;
        }
    }
    Some(value)
}

/// The numbers that Rust or WGSL declares as constants, by name.
fn constants(text: &str) -> BTreeMap<String, f64> {
    let mut known = BTreeMap::new();
    for line in text.lines() {
        let Some((_, declaration)) = line.split_once("const ") else { continue };
        let Some((name, expression)) = declaration.trim_end_matches(';').split_once(" = ") else { continue };
        // Rust states types, WGSL has the suffix `u`.
        let (name, _) = name.split_once(": ").unwrap_or((name, ""));
        if let Some(value) = evaluated(expression.trim_end_matches('u'), &known) {
            known.insert(name.to_owned(), value);
        }
    }
    known
}

#[test]
fn constants_are_found() {
    let text = "const SIDE: u32 = 4;\npub(super) const VOXELS: u32 = SIDE * SIDE * 1_0;\nconst F: f64 = 1.0 / 64.0;\nconst G: X = f(2);\nconst N = 8u;";
    let expected = [("SIDE", 4.0), ("VOXELS", 160.0), ("F", 1.0 / 64.0), ("N", 8.0)];
    assert_eq!(constants(text), expected.map(|(name, value)| (name.to_owned(), value)).into());
}

/// A constant's name means one number in Rust and WGSL, in every file of both.
#[test]
fn constants_with_one_name_have_one_value() {
    let mut found: BTreeMap<String, BTreeMap<String, f64>> = BTreeMap::new();
    for file in files(&root().join("src"), "rs").into_iter().filter(|file| !file.starts_with(root().join("src/bin"))) {
        for (name, value) in constants(&std::fs::read_to_string(&file).unwrap()) {
            found.entry(name).or_default().insert(file.display().to_string(), value);
        }
    }
    let mut compared = 0;
    let mut failures = Vec::new();
    for file in files(&root().join("shaders"), "wgsl") {
        let text = std::fs::read_to_string(&file).unwrap();
        for (name, value) in constants(&text) {
            for (other_file, &other) in found.get(&name).into_iter().flatten() {
                compared += 1;
                // WGSL has the digits that an f32 holds.
                if (other - value).abs() > 1e-7 * value.abs() {
                    failures.push(format!("{name}: {value} in {}, {other} in {other_file}", file.display()));
                }
            }
        }
    }
    failures.sort();
    failures.dedup();
    assert_none(&failures);
    assert!(compared > 12, "{compared}");
}
