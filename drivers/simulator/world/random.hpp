// SPDX-License-Identifier: Apache-2.0
// Random numbers that are the same on every machine and in any order of evaluation: each comes from
// a hash of (seed, purpose, index), so that parallel loops draw the same values on any number of
// threads.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace plumb::simulated {

/// The finalizer of SplitMix64 (Steele, Lea, Flood 2014): every input bit affects every output bit.
[[nodiscard]] constexpr std::uint64_t Hash(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

[[nodiscard]] constexpr std::uint64_t Hash(std::uint64_t a, std::uint64_t b) {
  return Hash(Hash(a) ^ b);
}
[[nodiscard]] constexpr std::uint64_t Hash(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  return Hash(Hash(a, b), c);
}

/// Uniform in [0, 1).
[[nodiscard]] constexpr double UnitUniform(std::uint64_t hash) {
  return static_cast<double>(hash >> 11) * 0x1.0p-53;
}

/// A sequence of random numbers. Not thread-safe; use one per purpose.
class RandomStream {
 public:
  explicit RandomStream(std::uint64_t seed) : seed_(Hash(seed)) {}
  double Uniform() { return UnitUniform(Hash(seed_, count_++)); }
  double Uniform(double low, double high) { return low + (high - low) * Uniform(); }
  /// Uniform in [-limit, limit].
  double Within(double limit) { return Uniform(-limit, limit); }
  /// Standard normal (Box and Muller).
  double Normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - Uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * Uniform());
  }

 private:
  std::uint64_t seed_;
  std::uint64_t count_ = 0;
};

}  // namespace plumb::simulated
