//! Arithmetic on several particles at once.

/// Particles that are computed together: one or two vector registers on the CPUs of today.
pub const LANES: usize = 16;

/// One number of each particle of a block.
pub type Lanes = [f32; LANES];

/// e^x for |x| <= 80, to 1 ulp or so (Cody-Waite reduction, the polynomial of Cephes' expf).
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    // Adding 1.5 * 2^23 rounds to an integer and leaves it in the low bits.
    const SHIFT: f32 = 12_582_912.0;
    let shifted = x * std::f32::consts::LOG2_E + SHIFT;
    let n = shifted - SHIFT;
    let r = (x - n * 0.693_359_4) + n * 2.121_944_4e-4;
    let p = 1.987_569_1e-4;
    let p = p * r + 1.398_199_9e-3;
    let p = p * r + 8.333_452e-3;
    let p = p * r + 4.166_579_6e-2;
    let p = p * r + 1.666_666_5e-1;
    let p = p * r + 0.5;
    let scale = f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0f32.to_bits()));
    (p * r * r + r + 1.0) * scale
}

/// ln x for positive normal x, to 1 ulp or so (the polynomial of Cephes' logf). NaN and infinity pass through.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    // The mantissa between sqrt(1/2) and sqrt(2), so that nothing cancels near one.
    let shifted = x.to_bits().wrapping_sub(0x3f35_04f3);
    let exponent = (shifted as i32 >> 23) as f32;
    let mantissa = f32::from_bits((shifted & 0x007f_ffff).wrapping_add(0x3f35_04f3));
    let f = mantissa - 1.0;
    let p = 7.037_683_6e-2;
    let p = p * f - 1.151_461e-1;
    let p = p * f + 1.167_699_9e-1;
    let p = p * f - 1.242_014_1e-1;
    let p = p * f + 1.424_932_3e-1;
    let p = p * f - 1.666_805_8e-1;
    let p = p * f + 2.000_071_5e-1;
    let p = p * f - 2.499_999_4e-1;
    let p = p * f + 3.333_333e-1;
    let square = f * f;
    let tail = p * f * square - 2.121_944_4e-4 * exponent - 0.5 * square;
    let value = (f + tail) + 0.693_359_4 * exponent;
    if x < f32::INFINITY { value } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_and_logarithm_are_exact_to_two_units_in_the_last_place() {
        for k in 0..200_000 {
            let t = f64::from(k) / 200_000.0;
            let x = ((2.0 * t - 1.0) * 80.0) as f32;
            let exact = f64::from(x).exp();
            assert!(
                (f64::from(exp(x)) - exact).abs() <= 2.0 * 6.0e-8 * exact,
                "{x}"
            );
            for y in [exp(x), (1.0 + 1.0e-2 * (2.0 * t - 1.0)) as f32] {
                let exact = f64::from(y).ln();
                assert!(
                    (f64::from(ln(y)) - exact).abs() <= 2.0 * 6.0e-8 * exact.abs() + 1.0e-37,
                    "{y}"
                );
            }
        }
        assert!(exp(0.0) == 1.0 && ln(1.0) == 0.0);
        assert!(ln(f32::NAN).is_nan() && exp(f32::NAN).is_nan());
    }
}
