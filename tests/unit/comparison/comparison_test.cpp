// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "words/diagnosis.hpp"

namespace plumb {
namespace {

using test::BodyCentroid;
using test::BodyMotionAbout;
using test::BodyShape;
using test::MakeSyntheticScene;
using test::SyntheticOptions;
using testing::AllOf;
using testing::Contains;
using testing::Field;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// A reference scan's options; the body lies in the middle of the floor.
SyntheticOptions ReferenceOptions(BodyShape shape = BodyShape::kTorso, double noise_m = 0.0) {
  SyntheticOptions options;
  options.shape = shape;
  options.seed = 10;
  options.noise_m = noise_m;
  options.normal_noise_rad = noise_m > 0 ? 0.05 : 0.0;
  const double x = shape == BodyShape::kFullBody ? 1.05 : 0.6;
  options.T_reference_body =
      Pose(Eigen::Translation3d(x, 0.45, 0) * Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  return options;
}

SyntheticOptions MovedBy(const Pose& T_motion, SyntheticOptions options) {
  options.seed += 7;
  options.T_reference_body = T_motion * options.T_reference_body;
  return options;
}

Eigen::Vector3d CentroidOf(const SyntheticOptions& options) {
  return options.T_reference_body * BodyCentroid(options.shape);
}

double ErrorAt_mm(const Comparison& comparison, const Pose& T_true, const Eigen::Vector3d& p) {
  return (comparison.motion->T * p - T_true * p).norm() / kMillimetre;
}

double Angle_deg(const Comparison& comparison, const Pose& T_true) {
  return RotationAngle(comparison.motion->T * T_true.inverse()) / kDegree;
}

// Median of the known cells within 4 mm: the scans here leave pinholes and keep the highest of a
// cell's samples.
double MedianAround(const HeightMap& map, double x, double y) {
  std::vector<float> values;
  for (double dx = -0.004; dx < 0.004; dx += map.grid.step) {
    for (double dy = -0.004; dy < 0.004; dy += map.grid.step) {
      const float z = map.z[*map.grid.cell(x + dx, y + dy)];
      if (std::isfinite(z)) values.push_back(z);
    }
  }
  if (values.empty()) return std::nan("");
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// One reference for the tests that only vary the current scan: making it costs more than comparing
// it.
const Scene& PerfectReference() {
  static const Scene scene = MakeSyntheticScene(ReferenceOptions());
  return scene;
}

// The same body, scanned again and not moved.
const Scene& PerfectRepeat() {
  static const Scene scene = MakeSyntheticScene(MovedBy(Pose::Identity(), ReferenceOptions()));
  return scene;
}

TEST(ComparisonTest, FindsSmallAndLargeMotionsOfAPerfectScan) {
  struct MotionCase {
    Eigen::Vector3d shift_m;
    double yaw_deg, pitch_deg, roll_deg;
  };
  const SyntheticOptions reference = ReferenceOptions();
  const Eigen::Vector3d centroid = CentroidOf(reference);
  for (const MotionCase& c :
       {MotionCase{{0.01, -0.02, 0.005}, 3, 1, -1}, MotionCase{{0.25, 0.2, 0}, -58, 2, -3},
        MotionCase{{-0.2, -0.1, 0.02}, 60, -4, 2}}) {
    const Pose T_motion = BodyMotionAbout(centroid, c.shift_m, c.yaw_deg, c.pitch_deg, c.roll_deg);
    const Comparison comparison =
        Compare(PerfectReference(), MakeSyntheticScene(MovedBy(T_motion, reference)));
    ASSERT_TRUE(comparison.motion);
    // Measured over eight motions and two bodies: at most 0.002 mm and 0.001 deg.
    EXPECT_LT(ErrorAt_mm(comparison, T_motion, centroid), 0.01);
    EXPECT_LT(Angle_deg(comparison, T_motion), 0.005);
    EXPECT_EQ(comparison.verdict, Verdict::kMove) << comparison.reasons.at(0).English();
    // The numbers are those of the true motion at the centroid that the comparison chose.
    const Vector6d truth = CouchVector(T_motion, comparison.motion->centroid_m, Pose::Identity());
    EXPECT_NEAR(comparison.correction->value.vertical_mm.value(), truth[2] / kMillimetre, 0.02);
    EXPECT_NEAR(comparison.correction->value.yaw_deg, truth[5] / kDegree, 0.005);
  }
}

TEST(ComparisonTest, AnUnmovedBodyIsInTolerance) {
  const Comparison comparison = Compare(PerfectReference(), PerfectRepeat());
  EXPECT_EQ(comparison.verdict, Verdict::kInTolerance);
  EXPECT_THAT(comparison.motion->weak_directions, IsEmpty());
  EXPECT_GT(comparison.region->coverage, 0.99);
  EXPECT_LT(comparison.motion->residual_p95_m,
            0.0015);  // cells of 1.5 mm on flanks: measured 0.0007
}

TEST(ComparisonTest, NoisyScansWithDifferentMissingFlanksStayWithinTheirStatedUncertainty) {
  double worst_ratio = 0.0;
  for (const BodyShape shape : {BodyShape::kTorso, BodyShape::kTorsoWide}) {
    SyntheticOptions reference = ReferenceOptions(shape, 0.001);
    const Eigen::Vector3d centroid = CentroidOf(reference);
    const Pose T_motion = BodyMotionAbout(centroid, {0.08, -0.05, 0.004}, 25, 1, -1.5);
    SyntheticOptions current = MovedBy(T_motion, reference);
    reference.min_up = 0.15;
    current.min_up = 0.3;
    const Pose T_body = current.T_reference_body;
    current.hidden = [T_body](const Eigen::Vector3d& p) {
      const Eigen::Vector3d p_body = T_body.inverse() * p;
      return p.z() > 0.005 && p_body.y() > 0.13 && p_body.x() < -0.05;
    };
    const Comparison comparison =
        Compare(MakeSyntheticScene(reference), MakeSyntheticScene(current));
    ASSERT_TRUE(comparison.motion);
    // 1 mm of noise in patches of 1 cm; measured over ten seeds: RMS 0.4 mm and 0.14 deg, most of
    // it roll about the long axis.
    EXPECT_LT(ErrorAt_mm(comparison, T_motion, centroid), 1.0);
    EXPECT_LT(Angle_deg(comparison, T_motion), 0.4);
    const Pose error = comparison.motion->T * T_motion.inverse();
    const Eigen::Vector3d shift = comparison.motion->T * comparison.motion->centroid_m -
                                  T_motion * comparison.motion->centroid_m;
    Vector6d twist;
    twist << VectorFromRotation(error.linear()), shift;
    worst_ratio = std::max(
        worst_ratio, std::sqrt(twist.dot(comparison.motion->covariance.ldlt().solve(twist)) / 6));
  }
  EXPECT_LT(worst_ratio, 2.0);  // chi of 6: 95 % lie below 1.45
}

TEST(ComparisonTest, AMovedArmAndABreathingBellyDoNotDragTheBody) {
  const SyntheticOptions reference = ReferenceOptions(BodyShape::kTorso, 0.0007);
  const Eigen::Vector3d centroid = CentroidOf(reference);
  const Pose T_motion = BodyMotionAbout(centroid, {0.02, 0.03, 0}, -8);
  SyntheticOptions current = MovedBy(T_motion, reference);
  current.deform = [](const Eigen::Vector3d& p) {
    const double belly =
        std::exp(-0.5 * (std::pow((p.x() + 0.12) / 0.05, 2) + std::pow(p.y() / 0.07, 2)));
    const double shoulder = p.x() > 0.15 && p.y() > 0.1 ? 1.0 : 0.0;
    return Eigen::Vector3d(0, 0.03 * shoulder, 0.015 * belly + 0.02 * shoulder);
  };
  const Comparison comparison = Compare(MakeSyntheticScene(reference), MakeSyntheticScene(current));
  ASSERT_TRUE(comparison.motion);
  EXPECT_LT(ErrorAt_mm(comparison, T_motion, centroid),
            2.0);  // measured 1.2; the deformed third moved by 15 to 36 mm
  EXPECT_LT(Angle_deg(comparison, T_motion), 0.8);  // measured 0.5, roll about the long axis
  EXPECT_LT(comparison.motion->inlier_fraction, 0.95);
}

TEST(ComparisonTest, AFullBodyIsRegisteredToo) {
  const SyntheticOptions reference = ReferenceOptions(BodyShape::kFullBody);
  const Eigen::Vector3d centroid = CentroidOf(reference);
  const Pose T_motion = BodyMotionAbout(centroid, {-0.06, 0.04, 0}, 9);
  const Comparison comparison =
      Compare(MakeSyntheticScene(reference), MakeSyntheticScene(MovedBy(T_motion, reference)));
  ASSERT_TRUE(comparison.motion);
  EXPECT_LT(ErrorAt_mm(comparison, T_motion, centroid), 0.1);  // measured 0.01
  EXPECT_LT(Angle_deg(comparison, T_motion), 0.01);            // measured 0.001
}

TEST(ComparisonTest, TheRollOfACylinderIsNotWellSeen) {
  const SyntheticOptions reference = ReferenceOptions(BodyShape::kCylinder);
  const Pose T_motion = BodyMotionAbout(CentroidOf(reference), {0.005, 0.004, 0}, 2);
  const Comparison comparison =
      Compare(MakeSyntheticScene(reference), MakeSyntheticScene(MovedBy(T_motion, reference)));
  ASSERT_TRUE(comparison.motion);
  EXPECT_EQ(comparison.verdict, Verdict::kNoAnswer);
  // The bar lies along x: its roll is the rotation about X, which is called pitch in the room.
  EXPECT_THAT(comparison.motion->weak_directions, Contains(Field(&WeakDirection::name, "pitch")));
  EXPECT_THAT(EnglishTexts(comparison.reasons),
              Contains(HasSubstr("pitch is not well determined")));
  // What is seen is still right: heights.
  EXPECT_NEAR((comparison.motion->T * comparison.motion->centroid_m -
               T_motion * comparison.motion->centroid_m)
                  .z(),
              0.0, 1e-4);
}

TEST(ComparisonTest, APolygonLimitsTheRegionAndMovesTheIsocentre) {
  CompareOptions options;
  options.region_polygon_m = {{0.45, 0.1}, {0.8, 0.1}, {0.8, 0.8}, {0.45, 0.8}};
  const Pose T_motion = BodyMotionAbout({0.6, 0.45, 0.1}, {0.03, -0.02, 0}, 6);
  const Comparison comparison = Compare(
      PerfectReference(), MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions())), options);
  ASSERT_TRUE(comparison.motion);
  EXPECT_LT(ErrorAt_mm(comparison, T_motion, comparison.motion->centroid_m), 0.05);
  EXPECT_NEAR(comparison.correction->isocentre_m.x(), 0.625, 0.03);
  options.isocentre_m = Eigen::Vector3d(0.5, 0.4, 0.05);
  const Comparison elsewhere = Compare(PerfectReference(), PerfectRepeat(), options);
  EXPECT_EQ(elsewhere.correction->isocentre_m, *options.isocentre_m);
}

TEST(ComparisonTest, AnIsocentreFarFromTheRegionIsSaidAndOneOutOfReachRefused) {
  CompareOptions options;
  const auto at = [&](const Eigen::Vector3d& isocentre_m) {
    options.isocentre_m = isocentre_m;
    return Compare(PerfectReference(), PerfectRepeat(), options);
  };
  EXPECT_THAT(EnglishTexts(at({0.6, 1.40, 0.1}).warnings),
              Not(testing::Contains(HasSubstr("isocentre"))));
  const Comparison far = at({0.6, 1.50, 0.1});
  EXPECT_THAT(EnglishTexts(far.warnings), testing::Contains(HasSubstr("isocentre lies 1.")));
  EXPECT_NE(far.verdict, Verdict::kNoAnswer);
  const Comparison millimetres = at({600, 450, 100});
  EXPECT_EQ(millimetres.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(millimetres.reasons.front().English(), HasSubstr("millimetres?"));
  EXPECT_THAT(at({60, 45, 10}).reasons.front().English(), HasSubstr("centimetres?"));
}

TEST(ComparisonTest, ACurrentScanWithoutTheReferenceMarkerStillCompares) {
  const SyntheticOptions reference = ReferenceOptions();
  const Eigen::Vector3d centroid = CentroidOf(reference);
  const Pose T_motion = BodyMotionAbout(centroid, {0.03, 0.01, 0.002}, 10);
  SyntheticOptions current = MovedBy(T_motion, reference);
  current.T_scene_reference =
      Pose(Eigen::Translation3d(0.4, -0.3, 1.1) *
           Eigen::AngleAxisd(2.4, Eigen::Vector3d(1, 0.3, 0.1).normalized()));
  current.hidden_markers = {0};
  const Comparison comparison = Compare(PerfectReference(), MakeSyntheticScene(current));
  ASSERT_TRUE(comparison.motion);
  EXPECT_LT(ErrorAt_mm(comparison, T_motion, centroid), 0.02);
  EXPECT_LT(Angle_deg(comparison, T_motion), 0.01);
  EXPECT_EQ(comparison.verdict, Verdict::kMove);
  EXPECT_TRUE(comparison.deviation && comparison.distance);
}

TEST(ComparisonTest, DeviationIsCurrentMinusReferenceAndVanishesAfterTheCorrection) {
  const Pose T_motion = BodyMotionAbout({0.6, 0.45, 0.1}, {0, 0, 0.012}, 0);
  const Comparison comparison =
      Compare(PerfectReference(), MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions())));
  EXPECT_NEAR(MedianAround(*comparison.deviation, 0.6, 0.45), 0.012, 4e-4);
  // The slope there is 20 degrees: the nearest point lies less far than the one above.
  EXPECT_NEAR(MedianAround(*comparison.distance, 0.6, 0.45), 0.012 * std::cos(20 * kDegree), 6e-4);
  EXPECT_NEAR(MedianAround(*comparison.deviation_after, 0.6, 0.45), 0.0, 4e-4);
  EXPECT_NEAR(MedianAround(*comparison.deviation, 0.1, 0.1), 0.0, 1e-6);  // the floor did not move
  EXPECT_LT(*comparison.correction->value.vertical_mm, -11.9);
}

TEST(ComparisonTest, TheMeasuredResidualMeetsItsLimit) {
  const Scene reference = PerfectReference(), current = PerfectRepeat();
  const double residual_m = Compare(reference, current).motion->residual_p95_m;
  ASSERT_GT(residual_m, 0);
  CompareOptions options;
  options.limits.max_residual_p95_m = 1.001 * residual_m;
  EXPECT_EQ(Compare(reference, current, options).verdict, Verdict::kInTolerance);
  options.limits.max_residual_p95_m = 0.999 * residual_m;
  const Comparison refused = Compare(reference, current, options);
  EXPECT_EQ(refused.verdict, Verdict::kNoAnswer);
  EXPECT_EQ(refused.limits.max_residual_p95_m, options.limits.max_residual_p95_m);
}

TEST(ComparisonTest, EachDoubtIsNoAnswerWithItsReason) {
  const SyntheticOptions reference = ReferenceOptions();
  SyntheticOptions half = MovedBy(Pose::Identity(), reference);
  half.hidden = [](const Eigen::Vector3d& p) { return p.x() > 0.7; };
  const Comparison uncovered = Compare(PerfectReference(), MakeSyntheticScene(half));
  EXPECT_EQ(uncovered.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(uncovered.reasons.at(0).English(), HasSubstr("% of the region"));

  SyntheticOptions hole = MovedBy(Pose::Identity(), reference);
  hole.hidden = [](const Eigen::Vector3d& p) {
    return (p.head<2>() - Eigen::Vector2d(0.6, 0.45)).norm() < 0.035;
  };
  const Comparison holed = Compare(PerfectReference(), MakeSyntheticScene(hole));
  EXPECT_FALSE(holed.body_parts->hole_place.empty());
  EXPECT_THAT(holed.reasons.at(0).English(),
              AllOf(HasSubstr("hole of 63 mm in the region ("),
                    HasSubstr("(" + holed.body_parts->hole_place.English() + ")")));

  SyntheticOptions other = ReferenceOptions(BodyShape::kCylinder);
  EXPECT_EQ(Compare(PerfectReference(), MakeSyntheticScene(other)).verdict, Verdict::kNoAnswer);

  Scene lost = PerfectRepeat();
  lost.longest_lost_s = 1.5;
  EXPECT_THAT(Compare(PerfectReference(), lost).reasons.at(0).English(),
              HasSubstr("lost for 1.5 s"));
  CompareOptions paper;
  paper.preset = Preset::kPaper;
  EXPECT_EQ(Compare(PerfectReference(), PerfectRepeat(), paper).verdict, Verdict::kInTolerance);
  const Comparison lost_by_paper = Compare(PerfectReference(), lost, paper);
  EXPECT_EQ(lost_by_paper.verdict, Verdict::kNoAnswer) << "gates hold for every preset";
  EXPECT_EQ(lost_by_paper.preset, Preset::kPaper);
  EXPECT_TRUE(lost_by_paper.correction) << "the numbers are reported nevertheless";
  Scene lost_reference = PerfectReference();
  lost_reference.longest_lost_s = 1.5;
  EXPECT_THAT(Compare(lost_reference, PerfectRepeat()).reasons.at(0).English(),
              HasSubstr("in the reference scan"));

  Scene breathing = PerfectRepeat();
  breathing.breathing = Breathing{.amplitude_m = 0.009, .period_s = 4.0};
  EXPECT_THAT(Compare(PerfectReference(), breathing).reasons.at(0).English(),
              HasSubstr("chest and belly rose by 9.0 mm in the current scan"));
  EXPECT_THAT(Compare(breathing, PerfectRepeat()).reasons.at(0).English(),
              HasSubstr("in the reference scan"));

  lost.markers.clear();
  const Comparison none = Compare(PerfectReference(), lost);
  EXPECT_EQ(none.verdict, Verdict::kNoAnswer);
  EXPECT_FALSE(none.alignment || none.motion || none.correction || none.deviation);

  Scene frameless = PerfectReference();
  frameless.frame = SceneFrame::kFirstKeyframe;
  frameless.height_map.reset();
  EXPECT_THAT(Compare(frameless, PerfectReference()).reasons.at(0).English(),
              HasSubstr("did not see its reference marker"));
  frameless.frame = SceneFrame::kReferenceMarker;
  EXPECT_THAT(Compare(frameless, PerfectReference()).reasons.at(0).English(),
              HasSubstr("measured no surface around its reference marker"));

  Scene empty = PerfectReference();
  empty.cloud = {};
  empty.height_map = HeightMap(empty.height_map->grid);
  EXPECT_EQ(Compare(PerfectReference(), empty).verdict, Verdict::kNoAnswer);
  EXPECT_EQ(Compare(empty, PerfectReference()).verdict, Verdict::kNoAnswer);
}

TEST(ComparisonTest, KnowsWhatItsScansWereRefusedAndWarnedFor) {
  Scene reference = PerfectReference(), current = PerfectRepeat();
  reference.warnings = {say::diagnosis::Mirrored()};
  Comparison compared = Compare(reference, current, {});
  EXPECT_EQ(compared.verdict, Verdict::kInTolerance) << "a warning alone refuses nothing";
  EXPECT_THAT(EnglishTexts(compared.warnings),
              testing::Contains(AllOf(HasSubstr("reference scan"), HasSubstr("mirror"))));
  current.warnings = current.refusals = {say::diagnosis::DepthUnit(5.0)};
  compared = Compare(reference, current, {});
  EXPECT_EQ(compared.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(EnglishTexts(compared.reasons),
              testing::ElementsAre(AllOf(HasSubstr("current scan"), HasSubstr("depth_scale"))));
}

TEST(ComparisonTest, ScansOfDifferentClassesOfSensorsAreNotCompared) {
  Scene reference = PerfectReference(), current = PerfectRepeat();
  reference.depth_sensor = current.depth_sensor = DepthSensor::kActiveStereo;
  EXPECT_EQ(Compare(reference, current, {}).verdict, Verdict::kInTolerance);
  reference.depth_sensor.reset();
  EXPECT_EQ(Compare(reference, current, {}).verdict, Verdict::kInTolerance) << "not known";
  reference.depth_sensor = DepthSensor::kTimeOfFlight;
  const Comparison compared = Compare(reference, current, {});
  EXPECT_EQ(compared.verdict, Verdict::kNoAnswer);
  ASSERT_EQ(compared.reasons.size(), 1U);
  EXPECT_EQ(compared.reasons.front().id(), "comparison.other_depth_sensor");
}

TEST(ComparisonTest, TheSensorProfileOfEachSceneIsNamed) {
  Scene reference = PerfectReference(), current = PerfectRepeat();
  reference.sensor_profile = "unit A, 3 sweeps";
  current.markers.clear();  // No answer is enough.
  const Comparison comparison = Compare(reference, current);
  EXPECT_EQ(comparison.reference_profile, "unit A, 3 sweeps");
  EXPECT_EQ(comparison.current_profile, std::nullopt);
}

TEST(ComparisonTest, WithoutASupportOnlyADrawnRegionGetsAVerdict) {
  SyntheticOptions reference = ReferenceOptions();
  reference.hidden = [](const Eigen::Vector3d& p) {
    return p.z() < 0.02;
  };  // The floor was not scanned.
  const Scene floorless = MakeSyntheticScene(reference);
  const Comparison all =
      Compare(floorless, MakeSyntheticScene(MovedBy(Pose::Identity(), reference)));
  EXPECT_EQ(all.verdict, Verdict::kNoAnswer);
  EXPECT_THAT(all.reasons.at(0).English(),
              HasSubstr("no flat support was found in the reference scan"));
  EXPECT_TRUE(all.motion) << "the computed motion is reported";

  CompareOptions drawn;
  drawn.region_polygon_m = {{0.35, 0.25}, {0.85, 0.25}, {0.85, 0.65}, {0.35, 0.65}};
  const Comparison region =
      Compare(floorless, MakeSyntheticScene(MovedBy(Pose::Identity(), reference)), drawn);
  EXPECT_EQ(region.verdict, Verdict::kInTolerance) << region.reasons.at(0).English();
  CompareOptions paper;
  paper.preset = Preset::kPaper;
  EXPECT_EQ(
      Compare(floorless, MakeSyntheticScene(MovedBy(Pose::Identity(), reference)), paper).verdict,
      Verdict::kNoAnswer);

  // The region is the reference's: a current scan of the body alone is enough.
  EXPECT_EQ(
      Compare(PerfectReference(), MakeSyntheticScene(MovedBy(Pose::Identity(), reference))).verdict,
      Verdict::kInTolerance);
}

// The current scan holds nothing but the body, 0.3 m from where it lay: in place, most of the
// region would seem unmeasured.
TEST(ComparisonTest, CoverageIsCountedWhereTheMotionTookTheBody) {
  const SyntheticOptions reference = ReferenceOptions();
  const Pose T_motion = BodyMotionAbout(CentroidOf(reference), {0.25, 0.15, 0}, 5);
  SyntheticOptions current = MovedBy(T_motion, reference);
  current.hidden = [](const Eigen::Vector3d& p) { return p.z() < 0.02; };
  const Comparison comparison = Compare(PerfectReference(), MakeSyntheticScene(current));
  ASSERT_TRUE(comparison.region);
  EXPECT_GT(comparison.region->coverage, 0.95) << comparison.reasons.at(0).English();
  EXPECT_EQ(comparison.verdict, Verdict::kMove) << comparison.reasons.at(0).English();
}

// The half of the body at larger x rose by 8 mm, the other half stayed.
TEST(ComparisonTest, TheDrawnRegionAloneDecidesTheMotion) {
  SyntheticOptions current = MovedBy(Pose::Identity(), ReferenceOptions());
  current.deform = [](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(0, 0, p.x() > 0 ? 0.008 : 0.0);
  };
  const Scene half_risen = MakeSyntheticScene(current);
  const auto vertical_mm = [&](double x_from, double x_to) {
    CompareOptions options;
    options.region_polygon_m = {{x_from, 0.1}, {x_to, 0.1}, {x_to, 0.8}, {x_from, 0.8}};
    const Comparison comparison = Compare(PerfectReference(), half_risen, options);
    return comparison.correction ? comparison.correction->value.vertical_mm.value() : NAN;
  };
  EXPECT_NEAR(vertical_mm(0.63, 0.95), -8.0, 0.3);
  EXPECT_NEAR(vertical_mm(0.25, 0.57), 0.0, 0.3);
}

TEST(ComparisonTest, VagueMarkersMakeTheNumbersVague) {
  Scene precise = PerfectRepeat();
  Scene vague = PerfectRepeat();
  for (auto& [id, marker] : precise.markers) marker.sigma_m = 0.0003;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 0.006);
  for (auto& [id, marker] : vague.markers) {
    marker.sigma_m = 0.006;
    for (Eigen::Vector3d& corner : marker.corners)
      corner += Eigen::Vector3d(noise(random), noise(random), noise(random));
  }
  const CouchNumbers u95 = Compare(PerfectReference(), precise).correction->u95;
  const CouchNumbers vague_u95 = Compare(PerfectReference(), vague).correction->u95;
  EXPECT_GT(*vague_u95.vertical_mm, 3 * *u95.vertical_mm);
  EXPECT_GT(*vague_u95.lateral_mm, 3 * *u95.lateral_mm);
  EXPECT_GT(vague_u95.yaw_deg, 2 * u95.yaw_deg);
}

// Sigmas are rules of thumb: where many corners agree far better, the numbers are less vague, but
// not as sure as those of markers that were stated to be precise.
TEST(ComparisonTest, CornersThatAgreeSpeakAgainstVagueSigmas) {
  Scene precise = PerfectRepeat();
  Scene vague = PerfectRepeat();
  for (auto& [id, marker] : precise.markers) marker.sigma_m = 0.0003;
  for (auto& [id, marker] : vague.markers) marker.sigma_m = 0.006;
  const auto markers = [](const Scene& scene) {
    return Compare(PerfectReference(), scene).motion->uncertainty.markers;
  };
  EXPECT_GT(markers(vague)(3, 3), 4 * markers(precise)(3, 3));
  EXPECT_LT(std::sqrt(markers(vague)(3, 3)), 0.001);  // 2 mm if the sigmas alone counted.
}

// The marker's x axis points to the gantry: a shift along it is longitudinal in the room.
TEST(ComparisonTest, TheNumbersAreThoseOfTheRoomsAxes) {
  CompareOptions options;
  options.T_iec_reference = Pose(Eigen::Translation3d(1, 2, 3) *
                                 Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
  const Pose T_motion(Eigen::Translation3d(0.012, 0, 0));
  const Comparison comparison = Compare(
      PerfectReference(), MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions())), options);
  ASSERT_TRUE(comparison.correction);
  EXPECT_NEAR(comparison.correction->value.longitudinal_mm.value(), -12.0, 0.02);
  EXPECT_NEAR(comparison.correction->value.lateral_mm.value(), 0.0, 0.02);
  EXPECT_EQ(comparison.correction->words[1].English(), "away from gantry");
}

TEST(ComparisonTest, WhereTheRoomWasNeverSaidNoWordSpeaksOfIt) {
  const Pose T_motion(Eigen::Translation3d(0.012, 0.02, 0));
  const Scene moved = MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions()));
  CompareOptions options;
  const Comparison unset = Compare(PerfectReference(), moved, options);
  options.T_iec_reference = Pose::Identity();
  const Comparison set = Compare(PerfectReference(), moved, options);
  const auto said = [](const Comparison& comparison) {
    std::string text;
    for (const Message& word : comparison.correction->words) text += word.English() + "; ";
    for (const Message& reason : comparison.reasons) text += reason.English() + "; ";
    for (const BodyPart& part : comparison.body_parts->parts) text += part.name.English() + "; ";
    return text;
  };
  EXPECT_THAT(said(unset), testing::Not(HasSubstr("gantry")));
  EXPECT_THAT(said(set), HasSubstr("gantry"));
  EXPECT_FALSE(unset.body_parts->room);
  EXPECT_TRUE(set.body_parts->room);
  EXPECT_EQ(unset.correction->value.longitudinal_mm, set.correction->value.longitudinal_mm);
}

