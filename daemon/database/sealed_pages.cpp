// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/sealed_pages.hpp"

#include <bit>
#include <cstring>

namespace plumb {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the sums of the log of writes are those of such a machine");

/// Each step is a bijection of the sum so far, so a change of one word always changes the result.
std::uint64_t SumOf(ConstPage page, std::uint32_t number) {
  constexpr std::uint64_t kOdd = 0x9E3779B97F4A7C15;
  std::uint64_t sum = (number + std::uint64_t{1}) * kOdd;
  for (std::size_t i = 0; i < kPageBytes - kSealBytes; i += sizeof(std::uint64_t)) {
    std::uint64_t word = 0;
    std::memcpy(&word, page.data() + i, sizeof(word));
    sum = (sum ^ word) * kOdd;
    sum ^= sum >> 32U;
  }
  return sum;
}

}  // namespace

void SealPage(Page page, std::uint32_t number) {
  const std::uint64_t sum = SumOf(page, number);
  std::memcpy(page.data() + kPageBytes - kSealBytes, &sum, kSealBytes);
}

bool IsSealed(ConstPage page, std::uint32_t number) { return SealIn(page) == SumOf(page, number); }

std::uint64_t SealIn(ConstPage page) {
  std::uint64_t seal = 0;
  std::memcpy(&seal, page.data() + kPageBytes - kSealBytes, kSealBytes);
  return seal;
}

void LogSum::Add(std::span<const std::uint8_t> bytes) {
  for (std::size_t i = 0; i + 8 <= bytes.size(); i += 8) {
    std::uint32_t word[2] = {};
    std::memcpy(word, bytes.data() + i, sizeof(word));
    a += word[0] + b;
    b += word[1] + a;
  }
}

}  // namespace plumb
