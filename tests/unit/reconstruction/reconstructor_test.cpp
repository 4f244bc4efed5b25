// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/reconstructor.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"
#include "tests/unit/tracking/ball_sweep.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

constexpr int kNumFrames = 16;

class ReconstructorTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { sweep_ = new BallSweep(MakeBallSweep(kNumFrames)); }
  static void TearDownTestSuite() { delete sweep_; }
  static const BallSweep& sweep() { return *sweep_; }

  static Scene Reconstruct(const ReconstructorOptions& options) {
    Reconstructor reconstructor(sweep().info, options);
    for (const Frame& frame : sweep().frames) reconstructor.AddFrame(frame);
    return reconstructor.Finish();
  }

  // Message of the DataError that finishing these frames gives; empty if none.
  static std::string Refusal(const std::vector<Frame>& frames) {
    Reconstructor reconstructor(sweep().info, {});
    try {
      for (const Frame& frame : frames) reconstructor.AddFrame(frame);
      static_cast<void>(reconstructor.Finish());
    } catch (const DataError& error) {
      return error.what();
    }
    return {};
  }

  static BallSweep* sweep_;
};
BallSweep* ReconstructorTest::sweep_ = nullptr;

// Distance of the cloud's points that belong to the ball's upper part from the true ball.
double BallRms(const BallSweep& sweep, const PointCloud& cloud, int& count) {
  const Eigen::Vector3d centre = sweep.T_world_reference.inverse() * sweep.ball_centre;
  double sum = 0;
  count = 0;
  for (const Eigen::Vector3f& point : cloud.points) {
    const Eigen::Vector3d p = point.cast<double>();
    if ((p - centre).norm() > kSweptBallRadius + 0.02 || p.z() < centre.z() + 0.03) continue;
    const double error = (p - centre).norm() - kSweptBallRadius;
    sum += error * error;
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 1.0;
}

TEST_F(ReconstructorTest, SceneOfTheBallIsTrue) {
  const Scene scene = Reconstruct({});
  EXPECT_EQ(scene.frame, SceneFrame::kReferenceMarker);
  EXPECT_EQ(scene.frames_total, kNumFrames);
  EXPECT_EQ(scene.frames_tracked, kNumFrames);
  EXPECT_EQ(scene.trajectory.size(), static_cast<std::size_t>(kNumFrames));
  EXPECT_EQ(scene.longest_lost_s, 0.0);
  EXPECT_EQ(scene.cloud.colors.size(), scene.cloud.size());
  int count = 0;
  const double rms = BallRms(sweep(), scene.cloud, count);
  double worst_path = 0;
  for (std::size_t i = 0; i < scene.trajectory.size(); ++i) {
    const Pose T_true = sweep().T_world_reference.inverse() * sweep().T_world_color[i];
    worst_path = std::max(
        worst_path, (T_true.inverse() * scene.trajectory[i].T_world_camera).translation().norm());
  }
  ASSERT_TRUE(scene.height_map.has_value());
  const Eigen::Vector3d centre = sweep().T_world_reference.inverse() * sweep().ball_centre;
  const auto cell = scene.height_map->grid.cell(centre.x(), centre.y());
  ASSERT_TRUE(cell.has_value());
  const double top = scene.height_map->z[*cell];
  fmt::print("ball {:.2e} m rms of {} points, path {:.2e} m, top {:.4f} of {:.4f} m\n", rms, count,
             worst_path, top, centre.z() + kSweptBallRadius);
  EXPECT_GT(count, 1000);
  EXPECT_LT(rms, 0.00045);                                  // Measured: 0.37 mm.
  EXPECT_LT(worst_path, 0.002);                             // Measured: 1.3 mm.
  EXPECT_NEAR(top, centre.z() + kSweptBallRadius, 0.0005);  // Measured: 0.0 mm.
  EXPECT_FALSE(scene.mesh.triangles.empty());
}

TEST_F(ReconstructorTest, WithoutMarkersTheFirstKeyframeIsTheFrame) {
  ReconstructorOptions options;
  options.keep_color = false;
  options.use_markers = false;
  const Scene scene = Reconstruct(options);
  EXPECT_EQ(scene.frame, SceneFrame::kFirstKeyframe);
  EXPECT_FALSE(scene.height_map.has_value());
  EXPECT_TRUE(scene.mesh.triangles.empty());
  EXPECT_TRUE(scene.markers.empty());
  EXPECT_TRUE(scene.cloud.colors.empty()) << "colours were to be left out";
  EXPECT_GT(scene.cloud.size(), 1000U);
  EXPECT_LT(scene.trajectory.front().T_world_camera.translation().norm(), 0.002);
  ASSERT_FALSE(scene.warnings.empty());
  EXPECT_THAT(scene.warnings.back().English(), HasSubstr("no marker was seen"));
}

TEST_F(ReconstructorTest, KeyframesAreAsFarApartAsAskedFor) {
  ReconstructorOptions options;
  std::vector<std::size_t> num_keyframes;
  for (const double spacing : {0.5, 1.0, 2.0}) {
    options.keyframe_spacing = spacing;
    num_keyframes.push_back(Reconstruct(options).keyframes.size());
  }
  EXPECT_GT(num_keyframes[0], num_keyframes[1]);
  EXPECT_GT(num_keyframes[1], num_keyframes[2]);
}

TEST_F(ReconstructorTest, ALongSweepIsSolvedWithABoundedNumberOfKeyframes) {
  const BallSweep long_sweep = MakeBallSweep(48);
  const auto reconstruct = [&](std::size_t max_images, std::size_t max_keyframes) {
    ReconstructorOptions options;
    options.keyframe_spacing = 0.5;
    options.max_images = max_images;
    options.max_keyframes = max_keyframes;
    Reconstructor reconstructor(long_sweep.info, options);
    for (const Frame& frame : long_sweep.frames) reconstructor.AddFrame(frame);
    return reconstructor.Finish();
  };
  const Scene all = reconstruct(96, 128);
  const Scene bounded = reconstruct(14, 16);
  ASSERT_GT(all.keyframes.size(), 17U);
  EXPECT_EQ(bounded.keyframes.size(), 16U);
  ASSERT_EQ(bounded.trajectory.size(), all.trajectory.size());
  double farthest_m = 0;
  for (std::size_t i = 0; i < all.trajectory.size(); ++i) {
    EXPECT_EQ(bounded.trajectory[i].time_s, all.trajectory[i].time_s);
    farthest_m = std::max(farthest_m, (bounded.trajectory[i].T_world_camera.translation() -
                                       all.trajectory[i].T_world_camera.translation())
                                          .norm());
  }
  fmt::print("{} keyframes, paths {:.2e} m apart\n", all.keyframes.size(), farthest_m);
  EXPECT_LT(farthest_m, 0.001);
}

TEST_F(ReconstructorTest, SaysHowWellTheSweepShowedEachTermOfTheCalibration) {
  const Scene scene = Reconstruct({});
  ASSERT_EQ(scene.calibration_sigma.size(), static_cast<std::size_t>(kCalibrationSize));
  for (const auto& [name, sigma] : scene.calibration_sigma) {
    EXPECT_TRUE(scene.calibration.contains(name)) << name;
    EXPECT_GT(sigma, 0) << name;
    EXPECT_LE(sigma, scene.calibration_prior_sigma.at(name) * (1 + 1e-9)) << name;
  }
  const auto remaining = [&](const char* name) {
    return scene.calibration_sigma.at(name) / scene.calibration_prior_sigma.at(name);
  };
  fmt::print(
      "remaining share of the prior: scale {:.3f}, shift {:.3f}, highest field term {:.3f}\n",
      remaining("depth_scale"), remaining("depth_shift_x_px"), remaining("depth_field_5_4"));
  EXPECT_LT(remaining("depth_scale"), 0.5) << "markers of known size show it";

  ReconstructorOptions paper;
  paper.preset = Preset::kPaper;
  EXPECT_TRUE(Reconstruct(paper).calibration_sigma.empty()) << "nothing was calibrated";
}

TEST_F(ReconstructorTest, PaperPresetMakesItsScene) {
  ReconstructorOptions options;
  options.preset = Preset::kPaper;
  options.num_icp_iterations = 2;
  const Scene scene = Reconstruct(options);
  EXPECT_EQ(scene.preset, Preset::kPaper);
  EXPECT_EQ(scene.frame, SceneFrame::kReferenceMarker);
  EXPECT_TRUE(scene.height_map.has_value());
  EXPECT_TRUE(scene.calibration.empty()) << "the sensor is taken at its word";
  int count = 0;
  const double rms = BallRms(sweep(), scene.cloud, count);
  fmt::print("paper: ball {:.2e} m rms of {} points\n", rms, count);
  EXPECT_GT(count, 1000);
  EXPECT_LT(rms, 0.0015);  // Measured: 0.36 mm.
}

TEST_F(ReconstructorTest, SameBitsOnAnyNumberOfThreads) {
  std::vector<Scene> scenes;
  for (std::size_t run = 0; run < 2; ++run) {
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism, run + 1);
    scenes.push_back(Reconstruct({}));
  }
  EXPECT_EQ(scenes[0].cloud.points, scenes[1].cloud.points);
  EXPECT_EQ(scenes[0].cloud.colors, scenes[1].cloud.colors);
  EXPECT_EQ(scenes[0].calibration, scenes[1].calibration);
  ASSERT_EQ(scenes[0].height_map->z.size(), scenes[1].height_map->z.size());
  for (std::size_t i = 0; i < scenes[0].height_map->z.size(); ++i) {
    const float a = scenes[0].height_map->z[i];
    const float b = scenes[1].height_map->z[i];
    ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << i;
  }
}

