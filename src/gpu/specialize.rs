//! What follows from specialization constants is decided before a driver sees a module: branches, and the `&&` and `||` that lead to them.
//!
//! A driver specializes a module too, but some inline every function first: what a run leaves out, strict arithmetic in
//! every quotient above all, then costs them more time to compile than what it needs. So `if (HAS_X && condition)` leaves no more
//! than `condition` in a branch, or nothing.

use std::collections::{HashMap, HashSet};

use sha2::{Digest, Sha256};

mod op {
    pub(super) const CONSTANT_TRUE: u32 = 41;
    pub(super) const CONSTANT_FALSE: u32 = 42;
    pub(super) const CONSTANT: u32 = 43;
    pub(super) const SPEC_CONSTANT_TRUE: u32 = 48;
    pub(super) const SPEC_CONSTANT_FALSE: u32 = 49;
    pub(super) const SPEC_CONSTANT: u32 = 50;
    pub(super) const SPEC_CONSTANT_COMPOSITE: u32 = 51;
    pub(super) const SPEC_CONSTANT_OP: u32 = 52;
    pub(super) const FUNCTION: u32 = 54;
    pub(super) const FUNCTION_END: u32 = 56;
    pub(super) const FUNCTION_CALL: u32 = 57;
    pub(super) const VARIABLE: u32 = 59;
    pub(super) const LOAD: u32 = 61;
    pub(super) const STORE: u32 = 62;
    pub(super) const ACCESS_CHAIN: u32 = 65;
    pub(super) const DECORATE: u32 = 71;
    pub(super) const COPY_OBJECT: u32 = 83;
    /// The first and the last of those that compute a value: conversions, arithmetic, comparisons.
    pub(super) const CONVERT_F_TO_U: u32 = 109;
    pub(super) const BIT_COUNT: u32 = 205;
    pub(super) const LOGICAL_OR: u32 = 166;
    pub(super) const LOGICAL_AND: u32 = 167;
    pub(super) const PHI: u32 = 245;
    pub(super) const LOOP_MERGE: u32 = 246;
    pub(super) const SELECTION_MERGE: u32 = 247;
    pub(super) const LABEL: u32 = 248;
    pub(super) const BRANCH: u32 = 249;
    pub(super) const BRANCH_CONDITIONAL: u32 = 250;
    pub(super) const SWITCH: u32 = 251;
    pub(super) const NAME: u32 = 5;
    pub(super) const ENTRY_POINT: u32 = 15;
    pub(super) const EXECUTION_MODE: u32 = 16;
    pub(super) const EXECUTION_MODE_ID: u32 = 331;
}

pub(super) const HEADER_WORDS: usize = 5;
/// Of the decoration that gives a constant the number by which it is specialized.
const SPEC_ID: u32 = 1;

/// The module with all decided that these constants (number and value; others keep their defaults) decide.
///
/// Numbers and names are those of the SPIR-V specification, version 1.6, section 3.
pub(super) fn decided(words: &[u32], constants: &[(u32, u32)]) -> Vec<u32> {
    let mut values = values(words, constants);
    let mut copies = HashMap::new();
    let mut result = words.to_vec();
    // What one step decides may decide more: a branch the phi behind it, and that phi the next branch.
    loop {
        let next = without_unreached(&folded(&result, &mut values, &mut copies));
        if next == result {
            break;
        }
        result = next;
    }
    without_unused(&joined(&result), words)
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
                if let Some(value) = value_of_known(*operation, operands, &values) {
                    values.insert(*result, value);
                }
            }
            _ => {}
        }
    }
    values
}

