//! The subcommands, one file each: its flags, its help, and what it does.

pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod explain;
pub(crate) mod info;
pub(crate) mod man;
pub(crate) mod render;
