//! Modules whose lanes vote in a loop ask the device to bring them together again, where it offers that.

use super::device::Reconvergence;
use super::specialize::{HEADER_WORDS, instructions, opcode};

/// Numbers of the SPIR-V specification, of SPV_KHR_maximal_reconvergence and SPV_KHR_subgroup_uniform_control_flow.
const EXTENSION: u32 = 10;
const ENTRY_POINT: u32 = 15;
const EXECUTION_MODE: u32 = 16;
const CAPABILITY: u32 = 17;
const SUBGROUP_UNIFORM_CONTROL_FLOW: u32 = 4421;
const MAXIMALLY_RECONVERGES: u32 = 6023;

/// The module with the execution mode for its entry point.
pub(super) fn reconverging(words: &[u32], offered: Reconvergence) -> Vec<u32> {
    let (extension, mode) = match offered {
        Reconvergence::Maximal => ("SPV_KHR_maximal_reconvergence", MAXIMALLY_RECONVERGES),
        Reconvergence::UniformControlFlow => ("SPV_KHR_subgroup_uniform_control_flow", SUBGROUP_UNIFORM_CONTROL_FLOW),
        Reconvergence::None => return words.to_vec(),
    };
    // Capabilities stand first, then extensions; execution modes follow the entry points.
    let mut result = words[..HEADER_WORDS].to_vec();
    let mut is_declared = false;
    for instruction in instructions(words) {
        if opcode(instruction) != CAPABILITY && !is_declared {
            is_declared = true;
            result.extend(with_text(EXTENSION, extension));
        }
        result.extend_from_slice(instruction);
        if opcode(instruction) == ENTRY_POINT {
            result.extend([EXECUTION_MODE | 3 << 16, instruction[2], mode]);
        }
    }
    result
}

/// An instruction with one operand, a text that ends in a zero byte.
fn with_text(opcode: u32, text: &str) -> Vec<u32> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(text.len() / 4 * 4 + 4, 0);
    let words = bytes.chunks_exact(4).map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let length = bytes.len() as u32 / 4 + 1;
    [opcode | length << 16].into_iter().chain(words).collect()
}
