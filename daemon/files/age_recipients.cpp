// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/age_recipients.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <sstream>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

/// Bech32 (BIP 173): five bits a character, of which the last six characters are a checksum.
constexpr std::string_view kBech32 = "qpzry9x8gf2tvdw0s3jn54khce6mua7l";
constexpr std::string_view kRecipientPrefix = "age1";
constexpr std::size_t kRecipientLength = 62;  // the prefix, 52 characters of 32 bytes, 6 of the sum

std::uint32_t NextSum(std::uint32_t sum, std::uint32_t value) {
  constexpr std::array<std::uint32_t, 5> kGenerators = {0x3b6a57b2, 0x26508e6d, 0x1ea119fa,
                                                        0x3d4233dd, 0x2a1462b3};
  const std::uint32_t top = sum >> 25;
  sum = (sum & 0x1ffffff) << 5 ^ value;
  for (std::size_t i = 0; i < kGenerators.size(); ++i)
    if ((top >> i & 1) != 0) sum ^= kGenerators[i];
  return sum;
}

using Point = std::array<std::uint8_t, 32>;  // the lowest byte first

/// Points with which no secret can be shared (RFC 7748, 6.1), so that `age` refuses them: of order
/// 1, 2, 4 or 8. No private key belongs to them.
bool IsOfSmallOrder(Point point) {
  constexpr Point kOrder8a = {0xe0, 0xeb, 0x7a, 0x7c, 0x3b, 0x41, 0xb8, 0xae, 0x16, 0x56, 0xe3,
                              0xfa, 0xf1, 0x9f, 0xc4, 0x6a, 0xda, 0x09, 0x8d, 0xeb, 0x9c, 0x32,
                              0xb1, 0xfd, 0x86, 0x62, 0x05, 0x16, 0x5f, 0x49, 0xb8, 0x00};
  constexpr Point kOrder8b = {0x5f, 0x9c, 0x95, 0xbc, 0xa3, 0x50, 0x8c, 0x24, 0xb1, 0xd0, 0xb1,
                              0x55, 0x9c, 0x83, 0xef, 0x5b, 0x04, 0x44, 0x5c, 0xc4, 0x58, 0x1c,
                              0x8e, 0x86, 0xd8, 0x22, 0x4e, 0xdd, 0xd0, 0x9f, 0x11, 0x57};
  point.back() &= 0x7f;  // X25519 ignores the highest bit
  if (point == kOrder8a || point == kOrder8b) return true;
  // 0 and 1; the modulus 2^255 - 19, the number before it and the one after it.
  const bool is_large = point.back() == 0x7f;
  const std::uint8_t fill = is_large ? 0xff : 0;
  if (point.back() != (is_large ? 0x7f : 0) ||
      !std::all_of(point.begin() + 1, point.end() - 1, [&](auto byte) { return byte == fill; }))
    return false;
  return is_large ? point[0] >= 0xec && point[0] <= 0xee : point[0] <= 1;
}

}  // namespace

bool IsAgeRecipient(const std::string& text) {
  if (text.size() != kRecipientLength || !text.starts_with(kRecipientPrefix)) return false;
  std::uint32_t sum = 1;
  for (const char c : std::string_view("age")) sum = NextSum(sum, static_cast<unsigned>(c) >> 5);
  sum = NextSum(sum, 0);
  for (const char c : std::string_view("age")) sum = NextSum(sum, static_cast<unsigned>(c) & 31);
  constexpr std::size_t kPaddingBits = 4;  // the last bits of the 52 characters, always 0
  Point point{};
  std::size_t bit = 0;
  for (const char c : text.substr(kRecipientPrefix.size())) {
    const std::size_t value = kBech32.find(c);
    if (value == std::string_view::npos) return false;
    sum = NextSum(sum, static_cast<std::uint32_t>(value));
    for (std::size_t i = 0; i < 5 && bit < 8 * point.size() + kPaddingBits; ++i, ++bit) {
      const std::size_t digit = value >> (4 - i) & 1;
      if (bit < 8 * point.size())
        point[bit / 8] |= static_cast<std::uint8_t>(digit << (7 - bit % 8));
      else if (digit != 0)
        return false;
    }
  }
  return sum == 1 && !IsOfSmallOrder(point);
}

AgeRecipients::AgeRecipients(std::vector<std::string> keys) : keys_(std::move(keys)) {
  if (keys_.size() > kMost) throw DataError(say::backup::ManyRecipients(kMost));
  const auto wrong = std::find_if_not(keys_.begin(), keys_.end(), IsAgeRecipient);
  if (wrong != keys_.end()) throw DataError(say::backup::NoRecipientKey(wrong->substr(0, 80)));
}

AgeRecipients AgeRecipients::FromFile(const std::filesystem::path& file) {
  constexpr std::size_t kMaxFile = std::size_t{64} << 10;
  std::istringstream lines(ReadTextFile(file, kMaxFile));
  std::vector<std::string> keys;
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with('\r')) line.pop_back();
    if (!line.empty() && !line.starts_with('#')) keys.push_back(line);
  }
  if (keys.empty()) throw DataError(say::backup::NoRecipientIn(file.string()));
  return AgeRecipients(std::move(keys));
}

}  // namespace plumb
