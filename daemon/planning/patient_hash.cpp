// SPDX-License-Identifier: Apache-2.0
#include "daemon/planning/patient_hash.hpp"

#include <sodium.h>

#include <array>

namespace plumb {
namespace {

constexpr std::size_t kMarkLetters = 16;

std::string HexOfKeyed(std::string_view key, std::string_view text) {
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> code{};
  crypto_auth_hmacsha256(code.data(), reinterpret_cast<const unsigned char*>(text.data()),
                         text.size(), reinterpret_cast<const unsigned char*>(key.data()));
  std::array<char, 2 * crypto_auth_hmacsha256_BYTES + 1> hex{};
  return sodium_bin2hex(hex.data(), hex.size(), code.data(), code.size());
}

}  // namespace

std::string MakePatientKey() {
  std::string key(kPatientKeyBytes, '\0');
  randombytes_buf(key.data(), key.size());
  return key;
}

std::string PatientHash(std::string_view key, std::string_view patient_id) {
  static_assert(kPatientKeyBytes == crypto_auth_hmacsha256_KEYBYTES);
  const std::size_t first = patient_id.find_first_not_of(' ');
  if (key.size() != kPatientKeyBytes || first == std::string_view::npos) return {};
  const std::size_t last = patient_id.find_last_not_of(' ');
  // The mark is of a text that no ID can be: a backslash separates values in DICOM.
  return HexOfKeyed(key, "\\key").substr(0, kMarkLetters) + ":" +
         HexOfKeyed(key, patient_id.substr(first, last - first + 1));
}

SamePatient ComparePatientHashes(std::string_view a, std::string_view b) {
  if (a.empty() || b.empty() || a.substr(0, kMarkLetters) != b.substr(0, kMarkLetters))
    return SamePatient::kUnknown;
  return a == b ? SamePatient::kSame : SamePatient::kOther;
}

}  // namespace plumb
