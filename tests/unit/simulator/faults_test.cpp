// SPDX-License-Identifier: Apache-2.0
// Each fault changes what it says, and with a fault off nothing else has changed.
#include "drivers/simulator/sensor/faults.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>

#include <Eigen/Dense>

#include "algo/base/units.hpp"
#include "drivers/simulator/sensor/color_camera.hpp"
#include "drivers/simulator/sensor/depth_camera.hpp"
#include "drivers/simulator/sensor/noise_field.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/unit/simulator/simulated_support.hpp"

namespace plumb::simulated {
namespace {

constexpr double kAbove_m = 0.80;

SensorUnit IdealWith(const FaultSet& faults, std::uint64_t unit = 3) {
  return MakeSensorUnit(NoiseLevel::kIdeal, unit, 160, 120, faults);
}

DepthShot LookDown(const SensorUnit& unit, double height = kAbove_m) {
  const World world = BallWorld({0, 0, -0.5});
  return DepthCamera(unit).Render(world, Trajectory(Standing(height)), 2.0, 7);
}

// Relative error of the measured depth of every pixel.
Eigen::VectorXd RelativeErrors(const DepthShot& shot) {
  Eigen::VectorXd errors(static_cast<Eigen::Index>(shot.true_m.total()));
  Eigen::Index i = 0;
  for (int y = 0; y < shot.true_m.rows; ++y) {
    for (int x = 0; x < shot.true_m.cols; ++x)
      errors[i++] = shot.measured_m.at<float>(y, x) / shot.true_m.at<float>(y, x) - 1.0;
  }
  return errors;
}

double Rms(const Eigen::VectorXd& values) {
  return std::sqrt(values.squaredNorm() / static_cast<double>(values.size()));
}

// What the best product polynomial of the image position, of these orders, leaves of an image.
Eigen::VectorXd LeftByPolynomial(const Eigen::VectorXd& image, int width, int height, int across,
                                 int down) {
  Eigen::MatrixXd terms(image.size(), (across + 1) * (down + 1));
  Eigen::Index row = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++row) {
      const double u = std::acos((2.0 * x - width + 1) / width);
      const double v = std::acos((2.0 * y - height + 1) / height);
      for (int i = 0; i <= across; ++i) {
        for (int j = 0; j <= down; ++j)
          terms(row, i * (down + 1) + j) = std::cos(i * u) * std::cos(j * v);  // Chebyshev.
      }
    }
  }
  const Eigen::VectorXd best = (terms.transpose() * terms).ldlt().solve(terms.transpose() * image);
  return image - terms * best;
}

TEST(FaultsTest, NamesAreUniqueAndCanBeParsed) {
  std::set<std::string> names;
  for (const FaultEntry& entry : AllFaults()) {
    EXPECT_TRUE(names.insert(std::string(entry.name)).second) << entry.name;
    EXPECT_EQ(ParseFault(entry.name), entry.fault);
    EXPECT_FALSE(entry.about.empty());
  }
  EXPECT_FALSE(ParseFault("depth"));
  EXPECT_FALSE(ParseFault(""));
  EXPECT_EQ(FaultSet().With(Fault::kTremble).Names(), std::vector<std::string>{"tremble"});
}

TEST(FaultsTest, LevelsAddFaults) {
  EXPECT_EQ(FaultsOf(NoiseLevel::kIdeal), FaultSet());
  const FaultSet mild = MildFaults(NoiseLevel::kNominal);
  const FaultSet nominal = FaultsOf(NoiseLevel::kNominal);
  const FaultSet hard = FaultsOf(NoiseLevel::kHard);
  for (const FaultEntry& entry : AllFaults()) {
    EXPECT_LE(mild.Has(entry.fault), nominal.Has(entry.fault)) << entry.name;
    EXPECT_LE(nominal.Has(entry.fault), hard.Has(entry.fault)) << entry.name;
  }
  EXPECT_TRUE(nominal.Has(Fault::kDepthField));
  EXPECT_FALSE(mild.Has(Fault::kDepthField));
}

TEST(FaultsTest, OneFaultOffLeavesTheRestOfTheUnit) {
  const FaultSet all = FaultsOf(NoiseLevel::kNominal);
  const SensorUnit whole = MakeSensorUnit(NoiseLevel::kNominal, 9, 640, 480, all);
  const SensorUnit straight =
      MakeSensorUnit(NoiseLevel::kNominal, 9, 640, 480, all.With(Fault::kDepthScale, false));
  EXPECT_NE(whole.depth_scale_error, 0.0);
  EXPECT_EQ(straight.depth_scale_error, 0.0);
  EXPECT_EQ(straight.depth_bow_per_m, 0.0);
  EXPECT_EQ(whole.color_true, straight.color_true);
  EXPECT_EQ(whole.color_written, straight.color_written);
  EXPECT_EQ(whole.depth_bend.field_rms, straight.depth_bend.field_rms);
  EXPECT_EQ(whole.depth_delay_s, straight.depth_delay_s);
  EXPECT_EQ(whole.depth_readout_s, straight.depth_readout_s);
  EXPECT_EQ(whole.tone.kind, straight.tone.kind);
  const SensorUnit calibrated =
      MakeSensorUnit(NoiseLevel::kNominal, 9, 640, 480, all.With(Fault::kCalibration, false));
  EXPECT_EQ(whole.color_true, calibrated.color_true);
  EXPECT_EQ(calibrated.color_true.fx, calibrated.color_written.fx);
  EXPECT_EQ(calibrated.color_true.distortion[0], calibrated.color_written.distortion[0]);
  EXPECT_TRUE(calibrated.T_color_depth_true.isApprox(calibrated.T_color_depth_assumed, 0.0));
}

