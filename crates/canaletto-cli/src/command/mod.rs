//! The subcommands. Each file holds one command with its flags and its help.

pub(crate) mod bake;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod compare_methods;
pub(crate) mod completions;
pub(crate) mod convert;
pub(crate) mod denoise;
pub(crate) mod explain;
pub(crate) mod farm;
pub(crate) mod form_factor;
pub(crate) mod grade;
pub(crate) mod info;
pub(crate) mod ladder;
pub(crate) mod man;
pub(crate) mod measure;
pub(crate) mod merge;
pub(crate) mod prepare;
pub(crate) mod render;
