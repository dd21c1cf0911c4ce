//! Files that are damaged at random: whatever stands in one, reading it ends within seconds, in memory bounded by its size, in
//! an answer and never in a panic. A few hundred inputs of each kind by default; `CANALETTO_FUZZ=20000` tries as many.

mod images;
mod models;
mod mutate;
mod tables;
