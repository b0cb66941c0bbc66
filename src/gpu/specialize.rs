//! Branches on specialization constants are decided before a driver sees a module.
//!
//! A driver specializes a module too, but some inline every function first: what a run leaves out, strict arithmetic in
//! every quotient above all, then costs them more time to compile than what it needs. Only the way through the code
//! changes; blocks that no way leads to stay, and are passed over.

use std::collections::{HashMap, HashSet};

use sha2::{Digest, Sha256};

mod op {
    pub const CONSTANT_TRUE: u32 = 41;
    pub const CONSTANT_FALSE: u32 = 42;
    pub const CONSTANT: u32 = 43;
    pub const SPEC_CONSTANT_TRUE: u32 = 48;
    pub const SPEC_CONSTANT_FALSE: u32 = 49;
    pub const SPEC_CONSTANT: u32 = 50;
    pub const SPEC_CONSTANT_COMPOSITE: u32 = 51;
    pub const SPEC_CONSTANT_OP: u32 = 52;
    pub const FUNCTION: u32 = 54;
    pub const FUNCTION_END: u32 = 56;
    pub const FUNCTION_CALL: u32 = 57;
    pub const DECORATE: u32 = 71;
    pub const PHI: u32 = 245;
    pub const SELECTION_MERGE: u32 = 247;
    pub const LABEL: u32 = 248;
    pub const BRANCH: u32 = 249;
    pub const BRANCH_CONDITIONAL: u32 = 250;
    pub const SWITCH: u32 = 251;
    pub const ENTRY_POINT: u32 = 15;
    pub const EXECUTION_MODE: u32 = 16;
    pub const EXECUTION_MODE_ID: u32 = 331;
}

pub(super) const HEADER_WORDS: usize = 5;
/// Of the decoration that gives a constant the number by which it is specialized.
const SPEC_ID: u32 = 1;

/// The module with its branches on these constants (number and value; others keep their defaults) decided.
///
/// Numbers and names are those of the SPIR-V specification, version 1.6, section 3.
pub(super) fn decided(words: &[u32], constants: &[(u32, u32)]) -> Vec<u32> {
    let values = values(words, constants);
    // Ways that are no longer taken: from block to block.
    let mut closed: HashSet<(u32, u32)> = HashSet::new();
    let mut result = words[..HEADER_WORDS].to_vec();
    let mut block = 0;
    let mut rest = instructions(words).peekable();
    while let Some(instruction) = rest.next() {
        if opcode(instruction) == op::LABEL {
            block = instruction[1];
        }
        let branch = rest.peek().filter(|next| opcode(instruction) == op::SELECTION_MERGE && opcode(next) == op::BRANCH_CONDITIONAL);
        let known = branch.and_then(|branch| Some((*branch, *values.get(&branch[1])?)));
        let Some((branch, condition)) = known else {
            result.extend_from_slice(instruction);
            continue;
        };
        let (taken, other) = if condition == 0 { (branch[3], branch[2]) } else { (branch[2], branch[3]) };
        if taken != other {
            closed.insert((block, other));
        }
        result.extend([first_word(op::BRANCH, 2), taken]);
        rest.next();
    }
    without_ways(&result, &closed)
}

/// Values of constants, by the id of their result: of integers and truth values of 32 bits, as far as they are known.
fn values(words: &[u32], constants: &[(u32, u32)]) -> HashMap<u32, u32> {
    let given: HashMap<u32, u32> = constants.iter().copied().collect();
    let mut numbers = HashMap::new();
    let mut values = HashMap::new();
    for instruction in instructions(words) {
        let specialized = |default| {
            let number: Option<&u32> = numbers.get(&instruction[2]);
            number.and_then(|number| given.get(number)).copied().unwrap_or(default)
        };
        match (opcode(instruction), instruction) {
            (op::DECORATE, [_, target, SPEC_ID, number]) => drop(numbers.insert(*target, *number)),
            (op::CONSTANT_TRUE, [_, _, result]) => drop(values.insert(*result, 1)),
            (op::CONSTANT_FALSE, [_, _, result]) => drop(values.insert(*result, 0)),
            (op::CONSTANT, [_, _, result, value]) => drop(values.insert(*result, *value)),
            (op::SPEC_CONSTANT_TRUE, [_, _, result]) => drop(values.insert(*result, u32::from(specialized(1) != 0))),
            (op::SPEC_CONSTANT_FALSE, [_, _, result]) => drop(values.insert(*result, u32::from(specialized(0) != 0))),
            (op::SPEC_CONSTANT, [_, _, result, default]) => drop(values.insert(*result, specialized(*default))),
            (op::SPEC_CONSTANT_OP, [_, _, result, operation, operands @ ..]) => {
                let operands: Option<Vec<u32>> = operands.iter().map(|operand| values.get(operand).copied()).collect();
                if let Some(value) = operands.and_then(|operands| value_of(*operation, &operands)) {
                    values.insert(*result, value);
                }
            }
            _ => {}
        }
    }
    values
}