TEST(FaultsTest, EveryMildFaultSwitchesOffWhatItNames) {
  const FaultSet mild = MildFaults(NoiseLevel::kNominal);
  const auto without = [&](Fault fault) {
    return MakeSensorUnit(NoiseLevel::kNominal, 9, 640, 480, mild.With(fault, false));
  };
  const SensorUnit all = MakeSensorUnit(NoiseLevel::kNominal, 9, 640, 480);
  EXPECT_GT(all.axial_noise, 0.0);
  EXPECT_EQ(without(Fault::kDepthNoise).axial_noise, 0.0);
  EXPECT_TRUE(all.quantised);
  EXPECT_FALSE(without(Fault::kQuantisation).quantised);
  EXPECT_GT(all.projector_baseline_m, 0.0);
  EXPECT_EQ(without(Fault::kShadow).projector_baseline_m, 0.0);
  EXPECT_GT(all.dropout, 0.0);
  EXPECT_EQ(without(Fault::kDropouts).dropout, 0.0);
  EXPECT_GT(all.readout_s, 0.0);
  EXPECT_EQ(without(Fault::kRollingShutter).readout_s, 0.0);
  EXPECT_EQ(without(Fault::kRollingShutter).depth_readout_s, 0.0);
  EXPECT_GT(all.exposure_s, 0.0);
  EXPECT_EQ(without(Fault::kMotionBlur).exposure_s, 0.0);
  EXPECT_GT(all.depth_delay_s, 0.0);
  EXPECT_EQ(without(Fault::kDelays).depth_delay_s, 0.0);
  EXPECT_GT(all.lens_blur_px, 0.0);
  EXPECT_EQ(without(Fault::kOptics).lens_blur_px, 0.0);
  EXPECT_GT(all.shot_noise, 0.0);
  EXPECT_EQ(without(Fault::kImageNoise).shot_noise, 0.0);
  EXPECT_GT(all.jpeg_quality, 0);
  EXPECT_EQ(without(Fault::kJpeg).jpeg_quality, 0);
}

TEST(FaultsTest, TheDepthFieldHasItsSizeAndNoLowPolynomialFollowsIt) {
  for (std::uint64_t unit = 1; unit <= 12; ++unit) {
    const SensorUnit bent = IdealWith(FaultSet().With(Fault::kDepthField), unit);
    EXPECT_GE(bent.depth_bend.field_rms, 0.0010);
    EXPECT_LE(bent.depth_bend.field_rms, 0.0020);
    const Eigen::VectorXd errors = RelativeErrors(LookDown(bent));
    EXPECT_NEAR(Rms(errors), bent.depth_bend.field_rms, 2e-6) << unit;
    // Scale, offset, bow and slopes are polynomials of order 2 in all; these are of order 5 x 4.
    const double left = Rms(LeftByPolynomial(errors, 160, 120, 5, 4)) / Rms(errors);
    EXPECT_GT(left, 0.05) << unit;
    EXPECT_GT(Rms(LeftByPolynomial(errors, 160, 120, 2, 2)) / Rms(errors), 0.25) << unit;
  }
}

TEST(FaultsTest, TheDepthFieldIsTheSameAtEveryDepthUnlessItsChangeIsOn) {
  const auto change = [](const FaultSet& faults) {
    const SensorUnit unit = IdealWith(faults);
    return Rms(RelativeErrors(LookDown(unit, 0.6)) - RelativeErrors(LookDown(unit, 1.2)));
  };
  EXPECT_LT(change(FaultSet().With(Fault::kDepthField)), 1e-6);
  const FaultSet changing = FaultSet().With(Fault::kDepthField).With(Fault::kDepthFieldChange);
  const double rms = IdealWith(changing).depth_bend.change_rms;
  // s(z) goes from -3/7 to +3/7 between 0.6 and 1.2 m.
  EXPECT_NEAR(change(changing), 6.0 / 7.0 * rms, 0.02 * rms);
}

TEST(FaultsTest, TheRadialErrorGrowsFromTheMiddleToTheCorner) {
  const SensorUnit unit = IdealWith(FaultSet().With(Fault::kDepthRadial));
  const DepthBend& bend = unit.depth_bend;
  EXPECT_GE(std::abs(bend.radial), 0.002);
  EXPECT_LE(std::abs(bend.radial), 0.004);
  const DepthShot shot = LookDown(unit);
  for (int y = 0; y < 120; y += 11) {
    for (int x = 0; x < 160; x += 11) {
      const double r2 = (std::pow(x - 79.5, 2) + std::pow(y - 59.5, 2)) / (80.0 * 80 + 60 * 60);
      const double expected =
          bend.radial * ((1 - bend.radial_quartic) * r2 + bend.radial_quartic * r2 * r2);
      EXPECT_NEAR(shot.measured_m.at<float>(y, x) / shot.true_m.at<float>(y, x) - 1, expected,
                  1e-6);
    }
  }
}

