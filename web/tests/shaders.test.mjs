// Every shader in the browser's compiler, which is stricter than others, with the constants that the library's passes give it.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { open } from "./browser.mjs";
import { api } from "./helpers.mjs";

let opened;
before(async () => (opened = await open()));
after(() => opened.close());

/** The values that passes give a constant. Those that are not named here always have the values of their declarations. */
const VALUES = { COMPOSITING: [0, 1, 2, 3, 4, 5, 6], SHEETS: [1, 2, 4], CHANNELS: [1, 2, 64], FULL_COLOR: [0, 255, 65535] };
/** The number of colour targets by what a fragment shader returns. */
const TARGETS = { One: 1, Two: 2, Four: 4 };
/** The formats of the targets of stages that do not draw sheets. */
const FORMATS = { first_hit: ["r32float"], resolve: ["rgba8unorm", "rgba32float"] };

/** The constants of a shader with their values. */
function overrides(source) {
    const declared = [...source.matchAll(/^override (\w+):\s*(\w+)/gm)].map(([, name, type]) => [name, type === "bool" ? [0, 1] : VALUES[name] ?? []]);
    return declared.filter(([, values]) => values.length > 0);
}

/** Sets of constants in which each value of each constant meets each value of every other constant. */
function pairwise(constants) {
    const all = constants.reduce((sets, [name, values]) => sets.flatMap((set) => values.map((value) => ({ ...set, [name]: value }))), [{}]);
    const pairs = (set) => {
        const entries = Object.entries(set).map(([name, value]) => `${name}=${value}`);
        return entries.flatMap((one, at) => [one, ...entries.slice(at + 1).map((other) => `${one} ${other}`)]);
    };
    const left = new Set(all.flatMap(pairs));
    const chosen = [];
    while (left.size > 0) {
        const gain = (set) => pairs(set).filter((pair) => left.has(pair)).length;
        const best = all.reduce((best, set) => (gain(set) > gain(best) ? set : best));
        pairs(best).forEach((pair) => left.delete(pair));
        chosen.push(best);
    }
    return chosen.length > 0 ? chosen : [{}];
}

test("pairs of constants are complete", () => {
    const sets = pairwise([["a", [0, 1]], ["b", [0, 1, 2]], ["c", [0, 1]], ["d", [0, 1]]]);
    for (const [one, other, count] of [["a", "b", 6], ["b", "d", 6], ["c", "d", 4]]) {
        assert.equal(new Set(sets.map((set) => `${set[one]} ${set[other]}`)).size, count);
    }
    assert.ok(sets.length < 12, `${sets.length} of 24`);
    assert.deepEqual(pairwise([]), [{}]);
});

/** The pipelines of a shader: entry points, constants, and the number of targets. */
function pipelines(stage, source) {
    const constants = overrides(source);
    const compute = [...source.matchAll(/@compute[^{]*?fn (\w+)/g)].flatMap(([, entry]) => pairwise(constants).map((set) => ({ stage, compute: entry, set })));
    const fragments = [...source.matchAll(/@fragment\s+fn (\w+)\(.*\)\s*->\s*(?:@location\(0\)\s*)?(\w+)/g)];
    const render = fragments.flatMap(([, fragment, returned]) => {
        const targets = TARGETS[returned] ?? 1;
        // A group has as many sheets as the stage has targets.
        const own = constants.map(([name, values]) => (name === "SHEETS" ? [name, [targets]] : [name, values]));
        const formats = FORMATS[stage] ?? ["rgba16float", "rgba32float"];
        const isAdded = ["splat", "splat_perspective", "sample", "field"].includes(stage);
        return pairwise(own).flatMap((set) => formats.map((format) => ({ stage, fragment, set, targets, format, isAdded })));
    });
    return [...compute, ...render];
}

test("the browser compiles every shader with the constants of every pass", async () => {
    const { page: shown } = await api(opened);
    const shaders = await shown.evaluate(async () => {
        const view = await window.make([8, 8], { backend: "gpu" });
        return [...await view.internals.shaders()];
    });
    const wanted = shaders.flatMap(([stage, source]) => pipelines(stage, source));
    const complaints = await shown.evaluate(async ({ shaders, wanted }) => {
        const adapter = await navigator.gpu.requestAdapter();
        const requiredFeatures = ["float32-blendable"].filter((feature) => adapter.features.has(feature));
        if (requiredFeatures.length === 0) throw new Error("sheets of rgba32float cannot be tested here");
        const limits = ["maxColorAttachmentBytesPerSample", "maxComputeWorkgroupStorageSize"];
        const requiredLimits = Object.fromEntries(limits.map((limit) => [limit, adapter.limits[limit]]));
        const device = await adapter.requestDevice({ requiredFeatures, requiredLimits });
        const complaints = [];
        const modules = new Map(shaders.map(([stage, code]) => [stage, device.createShaderModule({ code })]));
        for (const [stage, module] of modules) {
            const errors = (await module.getCompilationInfo()).messages.filter(({ type }) => type === "error");
            complaints.push(...errors.map(({ message, lineNum }) => `${stage}:${lineNum}: ${message}`));
        }
        const add = { srcFactor: "one", dstFactor: "one", operation: "add" };
        const compile = ({ stage, compute, fragment, set: constants, targets, format, isAdded }) => {
            const module = modules.get(stage);
            if (compute) return device.createComputePipelineAsync({ layout: "auto", compute: { module, entryPoint: compute, constants } });
            const target = { format, ...(isAdded ? { blend: { color: add, alpha: add } } : {}) };
            return device.createRenderPipelineAsync({
                layout: "auto",
                vertex: { module, entryPoint: "vertex", constants },
                fragment: { module, entryPoint: fragment, constants, targets: Array(targets).fill(target) },
            });
        };
        const results = await Promise.allSettled(wanted.map(compile));
        results.forEach(({ reason }, at) => {
            if (reason) complaints.push(`${JSON.stringify(wanted[at])}: ${reason.message}`);
        });
        return complaints;
    }, { shaders, wanted });
    const counts = wanted.reduce((counts, { stage }) => ({ ...counts, [stage]: (counts[stage] ?? 0) + 1 }), {});
    console.log(`${wanted.length} pipelines compiled: ${Object.entries(counts).map(([stage, count]) => `${stage} ${count}`).join(", ")}`);
    assert.deepEqual(complaints, []);
    assert.deepEqual(Object.keys(counts).sort(), shaders.map(([stage]) => stage).sort(), "every shader has a pipeline");
    // The seven compositings meet a flag, and `splat` draws one, two and four sheets in two forms and formats.
    assert.ok(counts.classify >= 14 && counts.splat === 12 && counts.composite >= 14, JSON.stringify(counts));
});
