//! Frame rates as fractions, since film formats use integers.

/// A frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate {
    /// The number of frames in [`Rate::seconds`] seconds.
    pub frames: u32,
    /// The number of seconds.
    pub seconds: u32,
}

impl Rate {
    /// The rate nearest to `fps`: an integer, a television rate (23.976 is 24000/1001), or a multiple of a thousandth.
    pub fn new(fps: f64) -> Rate {
        let whole = fps.round();
        let television = (fps * 1.001).round();
        if fps == whole {
            Rate { frames: whole as u32, seconds: 1 }
        } else if (television * 1000.0 / 1001.0 - fps).abs() < 0.001 {
            Rate { frames: television as u32 * 1000, seconds: 1001 }
        } else {
            let (mut a, mut b) = (((fps * 1000.0).round() as u32).max(1), 1000);
            while b > 0 {
                (a, b) = (b, a % b);
            }
            Rate { frames: ((fps * 1000.0).round() as u32).max(1) / a, seconds: 1000 / a }
        }
    }

    /// The end time of the first `frames` frames, in hundredths of a second, rounded.
    pub(super) fn hundredths(self, frames: u32) -> u64 {
        let (n, d) = (u64::from(frames) * u64::from(self.seconds) * 100, u64::from(self.frames));
        (n + d / 2) / d
    }

    /// The rate in frames per second.
    pub fn fps(self) -> f64 {
        f64::from(self.frames) / f64::from(self.seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_become_fractions() {
        let of = |fps: f64| {
            let r = Rate::new(fps);
            (r.frames, r.seconds)
        };
        assert_eq!(
            [of(25.0), of(23.976), of(29.97), of(59.94)],
            [(25, 1), (24000, 1001), (30000, 1001), (60000, 1001)]
        );
        assert_eq!([of(12.5), of(0.01), of(0.5), of(16.667)], [(25, 2), (1, 100), (1, 2), (16667, 1000)]);
    }
}
