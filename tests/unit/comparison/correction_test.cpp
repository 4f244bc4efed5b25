// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/correction.hpp"

#include <array>
#include <random>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "tests/unit/comparison/couch_rotation.hpp"

namespace plumb {
namespace {

using testing::CouchRotation;

const Eigen::Vector3d kIsocentre(0.5, 0.3, 0.12);

Pose Shift(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

Pose TurnAboutIsocentre(double angle_deg, const Eigen::Vector3d& axis) {
  return Eigen::Translation3d(kIsocentre) * Pose(Eigen::AngleAxisd(angle_deg * kDegree, axis)) *
         Eigen::Translation3d(-kIsocentre);
}

Correction Correct(const Pose& T_motion, MarkerKind kind = MarkerKind::kRoom,
                   PatientPosture posture = PatientPosture::kHeadFirstSupine,
                   const Pose& T_iec_reference = Pose::Identity()) {
  return CorrectionOf(T_motion, Matrix6d::Identity() * 1e-6, {0.4, 0.2, 0.1}, kIsocentre,
                      T_iec_reference, kind, posture);
}

// The six numbers in the order vertical, longitudinal, lateral, pitch, roll, yaw.
std::array<double, 6> Six(const CouchNumbers& n) {
  return {n.vertical_mm.value(),
          n.longitudinal_mm.value(),
          n.lateral_mm.value(),
          n.pitch_deg,
          n.roll_deg,
          n.yaw_deg};
}

TEST(CorrectionTest, EachOfTheSixNumbersUndoesItsOwnMotion) {
  // The body moved up, toward the gantry, to the viewer's right; it turned about X, Y, Z: apply the
  // opposite of each.
  const std::array<Pose, 6> motions = {Shift(0, 0, 0.010),
                                       Shift(0, 0.010, 0),
                                       Shift(0.010, 0, 0),
                                       TurnAboutIsocentre(10, Eigen::Vector3d::UnitX()),
                                       TurnAboutIsocentre(10, Eigen::Vector3d::UnitY()),
                                       TurnAboutIsocentre(10, Eigen::Vector3d::UnitZ())};
  for (std::size_t i = 0; i < 6; ++i) {
    const auto six = Six(Correct(motions[i]).value);
    for (std::size_t k = 0; k < 6; ++k)
      EXPECT_NEAR(six[k], k == i ? -10.0 : 0.0, 1e-9) << "motion " << i << ", number " << k;
  }
}

TEST(CorrectionTest, AnglesComeBackFromTheirRotation) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> angle(-1.4, 1.4);
  for (int trial = 0; trial < 200; ++trial) {
    const double pitch = angle(random), roll = angle(random), yaw = angle(random);
    Pose T_correction = Pose::Identity();
    T_correction.linear() = CouchRotation(pitch, roll, yaw);
    const Vector6d couch =
        CouchVector(T_correction.inverse(), Eigen::Vector3d::Zero(), Pose::Identity());
    EXPECT_NEAR(couch[3], pitch, 1e-12);
    EXPECT_NEAR(couch[4], roll, 1e-12);
    EXPECT_NEAR(couch[5], yaw, 1e-12);
  }
}

TEST(CorrectionTest, ShiftAndTurnAboutTheIsocentreUndoTheMotionInTheRoomFrame) {
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 100; ++trial) {
    Vector6d twist;
    for (int i = 0; i < 6; ++i) twist[i] = 0.3 * normal(random);
    const Pose T_motion = PoseFromTwist(twist);
    for (int i = 0; i < 6; ++i) twist[i] = normal(random);
    const Pose T_iec_reference = PoseFromTwist(twist);
    const Eigen::Vector3d isocentre_iec = T_iec_reference * kIsocentre;
    const Vector6d couch = CouchVector(T_motion, kIsocentre, T_iec_reference);
    const Pose T_applied = Eigen::Translation3d(couch.head<3>()) *
                           Eigen::Translation3d(isocentre_iec) *
                           Pose(Eigen::AngleAxisd(CouchRotation(couch[3], couch[4], couch[5]))) *
                           Eigen::Translation3d(-isocentre_iec);
    // A point of the body, moved and then corrected, is back where it was.
    const Eigen::Vector3d p(0.1, -0.2, 0.3);
    const Eigen::Vector3d back =
        T_iec_reference.inverse() * (T_applied * (T_iec_reference * (T_motion * p)));
    EXPECT_LT((back - p).norm(), 1e-12);
  }
}

TEST(CorrectionTest, TheMarkersYawAgainstTheRoomTurnsTheNumbers) {
  // The marker's x axis points to the gantry (+Y of the room): a body that moved along it has come
  // toward the gantry.
  const Pose T_iec_reference(Eigen::Translation3d(1, 2, 3) *
                             Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
  const auto six = Six(Correct(Shift(0.010, 0, 0), MarkerKind::kRoom,
                               PatientPosture::kHeadFirstSupine, T_iec_reference)
                           .value);
  EXPECT_NEAR(six[1], -10.0, 1e-9);
  EXPECT_NEAR(six[2], 0.0, 1e-9);
}

TEST(CorrectionTest, WordsFollowThePosture) {
  const Pose moved =
      Shift(-0.01, 0.01, -0.01);  // correction: to the viewer's right, away from the gantry, up
  EXPECT_EQ(Correct(moved).words[0].English(), "up");
  EXPECT_EQ(Correct(moved).words[1].English(), "away from gantry");
  // On the back with the head to the gantry, the left hand is on the right of a viewer at the feet.
  EXPECT_EQ(Correct(moved).words[2].English(), "to patient left");
  EXPECT_EQ(Correct(moved, MarkerKind::kRoom, PatientPosture::kHeadFirstProne).words[2].English(),
            "to patient right");
  EXPECT_EQ(Correct(moved, MarkerKind::kRoom, PatientPosture::kFeetFirstSupine).words[2].English(),
            "to patient right");
  EXPECT_EQ(Correct(moved, MarkerKind::kRoom, PatientPosture::kFeetFirstProne).words[2].English(),
            "to patient left");
  // The gantry end sank: lift it.
  const Pose pitched = TurnAboutIsocentre(-5, Eigen::Vector3d::UnitX());
  EXPECT_EQ(Correct(pitched).words[3].English(), "head up");
  EXPECT_EQ(
      Correct(pitched, MarkerKind::kRoom, PatientPosture::kFeetFirstSupine).words[3].English(),
      "head down");
  // Roll > 0 lowers +X, where the left side is head first supine.
  EXPECT_EQ(Correct(TurnAboutIsocentre(-5, Eigen::Vector3d::UnitY())).words[4].English(),
            "patient left side down");
  // Yaw > 0 carries the gantry end to -X, the patient's right.
  EXPECT_EQ(Correct(TurnAboutIsocentre(-5, Eigen::Vector3d::UnitZ())).words[5].English(),
            "head to patient right");
}

TEST(CorrectionTest, WithoutAPostureTheWordsAreTheRooms) {
  const auto words = [](const Pose& T_motion) {
    return CorrectionOf(T_motion, Matrix6d::Identity() * 1e-6, kIsocentre, kIsocentre,
                        Pose::Identity(), MarkerKind::kRoom, std::nullopt)
        .words;
  };
  EXPECT_EQ(words(Shift(-0.01, 0, 0))[2].English(), "to the right, facing the gantry");
  EXPECT_EQ(words(Shift(0.01, 0, 0))[2].English(), "to the left, facing the gantry");
  EXPECT_EQ(words(TurnAboutIsocentre(-5, Eigen::Vector3d::UnitX()))[3].English(), "gantry end up");
  EXPECT_EQ(words(TurnAboutIsocentre(5, Eigen::Vector3d::UnitX()))[3].English(), "gantry end down");
  // Roll > 0 turns +Z toward +X: the side at +X, right of who faces the gantry, goes down.
  EXPECT_EQ(words(TurnAboutIsocentre(-5, Eigen::Vector3d::UnitY()))[4].English(),
            "right side down, facing the gantry");
  EXPECT_EQ(words(TurnAboutIsocentre(5, Eigen::Vector3d::UnitY()))[4].English(),
            "left side down, facing the gantry");
  EXPECT_EQ(words(TurnAboutIsocentre(-5, Eigen::Vector3d::UnitZ()))[5].English(),
            "counter-clockwise from above");
  EXPECT_EQ(words(TurnAboutIsocentre(5, Eigen::Vector3d::UnitZ()))[5].English(),
            "clockwise from above");
}

TEST(CorrectionTest, CouchMarkersGivePostureOnly) {
  const Correction correction =
      Correct(Shift(0.01, 0.02, 0.03) * TurnAboutIsocentre(3, Eigen::Vector3d::UnitZ()),
              MarkerKind::kCouch);
  EXPECT_FALSE(correction.value.vertical_mm || correction.value.longitudinal_mm ||
               correction.value.lateral_mm);
  EXPECT_FALSE(correction.u95.vertical_mm || correction.u95.longitudinal_mm ||
               correction.u95.lateral_mm);
  EXPECT_NEAR(correction.value.yaw_deg, -3.0, 1e-9);
  EXPECT_EQ(correction.words[0].English(), "");
}

TEST(CorrectionTest, UncertaintyOfTheIsocentreGrowsWithItsDistanceFromTheBody) {
  // 1 mrad about z at the centroid and 1 mm of shift: an isocentre 0.5 m along x moves by 0.5 mm
  // more in y.
  Matrix6d covariance = Matrix6d::Zero();
  covariance(2, 2) = 1e-6;
  covariance.diagonal().tail<3>().setConstant(1e-6);
  const Eigen::Vector3d centroid(0.1, 0.2, 0.1);
  const Correction correction =
      CorrectionOf(Pose::Identity(), covariance, centroid, centroid + Eigen::Vector3d(0.5, 0, 0),
                   Pose::Identity(), MarkerKind::kRoom, PatientPosture::kHeadFirstSupine);
  const auto u95 = Six(correction.u95);
  EXPECT_NEAR(u95[0], 1.96, 1e-3);
  EXPECT_NEAR(u95[1], 1.96 * std::sqrt(1.25), 1e-3);
  EXPECT_NEAR(u95[2], 1.96, 1e-3);
  EXPECT_NEAR(u95[3], 0.0, 1e-6);
  EXPECT_NEAR(u95[5], 1.96e-3 / kDegree, 1e-4);
}

}  // namespace
}  // namespace plumb
