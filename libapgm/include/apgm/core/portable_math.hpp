#pragma once

/// Elementary functions that give the same bits on every machine.
///
/// The C library picks variants with and without fused multiply-add at run time, so its results may differ in
/// the last bit from CPU to CPU. These use only + - * / and bit operations, in a fixed order. Errors stay
/// within 2 ulp of the exact value. Special values follow the C library: log(0) = -inf, log(x < 0) = NaN,
/// NaN gives NaN.
namespace apgm::portable {

/// Natural logarithm.
double log(double x);
/// ln(1 + x), also for tiny x. log1p(-1) = -inf.
double log1p(double x);
/// e^x; 0 below about -745, +inf above about 709.8.
double exp(double x);
/// e^x - 1, also for tiny x.
double expm1(double x);
/// Sine and cosine of an angle in radians, |x| <= 1e5. Beyond, the result is NaN.
double sin(double x);
double cos(double x);

}  // namespace apgm::portable