/// What an operation makes of known operands; `None` for one that is not known here.
fn value_of(operation: u32, operands: &[u32]) -> Option<u32> {
    let value = match (operation, operands) {
        // LogicalEqual and IEqual, LogicalNotEqual and INotEqual.
        (164 | 170, [a, b]) => u32::from(a == b),
        (165 | 171, [a, b]) => u32::from(a != b),
        // LogicalOr, LogicalAnd, LogicalNot.
        (166, [a, b]) => a | b,
        (167, [a, b]) => a & b,
        (168, [a]) => u32::from(*a == 0),
        // UGreaterThan, UGreaterThanEqual, ULessThan, ULessThanEqual.
        (172, [a, b]) => u32::from(a > b),
        (174, [a, b]) => u32::from(a >= b),
        (176, [a, b]) => u32::from(a < b),
        (178, [a, b]) => u32::from(a <= b),
        // BitwiseAnd.
        (199, [a, b]) => a & b,
        _ => return None,
    };
    Some(value)
}

/// Values that a block takes by the way to it: not by ways that are closed.
fn without_ways(words: &[u32], closed: &HashSet<(u32, u32)>) -> Vec<u32> {
    let mut result = words[..HEADER_WORDS].to_vec();
    let mut block = 0;
    for instruction in instructions(words) {
        match (opcode(instruction), instruction) {
            (op::PHI, [_, kind, id, choices @ ..]) => {
                let open: Vec<u32> =
                    choices.chunks_exact(2).filter(|choice| !closed.contains(&(choice[1], block))).flatten().copied().collect();
                result.extend([first_word(op::PHI, 3 + open.len()), *kind, *id]);
                result.extend(open);
                continue;
            }
            (op::LABEL, [_, label]) => block = *label,
            _ => {}
        }
        result.extend_from_slice(instruction);
    }
    result
}

/// Digest of what a driver compiles of a decided module: the blocks that some way leads to, what they name, and the values of
/// the constants (number and value) among that. Modules with the same digest are the same program.
pub(super) fn content(words: &[u32], constants: &[(u32, u32)]) -> [u8; 32] {
    let (globals, functions) = parts(words);
    let mut hash = Sha256::new();
    let mut add = |words: &[u32]| hash.update(bytemuck::cast_slice::<u32, u8>(words));
    // Every word counts as a name, so that a literal may keep a constant that nothing names, and nothing that is named is missed.
    let mut named: HashSet<u32> = HashSet::new();
    let entry = globals.iter().find(|instruction| opcode(instruction) == op::ENTRY_POINT).map(|instruction| instruction[2]);
    let mut called: Vec<u32> = entry.into_iter().collect();
    let mut next = 0;
    while let Some(function) = called.get(next).and_then(|id| functions.get(id)) {
        next += 1;
        for instruction in reached(function) {
            add(instruction);
            named.extend(&instruction[1..]);
            if opcode(instruction) == op::FUNCTION_CALL && !called.contains(&instruction[3]) {
                called.push(instruction[3]);
            }
        }
    }
    // These stand before the constants that they name: the work-group size.
    globals.iter().filter(|instruction| is_execution_mode(instruction)).for_each(|instruction| named.extend(&instruction[1..]));
    let given: HashMap<u32, u32> = constants.iter().copied().collect();
    let numbers: HashMap<u32, u32> = globals
        .iter()
        .filter_map(|instruction| match (opcode(instruction), *instruction) {
            (op::DECORATE, [_, target, SPEC_ID, number]) => Some((*target, *number)),
            _ => None,
        })
        .collect();
    // What is named stands before what names it.
    for instruction in globals.iter().rev() {
        let is_constant = (op::CONSTANT_TRUE..=op::SPEC_CONSTANT_OP).contains(&opcode(instruction));
        let result = if is_constant { instruction[2] } else { 0 };
        // All that is no constant, types and decorations above all, counts.
        if !is_constant || named.contains(&result) || opcode(instruction) == op::SPEC_CONSTANT_COMPOSITE {
            let is_about_constants = opcode(instruction) == op::DECORATE && instruction[2] == SPEC_ID;
            if !is_about_constants && !is_text(instruction) {
                add(instruction);
                named.extend(&instruction[1..]);
            }
            if let Some(value) = numbers.get(&result).and_then(|number| given.get(number)) {
                add(&[*value]);
            }
        }
    }
    hash.finalize().into()
}