TEST_F(ReconstructorTest, TheSceneUpToNowIsThatOfASweepThatEndsThere) {
  constexpr std::size_t kPart = 10;
  int num_learned = 0;
  ReconstructorOptions learning;
  learning.on_learned = [&](const SensorProfile&) { ++num_learned; };
  Reconstructor whole(sweep().info, learning);
  Reconstructor part(sweep().info, {});
  std::function<Scene(const std::stop_token&)> up_to_now;
  for (std::size_t i = 0; i < sweep().frames.size(); ++i) {
    if (i == kPart) up_to_now = whole.SceneUpToNow();
    if (i < kPart) part.AddFrame(sweep().frames[i]);
    whole.AddFrame(sweep().frames[i]);
  }
  const Scene after = whole.Finish();
  const int learned = std::exchange(num_learned, 0);
  const Scene asked_for = up_to_now({});
  const Scene ended = part.Finish();
  EXPECT_EQ(learned, 1);
  EXPECT_EQ(num_learned, 0);
  EXPECT_EQ(asked_for.frames_total, static_cast<int>(kPart));
  EXPECT_EQ(asked_for.cloud.points, ended.cloud.points);
  EXPECT_EQ(asked_for.calibration, ended.calibration);
  // The sweep went on undisturbed.
  EXPECT_EQ(after.cloud.points, Reconstruct({}).cloud.points);
}

