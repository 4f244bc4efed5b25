// SPDX-License-Identifier: Apache-2.0
#include <sodium.h>

#include <array>
#include <fstream>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/bundle_copy.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using testing::TempFolder;

TEST(BundleDamageTest, WhatIsNoBundleIsUnknown) {
  const TempFolder folder;
  EXPECT_EQ(LookForDamage(folder / "none"), BundleState::kUnknown);
  for (const std::size_t size : {0U, 7U, 8U, 9U, 100U, 5000U}) {
    for (const char fill : {'\0', '\1', '\xFF'}) {
      std::ofstream(folder / "file", std::ios::binary) << std::string(size, fill);
      EXPECT_EQ(LookForDamage(folder / "file"), BundleState::kUnknown) << size;
    }
  }
}

/// As at the end of plumbd, which must not wait for gigabytes.
TEST(BundleDamageTest, AStopRequestEndsTheLookAndTheCopy) {
  const TempFolder folder;
  const std::string body = "hsqs" + std::string(100'000, 'x');
  std::string signature = "\x06\x09\x60\x86\x48\x01\x65\x03\x04\x02\x01";
  std::array<unsigned char, crypto_hash_sha256_BYTES> digest{};
  crypto_hash_sha256(digest.data(), reinterpret_cast<const unsigned char*>(body.data()),
                     body.size());
  signature.append(digest.begin(), digest.end());
  std::ofstream(folder / "bundle", std::ios::binary)
      << body << signature << std::string(7, '\0') << static_cast<char>(signature.size());
  std::stop_source stop;
  EXPECT_EQ(LookForDamage(folder / "bundle", stop.get_token()), BundleState::kWhole);
  const Descriptor file = OpenForReading(folder / "bundle");
  const auto copied = folder / "copied";
  EXPECT_TRUE(std::filesystem::exists(CopyBundle(file.get(), copied, 1 << 20, stop.get_token())));
  std::filesystem::remove_all(copied);
  (void)stop.request_stop();
  EXPECT_EQ(LookForDamage(folder / "bundle", stop.get_token()), BundleState::kUnknown);
  EXPECT_THROW((void)CopyBundle(file.get(), copied, 1 << 20, stop.get_token()), Interrupted);
  EXPECT_TRUE(std::filesystem::is_empty(copied));
}

}  // namespace
}  // namespace plumb
