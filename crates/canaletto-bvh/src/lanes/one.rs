//! One lane: the numbers themselves.

use super::{Bits64, Mask, Real, Real32, Real64};

impl Mask for bool {
    const COUNT: u32 = 1;

    #[inline(always)]
    fn splat(value: bool) -> bool {
        value
    }

    #[inline(always)]
    fn from_bits(bits: u32) -> bool {
        bits & 1 == 1
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
}

macro_rules! one_lane {
    ($type:ident) => {
        impl Real for $type {
            type Scalar = $type;
            type Mask = bool;
            const COUNT: usize = 1;

            #[inline(always)]
            fn splat(value: $type) -> $type {
                value
            }

            #[inline(always)]
            fn load(from: &[$type]) -> $type {
                from[0]
            }

            #[inline(always)]
            fn store(self, to: &mut [$type]) {
                to[0] = self;
            }

            #[inline(always)]
            fn sqrt(self) -> $type {
                $type::sqrt(self)
            }

            #[inline(always)]
            fn abs(self) -> $type {
                $type::abs(self)
            }

            #[inline(always)]
            fn less(self, other: $type) -> bool {
                self < other
            }

            #[inline(always)]
            fn at_most(self, other: $type) -> bool {
                self <= other
            }

            #[inline(always)]
            #[allow(clippy::float_cmp)]
            fn equal(self, other: $type) -> bool {
                self == other
            }

            #[inline(always)]
            fn select(mask: bool, yes: $type, no: $type) -> $type {
                if mask { yes } else { no }
            }
        }
    };
}

one_lane!(f64);
one_lane!(f32);

impl Real64 for f64 {
    type Narrow = f32;
    type Bits = u64;

    #[inline(always)]
    fn narrow(self) -> f32 {
        self as f32
    }

    #[inline(always)]
    fn to_bits(self) -> u64 {
        f64::to_bits(self)
    }

    #[inline(always)]
    fn from_bits(bits: u64) -> f64 {
        f64::from_bits(bits)
    }
}

impl Real32 for f32 {
    type Wide = f64;

    #[inline(always)]
    fn widen(self) -> f64 {
        f64::from(self)
    }
}

impl Bits64 for u64 {
    #[inline(always)]
    fn splat(bits: u64) -> u64 {
        bits
    }

    #[inline(always)]
    fn up<const N: u32>(self) -> u64 {
        self << N
    }

    #[inline(always)]
    fn down<const N: u32>(self) -> u64 {
        self >> N
    }
}