TEST_F(ReconstructorTest, SaysWhatIsMissing) {
  EXPECT_THAT(Refusal({}), HasSubstr("0 usable frame"));
  EXPECT_THAT(Refusal({sweep().frames[0]}), HasSubstr("1 usable frame"));
  std::vector<Frame> no_depth(sweep().frames.begin(), sweep().frames.begin() + 3);
  for (Frame& frame : no_depth) frame.depth_m = Blank(frame).depth_m;
  EXPECT_THAT(Refusal(no_depth), HasSubstr("depth images are empty"));
  // Depth in single pixels only: no surface, and no marker either.
  std::vector<Frame> specks;
  for (int i = 0; i < 3; ++i) {
    specks.push_back(Blank(sweep().frames[static_cast<std::size_t>(i)]));
    for (int r = 4; r < 240; r += 8)
      for (int c = 4; c < 320; c += 8) specks.back().depth_m.at<float>(r, c) = 0.8F;
  }
  EXPECT_THAT(Refusal(specks), HasSubstr("none of 3 frames"));
  Frame small = sweep().frames[0];
  small.depth_m = small.depth_m(cv::Rect(0, 0, 160, 120)).clone();
  EXPECT_THAT(Refusal({small}), HasSubstr("160x120"));
}

TEST_F(ReconstructorTest, CountsLostAndDroppedFrames) {
  Reconstructor reconstructor(sweep().info, {});
  for (std::size_t i = 0; i < 10; ++i) {
    const bool blank = i < 2 || i == 6;
    const TrackingReport report =
        reconstructor.AddFrame(blank ? Blank(sweep().frames[i]) : sweep().frames[i]);
    EXPECT_EQ(report.tracked, !blank) << i;
    EXPECT_EQ(report.median_depth_m > 0, !blank);
  }
  reconstructor.CountDropped(5);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.frames_total, 15);
  EXPECT_EQ(scene.frames_dropped, 5);
  EXPECT_EQ(scene.frames_tracked, 7);
  EXPECT_NEAR(scene.longest_lost_s, 2 / 15.0, 0.01);
}

