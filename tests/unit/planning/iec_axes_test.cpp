// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/iec_axes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include <Eigen/LU>

#include "algo/base/names.hpp"

namespace plumb {
namespace {

constexpr std::array kAllPostures = {
    PatientPosture::kHeadFirstSupine, PatientPosture::kHeadFirstProne,
    PatientPosture::kFeetFirstSupine, PatientPosture::kFeetFirstProne};

// Least and largest X, Y, Z of a box in the patient's axes, after the isocentre was moved to the
// origin and the patient was laid down.
struct IecBox {
  Eigen::Vector3d low, high;
};

IecBox BoxInIec(PatientPosture posture) {
  // A real structure set: its body and its isocentre, mm.
  const Eigen::Vector3d low(-229.5, -419.4, -122.4), high(244.7, -109.0, 168.6);
  const Eigen::Vector3d isocentre(72.530, -304.345, -9.309);
  const Eigen::Matrix3d R = IecFromPatient(posture);
  const Eigen::Vector3d a = R * (low - isocentre), b = R * (high - isocentre);
  return {a.cwiseMin(b), a.cwiseMax(b)};
}

void ExpectBox(PatientPosture posture, std::array<double, 6> expected) {
  const IecBox box = BoxInIec(posture);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(box.low[axis], expected[static_cast<std::size_t>(2 * axis)], 0.06)
        << Name(posture) << " axis " << axis;
    EXPECT_NEAR(box.high[axis], expected[static_cast<std::size_t>(2 * axis + 1)], 0.06)
        << Name(posture) << " axis " << axis;
  }
}

TEST(IecAxesTest, ARealBodyLiesAsInTheTableOfEachPosition) {
  ExpectBox(PatientPosture::kHeadFirstSupine, {-302.0, 172.2, -113.1, 177.9, -195.3, 115.1});
  ExpectBox(PatientPosture::kHeadFirstProne, {-172.2, 302.0, -113.1, 177.9, -115.1, 195.3});
  ExpectBox(PatientPosture::kFeetFirstSupine, {-172.2, 302.0, -177.9, 113.1, -195.3, 115.1});
  ExpectBox(PatientPosture::kFeetFirstProne, {-302.0, 172.2, -177.9, 113.1, -115.1, 195.3});
}

TEST(IecAxesTest, EachIsARotation) {
  for (const PatientPosture posture : kAllPostures) {
    const Eigen::Matrix3d R = IecFromPatient(posture);
    EXPECT_EQ((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 0.0) << Name(posture);
    EXPECT_DOUBLE_EQ(R.determinant(), 1.0) << Name(posture);
  }
}

TEST(IecAxesTest, HeadAndFaceLieAsTheNameSays) {
  const Eigen::Vector3d head = Eigen::Vector3d::UnitZ(), face = -Eigen::Vector3d::UnitY();
  for (const PatientPosture posture : kAllPostures) {
    const Eigen::Matrix3d R = IecFromPatient(posture);
    const bool head_first = Name(posture)[0] == 'H', supine = Name(posture)[2] == 'S';
    EXPECT_EQ((R * head).y(), head_first ? 1.0 : -1.0) << Name(posture) << ": Y is to the gantry";
    EXPECT_EQ((R * face).z(), supine ? 1.0 : -1.0) << Name(posture) << ": Z is up";
  }
}

TEST(IecAxesTest, OtherPositionsAreNone) {
  EXPECT_EQ(PostureOfPosition("FFP"), PatientPosture::kFeetFirstProne);
  for (const char* other : {"HFDL", "HFDR", "FFDL", "FFDR", "SITTING", "", "hfs", "HFS "})
    EXPECT_EQ(PostureOfPosition(other), std::nullopt) << other;
}

}  // namespace
}  // namespace plumb
