//! Reproducible damage to files, and the limits for every reader.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// The outcome of an input.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The input is read or refused; memory is bounded by its size.
    Ordinary,
    /// The input is complete and exceeds the bound, which a note reports.
    Told,
}

/// The longest time for one input.
const LONGEST: Duration = Duration::from_secs(2);

/// A lock that serialises the tests, because the memory of the whole process is measured.
static ALONE: Mutex<()> = Mutex::new(());

/// The number of inputs of each kind.
fn inputs(few: u64) -> u64 {
    std::env::var("CANALETTO_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(few)
}

/// Reads damaged variants of `seeds`. `repaired` may correct checksums, without which readers reject nearly all damage.
///
/// # Panics
/// With the number of an input that panicked, took too long or used too much memory. `CANALETTO_FUZZ_KEEP=folder`
/// stores the input there.
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

/// Reads a single input.
///
/// # Panics
/// As [`run`].
pub(crate) fn bounded(name: &str, input: &[u8], read: impl Fn(&[u8]) -> Outcome) {
    let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    tried(name, input, &read);
}

/// The number of attempts for an input that takes too long or too much memory, because other tests of the process may
/// interfere.
const TRIES: u32 = 4;

/// The time and the memory in bytes of an input; zero if its outcome is [`Outcome::Told`].
fn tried(name: &str, input: &[u8], read: &impl Fn(&[u8]) -> Outcome) -> (Duration, u64) {
    (1..TRIES)
        .find_map(|_| tried_once(name, input, read, false))
        .or_else(|| tried_once(name, input, read, true))
        .unwrap_or_default()
}

/// As [`tried`]; `None` if the input exceeds a limit and `last` is false.
fn tried_once(name: &str, input: &[u8], read: &impl Fn(&[u8]) -> Outcome, last: bool) -> Option<(Duration, u64)> {
    let before = reset_peak();
    let start = Instant::now();
    let result = catch_unwind(AssertUnwindSafe(|| read(input)));
    let took = start.elapsed();
    let memory = peak().saturating_sub(before);
    let told = matches!(result, Ok(Outcome::Told));
    let bound = (64 << 20) + 20 * input.len() as u64;
    // Complete large inputs may exceed the limits.
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

/// Resets the process's peak memory to its current memory, and returns that; `u64::MAX` where the system can't.
fn reset_peak() -> u64 {
    // See proc(5): 5 resets the peak.
    if fs::write("/proc/self/clear_refs", "5").is_err() {
        return u64::MAX;
    }
    peak()
}

/// The process's peak memory in bytes; 0 if it isn't available.
fn peak() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) * 1024
}

/// The generator SplitMix64 (Steele, Lea and Flood, 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from 0 to `most` − 1; 0 if `most` is 0.
    pub(crate) fn below(&mut self, most: usize) -> usize {
        (self.next() % most.max(1) as u64) as usize
    }
}

/// Numbers that are difficult for readers.
const ODD: [u32; 14] =
    [0, 1, 2, 3, 4, 127, 128, 255, 0x7fff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff];

/// One of the seeds after one to eight mutations.
fn damaged(seeds: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut bytes = seeds[random.below(seeds.len())].clone();
    for _ in 0..=random.below(8) {
        // Headers are damaged more often.
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