// The sweep with its depth read in a wrong unit.
std::vector<Frame> Scaled(const std::vector<Frame>& frames, double scale) {
  std::vector<Frame> scaled = frames;
  for (Frame& frame : scaled) frame.depth_m = cv::Mat(frame.depth_m * scale);
  return scaled;
}

TEST_F(ReconstructorTest, NoSurfaceAroundTheReferenceMarkerIsNoHeightMap) {
  Reconstructor reconstructor(sweep().info, {});
  // Three times as far: in range of the sensor, and a metre and a half below the marker.
  for (const Frame& frame : Scaled(sweep().frames, 3.0)) reconstructor.AddFrame(frame);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.frame, SceneFrame::kReferenceMarker);
  EXPECT_FALSE(scene.cloud.empty());
  EXPECT_FALSE(scene.height_map.has_value()) << scene.height_map->grid.width << " columns";
  ASSERT_FALSE(scene.warnings.empty());
  EXPECT_THAT(scene.warnings.back().English(),
              HasSubstr("no surface was measured around reference marker"));
}

// The first view of the sweep again and again, as from a tripod.
std::vector<Frame> Static(const std::vector<Frame>& frames, int count) {
  std::vector<Frame> still(static_cast<std::size_t>(count), frames.front());
  for (int i = 0; i < count; ++i) {
    Frame& frame = still[static_cast<std::size_t>(i)];
    frame.index = i;
    frame.color_time_s += i / 15.0;
    frame.depth_time_s += i / 15.0;
  }
  return still;
}

TEST_F(ReconstructorTest, SensorOnATripodGetsTheReferenceMarkersFrame) {
  Reconstructor reconstructor(sweep().info, {});
  for (const Frame& frame : Static(sweep().frames, 30)) reconstructor.AddFrame(frame);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.keyframes.size(), 1U) << "else this tests nothing";
  ASSERT_EQ(scene.frame, SceneFrame::kReferenceMarker);
  ASSERT_TRUE(scene.height_map.has_value());
  EXPECT_THAT(EnglishTexts(scene.warnings), ::testing::Contains(HasSubstr("from 1 place only")));
  // Measured: 0.78 mm, several times that of a sweep, from the covariance of this one view.
  EXPECT_GT(scene.markers.at(kReferenceBoard).sigma_m, 0.0004);
  EXPECT_LT(scene.markers.at(kReferenceBoard).sigma_m, 0.0016);
  const Pose T_true = sweep().T_world_reference.inverse() * sweep().T_world_color.front();
  const Pose T_error = T_true.inverse() * scene.trajectory.front().T_world_camera;
  const double turn_deg = Eigen::AngleAxisd(T_error.linear()).angle() / kDegree;
  fmt::print("tripod: {:.2e} m, {:.3f} deg\n", T_error.translation().norm(), turn_deg);
  EXPECT_LT(T_error.translation().norm(), 0.01);
  EXPECT_LT(turn_deg, 1.0);
}

TEST_F(ReconstructorTest, AMarkerOfFewFramesIsNoFrameAndTheWarningSaysHowMany) {
  Reconstructor reconstructor(sweep().info, {});
  for (const Frame& frame : Static(sweep().frames, 4)) reconstructor.AddFrame(frame);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.frame, SceneFrame::kFirstKeyframe);
  EXPECT_THAT(
      EnglishTexts(scene.warnings),
      ::testing::Contains(HasSubstr("in 1 of the images used and in 4 in all, 3 or 5 are needed")));
}

TEST_F(ReconstructorTest, PaperPresetWarnsOfItsOwnFrameOnly) {
  ReconstructorOptions options;
  options.preset = Preset::kPaper;
  options.num_icp_iterations = 1;
  Reconstructor reconstructor(sweep().info, options);
  for (const Frame& frame : Static(sweep().frames, 4)) reconstructor.AddFrame(frame);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.frame, SceneFrame::kReferenceMarker)
      << "one keyframe is enough for the published means";
  EXPECT_THAT(EnglishTexts(scene.warnings),
              ::testing::Not(::testing::Contains(HasSubstr("where the scene lies is not known"))));
}

