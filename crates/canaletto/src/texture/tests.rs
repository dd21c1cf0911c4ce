//! Tests of what several files of the folder do together.

mod filter;
