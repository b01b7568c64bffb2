//! Recorded operations as a list of bytes, which a loop in C (`templates/listed.c`) executes. An operation takes four bytes,
//! against about twenty-seven from a compiler for an AVR. The operations, and so the bits, are those of
//! [`Body`](super::body::Body).
//!
//! Format of a list: number of registers, number of registers and constants, number of inputs, the inputs; operations up to
//! `END`; number of results, and for each its operand and its place. An operand is one byte: a register, a constant or an
//! input.

use std::collections::BTreeSet;
use std::fmt::Write;

use ohmstrain_ekf::record::{Operation, Place, Recorded};

use super::body::scopes::Scopes;
use super::body::uses_of_needed;
use crate::literal::Literal;

/// Smallest number of operations that is worth a list.
const WORTH: usize = 24;

/// Operations in C, on `a`, `b` and further operands; their codes are their indices here. The first two are not operations,
/// those up to `COPY` take one operand.
const OPERATIONS: [(&str, &str); 23] = [
    ("SKIP", ""),
    ("SKIP_UNLESS", ""),
    ("COPY", "a"),
    ("NEGATE", ".number = -a.number"),
    ("ABSOLUTE", ".number = fabsf(a.number)"),
    ("ROOT", ".number = sqrtf(a.number)"),
    ("EXPONENTIAL", ".number = expf(a.number)"),
    ("EXPONENTIAL_LESS_ONE", ".number = expm1f(a.number)"),
    ("TANGENT", ".number = tanhf(a.number)"),
    ("FALLING", ".number = falling(a.number)"),
    ("NOT_NEGATIVE", ".truth = a.number >= 0.0f"),
    ("FINITE", ".truth = isfinite(a.number) != 0"),
    ("NOT", ".truth = !a.truth"),
    ("ADD", ".number = a.number + b.number"),
    ("SUBTRACT", ".number = a.number - b.number"),
    ("MULTIPLY", ".number = a.number * b.number"),
    ("DIVIDE", ".number = a.number / b.number"),
    ("LESS", ".truth = a.number < b.number"),
    ("AT_MOST", ".truth = a.number <= b.number"),
    ("EQUAL", ".truth = a.number == b.number"),
    ("BOTH", ".truth = a.truth && b.truth"),
    ("EITHER", ".truth = a.truth || b.truth"),
    ("PICK", ""),
];
const SKIP: u8 = 0;
const SKIP_UNLESS: u8 = 1;
const COPY: u8 = 2;
const PICK: u8 = 22;
const END: u8 = 255;

/// Source of an input or place of a result: two bits for the kind, six for the index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// A number of the state.
    Number(usize),
    /// A truth value of the state.
    Truth(usize),
    /// A number of the step.
    Step(usize),
    /// An argument, or an output to the caller.
    Given(usize),
}

impl Slot {
    fn byte(self) -> Option<u8> {
        let (kind, place) = match self {
            Self::Number(place) => (0, place),
            Self::Truth(place) => (1, place),
            Self::Step(place) => (2, place),
            Self::Given(place) => (3, place),
        };
        (place < 64).then_some(kind << 6 | place as u8)
    }
}

/// Requirements of a program's lists on the loop that runs them.
#[derive(Debug, Default)]
pub struct Lists {
    registers: usize,
    codes: BTreeSet<u8>,
}

impl Lists {
    /// Returns the largest number of registers that a list uses.
    pub const fn registers(&self) -> usize {
        self.registers
    }

    /// Returns the names of the codes, in order.
    pub fn names(&self) -> Vec<&'static str> {
        OPERATIONS.iter().map(|(name, _)| *name).collect()
    }

    /// Returns the cases of the operations that occur.
    pub fn cases(&self) -> Vec<String> {
        let occurring = self.codes.iter().filter(|code| (COPY..PICK).contains(code));
        let case = |code: &u8| {
            let (name, done) = OPERATIONS[usize::from(*code)];
            if done == "a" {
                format!("case {name}: out = a; break;")
            } else {
                format!("case {name}: out{done}; break;")
            }
        };
        occurring.map(case).collect()
    }
}

#[derive(Clone, Copy)]
enum Operand {
    Register(usize),
    Constant(usize),
    Input(usize),
}

/// An operation, or a jump to another one.
struct Instruction {
    code: u8,
    result: usize,
    operands: Vec<Operand>,
    /// Target instruction of a jump.
    to: usize,
}

/// Instructions of a recorded function, with each result in a register of its own.
struct Listing<'a> {
    operations: &'a [Operation],
    uses: &'a [usize],
    scopes: Scopes,
    slot_of: &'a dyn Fn(usize) -> Slot,
    values: Vec<Option<Operand>>,
    instructions: Vec<Instruction>,
    constants: Vec<u32>,
    inputs: Vec<Slot>,
    registers: usize,
}