TEST_F(ReconstructorTest, TimesEveryStage) {
  for (const Preset preset : {Preset::kBest, Preset::kPaper}) {
    ReconstructorOptions options;
    options.preset = preset;
    options.num_icp_iterations = 1;
    double now_s = 0;
    options.now_s = [&] { return now_s += 1.0; };
    const Scene scene = Reconstruct(options);
    for (const char* stage : {"tracking_per_frame_median", "clouds", "global_registration",
                              "markers", "height_map", "mesh", "after_last_frame"})
      EXPECT_GT(scene.timings_s.count(stage), 0U) << Name(preset) << ": " << stage;
  }
}

TEST_F(ReconstructorTest, DepthOutOfRangeIsRefusedWithItsDistance) {
  const std::string message = Refusal(Scaled(sweep().frames, 8.0));
  fmt::print("{}\n", message);
  EXPECT_THAT(message, HasSubstr("expected from 0.3 to 4.0 m; check the distance"));
}

TEST_F(ReconstructorTest, ImagesThatNeverCameAreTold) {
  std::vector<Frame> frames = Static(sweep().frames, 12);
  for (std::size_t i = 6; i < frames.size(); ++i)
    frames[i].color_time_s += 1.5, frames[i].depth_time_s += 1.5;
  Reconstructor reconstructor(sweep().info, {});
  for (const Frame& frame : frames) reconstructor.AddFrame(frame);
  const Scene scene = reconstructor.Finish();
  EXPECT_EQ(scene.frames_tracked, 12);
  EXPECT_NEAR(scene.longest_lost_s, 1.5 + 1 / 15.0, 1e-6);
  EXPECT_THAT(EnglishTexts(scene.warnings),
              ::testing::Contains(HasSubstr("no image came for 1.57 s")));
}

TEST_F(ReconstructorTest, StopsOnRequest) {
  Reconstructor reconstructor(sweep().info, {});
  for (std::size_t i = 0; i < 3; ++i) reconstructor.AddFrame(sweep().frames[i]);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(static_cast<void>(reconstructor.Finish(stop.get_token())), Interrupted);
}

// The scene of these frames if the sensor states this noise.
Scene SceneOf(StreamInfo info, const std::vector<Frame>& frames, const DepthNoise& noise,
              Preset preset) {
  info.depth_noise = noise;
  ReconstructorOptions options;
  options.preset = preset;
  options.num_icp_iterations = 2;
  Reconstructor reconstructor(info, options);
  for (const Frame& frame : frames) reconstructor.AddFrame(frame);
  return reconstructor.Finish();
}

TEST_F(ReconstructorTest, TheJointRegistrationWeighsByTheNoiseThatTheSensorStates) {
  const auto sigma_of_scale = [](const DepthNoise& noise) {
    const Scene scene = SceneOf(sweep().info, sweep().frames, noise, Preset::kBest);
    return std::sqrt(scene.sensitivity.value().covariance(kDepthAt, kDepthAt));
  };
  const double usual = sigma_of_scale({}), noisy = sigma_of_scale({.constant_m = 0.09});
  fmt::print("scale of the depth known to {:.2e}, of a noisy sensor to {:.2e}\n", usual, noisy);
  EXPECT_GT(noisy, 1.25 * usual);  // Measured: 1.48. The markers limit it, too.
}

TEST_F(ReconstructorTest, SurfacesAreSmoothedByTheNoiseThatTheSensorStates) {
  // A chessboard of 27 mm: edges everywhere for structured light, noise for a worse sensor.
  std::vector<Frame> rough = sweep().frames;
  for (Frame& frame : rough) {
    frame.depth_m = frame.depth_m.clone();
    for (int r = 0; r < frame.depth_m.rows; ++r)
      for (int c = 0; c < frame.depth_m.cols; ++c)
        if (float& z = frame.depth_m.at<float>(r, c); z > 0)
          z += (r + c) % 2 == 0 ? 0.0135F : -0.0135F;
  }
  for (const Preset preset : {Preset::kBest, Preset::kPaper}) {
    const auto num_points = [&](const DepthNoise& noise) -> std::size_t {
      try {
        return SceneOf(sweep().info, rough, noise, preset).cloud.size();
      } catch (const DataError& error) {
        fmt::print("{}: {}\n", Name(preset), error.what());
        return 0;
      }
    };
    const std::size_t usual = num_points({}), noisy = num_points({.constant_m = 0.014});
    fmt::print("{}: {} points, with the noise stated {}\n", Name(preset), usual, noisy);
    EXPECT_GT(noisy, 10000U) << Name(preset);
    EXPECT_LT(usual, noisy / 3) << Name(preset);
  }
}

}  // namespace
}  // namespace plumb