TEST(FaultsTest, ToneCurvesOfUnitsDifferAndRise) {
  std::set<ToneCurve::Kind> kinds;
  for (std::uint64_t unit = 1; unit <= 20; ++unit) {
    const ToneCurve tone = IdealWith(FaultSet().With(Fault::kToneCurve), unit).tone;
    kinds.insert(tone.kind);
    EXPECT_NEAR(tone.Encode(0.0), 0.0, 1e-6);
    EXPECT_NEAR(tone.Encode(1.0), 1.0, 1e-6);
    for (int i = 1; i <= 100; ++i) EXPECT_GT(tone.Encode(i / 100.0), tone.Encode((i - 1) / 100.0));
    if (tone.kind == ToneCurve::Kind::kPower) {
      EXPECT_GE(tone.gamma, 1.6);
      EXPECT_LE(tone.gamma, 2.8);
    }
  }
  EXPECT_EQ(kinds.size(), 4U);
}

TEST(FaultsTest, TheImageIsTheLightThroughTheUnitsToneCurve) {
  const World world = BallWorld({0, 0, -0.5});
  const Trajectory trajectory(Standing(kAbove_m));
  SensorUnit unit = IdealWith({});
  unit.tone = {.kind = ToneCurve::Kind::kLinear};
  const cv::Mat light = ColorCamera(unit).Render(world, trajectory, 2.0, 1);
  for (const ToneCurve& tone : {ToneCurve{.kind = ToneCurve::Kind::kPower, .gamma = 2.6},
                                ToneCurve{.kind = ToneCurve::Kind::kSrgb},
                                ToneCurve{.kind = ToneCurve::Kind::kSShaped, .contrast = 0.5}}) {
    unit.tone = tone;
    const cv::Mat image = ColorCamera(unit).Render(world, trajectory, 2.0, 1);
    for (int y = 0; y < 120; y += 13) {
      for (int x = 0; x < 160; x += 13) {
        const double linear = light.at<cv::Vec3b>(y, x)[1] / 255.0;
        const double low = 255 * tone.Encode(linear - 0.6 / 255);
        const double high = 255 * tone.Encode(linear + 0.6 / 255);
        EXPECT_GE(image.at<cv::Vec3b>(y, x)[1], std::floor(low));
        EXPECT_LE(image.at<cv::Vec3b>(y, x)[1], std::ceil(high));
      }
    }
  }
}

TEST(FaultsTest, ATremblingHandHasItsSizeAndSpeed) {
  SweepOptions sweep;
  sweep.seed = 5;
  const Trajectory steady(sweep);
  sweep.tremble_m = 0.004;
  sweep.tremble_rad = 0.4 * kDegree;
  const Trajectory trembling(sweep);
  double shift = 0, turn = 0, speed = 0;
  constexpr int kSamples = 4000;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int i = 0; i < kSamples; ++i) {
    const double time = 40.0 * i / kSamples;
    const Pose a = steady.T_world_camera(time);
    const Pose b = trembling.T_world_camera(time);
    const Eigen::Vector3d away = b.translation() - a.translation();
    shift += away.squaredNorm() / kSamples;
    turn += std::pow(RotationAngle(a.inverse() * b), 2) / kSamples;
    if (i > 0) speed += ((away - last) * (kSamples / 40.0)).squaredNorm() / kSamples;
    last = away;
  }
  EXPECT_NEAR(std::sqrt(shift), 0.004, 0.0004);
  // An operator who swings the sensor to the side turns it back towards the scene, so a shift is
  // also a turn, and the limit is a little larger.
  EXPECT_NEAR(std::sqrt(turn), 0.4 * kDegree, 0.1 * kDegree);
  EXPECT_GT(std::sqrt(speed), 0.05);
  EXPECT_LT(std::sqrt(speed), 0.15);
}

TEST(FaultsTest, TheHandTremblesWhereItsFaultIsOn) {
  const auto sweep = [](const FaultSet& faults) {
    return PlanSuite({.suite = "demo", .out = {}, .seed = 4, .faults = faults})
        .scenes.front()
        .sweep.motion;
  };
  const FaultSet nominal = FaultsOf(NoiseLevel::kNominal);
  const SweepOptions on = sweep(nominal);
  const SweepOptions off = sweep(nominal.With(Fault::kTremble, false));
  EXPECT_DOUBLE_EQ(on.tremble_m, 0.004);
  EXPECT_DOUBLE_EQ(on.tremble_rad, 0.4 * kDegree);
  EXPECT_EQ(off.tremble_m, 0.0);
  EXPECT_EQ(off.tremble_rad, 0.0);
  EXPECT_EQ(on.seed, off.seed);
  EXPECT_EQ(on.swing_m, off.swing_m);
}

}  // namespace
}  // namespace plumb::simulated
