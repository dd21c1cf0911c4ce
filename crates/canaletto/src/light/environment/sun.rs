//! The position of the sun at a place and time: the low-precision formulas of the *Astronomical Almanac* (Michalsky
//! 1988), good to 0.01° between 1950 and 2050. The refraction of the air, up to half a degree at the horizon, is
//! omitted.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A moment of universal time (UTC, Gregorian calendar).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    /// The days since noon of January 1st, 2000.
    days: f64,
}

impl Moment {
    /// The years for which the formulas hold.
    pub const YEARS: std::ops::RangeInclusive<i32> = 1950..=2050;

    /// A date with the hours since its midnight, UTC; hours may lie outside of the day.
    ///
    /// # Errors
    /// A message if the date doesn't exist, or lies outside the years of the formulas.
    pub fn new(year: i32, month: u32, day: u32, hours: f64) -> Result<Moment, String> {
        if !Moment::YEARS.contains(&year) {
            return Err(format!("the year is {year}; the sun's place is known from 1950 to 2050"));
        }
        let leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
        let february = if leap { 29 } else { 28 };
        let lengths = [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
        let Some(length) = month.checked_sub(1).and_then(|m| lengths.get(m as usize)) else {
            return Err(format!("the month is {month}; it must be between 1 and 12"));
        };
        if !(1..=*length).contains(&day) {
            return Err(format!("the day is {day}; that month has {length} days"));
        }
        if !hours.is_finite() || hours.abs() > 72.0 {
            return Err(format!("the time is {hours} hours; it must be a time of day"));
        }
        let before: u32 = lengths[..month as usize - 1].iter().sum();
        let years = year - 2000;
        let leap_days = (year - 1) / 4 - (year - 1) / 100 + (year - 1) / 400 - 484;
        // January 1st, 2000 began half a day before noon.
        let days = f64::from(years) * 365.0 + f64::from(leap_days) + f64::from(before + day - 1) - 0.5 + hours / 24.0;
        Ok(Moment { days })
    }

    /// The unit direction to the sun from a place on earth, in degrees north and east: x is east, y up, −z north.
    pub fn sun(&self, latitude: f64, longitude: f64) -> DVec3 {
        let n = self.days;
        let mean = (280.460 + 0.985_647_4 * n) % 360.0;
        let anomaly = ((357.528 + 0.985_600_3 * n) % 360.0).to_radians();
        let ecliptic = (mean + 1.915 * libm::sin(anomaly) + 0.020 * libm::sin(2.0 * anomaly)).to_radians();
        let obliquity = (23.439 - 0.000_000_4 * n).to_radians();
        let (sin, cos) = libm::sincos(ecliptic);
        let right_ascension = libm::atan2(libm::cos(obliquity) * sin, cos);
        let declination = libm::asin(libm::sin(obliquity) * sin);
        // Sidereal time grows by a day and four minutes in a day.
        let midnight = libm::floor(n + 0.5) - 0.5;
        let hours = (n - midnight) * 24.0;
        let sidereal = (6.697_375 + 0.065_709_824_2 * n + hours) % 24.0;
        let hour_angle = (sidereal * 15.0 + longitude).to_radians() - right_ascension;
        let (sin_h, cos_h) = libm::sincos(hour_angle);
        let (sin_d, cos_d) = libm::sincos(declination);
        let (sin_l, cos_l) = libm::sincos(latitude.to_radians());
        let north = sin_d * cos_l - cos_d * cos_h * sin_l;
        DVec3::new(-cos_d * sin_h, sin_d * sin_l + cos_d * cos_h * cos_l, -north)
    }
}

/// The unit direction of a height above the horizon and a compass bearing, in degrees: 0 is north (−z), 90 east (+x).
pub fn bearing(height: f64, azimuth: f64) -> DVec3 {
    let (sin_h, cos_h) = libm::sincos(height.to_radians());
    let (sin_a, cos_a) = libm::sincos(azimuth.to_radians());
    DVec3::new(cos_h * sin_a, sin_h, -cos_h * cos_a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(sun: DVec3) -> (f64, f64) {
        (sun.y.asin().to_degrees(), sun.x.atan2(-sun.z).to_degrees().rem_euclid(360.0))
    }

    /// The worked example of Reda and Andreas, *Solar Position Algorithm* (NREL/TP-560-34302): Golden, Colorado,
    /// 2003-10-17 12:30:30 at UTC−7. Azimuth 194.34024°, height without refraction 39.872046°.
    #[test]
    fn the_example_of_the_nrel() {
        let moment = Moment::new(2003, 10, 17, 12.0 + 30.5 / 60.0 + 7.0).unwrap();
        let (height, azimuth) = angles(moment.sun(39.742476, -105.1786));
        assert!((height - 39.872046).abs() < 0.01 && (azimuth - 194.34024).abs() < 0.015, "{height} {azimuth}");
    }

    /// At the solstice the sun is in the zenith of the tropic at noon, and at the equinox in that of the equator.
    #[test]
    fn solstice_and_equinox() {
        let june = Moment::new(2026, 6, 21, 12.03).unwrap().sun(23.436, 0.0);
        assert!(june.y > 0.9999, "{june}");
        let march = Moment::new(2026, 3, 20, 14.77).unwrap();
        let highest = (0..360).map(|l| march.sun(0.0, f64::from(l)).y).fold(0.0, f64::max);
        assert!(highest > 0.99996, "{highest}");
        let (_, morning) = angles(march.sun(0.0, -125.0));
        assert!((morning - 90.0).abs() < 1.0, "the sun rises in the east: {morning}");
    }

    #[test]
    fn dates_that_are_none() {
        for ((y, m, d), problem) in [
            ((1949, 1, 1), "the year is 1949"),
            ((2026, 0, 1), "the month is 0"),
            ((2026, 13, 1), "the month is 13"),
            ((2026, 2, 29), "the day is 29; that month has 28 days"),
            ((2026, 4, 31), "the day is 31; that month has 30 days"),
            ((2026, 1, 0), "the day is 0"),
        ] {
            let error = Moment::new(y, m, d, 0.0).unwrap_err();
            assert!(error.to_string().starts_with(problem), "{error}");
        }
        assert!(Moment::new(2024, 2, 29, 0.0).is_ok());
        // Consecutive days have consecutive numbers in all years.
        let day = |y, m, d| Moment::new(y, m, d, 0.0).unwrap().days;
        assert_eq!(day(2000, 1, 1), -0.5);
        for year in 1950..2050 {
            assert_eq!(day(year + 1, 1, 1) - day(year, 12, 31), 1.0);
            assert_eq!(day(year, 3, 1) - day(year, 2, 28), if year % 4 == 0 { 2.0 } else { 1.0 });
        }
    }

    #[test]
    fn bearings_go_round_from_north() {
        assert!((bearing(0.0, 90.0) - DVec3::X).length() < 1e-15);
        assert!((bearing(0.0, 0.0) - DVec3::NEG_Z).length() < 1e-15);
        assert!((bearing(90.0, 77.0) - DVec3::Y).length() < 1e-15);
    }
}
