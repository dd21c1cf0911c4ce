//! Clocks, and medians and ranges of interleaved rounds.

use std::time::Instant;

/// What a contestant's time is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Clock {
    /// Time that passes.
    Wall,
    /// Time that the threads of this process ran, together; only on Linux.
    Cpu,
}

impl Clock {
    /// The seconds that `work` takes.
    pub fn time(self, work: impl FnOnce()) -> f64 {
        let (start, ran) = (Instant::now(), self.ran());
        work();
        match (ran, self.ran()) {
            (Some(before), Some(after)) => after - before,
            _ => start.elapsed().as_secs_f64(),
        }
    }

    /// The seconds of the processes that `work` starts and waits for.
    pub fn time_child(self, work: impl FnOnce()) -> f64 {
        let (start, ran) = (Instant::now(), self.children_ran());
        work();
        match (ran, self.children_ran()) {
            (Some(before), Some(after)) => after - before,
            _ => start.elapsed().as_secs_f64(),
        }
    }

    /// The processor time of all ended children in seconds, with a resolution of a hundredth.
    fn children_ran(self) -> Option<f64> {
        if self == Self::Wall {
            return None;
        }
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        // The fields follow the program's name, which may contain any characters. cutime and cstime are the 16th and
        // 17th of all.
        let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(13);
        let mut next = || fields.next()?.parse::<f64>().ok();
        Some((next()? + next()?) / 100.0)
    }

    /// The processor time of all threads so far in seconds, from the scheduler.
    fn ran(self) -> Option<f64> {
        if self == Self::Wall {
            return None;
        }
        let mut nanoseconds = 0.0;
        for task in std::fs::read_dir("/proc/self/task").ok()? {
            let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
            nanoseconds += text.split_whitespace().next()?.parse::<f64>().ok()?;
        }
        Some(nanoseconds * 1e-9)
    }
}

/// The seconds per round of one contestant.
#[derive(Clone, Debug, Default)]
pub struct Times(pub Vec<f64>);

/// A ratio and its range over rounds.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    /// The ratio of medians.
    pub median: f64,
    /// The smallest ratio of a round.
    pub min: f64,
    /// The largest ratio of a round.
    pub max: f64,
}

impl Times {
    /// The median; NaN without rounds.
    pub fn median(&self) -> f64 {
        let mut times = self.0.clone();
        times.sort_by(f64::total_cmp);
        let n = times.len();
        if n == 0 { f64::NAN } else { (times[n / 2] + times[(n - 1) / 2]) / 2.0 }
    }

    /// The factor by which this contestant is faster than `other`, computed round by round.
    pub fn faster_than(&self, other: &Self) -> Ratio {
        let rounds = || self.0.iter().zip(&other.0).map(|(ours, theirs)| theirs / ours);
        Ratio {
            median: other.median() / self.median(),
            min: rounds().fold(f64::INFINITY, f64::min),
            max: rounds().fold(0.0, f64::max),
        }
    }
}

impl std::fmt::Display for Ratio {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.2} [{:.2} {:.2}]", self.median, self.min, self.max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_of_medians_and_spreads_of_rounds() {
        let [ours, theirs] = [Times(vec![1.0, 2.0, 9.0]), Times(vec![4.0, 2.0, 6.0])];
        let ratio = ours.faster_than(&theirs);
        assert_eq!((ratio.median, ratio.min, ratio.max), (2.0, 6.0 / 9.0, 4.0));
        assert_eq!(Times(vec![1.0, 4.0]).median(), 2.5);
    }
}
