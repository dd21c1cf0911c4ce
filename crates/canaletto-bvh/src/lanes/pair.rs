//! Twice as many lanes: those of the first half come first.

use super::{Bits64, Mask, Real, Real32, Real64};
use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

/// Two halves with the same operations.
#[derive(Clone, Copy, Debug)]
pub struct Pair<A>(pub(super) A, pub(super) A);

macro_rules! by_halves {
    ($($trait:ident $name:ident),*) => {
        $(impl<A: $trait<Output = A>> $trait for Pair<A> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Pair(self.0.$name(other.0), self.1.$name(other.1))
            }
        })*
    };
}

by_halves!(Add add, Sub sub, Mul mul, Div div, BitAnd bitand, BitOr bitor, BitXor bitxor);

impl<A: Neg<Output = A>> Neg for Pair<A> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Pair(-self.0, -self.1)
    }
}

impl<A: Not<Output = A>> Not for Pair<A> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Pair(!self.0, !self.1)
    }
}

/// The operators whose other side is one number for all lanes.
macro_rules! by_one {
    ($scalar:ident: $($trait:ident $name:ident),*) => {
        $(impl<A: Real<Scalar = $scalar>> $trait<$scalar> for Pair<A> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: $scalar) -> Self {
                let other = A::splat(other);
                Pair($trait::<A>::$name(self.0, other), $trait::<A>::$name(self.1, other))
            }
        })*
    };
}

by_one!(f64: Add add, Sub sub, Mul mul, Div div);
by_one!(f32: Add add, Sub sub, Mul mul, Div div);

impl<A: Mask> Mask for Pair<A> {
    const COUNT: u32 = 2 * A::COUNT;

    #[inline(always)]
    fn splat(value: bool) -> Self {
        Pair(A::splat(value), A::splat(value))
    }

    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Pair(A::from_bits(bits), A::from_bits(bits >> A::COUNT))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << A::COUNT
    }
}

impl<A: Real> Real for Pair<A>
where
    Pair<A>: Add<A::Scalar, Output = Self>
        + Sub<A::Scalar, Output = Self>
        + Mul<A::Scalar, Output = Self>
        + Div<A::Scalar, Output = Self>,
{
    type Scalar = A::Scalar;
    type Mask = Pair<A::Mask>;
    const COUNT: usize = 2 * A::COUNT;

    #[inline(always)]
    fn splat(value: A::Scalar) -> Self {
        Pair(A::splat(value), A::splat(value))
    }

    #[inline(always)]
    fn load(from: &[A::Scalar]) -> Self {
        Pair(A::load(from), A::load(&from[A::COUNT..]))
    }

    #[inline(always)]
    fn store(self, to: &mut [A::Scalar]) {
        self.0.store(to);
        self.1.store(&mut to[A::COUNT..]);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Pair(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Pair(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn less(self, other: Self) -> Pair<A::Mask> {
        Pair(self.0.less(other.0), self.1.less(other.1))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Pair<A::Mask> {
        Pair(self.0.at_most(other.0), self.1.at_most(other.1))
    }

    #[inline(always)]
    fn equal(self, other: Self) -> Pair<A::Mask> {
        Pair(self.0.equal(other.0), self.1.equal(other.1))
    }

    #[inline(always)]
    fn select(mask: Pair<A::Mask>, yes: Self, no: Self) -> Self {
        Pair(A::select(mask.0, yes.0, no.0), A::select(mask.1, yes.1, no.1))
    }
}

impl<A: Real64> Real64 for Pair<A> {
    type Narrow = Pair<A::Narrow>;
    type Bits = Pair<A::Bits>;

    #[inline(always)]
    fn narrow(self) -> Pair<A::Narrow> {
        Pair(self.0.narrow(), self.1.narrow())
    }

    #[inline(always)]
    fn to_bits(self) -> Pair<A::Bits> {
        Pair(self.0.to_bits(), self.1.to_bits())
    }

    #[inline(always)]
    fn from_bits(bits: Pair<A::Bits>) -> Self {
        Pair(A::from_bits(bits.0), A::from_bits(bits.1))
    }
}

impl<A: Real32> Real32 for Pair<A> {
    type Wide = Pair<A::Wide>;

    #[inline(always)]
    fn widen(self) -> Pair<A::Wide> {
        Pair(self.0.widen(), self.1.widen())
    }
}

impl<A: Bits64> Bits64 for Pair<A> {
    #[inline(always)]
    fn splat(bits: u64) -> Self {
        Pair(A::splat(bits), A::splat(bits))
    }

    #[inline(always)]
    fn up<const N: u32>(self) -> Self {
        Pair(self.0.up::<N>(), self.1.up::<N>())
    }

    #[inline(always)]
    fn down<const N: u32>(self) -> Self {
        Pair(self.0.down::<N>(), self.1.down::<N>())
    }
}