/// Defines a list in C, its operations and its constants, called `OPERATIONS` and `CONSTANTS`; `None` if it is not worth one,
/// or does not fit into bytes. Inputs come from `slot_of`, results go to `kept`.
pub fn list(
    lists: &mut Lists,
    recorded: &Recorded,
    slot_of: &dyn Fn(usize) -> Slot,
    kept: &[(Place, Slot)],
) -> Option<String> {
    let operations = recorded.operations.as_slice();
    let results: Vec<Place> = kept.iter().map(|(place, _)| *place).collect();
    let uses = uses_of_needed(operations, &results);
    if uses.iter().filter(|uses| **uses > 0).count() < WORTH {
        return None;
    }
    let mut listing = Listing {
        operations,
        uses: &uses,
        scopes: Scopes::new(operations, &uses, &results),
        slot_of,
        values: vec![None; operations.len()],
        instructions: Vec::new(),
        constants: Vec::new(),
        inputs: Vec::new(),
        registers: 0,
    };
    let mut ends = Vec::new();
    for (place, slot) in kept {
        let mut operand = listing.value(*place)?;
        // Numbers of the state are overwritten at the end, so they are read before.
        if matches!(operand, Operand::Input(_)) {
            operand = listing.put(COPY, vec![operand]);
        }
        ends.push((operand, *slot));
    }
    let (registers, placed) = listing.placed(&ends);
    let bytes = listing.bytes(registers, &placed, &ends)?;
    lists.registers = lists.registers.max(registers);
    lists.codes.extend(listing.instructions.iter().map(|instruction| instruction.code));
    let mut text = format!("    static const FLASH uint8_t OPERATIONS[{}] = {{", bytes.len());
    for row in bytes.chunks(24) {
        let _ = write!(text, "\n        {},", row.iter().map(u8::to_string).collect::<Vec<_>>().join(", "));
    }
    let constants: Vec<String> = listing.constants.iter().map(|bits| constant(f32::from_bits(*bits))).collect();
    let _ = write!(text, "\n    }};\n    static const FLASH float CONSTANTS[{}] = {{", constants.len().max(1));
    for row in constants.chunks(8) {
        let _ = write!(text, "\n        {},", row.join(", "));
    }
    text.push_str(if constants.is_empty() { "0.0f};\n" } else { "\n    };\n" });
    Some(text)
}

fn constant(number: f32) -> String {
    if number == f32::INFINITY { "INFINITY".into() } else { format!("{}f", Literal(number).text()) }
}