type Instructions<'a> = Vec<&'a [u32]>;

/// What stands before the first function, and the functions by their ids.
fn parts(words: &[u32]) -> (Instructions<'_>, HashMap<u32, Instructions<'_>>) {
    let mut globals = Vec::new();
    let mut functions: HashMap<u32, Instructions> = HashMap::new();
    let mut current = None;
    for instruction in instructions(words) {
        if opcode(instruction) == op::FUNCTION {
            current = Some(instruction[2]);
        }
        match current {
            None => globals.push(instruction),
            Some(id) => functions.entry(id).or_default().push(instruction),
        }
    }
    (globals, functions)
}

/// Instructions of a function, in their order, without the blocks that no way leads to.
fn reached<'a>(function: &[&'a [u32]]) -> Instructions<'a> {
    let mut block = 0;
    let mut ways: HashMap<u32, Vec<u32>> = HashMap::new();
    for instruction in function {
        match (opcode(instruction), *instruction) {
            (op::LABEL, [_, label]) => {
                // The first block is where a call leads.
                let first = ways.is_empty().then_some(*label);
                block = *label;
                ways.entry(0).or_default().extend(first);
                ways.entry(block).or_default();
            }
            (op::BRANCH, [_, to]) => ways.entry(block).or_default().push(*to),
            (op::BRANCH_CONDITIONAL, [_, _, to, other, ..]) => ways.entry(block).or_default().extend([*to, *other]),
            // Literals among the targets are no labels, or keep a block that nothing leads to.
            (op::SWITCH, [_, _, targets @ ..]) => ways.entry(block).or_default().extend(targets),
            _ => {}
        }
    }
    let mut reached: HashSet<u32> = HashSet::from([0]);
    let mut rest = vec![0];
    while let Some(block) = rest.pop() {
        rest.extend(ways.get(&block).into_iter().flatten().filter(|to| reached.insert(**to)));
    }
    let mut is_reached = true;
    let mut kept = Vec::new();
    for instruction in function {
        match (opcode(instruction), *instruction) {
            (op::LABEL, [_, label]) => is_reached = reached.contains(label),
            (op::FUNCTION_END, _) => is_reached = true,
            _ => {}
        }
        if is_reached {
            kept.push(*instruction);
        }
    }
    kept
}

fn is_execution_mode(instruction: &[u32]) -> bool {
    matches!(opcode(instruction), op::EXECUTION_MODE | op::EXECUTION_MODE_ID)
}

/// Names and lines for debuggers, which change no program.
fn is_text(instruction: &[u32]) -> bool {
    (2..=8).contains(&opcode(instruction))
}

pub(super) fn instructions(words: &[u32]) -> impl Iterator<Item = &[u32]> {
    let mut rest = &words[HEADER_WORDS..];
    std::iter::from_fn(move || {
        let length = (rest.first()? >> 16) as usize;
        let (instruction, others) = rest.split_at(length);
        rest = others;
        Some(instruction)
    })
}

