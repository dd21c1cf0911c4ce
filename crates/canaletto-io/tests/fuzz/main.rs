//! Randomly damaged files: for any content, reading ends within seconds, in memory bounded by the file's size, with a
//! result or an error and never with a panic. The default is a few hundred inputs of each kind; `CANALETTO_FUZZ=20000`
//! sets the number.

mod images;
mod models;
mod mutate;
mod tables;