impl Listing<'_> {
    /// Appends an operation, and returns its result.
    fn put(&mut self, code: u8, operands: Vec<Operand>) -> Operand {
        let result = self.register();
        self.instructions.push(Instruction { code, result, operands, to: 0 });
        Operand::Register(result)
    }

    fn register(&mut self) -> usize {
        self.registers += 1;
        self.registers - 1
    }

    fn constant(&mut self, number: f32) -> Operand {
        let bits = number.to_bits();
        let known = self.constants.iter().position(|other| *other == bits);
        Operand::Constant(known.unwrap_or_else(|| {
            self.constants.push(bits);
            self.constants.len() - 1
        }))
    }

    /// Returns the operand of a result, which is computed first if it has not been needed yet.
    fn value(&mut self, place: Place) -> Option<Operand> {
        if self.values[place].is_none() {
            let made = self.made(place)?;
            // A branch has set it already.
            self.values[place].get_or_insert(made);
        }
        self.values[place]
    }

    fn made(&mut self, place: Place) -> Option<Operand> {
        if self.scopes.branch_of(place).is_some() {
            self.branch(place)?;
            return self.values[place];
        }
        let operation = self.operations[place];
        let code = match operation {
            Operation::Input(number) | Operation::Flag(number) => {
                let slot = (self.slot_of)(number);
                let known = self.inputs.iter().position(|other| *other == slot);
                return Some(Operand::Input(known.unwrap_or_else(|| {
                    self.inputs.push(slot);
                    self.inputs.len() - 1
                })));
            }
            Operation::Constant(number) => return Some(self.constant(number)),
            Operation::Known(truth) => {
                let zero = self.constant(0.0);
                return Some(self.put(code_of(if truth { "AT_MOST" } else { "LESS" })?, vec![zero, zero]));
            }
            Operation::Negate(_) => "NEGATE",
            Operation::Absolute(_) => "ABSOLUTE",
            Operation::Root(_) => "ROOT",
            Operation::Exponential(_) => "EXPONENTIAL",
            Operation::ExponentialLessOne(_) => "EXPONENTIAL_LESS_ONE",
            Operation::Tangent(_) => "TANGENT",
            Operation::Falling(_) => "FALLING",
            Operation::NotNegative(_) => "NOT_NEGATIVE",
            Operation::Finite(_) => "FINITE",
            Operation::Not(_) => "NOT",
            Operation::Add(..) => "ADD",
            Operation::Subtract(..) => "SUBTRACT",
            Operation::Multiply(..) => "MULTIPLY",
            Operation::Divide(..) => "DIVIDE",
            Operation::Less(..) => "LESS",
            Operation::AtMost(..) => "AT_MOST",
            Operation::Equal(..) => "EQUAL",
            Operation::Both(..) => "BOTH",
            Operation::Either(..) => "EITHER",
            Operation::Pick(..) => "PICK",
            // These occur in `falling`, which is compiled, and in hypotheses.
            Operation::ToExponent(_) | Operation::Tail(_) | Operation::Hazard(_) => return None,
        };
        let operands = operation.operands().map(|operand| self.value(operand)).collect::<Option<Vec<_>>>()?;
        Some(self.put(code_of(code)?, operands))
    }

    /// Lists a choice whose arms are worth a branch, together with all choices made by the same branch.
    fn branch(&mut self, choice: Place) -> Option<()> {
        let branch = self.scopes.branch_of(choice)?;
        let mut choices = branch.choices.clone();
        choices.sort_unstable();
        let shared = self.scopes.shared(self.operations, self.uses, branch);
        let Operation::Pick(mask, ..) = self.operations[choice] else { return None };
        let mask = self.value(mask)?;
        for place in shared {
            self.value(place)?;
        }
        let results: Vec<usize> = choices.iter().map(|_| self.register()).collect();
        let first = self.instructions.len();
        self.instructions.push(Instruction { code: SKIP_UNLESS, result: 0, operands: vec![mask], to: 0 });
        for way in 0..2 {
            for (place, result) in choices.iter().zip(&results) {
                let Operation::Pick(_, yes, no) = self.operations[*place] else { return None };
                let operand = self.value([yes, no][way])?;
                self.instructions.push(Instruction { code: COPY, result: *result, operands: vec![operand], to: 0 });
            }
            if way == 0 {
                let last = self.instructions.len();
                self.instructions.push(Instruction { code: SKIP, result: 0, operands: Vec::new(), to: 0 });
                self.instructions[first].to = last + 1;
            } else {
                let (end, to) = (self.instructions[first].to - 1, self.instructions.len());
                self.instructions[end].to = to;
            }
        }
        for (place, result) in choices.into_iter().zip(results) {
            self.values[place] = Some(Operand::Register(result));
        }
        Some(())
    }

    /// Assigns registers: their number, and the register of each result from its first write to its last read.
    fn placed(&self, ends: &[(Operand, Slot)]) -> (usize, Vec<usize>) {
        let mut last = vec![0; self.registers];
        let mut first = vec![usize::MAX; self.registers];
        for (k, instruction) in self.instructions.iter().enumerate() {
            for operand in &instruction.operands {
                if let Operand::Register(register) = operand {
                    last[*register] = k;
                }
            }
            if instruction.code > SKIP_UNLESS {
                first[instruction.result] = first[instruction.result].min(k);
                last[instruction.result] = last[instruction.result].max(k);
            }
        }
        for (operand, _) in ends {
            if let Operand::Register(register) = operand {
                last[*register] = usize::MAX;
            }
        }
        let mut order: Vec<usize> = (0..self.registers).collect();
        order.sort_by_key(|register| first[*register]);
        let (mut free_from, mut placed) = (Vec::new(), vec![0; self.registers]);
        for register in order {
            // Operands are read before the result is written.
            let found = free_from.iter().position(|end| *end <= first[register]);
            let place = found.unwrap_or_else(|| {
                free_from.push(0);
                free_from.len() - 1
            });
            free_from[place] = last[register];
            placed[register] = place;
        }
        (free_from.len(), placed)
    }

    fn bytes(&self, registers: usize, placed: &[usize], ends: &[(Operand, Slot)]) -> Option<Vec<u8>> {
        let first_input = registers + self.constants.len();
        let operand = |operand: &Operand| {
            u8::try_from(match operand {
                Operand::Register(register) => placed[*register],
                Operand::Constant(constant) => registers + constant,
                Operand::Input(input) => first_input + input,
            })
            .ok()
        };
        let mut bytes = [registers, first_input, self.inputs.len()]
            .into_iter()
            .map(|count| u8::try_from(count).ok())
            .chain(self.inputs.iter().map(|slot| slot.byte()))
            .collect::<Option<Vec<u8>>>()?;
        let mut starts = Vec::new();
        let mut start = 0;
        for instruction in &self.instructions {
            starts.push(start);
            start += length(instruction);
        }
        starts.push(start);
        for (k, instruction) in self.instructions.iter().enumerate() {
            bytes.push(instruction.code);
            if instruction.code <= SKIP_UNLESS {
                let distance = u16::try_from(starts[instruction.to] - starts[k + 1]).ok()?;
                bytes.push(instruction.operands.first().map_or(Some(0), operand)?);
                bytes.extend(distance.to_le_bytes());
            } else {
                bytes.push(u8::try_from(placed[instruction.result]).ok()?);
                for one in &instruction.operands {
                    bytes.push(operand(one)?);
                }
            }
        }
        bytes.extend([END, u8::try_from(ends.len()).ok()?]);
        for (result, slot) in ends {
            bytes.extend([operand(result)?, slot.byte()?]);
        }
        Some(bytes)
    }
}

/// Returns the length of an instruction in bytes.
fn length(instruction: &Instruction) -> usize {
    if instruction.code <= SKIP_UNLESS { 4 } else { 2 + instruction.operands.len() }
}

fn code_of(name: &str) -> Option<u8> {
    OPERATIONS.iter().position(|(known, _)| *known == name).map(|code| code as u8)
}
