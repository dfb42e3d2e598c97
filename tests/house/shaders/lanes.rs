//! Values that the lanes of a subgroup share.

use std::collections::BTreeSet;

use naga::valid::FunctionInfo;
use naga::{Block, Expression, Function, Handle, Statement};

use sheetsplat::internals::gpu::shaders;

use super::{assert_none, validated};

/// Whether a block shares values among the lanes of a subgroup, itself or by calling one of some functions.
fn shares(block: &Block, sharing: &BTreeSet<Handle<Function>>) -> bool {
    block.iter().any(|statement| match statement {
        Statement::SubgroupBallot { .. }
        | Statement::SubgroupGather { .. }
        | Statement::SubgroupCollectiveOperation { .. } => true,
        Statement::ControlBarrier(_) => true,
        Statement::Call { function, .. } => sharing.contains(function),
        Statement::Block(inner) => shares(inner, sharing),
        Statement::If { accept, reject, .. } => shares(accept, sharing) || shares(reject, sharing),
        Statement::Switch { cases, .. } => cases.iter().any(|case| shares(&case.body, sharing)),
        Statement::Loop { body, continuing, .. } => shares(body, sharing) || shares(continuing, sharing),
        _ => false,
    })
}

/// Whether some lanes of a subgroup may skip a place where a block shares values.
fn is_skipped(block: &Block, info: &FunctionInfo, sharing: &BTreeSet<Handle<Function>>) -> bool {
    let differs = |condition: Handle<Expression>| info[condition].uniformity.non_uniform_result.is_some();
    block.iter().any(|statement| match statement {
        Statement::Block(inner) => is_skipped(inner, info, sharing),
        Statement::If { condition, accept, reject } => [accept, reject]
            .iter()
            .any(|side| differs(*condition) && shares(side, sharing) || is_skipped(side, info, sharing)),
        Statement::Switch { selector, cases } => cases
            .iter()
            .any(|case| differs(*selector) && shares(&case.body, sharing) || is_skipped(&case.body, info, sharing)),
        Statement::Loop { body, continuing, .. } => {
            is_skipped(body, info, sharing) || is_skipped(continuing, info, sharing)
        }
        _ => false,
    })
}

/// GPUs give nothing defined from lanes that do not take part, where a software driver computes all of them under a mask: no `if`, and no `&&` or `||`
/// (which is one), that lanes may decide differently has a part that shares values. Loops are not looked at: lanes go through those that share values
/// together, which naga cannot see. Nor can it see that what the lanes of a workgroup read from its memory is the same for all; but for these functions the
/// stages are the same.
#[test]
fn all_lanes_share_values() {
    let mut skipped = Vec::new();
    for shader in shaders::GATHER[..2].iter().chain(&shaders::GATHER_PLANES[..2]) {
        let (module, info) = validated(shader).unwrap();
        // Functions are declared before they are called.
        let mut sharing = BTreeSet::new();
        for (handle, function) in module.functions.iter() {
            if shares(&function.body, &sharing) {
                sharing.insert(handle);
            }
            if is_skipped(&function.body, &info[handle], &sharing) {
                skipped.push(format!("{}: {}", shader.stage, function.name.as_deref().unwrap_or("without a name")));
            }
        }
        assert!(sharing.len() > 10, "{}", shader.stage);
    }
    assert_none(&skipped);
}
