//! Tests of what several files of the folder do together.

mod bent;
mod weight;
