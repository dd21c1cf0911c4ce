//! Choice of the processor's instruction set, for comparisons. It is an environment variable, since no picture depends
//! on it.

use crate::failure::Failure;
use canaletto::InstructionSet;
use std::env;

/// The variable's name.
pub(crate) const VARIABLE: &str = "CANALETTO_INSTRUCTION_SET";

/// Limits the instructions to the set that the variable names, if it is set.
pub(crate) fn choose() -> Result<(), Failure> {
    let Some(wanted) = env::var_os(VARIABLE).filter(|value| !value.is_empty()) else { return Ok(()) };
    let names = |sets: &[InstructionSet]| sets.iter().map(|set| set.name()).collect::<Vec<_>>().join(", ");
    let Some(set) = InstructionSet::ALL.into_iter().find(|set| wanted == set.name()) else {
        let message = format!("{VARIABLE} is \"{}\", which is no set of instructions", wanted.display());
        return Err(Failure::usage(message).help(format!("there are: {}", names(&InstructionSet::ALL))));
    };
    if !InstructionSet::available().contains(&set) {
        let message = format!("{VARIABLE} is {}, which this processor doesn't have", set.name());
        return Err(Failure::usage(message).help(format!("here there are: {}", names(InstructionSet::available()))));
    }
    set.limit();
    Ok(())
}
