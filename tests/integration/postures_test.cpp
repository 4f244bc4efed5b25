// SPDX-License-Identifier: Apache-2.0
// A body that really lies in each of the four postures: what plan and result say where the plan
// states its posture, and where the plan has it turned end for end.
#include <array>
#include <cmath>
#include <ostream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/comparison/comparison.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "daemon/reports/plan_doubts.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "words/comparison.hpp"

namespace plumb {

/// How a test is called.
void PrintTo(PatientPosture posture, std::ostream* out) { *out << Name(posture); }

namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;
using ::testing::Contains;
using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::Not;

PatientPosture TurnedEndForEnd(PatientPosture posture) {
  switch (posture) {
    case PatientPosture::kHeadFirstSupine:
      return PatientPosture::kFeetFirstSupine;
    case PatientPosture::kHeadFirstProne:
      return PatientPosture::kFeetFirstProne;
    case PatientPosture::kFeetFirstSupine:
      return PatientPosture::kHeadFirstSupine;
    case PatientPosture::kFeetFirstProne:
      break;
  }
  return PatientPosture::kHeadFirstProne;
}

/// What the six words are after the motion of MovedBy(), by who lies how: the room's axes and the
/// patient's sides alone decide.
std::array<std::string, 6> ExpectedWords(PatientPosture posture) {
  const bool head_first =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kHeadFirstProne;
  const bool supine =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kFeetFirstSupine;
  const bool left_is_plus_x = head_first == supine;
  return {"down",
          "away from gantry",
          left_is_plus_x ? "to patient right" : "to patient left",
          head_first ? "head down" : "head up",
          left_is_plus_x ? "patient right side down" : "patient left side down",
          supine ? "head to patient left" : "head to patient right"};
}

class PosturesTest : public ::testing::TestWithParam<PatientPosture> {
 protected:
  PosturesTest() {
    SimulateOptions options;
    // 3 Hz over 12 s: as slow as a real sweep, with a tenth of its frames.
    options.frames = 36;
    options.rate_hz = 3;
    options.width = 320;
    options.height = 240;
    options.seed = 5;
    options.noise = simulated::NoiseLevel::kIdeal;
    plan_ = simulated::PlanSuite(options);
    T_world_planned_ = plan_.scenes[0].T_world_body;
    // The head of the first scene points to the gantry, and the patient's left is +X.
    T_iec_world_.linear() << 0, 1, 0, -1, 0, 0, 0, 0, 1;
    T_iec_world_.translation() = -(T_iec_world_.linear() * Centre());
    for (const simulated::Board& board : plan_.room.boards)
      if (board.id == plan_.reference_marker) T_world_marker_ = board.T_world_marker;
  }

  [[nodiscard]] const simulated::BodyModel& body() const { return *plan_.scenes[0].body; }
  /// About which the body is turned.
  [[nodiscard]] Vector3d Centre() const { return T_world_planned_ * body().centroid; }

  /// The body on the couch in a posture.
  [[nodiscard]] Pose Lying(PatientPosture posture) const {
    const bool feet_first =
        posture == PatientPosture::kFeetFirstSupine || posture == PatientPosture::kFeetFirstProne;
    const bool prone =
        posture == PatientPosture::kHeadFirstProne || posture == PatientPosture::kFeetFirstProne;
    Pose T = Pose::Identity();
    T.linear() = (AngleAxisd(feet_first ? M_PI : 0.0, Vector3d::UnitZ()) *
                  Eigen::Quaterniond(T_world_planned_.linear()) *
                  AngleAxisd(prone ? M_PI : 0.0, Vector3d::UnitX()))
                     .toRotationMatrix();
    double lowest = 0.0;
    for (const Eigen::Vector3f& vertex : body().surface.vertices)
      lowest = std::min(lowest, (T.linear() * vertex.cast<double>()).z());
    const Vector3d turned = T.linear() * body().centroid;
    T.translation() = Vector3d(Centre().x() - turned.x(), Centre().y() - turned.y(), -lowest);
    return T;
  }

  /// The same body moved by a positive amount along and about each axis of IEC 61217.
  [[nodiscard]] Pose MovedBy(const Pose& T_world_body) const {
    constexpr double kTurn = 1.5 * kDegree;
    Pose M_iec = Pose::Identity();
    M_iec.linear() = (AngleAxisd(kTurn, Vector3d::UnitZ()) * AngleAxisd(kTurn, Vector3d::UnitY()) *
                      AngleAxisd(kTurn, Vector3d::UnitX()))
                         .toRotationMatrix();
    M_iec.translation() = Vector3d(8, 8, 8) * kMillimetre;
    return T_iec_world_.inverse() * M_iec * T_iec_world_ * T_world_body;
  }