TEST(ComparisonTest, CouchMarkersRefuseShiftsAndJudgePostureOnly) {
  CompareOptions options;
  options.marker_kind = MarkerKind::kCouch;
  const Pose T_motion(Eigen::Translation3d(0.05, 0, 0));
  const Comparison comparison = Compare(
      PerfectReference(), MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions())), options);
  EXPECT_EQ(comparison.verdict, Verdict::kInTolerance);
  EXPECT_FALSE(comparison.correction->value.lateral_mm);
  EXPECT_THAT(EnglishTexts(comparison.warnings), Contains(HasSubstr("only the posture is judged")));
}

TEST(ComparisonTest, OtherMarkersAreBadInputAndBadOptionsAreTheCallersMistake) {
  Scene other = PerfectReference();
  other.room_markers.length_m = 0.1;
  EXPECT_THROW((void)Compare(PerfectReference(), other), DataError);
  other = PerfectReference();
  other.room_markers.dictionary = "DICT_4X4_50";
  EXPECT_THROW((void)Compare(PerfectReference(), other), DataError);
  CompareOptions options;
  options.region_polygon_m = {{0, 0}, {1, 1}};
  EXPECT_THROW((void)Compare(PerfectReference(), PerfectReference(), options),
               std::invalid_argument);
  options = {};
  options.limits.shift_tolerance_m = 0;
  EXPECT_THROW((void)Compare(PerfectReference(), PerfectReference(), options),
               std::invalid_argument);
}

TEST(ComparisonTest, StopsOnRequest) {
  std::stop_source stop;
  stop.request_stop();
  CompareOptions options;
  options.stop = stop.get_token();
  EXPECT_THROW((void)Compare(PerfectReference(), PerfectReference(), options), Interrupted);
}

TEST(ComparisonTest, OneThreadAndTwoGiveTheSameBits) {
  const Pose T_motion = BodyMotionAbout({0.6, 0.45, 0.1}, {0.03, -0.02, 0}, 6);
  const Scene current =
      MakeSyntheticScene(MovedBy(T_motion, ReferenceOptions(BodyShape::kTorso, 0.001)));
  const auto run = [&](std::size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                            threads);
    return Compare(PerfectReference(), current);
  };
  const Comparison one = run(1);
  const Comparison two = run(2);
  EXPECT_TRUE(one.motion->T.matrix() == two.motion->T.matrix());
  EXPECT_TRUE(one.motion->covariance == two.motion->covariance);
  EXPECT_EQ(one.motion->residual_p95_m, two.motion->residual_p95_m);
  ASSERT_TRUE(one.deformation && two.deformation);
  EXPECT_EQ(one.deformation->shifts_m, two.deformation->shifts_m);
}

}  // namespace
}  // namespace plumb
