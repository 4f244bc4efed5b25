// SPDX-License-Identifier: Apache-2.0
#include "daemon/planning/patient_hash.hpp"

#include <gtest/gtest.h>

namespace plumb {
namespace {

const std::string kKey(kPatientKeyBytes, 'k'), kOtherKey(kPatientKeyBytes, 'o');

TEST(PatientHashTest, TheSameIdIsTheSamePatientAndIsNotInTheHash) {
  const std::string hash = PatientHash(kKey, "4711");
  EXPECT_EQ(hash.find("4711"), std::string::npos);
  EXPECT_EQ(ComparePatientHashes(hash, PatientHash(kKey, " 4711  ")), SamePatient::kSame)
      << "spaces around it do not count";
  EXPECT_EQ(ComparePatientHashes(hash, PatientHash(kKey, "4712")), SamePatient::kOther);
  EXPECT_EQ(ComparePatientHashes(hash, PatientHash(kKey, "47 11")), SamePatient::kOther);
}

TEST(PatientHashTest, WhatCannotBeComparedIsUnknown) {
  const std::string hash = PatientHash(kKey, "4711");
  EXPECT_EQ(ComparePatientHashes(hash, PatientHash(kOtherKey, "4711")), SamePatient::kUnknown);
  for (const char* none : {"", "  "}) EXPECT_EQ(PatientHash(kKey, none), "") << none;
  EXPECT_EQ(ComparePatientHashes(hash, ""), SamePatient::kUnknown);
  EXPECT_EQ(ComparePatientHashes("", ""), SamePatient::kUnknown);
  EXPECT_EQ(PatientHash("short", "4711"), "") << "a key that is none";
}

}  // namespace
}  // namespace plumb
