//! Damage to files, the same in every run, and what every reader must keep to.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// What came of an input.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// It is read or refused; memory is bounded by its size.
    Ordinary,
    /// It is whole and takes more, which its reader is told.
    Told,
}

/// The longest that one input may take.
const LONGEST: Duration = Duration::from_secs(2);

/// One kind at a time: the memory of the whole process is looked at.
static ALONE: Mutex<()> = Mutex::new(());

/// How many inputs are tried of each kind.
fn inputs(few: u64) -> u64 {
    std::env::var("CANALETTO_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

/// Tries damaged forms of `seeds`. `repaired` may put checksums in order, without which hardly any damage comes past them.
///
/// # Panics
/// With the number of the input that panicked, took too long or too much memory. `CANALETTO_FUZZ_KEEP=folder` keeps it there.
pub(crate) fn run(
    name: &str,
    seeds: &[Vec<u8>],
    few: u64,
    repaired: impl Fn(&mut Vec<u8>),
    read: impl Fn(&[u8]) -> Outcome,
) {
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    for seed in seeds {
        read(seed);
    }
    let (mut slowest, mut largest) = (Duration::ZERO, 0);
    for number in 0..inputs(few) {
        let mut random = Random(number.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5eed);
        let mut input = damaged(seeds, &mut random);
        if random.below(4) > 0 {
            repaired(&mut input);
        }
        let (took, memory) = tried(&format!("{name}-{number}"), &input, &read);
        (slowest, largest) = (slowest.max(took), largest.max(memory));
    }
    println!("{name}: {} inputs, the slowest took {slowest:?}, the largest {largest} bytes", inputs(few));
}

/// Tries one input that is made for it.
///
/// # Panics
/// As [`run`].
pub(crate) fn bounded(name: &str, input: &[u8], read: impl Fn(&[u8]) -> Outcome) {
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    tried(name, input, &read);
}

/// How often an input is tried that took too long or too much: other tests of the process may have been at work.
const TRIES: u32 = 4;

/// How long an input took, and how much memory, if that isn't told.
fn tried(name: &str, input: &[u8], read: &impl Fn(&[u8]) -> Outcome) -> (Duration, u64) {
    (1..TRIES)
        .find_map(|_| tried_once(name, input, read, false))
        .or_else(|| tried_once(name, input, read, true))
        .unwrap_or_default()
}

/// [`tried`], or nothing if it took too long or too much, unless it is the last time.
fn tried_once(name: &str, input: &[u8], read: &impl Fn(&[u8]) -> Outcome, last: bool) -> Option<(Duration, u64)> {
    let before = reset_peak();
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| read(input)));
    let took = start.elapsed();
    let memory = peak().saturating_sub(before);
    let told = matches!(result, Ok(Outcome::Told));
    let bound = (64 << 20) + 20 * input.len() as u64;
    // What is whole and large may take as long as it does.
    let too_much = (took > LONGEST || memory > bound) && !told;
    if too_much && !last && result.is_ok() {
        return None;
    }
    if result.is_err() || too_much {
        if let Ok(folder) = std::env::var("CANALETTO_FUZZ_KEEP") {
            fs::write(format!("{folder}/{name}"), input).expect("a place to keep it");
        }
        let panicked = if result.is_err() { "panicked, " } else { "" };
        panic!("{name} of {} bytes: {panicked}took {took:?} and {memory} bytes of memory", input.len());
    }
    Some(if told { (Duration::ZERO, 0) } else { (took, memory) })
}

/// Sets the process's peak of memory back to what it has, which is returned; 0 where the system doesn't tell.
fn reset_peak() -> u64 {
    // proc(5): 5 resets the peak.
    if fs::write("/proc/self/clear_refs", "5").is_err() {
        return u64::MAX;
    }
    peak()
}

/// The process's peak of memory in bytes.
fn peak() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// SplitMix64 (Steele, Lea and Flood, 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// One of 0 to `most` − 1; 0 if that is none.
    pub(crate) fn below(&mut self, most: usize) -> usize {
        (self.next() % most.max(1) as u64) as usize
    }
}

/// Numbers at which readers stumble.
const ODD: [u32; 14] =
    [0, 1, 2, 3, 4, 127, 128, 255, 0x7fff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff];

/// One of the seeds with one to eight things done to it.
fn damaged(seeds: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(8) {
        // Headers matter most.
        let reach = if random.below(2) == 0 { bytes.len().min(128) } else { bytes.len() };
        let at = random.below(reach);
        let length = 1 + random.below(16);
        let end = (at + length).min(bytes.len());
        match random.below(10) {
            0 | 1 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b ^= 1 << random.below(8)),
            2 => bytes.iter_mut().skip(at).take(1).for_each(|b| *b = random.next() as u8),
            3 | 4 => {
                let (size, number) = ([1, 2, 4][random.below(3)], ODD[random.below(ODD.len())]);
                let big = random.below(2) == 0;
                let number = if big { number.to_be_bytes() } else { number.to_le_bytes() };
                let number = if big { &number[4 - size..] } else { &number[..size] };
                bytes.iter_mut().skip(at).zip(number).for_each(|(b, n)| *b = *n);
            }
            5 => drop(bytes.drain(at..end)),
            6 => {
                let copied = bytes[at..end].to_vec();
                let to = random.below(bytes.len());
                bytes.splice(to..to, copied.repeat(1 + random.below(4)));
            }
            7 => bytes.truncate(at.max(1)),
            8 => {
                let other = &seeds[random.below(seeds.len())];
                let from = random.below(other.len());
                let copied = other[from..(from + 64).min(other.len())].to_vec();
                let end = (at + copied.len()).min(bytes.len());
                bytes.splice(at..end, copied);
            }
            _ => bytes[at..end].fill([0, 0xff, random.next() as u8][random.below(3)]),
        }
        if bytes.is_empty() {
            bytes.push(0);
        }
    }
    bytes
}
