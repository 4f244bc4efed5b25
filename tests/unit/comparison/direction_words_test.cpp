// SPDX-License-Identifier: Apache-2.0
// The words beside the six numbers, for every posture, number and sign, from a table written by
// hand: left and right of the patient are where a mistake would be dangerous.
#include <gtest/gtest.h>

#include <array>
#include <string>

#include "algo/base/units.hpp"
#include "algo/comparison/correction.hpp"
#include "tests/unit/comparison/couch_rotation.hpp"

namespace plumb {
namespace {

using testing::CouchRotation;

struct Row {
  PatientPosture posture;
  // Vertical, longitudinal, lateral, pitch, roll, yaw; each for a positive and a negative number.
  std::array<std::array<const char*, 2>, 6> words;
};

constexpr std::array<const char*, 2> kVertical = {"up", "down"};
constexpr std::array<const char*, 2> kLongitudinal = {"toward gantry", "away from gantry"};
constexpr std::array<const char*, 2> kToLeft = {"to patient left", "to patient right"};
constexpr std::array<const char*, 2> kToRight = {"to patient right", "to patient left"};
constexpr std::array<const char*, 2> kHeadUp = {"head up", "head down"};
constexpr std::array<const char*, 2> kHeadDown = {"head down", "head up"};
constexpr std::array<const char*, 2> kLeftDown = {"patient left side down",
                                                  "patient right side down"};
constexpr std::array<const char*, 2> kRightDown = {"patient right side down",
                                                   "patient left side down"};
constexpr std::array<const char*, 2> kHeadToLeft = {"head to patient left",
                                                    "head to patient right"};
constexpr std::array<const char*, 2> kHeadToRight = {"head to patient right",
                                                     "head to patient left"};

// Facing the gantry: +X to the right, +Y to the gantry, +Z up. The patient's left is +X head first
// supine and feet first prone, -X in the two other postures. Positive pitch lifts the end at the
// gantry, positive roll lowers +X, positive yaw carries the end at the gantry to -X.
constexpr std::array<Row, 4> kTable = {
    Row{PatientPosture::kHeadFirstSupine,
        {kVertical, kLongitudinal, kToLeft, kHeadUp, kLeftDown, kHeadToRight}},
    Row{PatientPosture::kHeadFirstProne,
        {kVertical, kLongitudinal, kToRight, kHeadUp, kRightDown, kHeadToLeft}},
    Row{PatientPosture::kFeetFirstSupine,
        {kVertical, kLongitudinal, kToRight, kHeadDown, kRightDown, kHeadToRight}},
    Row{PatientPosture::kFeetFirstProne,
        {kVertical, kLongitudinal, kToLeft, kHeadDown, kLeftDown, kHeadToLeft}}};

// A motion of the body that one of the six numbers alone puts right.
Pose MotionFor(int number, double sign) {
  const double shift = sign * 10 * kMillimetre, turn = sign * 2 * kDegree;
  Pose apply = Pose::Identity();
  if (number == 0) apply.translation().z() = shift;
  if (number == 1) apply.translation().y() = shift;
  if (number == 2) apply.translation().x() = shift;
  if (number == 3) apply.linear() = CouchRotation(turn, 0, 0);
  if (number == 4) apply.linear() = CouchRotation(0, turn, 0);
  if (number == 5) apply.linear() = CouchRotation(0, 0, turn);
  return apply.inverse();
}

TEST(CorrectionWordsTest, EveryPostureNumberAndSignHasItsWords) {
  for (const Row& row : kTable) {
    for (int number = 0; number < 6; ++number) {
      for (const double sign : {1.0, -1.0}) {
        const Correction correction = CorrectionOf(
            MotionFor(number, sign), Matrix6d::Identity() * 1e-8, Eigen::Vector3d::Zero(),
            Eigen::Vector3d::Zero(), Pose::Identity(), MarkerKind::kRoom, row.posture);
        const auto i = static_cast<std::size_t>(number);
        EXPECT_EQ(correction.words[i].English(), row.words[i][sign > 0 ? 0 : 1])
            << Name(row.posture) << ", number " << number << ", sign " << sign;
      }
    }
  }
}

// Where the room's directions are not set: `turn_deg` from the marker's y axis to the head,
// counter- clockwise from above; the plan's "head first" says nothing then, supine and prone do.
std::array<std::string, 6> WithoutRoom(double turn_deg, PatientPosture posture, double sign,
                                       MarkerKind kind = MarkerKind::kRoom) {
  const bool is_supine =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kFeetFirstSupine;
  const Eigen::Rotation2Dd turn(turn_deg * kDegree);
  const PatientAxes patient = {turn * Eigen::Vector2d::UnitY(),
                               turn * Eigen::Vector2d(is_supine ? 1 : -1, 0)};
  std::array<std::string, 6> words;
  for (int number = 0; number < 6; ++number) {
    words[static_cast<std::size_t>(number)] =
        CorrectionOf(MotionFor(number, sign), Matrix6d::Identity() * 1e-8, Eigen::Vector3d::Zero(),
                     Eigen::Vector3d::Zero(), std::nullopt, kind, posture, patient)
            .words[static_cast<std::size_t>(number)]
            .English();
  }
  return words;
}

TEST(CorrectionWordsTest, WithoutARoomTheWordsAreThePatients) {
  using Words = std::array<std::string, 6>;
  constexpr auto kSupine = PatientPosture::kHeadFirstSupine;
  constexpr auto kProne = PatientPosture::kHeadFirstProne;
  const Words along = {"up (anterior)", "toward the head",        "to patient left",
                       "head up",       "patient left side down", "head to patient right"};
  EXPECT_EQ(WithoutRoom(0, kSupine, 1), along);
  EXPECT_EQ(WithoutRoom(0, PatientPosture::kFeetFirstSupine, 1), along);
  EXPECT_EQ(WithoutRoom(20, kSupine, 1), along);
  EXPECT_EQ(WithoutRoom(0, kSupine, -1),
            (Words{"down (posterior)", "toward the feet", "to patient right", "head down",
                   "patient right side down", "head to patient left"}));
  EXPECT_EQ(WithoutRoom(0, kProne, 1),
            (Words{"up (posterior)", "toward the head", "to patient right", "head up",
                   "patient right side down", "head to patient left"}));
  // The head lies at -X: then a supine person's left hand lies at +Y.
  EXPECT_EQ(WithoutRoom(90, kSupine, 1),
            (Words{"up (anterior)", "to patient left", "toward the feet", "patient right side down",
                   "head up", "head to patient right"}));
  EXPECT_EQ(WithoutRoom(45, kSupine, 1),
            (Words{"up (anterior)", "toward the head and patient left",
                   "toward the feet and patient left", "head and patient left side up",
                   "head and patient right side up", "head to patient right"}));
  const Words posture_only = WithoutRoom(0, kSupine, 1, MarkerKind::kCouch);
  EXPECT_EQ(posture_only[0] + posture_only[1] + posture_only[2], "");
  EXPECT_EQ(posture_only[3], "head up");
}

TEST(CorrectionWordsTest, WithoutARoomNoWordSpeaksOfCouchOrGantry) {
  for (const double sign : {1.0, -1.0}) {
    for (int number = 0; number < 6; ++number) {
      const auto i = static_cast<std::size_t>(number);
      const auto words = [&](const std::optional<Pose>& T_iec_reference) {
        return CorrectionOf(MotionFor(number, sign), Matrix6d::Identity() * 1e-8,
                            Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), T_iec_reference,
                            MarkerKind::kRoom, std::nullopt)
            .words[i]
            .English();
      };
      EXPECT_EQ(words(std::nullopt).find("gantry"), std::string::npos) << words(std::nullopt);
      EXPECT_FALSE(words(std::nullopt).empty());
      // Set to the identity, the room is known all the same.
      EXPECT_EQ(words(Pose::Identity()).find("gantry") != std::string::npos,
                number > 0 && number < 5)
          << words(Pose::Identity());
    }
  }
}

}  // namespace
}  // namespace plumb