  [[nodiscard]] Scene Swept(const Pose& T_world_body, std::size_t scene) {
    plan_.scenes[scene].T_world_body = T_world_body;
    const auto source = simulated::MakeSource(plan_, scene);
    Reconstructor reconstructor(source->info(), {});
    while (const auto frame = source->Next()) reconstructor.AddFrame(*frame);
    return reconstructor.Finish();
  }

  [[nodiscard]] Comparison Compared(const Scene& reference, const Scene& current,
                                    PatientPosture posture) const {
    CompareOptions options;
    options.isocentre_m = T_world_marker_.inverse() * Centre();
    options.T_iec_reference = T_iec_world_ * T_world_marker_;
    options.posture = posture;
    return Compare(reference, current, options);
  }
  [[nodiscard]] bool PlanDoubts(const Scene& reference, PatientPosture posture) const {
    return ContradictsPosture(reference, T_iec_world_ * T_world_marker_, posture);
  }
  static std::array<std::string, 6> WordsOf(const Comparison& comparison) {
    std::array<std::string, 6> words;
    for (std::size_t i = 0; i < words.size(); ++i)
      words.at(i) = comparison.correction->words.at(i).English();
    return words;
  }

  static std::array<double, 6> NumbersOf(const Comparison& comparison) {
    const CouchNumbers& numbers = comparison.correction->value;
    return {*numbers.vertical_mm, *numbers.longitudinal_mm, *numbers.lateral_mm,
            numbers.pitch_deg,    numbers.roll_deg,         numbers.yaw_deg};
  }

  simulated::SuitePlan plan_;
  Pose T_world_planned_ = Pose::Identity();  ///< Of the first scene's body: head first, supine.
  Pose T_iec_world_ = Pose::Identity(), T_world_marker_ = Pose::Identity();
};

TEST_P(PosturesTest, WordsFollowThePlanWhereTheSurfaceAgreesAndTheRoomWhereItDoesNot) {
  const PatientPosture lies = GetParam(), turned = TurnedEndForEnd(lies);
  const Scene reference = Swept(Lying(lies), 0), current = Swept(MovedBy(Lying(lies)), 1);
  EXPECT_FALSE(PlanDoubts(reference, lies));
  EXPECT_TRUE(PlanDoubts(reference, turned));

  const Comparison right = Compared(reference, current, lies);
  ASSERT_TRUE(right.correction) << right.reasons.front().English();
  EXPECT_EQ(right.verdict, Verdict::kMove) << right.reasons.front().English();
  EXPECT_TRUE(right.body_parts->by_posture);
  EXPECT_THAT(WordsOf(right), ElementsAreArray(ExpectedWords(lies)));
  EXPECT_THAT(right.warnings, Not(Contains(say::comparison::HeadAtOtherEnd())));

  const Comparison wrong = Compared(reference, current, turned);
  ASSERT_TRUE(wrong.correction);
  EXPECT_FALSE(wrong.body_parts->by_posture);
  EXPECT_FALSE(wrong.body_parts->patient) << "no picture names a side of the patient";
  EXPECT_THAT(wrong.warnings, Contains(say::comparison::HeadAtOtherEnd()));
  for (const std::string& words : WordsOf(wrong)) {
    EXPECT_THAT(words, Not(HasSubstr("patient")));
    EXPECT_THAT(words, Not(HasSubstr("head")));
  }
  // Measured in the four postures: within 0.09 mm and 0.05 deg.
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_NEAR(NumbersOf(right).at(i), i < 3 ? -8.0 : -1.5, i < 3 ? 0.3 : 0.1) << "number " << i;
  EXPECT_EQ(NumbersOf(wrong), NumbersOf(right)) << "the posture decides words, never a number";
}

INSTANTIATE_TEST_SUITE_P(All, PosturesTest,
                         ::testing::Values(PatientPosture::kHeadFirstSupine,
                                           PatientPosture::kHeadFirstProne,
                                           PatientPosture::kFeetFirstSupine,
                                           PatientPosture::kFeetFirstProne));

/// A patient who lies the other way round today is no correction, however large.
TEST_F(PosturesTest, WhoLiesTurnedTodayGetsNoNumbers) {
  const PatientPosture planned = PatientPosture::kHeadFirstSupine;
  const Scene reference = Swept(Lying(planned), 0);
  for (const PatientPosture lies :
       {PatientPosture::kFeetFirstSupine, PatientPosture::kHeadFirstProne}) {
    const Comparison today = Compared(reference, Swept(Lying(lies), 1), planned);
    EXPECT_EQ(today.verdict, Verdict::kNoAnswer) << Name(lies);
  }
}

}  // namespace
}  // namespace plumb