/// The value of an operation whose operands are known.
fn value_of_known(operation: u32, operands: &[u32], values: &HashMap<u32, u32>) -> Option<u32> {
    let operands: Option<Vec<u32>> = operands.iter().map(|operand| values.get(operand).copied()).collect();
    value_of(operation, &operands?)
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

/// One step: branches on known conditions go one way, and phis and `&&` and `||` that come to one operand are copies of it.
/// Adds what that makes known to `values`, and whose copy a result is to `copies`.
fn folded(words: &[u32], values: &mut HashMap<u32, u32>, copies: &mut HashMap<u32, u32>) -> Vec<u32> {
    let ways = ways(words);
    let mut result = words[..HEADER_WORDS].to_vec();
    let mut block = 0;
    let mut rest = instructions(words).peekable();
    while let Some(instruction) = rest.next() {
        let source_of = |id: &u32| copies.get(id).copied().unwrap_or(*id);
        let copied = match (opcode(instruction), instruction) {
            (op::LABEL, [_, label]) => {
                block = *label;
                None
            }
            (op::SELECTION_MERGE, _) => {
                let branch = rest.peek().filter(|next| opcode(next) == op::BRANCH_CONDITIONAL);
                if let Some((branch, value)) = branch.and_then(|branch| Some((*branch, *values.get(&branch[1])?))) {
                    result.extend([first_word(op::BRANCH, 2), branch[if value == 0 { 3 } else { 2 }]]);
                    rest.next();
                    continue;
                }
                None
            }
            (op::BRANCH_CONDITIONAL, [first, condition, targets @ ..]) => {
                result.extend([*first, source_of(condition)]);
                result.extend(targets);
                continue;
            }
            (op::STORE, [first, pointer, value, access @ ..]) => {
                result.extend([*first, *pointer, source_of(value)]);
                result.extend(access);
                continue;
            }
            (op::PHI, [_, kind, id, choices @ ..]) => {
                let is_open = |choice: &&[u32]| ways.get(&choice[1]).is_some_and(|targets| targets.contains(&block));
                let open: Vec<u32> =
                    choices.chunks_exact(2).filter(is_open).flat_map(|choice| [source_of(&choice[0]), choice[1]]).collect();
                if open.len() != 2 {
                    result.extend([first_word(op::PHI, 3 + open.len()), *kind, *id]);
                    result.extend(open);
                    continue;
                }
                Some((*kind, *id, open[0]))
            }
            (operation @ (op::LOGICAL_OR | op::LOGICAL_AND), [_, kind, id, a, b]) => {
                let value = |operand: &u32| values.get(operand).map(|value| *value != 0);
                // True decides `||` and leaves `&&` to the other operand.
                let operand = match (value(a), value(b)) {
                    (Some(known), _) => Some(if known == (operation == op::LOGICAL_OR) { a } else { b }),
                    (_, Some(known)) => Some(if known == (operation == op::LOGICAL_OR) { b } else { a }),
                    _ => None,
                };
                operand.map(|operand| (*kind, *id, source_of(operand)))
            }
            (operation, [_, _, id, operands @ ..]) => {
                if let Some(value) = value_of_known(operation, operands, values) {
                    values.insert(*id, value);
                }
                None
            }
            _ => None,
        };
        match copied {
            Some((kind, id, source)) => {
                result.extend([first_word(op::COPY_OBJECT, 4), kind, id, source]);
                copies.insert(id, source);
                if let Some(value) = values.get(&source) {
                    values.insert(id, *value);
                }
            }
            None => result.extend_from_slice(instruction),
        }
    }
    result
}

/// The blocks that each block names: those that it branches to, and those where its branches meet again, which have to exist. Block 0
/// stands before the first block of each function.
fn ways(words: &[u32]) -> HashMap<u32, Vec<u32>> {
    let mut ways: HashMap<u32, Vec<u32>> = HashMap::new();
    let mut block = 0;
    for instruction in instructions(words) {
        let targets = match (opcode(instruction), instruction) {
            (op::FUNCTION_END, _) => {
                block = 0;
                continue;
            }
            (op::LABEL, [_, label]) => {
                if block == 0 {
                    ways.entry(0).or_default().push(*label);
                }
                block = *label;
                continue;
            }
            (op::SELECTION_MERGE | op::BRANCH, [_, target, ..]) => std::slice::from_ref(target),
            (op::LOOP_MERGE, [_, targets @ .., _]) | (op::BRANCH_CONDITIONAL, [_, _, targets @ ..]) => &targets[..2],
            // Literals among the targets are no labels, or keep a block that nothing leads to.
            (op::SWITCH, [_, _, targets @ ..]) => targets,
            _ => continue,
        };
        ways.entry(block).or_default().extend(targets);
    }
    ways
}

/// Without the blocks that no way leads to.
fn without_unreached(words: &[u32]) -> Vec<u32> {
    let ways = ways(words);
    let mut reached: HashSet<u32> = HashSet::new();
    let mut rest = vec![0];
    while let Some(block) = rest.pop() {
        rest.extend(ways.get(&block).into_iter().flatten().filter(|to| reached.insert(**to)));
    }
    let mut result = words[..HEADER_WORDS].to_vec();
    let mut is_reached = true;
    for instruction in instructions(words) {
        match opcode(instruction) {
            op::LABEL => is_reached = reached.contains(&instruction[1]),
            op::FUNCTION_END => is_reached = true,
            _ => {}
        }
        if is_reached {
            result.extend_from_slice(instruction);
        }
    }
    result
}

/// A block that ends in a branch to the next one, which nothing else names, and that next one are one.
fn joined(words: &[u32]) -> Vec<u32> {
    let mut named: HashMap<u32, u32> = HashMap::new();
    ways(words).values().flatten().for_each(|target| *named.entry(*target).or_default() += 1);
    let code: Vec<&[u32]> = instructions(words).collect();
    // Blocks that are the end of another, and that other.
    let mut ends: HashMap<u32, u32> = HashMap::new();
    let mut block = 0;
    for three in code.windows(3).filter(|three| opcode(three[2]) == op::LABEL) {
        let label = three[2][1];
        let follows = opcode(three[1]) == op::BRANCH && three[1][1] == label && opcode(three[0]) != op::LOOP_MERGE;
        if follows && named[&label] == 1 {
            ends.insert(label, block);
        } else {
            block = label;
        }
    }
    let mut result = words[..HEADER_WORDS].to_vec();
    for instruction in code {
        match (opcode(instruction), instruction) {
            (op::LABEL | op::BRANCH, [_, label]) if ends.contains_key(label) => {}
            (op::PHI, [first, kind, id, choices @ ..]) => {
                result.extend([*first, *kind, *id]);
                result.extend(choices.chunks_exact(2).flat_map(|choice| [choice[0], *ends.get(&choice[1]).unwrap_or(&choice[1])]));
            }
            _ => result.extend_from_slice(instruction),
        }
    }
    result
}

/// Without values that nothing uses, and without names and decorations of what is no longer there and was in `before`.
fn without_unused(words: &[u32], before: &[u32]) -> Vec<u32> {
    let code: Vec<&[u32]> = instructions(words).collect();
    let mut used: HashSet<u32> =
        code.iter().filter(|instruction| opcode(instruction) == op::PHI).flat_map(|phi| &phi[3..]).copied().collect();
    // But for phis, which may name what a loop computes later, what is used stands before its use.
    let mut kept: Vec<&[u32]> = Vec::with_capacity(code.len());
    for instruction in code.into_iter().rev() {
        let only_computes =
            matches!(opcode(instruction), op::LOAD | op::ACCESS_CHAIN | op::COPY_OBJECT | op::CONVERT_F_TO_U..=op::BIT_COUNT);
        if !only_computes || used.contains(&instruction[2]) {
            used.extend(&instruction[1..]);
            kept.push(instruction);
        }
    }
    kept.reverse();
    let result = [&words[..HEADER_WORDS], &kept.concat()].concat();
    let gone = &defined(before) - &defined(&result);
    let is_about_gone = |instruction: &&[u32]| matches!(opcode(instruction), op::NAME | op::DECORATE) && gone.contains(&instruction[1]);
    kept.retain(|instruction| !is_about_gone(instruction));
    [&words[..HEADER_WORDS], &kept.concat()].concat()
}

/// Constants, variables, and what functions compute; of instructions without a result what they use, which is one of these too.
fn defined(words: &[u32]) -> HashSet<u32> {
    let (globals, functions) = parts(words);
    let values = globals.into_iter().filter(|instruction| (op::CONSTANT_TRUE..=op::VARIABLE).contains(&opcode(instruction)));
    values.chain(functions.into_values().flatten()).filter_map(|instruction| instruction.get(2)).copied().collect()
}

/// Digest of what a driver compiles of a decided module: the functions that are called, what they name, and the values of the
/// constants (number and value) among that. Modules with the same digest are the same program.
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
        for instruction in function {
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

    /// A function that returns 1 if `%condition` holds, which the text defines before all functions, and else 2.
    fn module(condition: &str) -> Vec<u32> {
        let body = "OpSelectionMerge %end None
             OpBranchConditional %condition %then %end
             %then = OpLabel
             OpBranch %end
             %end = OpLabel
             %chosen = OpPhi %uint %one %then %two %start
             OpReturnValue %chosen";
        assembled("", condition, body)
    }

    /// A function of `%argument` with this body after `%start`.
    fn assembled(decorations: &str, constants: &str, body: &str) -> Vec<u32> {
        let text = format!(
            "OpCapability Shader
             OpMemoryModel Logical GLSL450
             {decorations}
             OpDecorate %number SpecId 3
             OpDecorate %flag SpecId 7
             %bool = OpTypeBool
             %uint = OpTypeInt 32 0
             %function = OpTypeFunction %uint %uint
             %one = OpConstant %uint 1
             %two = OpConstant %uint 2
             %number = OpSpecConstant %uint 2
             %flag = OpSpecConstantFalse %bool
             {constants}
             %main = OpFunction %uint None %function
             %argument = OpFunctionParameter %uint
             %start = OpLabel
             {body}
             OpFunctionEnd"
        );
        Compiler::new().unwrap().assemble(&text, None).unwrap().as_binary().to_vec()
    }

    fn opcodes(words: &[u32]) -> Vec<u32> {
        instructions(words).map(opcode).collect()
    }

    const EQUAL: &str = "%condition = OpSpecConstantOp %bool IEqual %number %two";
    const OPEN: &str = "%undefined = OpUndef %bool\n%condition = OpSpecConstantOp %bool LogicalEqual %undefined %flag";

    #[test]
    fn branches_go_where_their_constants_say() {
        const RETURN_VALUE: u32 = 254;
        let both = "%other = OpSpecConstantOp %bool LogicalNot %flag
                    %large = OpSpecConstantOp %bool UGreaterThan %number %two
                    %condition = OpSpecConstantOp %bool LogicalAnd %large %other";
        for (condition, constants, expected) in [
            (EQUAL, &[][..], 1),
            (EQUAL, &[(3, 2)][..], 1),
            (EQUAL, &[(3, 1)][..], 2),
            (EQUAL, &[(7, 1)][..], 1),
            (both, &[][..], 2),
            (both, &[(3, 3)][..], 1),
            (both, &[(3, 3), (7, 1)][..], 2),
            // Any number but 0 is true.
            (both, &[(3, 3), (7, 2)][..], 2),
        ] {
            let found = decided(&module(condition), constants);
            let body = opcodes(&found).into_iter().skip_while(|opcode| *opcode != op::LABEL);
            assert_eq!(body.collect::<Vec<_>>(), [op::LABEL, op::COPY_OBJECT, RETURN_VALUE, op::FUNCTION_END], "{condition}");
            let returned = instructions(&found).find(|instruction| opcode(instruction) == op::COPY_OBJECT).unwrap()[3];
            assert_eq!(values(&found, &[])[&returned], expected, "{condition}");
        }
    }

    /// `if` with both conditions in one leaves what one `if` in another does, of all ways in which the compiler writes `&&` and `||`.
    #[test]
    fn one_condition_of_two_leaves_what_two_of_one_leave() {
        const EQUALS: u32 = 170;
        let asked = "%asked = OpIEqual %bool %argument %one";
        let decorations = "OpName %asked \"asked\"\nOpDecorate %asked RelaxedPrecision\nOpDecorate %kept RelaxedPrecision";
        let then = "%then = OpLabel
             %kept = OpIAdd %uint %argument %two
             OpReturnValue %kept";
        let short = |targets: &str| {
            format!(
                "OpSelectionMerge %met None
                 OpBranchConditional %flag {targets}
                 %ask = OpLabel
                 {asked}
                 OpBranch %met
                 %met = OpLabel
                 %both = OpPhi %bool %flag %start %asked %ask"
            )
        };
        let ending = |condition: &str| {
            format!(
                "{condition}
                 OpSelectionMerge %end None
                 OpBranchConditional %both %then %end
                 {then}
                 %end = OpLabel
                 OpReturnValue %two"
            )
        };
        let nested = |first: &str| {
            format!(
                "OpSelectionMerge %end None
                 OpBranchConditional %flag {first}
                 %ask = OpLabel
                 {asked}
                 OpSelectionMerge %inner None
                 OpBranchConditional %asked %then %inner
                 {then}
                 %inner = OpLabel
                 OpBranch %end
                 %end = OpLabel
                 OpReturnValue %two"
            )
        };
        let and = [ending(&short("%ask %met")), ending(&format!("{asked}\n%both = OpLogicalAnd %bool %flag %asked"))];
        let or = [ending(&short("%met %ask")), ending(&format!("{asked}\n%both = OpLogicalOr %bool %asked %flag"))];
        let left = |body: &str, flag| decided(&assembled(decorations, "", body), &[(7, flag)]);
        let count = |words: &[u32], wanted: u32| opcodes(words).into_iter().filter(|opcode| *opcode == wanted).count();
        for (bodies, nested, asks) in [(&and, nested("%ask %end"), 1), (&or, nested("%end %ask"), 0)] {
            for body in bodies {
                let found = left(body, asks);
                assert_eq!(opcodes(&found), opcodes(&left(&nested, asks)), "{body}");
                let branch = instructions(&found).find(|instruction| opcode(instruction) == op::BRANCH_CONDITIONAL).unwrap();
                let equal = instructions(&found).find(|instruction| opcode(instruction) == EQUALS).unwrap();
                assert_eq!(branch[1], equal[2], "the branch asks what is asked");
                assert_eq!((count(&found, op::PHI), count(&found, op::COPY_OBJECT), count(&found, op::NAME)), (0, 0, 1), "{body}");

                // Otherwise the constant decides: nothing is asked, and names and decorations go with what they are about.
                let found = left(body, 1 - asks);
                assert_eq!(count(&found, op::LABEL), 1, "{body}");
            }
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