pub(super) fn opcode(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

fn first_word(opcode: u32, length: usize) -> u32 {
    opcode | (length as u32) << 16
}

#[cfg(test)]
mod tests {
    use shaderc::Compiler;

    use super::*;

    /// A function that returns 1 if `%condition` holds, which the text defines, and else 2.
    fn module(condition: &str) -> Vec<u32> {
        let text = format!(
            "OpCapability Shader
             OpMemoryModel Logical GLSL450
             OpDecorate %number SpecId 3
             OpDecorate %flag SpecId 7
             %bool = OpTypeBool
             %uint = OpTypeInt 32 0
             %function = OpTypeFunction %uint
             %one = OpConstant %uint 1
             %two = OpConstant %uint 2
             %number = OpSpecConstant %uint 2
             %flag = OpSpecConstantFalse %bool
             {condition}
             %main = OpFunction %uint None %function
             %start = OpLabel
             OpSelectionMerge %end None
             OpBranchConditional %condition %then %end
             %then = OpLabel
             OpBranch %end
             %end = OpLabel
             %chosen = OpPhi %uint %one %then %two %start
             OpReturnValue %chosen
             OpFunctionEnd"
        );
        Compiler::new().unwrap().assemble(&text, None).unwrap().as_binary().to_vec()
    }

    /// The blocks that branches lead to without a condition, in the order of the text, and the choices of the last block.
    fn ways(words: &[u32]) -> (Vec<u32>, usize) {
        let branches = instructions(words).filter(|instruction| opcode(instruction) == op::BRANCH).map(|branch| branch[1]);
        let phi = instructions(words).find(|instruction| opcode(instruction) == op::PHI).unwrap();
        (branches.collect(), (phi.len() - 3) / 2)
    }

    fn labels(words: &[u32]) -> Vec<u32> {
        instructions(words).filter(|instruction| opcode(instruction) == op::LABEL).map(|label| label[1]).collect()
    }

    const EQUAL: &str = "%condition = OpSpecConstantOp %bool IEqual %number %two";
    const OPEN: &str = "%undefined = OpUndef %bool\n%condition = OpSpecConstantOp %bool LogicalEqual %undefined %flag";

    #[test]
    fn branches_go_where_their_constants_say() {
        let both = "%other = OpSpecConstantOp %bool LogicalNot %flag
                    %large = OpSpecConstantOp %bool UGreaterThan %number %two
                    %condition = OpSpecConstantOp %bool LogicalAnd %large %other";
        for (condition, constants, expected) in [
            (EQUAL, &[][..], true),
            (EQUAL, &[(3, 2)][..], true),
            (EQUAL, &[(3, 1)][..], false),
            (EQUAL, &[(7, 1)][..], true),
            (both, &[][..], false),
            (both, &[(3, 3)][..], true),
            (both, &[(3, 3), (7, 1)][..], false),
            // Any number but 0 is true.
            (both, &[(3, 3), (7, 2)][..], false),
        ] {
            let words = module(condition);
            let found = decided(&words, constants);
            let [_, then, end] = labels(&found)[..] else { panic!("blocks are lost") };
            // Past %then, whose way to %end stays, or through it, so that the way past it is no choice of %end.
            assert_eq!(
                ways(&found),
                (if expected { vec![then, end] } else { vec![end, end] }, if expected { 1 } else { 2 }),
                "{condition}"
            );
            assert!(instructions(&found).all(|instruction| !matches!(opcode(instruction), op::SELECTION_MERGE | op::BRANCH_CONDITIONAL)));
        }
    }

    /// Whatever no block that is reached names changes no content; all else does.
    #[test]
    fn the_content_is_what_is_left() {
        let digest = |words: &[u32], constants: &[(u32, u32)]| content(&decided(words, constants), constants);
        let whole = |condition: &str| {
            let mut words = module(condition);
            // An entry point, where it has to stand: behind the memory model.
            let place = HEADER_WORDS + instructions(&words).take(2).map(<[u32]>::len).sum::<usize>();
            let function = instructions(&words).find(|instruction| opcode(instruction) == op::FUNCTION).unwrap()[2];
            words.splice(place..place, [first_word(op::ENTRY_POINT, 4), 5, function, 0]);
            words
        };
        let words = whole(EQUAL);
        let same = digest(&words, &[(3, 1), (7, 0)]);
        assert_eq!(digest(&words, &[(3, 1), (7, 1)]), same, "nothing names %flag");
        assert_eq!(digest(&words, &[(3, 4), (7, 1)]), same, "no block that is left names %number");
        assert_ne!(digest(&words, &[(3, 2)]), same, "the other way");
        let words = whole(OPEN);
        assert_ne!(digest(&words, &[(7, 0)]), digest(&words, &[(7, 1)]), "the condition names %flag");
        assert_eq!(digest(&words, &[(3, 0)]), digest(&words, &[(3, 1)]), "and not %number");
    }

    #[test]
    fn what_is_not_known_stays_open() {
        let unusual = "%condition = OpSpecConstantOp %bool Select %flag %flag %flag";
        for condition in [OPEN, unusual] {
            let words = module(condition);
            assert_eq!(decided(&words, &[(3, 1), (7, 1)]), words);
        }
    }
}
