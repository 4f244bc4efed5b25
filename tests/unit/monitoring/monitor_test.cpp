// SPDX-License-Identifier: Apache-2.0
// One and two sensors at rest over a body, from their mounting on.
#include "algo/monitoring/monitor.hpp"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "tests/support/rest_frames.hpp"

namespace plumb {
namespace {

using test::RestFrames;

constexpr double kMonitoredFrame_s = 1.0 / RestFrames::kRate_hz;

class MonitorTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { scene_ = new Scene(test::ScannedBody()); }
  static void TearDownTestSuite() { delete std::exchange(scene_, nullptr); }

  void AddSensor(double side) {
    sensors_.push_back(std::make_unique<RestFrames>(*scene_, side, 7U + sensors_.size()));
  }
  void Begin(const MonitorOptions& options = {}) {
    std::vector<StreamInfo> infos;
    for (const auto& sensor : sensors_) infos.push_back(sensor->info());
    monitor_ = std::make_unique<Monitor>(*scene_, infos, options);
  }
  /// Until a time; the sensors take turns.
  std::vector<MonitorLine> RunUntil(double end_s) {
    std::vector<MonitorLine> lines;
    for (; time_s_ < end_s; time_s_ += kMonitoredFrame_s) {
      for (std::size_t i = 0; i < sensors_.size(); ++i) {
        const double at_s = time_s_ + kMonitoredFrame_s * static_cast<double>(i) /
                                          static_cast<double>(sensors_.size());
        const Frame frame = sensors_[i]->At(at_s, covered_ == i);
        const double begun_s = CpuOfThread_s();
        const auto line = monitor_->Add(frame, i);
        longest_s_ = std::max(longest_s_, CpuOfThread_s() - begun_s);
        if (line) lines.push_back(*line);
      }
    }
    return lines;
  }
  void BeginAgainstReference() {
    MonitorOptions options;
    options.accepted = AcceptedMotion{.centroid_m = test::MiddleOfBody()};
    options.judges_reference = true;
    Begin(options);
  }
  static Pose Shifted(const Eigen::Vector3d& shift_m) {
    Pose T = Pose::Identity();
    T.translation() = shift_m;
    return T;
  }
  void Move(const Eigen::Vector3d& shift_m) {
    for (const auto& sensor : sensors_) sensor->Move(Shifted(shift_m));
  }
  static double CpuOfThread_s() {
    timespec now{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  static double OffBy(const MonitorLine& line, const Eigen::Vector3d& shift_m) {
    return (line.since_zero->value.head<3>().norm() - shift_m.norm()) / kMillimetre;
  }

  static inline Scene* scene_ = nullptr;
  std::vector<std::unique_ptr<RestFrames>> sensors_;
  std::unique_ptr<Monitor> monitor_;
  std::optional<std::size_t> covered_;
  double time_s_ = 100.0;
  double longest_s_ = 0.0;  ///< Processor time of one frame.
};

TEST_F(MonitorTest, ABodyThatWasMovedSinceItsSweepHasNoNumbersAgainstTheReference) {
  const auto turned = [](double angle_deg) {
    Vector6d twist = Vector6d::Zero();
    twist[2] = angle_deg * kDegree;
    return PoseAbout(test::MiddleOfBody(), twist);
  };
  // On both sides of 15 mm and of 1.5 deg.
  for (const auto& [T_motion, is_near] :
       {std::pair(Shifted({0.0135, 0.0, 0.0}), true), std::pair(Shifted({0.0165, 0.0, 0.0}), false),
        std::pair(turned(1.3), true), std::pair(turned(1.7), false)}) {
    sensors_.clear();
    time_s_ = 0;
    AddSensor(1.0);
    sensors_[0]->Move(T_motion);
    BeginAgainstReference();
    const std::vector<MonitorLine> lines = RunUntil(12.0);
    EXPECT_TRUE(lines.back().since_zero) << T_motion.matrix();
    EXPECT_EQ(lines.back().against_reference.has_value(), is_near) << T_motion.matrix();
    EXPECT_EQ(lines.back().reason, is_near ? BlindReason::kNone : BlindReason::kNoZero);
    const auto is_in = [](const MonitorLine& line) { return line.advice == LiveAdvice::kIn; };
    EXPECT_EQ(std::ranges::any_of(lines, is_in), is_near)
        << "the result of the sweep does not hold where the body lies now";
  }
}

TEST_F(MonitorTest, TheSensorThatSawTheBodyMovedSinceItsSweepNeedNotSeeItAnyMore) {
  AddSensor(1.0);
  AddSensor(-1.0);
  // The sensors disagree by their own errors.
  sensors_[0]->Move(Shifted({0.0165, 0.0, 0.0}));
  sensors_[1]->Move(Shifted({0.0135, 0.0, 0.0}));
  BeginAgainstReference();
  ASSERT_FALSE(RunUntil(112.0).back().against_reference);
  covered_ = 0;
  const std::vector<MonitorLine> covered = RunUntil(113.5);
  EXPECT_EQ(covered.back().sensors_used, 1);
  EXPECT_TRUE(covered.back().since_zero);
  EXPECT_FALSE(covered.back().against_reference);
}

TEST_F(MonitorTest, OneSensorFollowsTheBodyAndNoFrameTakesLong) {
  AddSensor(1.0);
  Begin();
  const std::vector<MonitorLine> start = RunUntil(110.5);
  ASSERT_EQ(start.back().state, MonitorState::kMonitoring) << "within ten seconds and a half";
  EXPECT_NEAR(static_cast<double>(monitor_->sensor().still_times_s().size()), 121, 1)
      << "eight seconds";
  const Eigen::Vector3d shift_m(0.004, -0.003, 0.002);
  Move(shift_m);
  const std::vector<MonitorLine> moved = RunUntil(112.0);
  ASSERT_TRUE(moved.back().since_zero);
  EXPECT_NEAR(OffBy(moved.back(), shift_m), 0.0, 0.4);
  EXPECT_EQ(moved.back().sensors_used, 1);
#ifdef NDEBUG
  // The 121 fits of the zero in one call take about as long as all frames of a second.
  EXPECT_LT(longest_s_, 0.25);
#endif
  RecordProperty("longest_frame_cpu_ms", std::to_string(1e3 * longest_s_));
}

TEST_F(MonitorTest, ASlowMountIsMadeUpForWhereAWholeBreathIsSeen) {
  AddSensor(1.0);
  Begin();
  // Something hides the markers at first: the first second is of no use.
  std::vector<MonitorLine> lines;
  for (; time_s_ < 110.2; time_s_ += kMonitoredFrame_s) {
    Frame frame = sensors_[0]->At(time_s_);
    // A new image: the sensor's own is shared by all frames.
    if (time_s_ < 100.9)
      frame.color_rgb = cv::Mat(frame.color_rgb.size(), CV_8UC3, cv::Scalar::all(0));
    if (const auto line = monitor_->Add(frame)) lines.push_back(*line);
  }
  ASSERT_EQ(lines.back().state, MonitorState::kMonitoring);
  EXPECT_LT(monitor_->sensor().still_times_s().size(), 115U) << "less than eight seconds";
  EXPECT_NEAR(monitor_->sensor().breathing()->period_s, RestFrames::kBreath_s, 0.3);
}

TEST_F(MonitorTest, TwoSensorsGoOnWhileOneIsBlindAndAfterOneWasPushed) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  const std::vector<MonitorLine> start = RunUntil(112.0);
  ASSERT_EQ(start.back().state, MonitorState::kMonitoring);
  EXPECT_EQ(start.back().sensors_used, 2);
  const LiveNumbers both = start.back().since_zero.value();

  covered_ = 0;
  const Eigen::Vector3d shift_m(0.0, 0.004, 0.0);
  Move(shift_m);
  const std::vector<MonitorLine> covered = RunUntil(113.5);
  EXPECT_EQ(covered.back().state, MonitorState::kMonitoring);
  EXPECT_EQ(covered.back().sensors_used, 1);
  EXPECT_NEAR(OffBy(covered.back(), shift_m), 0.0, 0.5);
  EXPECT_GT(covered.back().since_zero->u95.head<3>().norm(), both.u95.head<3>().norm())
      << "its own uncertainty";

  covered_.reset();
  EXPECT_EQ(RunUntil(114.0).back().sensors_used, 2) << "it sees again";

  sensors_[0]->Push({0.002, 0.001, 0.0});
  const std::vector<MonitorLine> pushed = RunUntil(116.5);
  EXPECT_EQ(pushed.back().state, MonitorState::kMonitoring);
  EXPECT_EQ(pushed.back().sensors_used, 1);
  EXPECT_EQ(pushed.back().sensor, 1U) << "the one that was pushed takes no part any more";
  const MonitorLine aside = monitor_->LineAside(sensors_[0]->At(time_s_), 0);
  EXPECT_EQ(aside.state, MonitorState::kMovedSensor) << "its own reason";
  EXPECT_EQ(aside.advice, LiveAdvice::kUnknown);
  EXPECT_FALSE(aside.since_zero);
  EXPECT_NEAR(OffBy(pushed.back(), shift_m), 0.0, 0.5);

  sensors_[1]->Push({0.002, 0.001, 0.0});
  EXPECT_EQ(RunUntil(119.0).back().state, MonitorState::kMovedSensor);
}

TEST_F(MonitorTest, OneThatWasAwayIsUsedAgainOnlyWhereItStood) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  ASSERT_EQ(RunUntil(112.0).back().sensors_used, 2);
  const auto second_alone_until = [&](double end_s) {
    for (; time_s_ < end_s; time_s_ += kFrame_s)
      EXPECT_TRUE(monitor_->Add(sensors_[1]->At(time_s_), 1));
  };
  second_alone_until(114.0);
  EXPECT_EQ(monitor_->share(0), SensorShare::kNoImage);
  EXPECT_EQ(monitor_->share(1), SensorShare::kUsed);
  // Its place is judged by three images, five of which are looked at in a second.
  const std::vector<MonitorLine> back = RunUntil(115.5);
  EXPECT_EQ(back.front().sensors_used, 1);
  EXPECT_EQ(back.back().sensors_used, 2);
  EXPECT_EQ(monitor_->share(0), SensorShare::kUsed);

  second_alone_until(117.5);
  sensors_[0]->Push({0.002, 0.001, 0.0});
  for (const MonitorLine& line : RunUntil(119.0)) EXPECT_EQ(line.sensors_used, 1) << line.time_s;
  EXPECT_EQ(monitor_->share(0), SensorShare::kMoved);
}

TEST_F(MonitorTest, OneThatIsSilentFromTheZeroOnIsUsedOnlyWhereItStood) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  const auto is_zeroed = [&](std::size_t i) {
    return monitor_->sensor(i).stage() == RestStage::kReady;
  };
  while (!is_zeroed(0) || !is_zeroed(1)) (void)RunUntil(time_s_ + kMonitoredFrame_s);
  while (!monitor_->zero_time_s() || time_s_ < *monitor_->zero_time_s() + 1.5) {
    (void)monitor_->Add(sensors_[1]->At(time_s_), 1);
    time_s_ += kMonitoredFrame_s;
  }
  sensors_[0]->Push({0.002, 0.001, 0.0});
  for (const MonitorLine& line : RunUntil(time_s_ + 1.5))
    EXPECT_EQ(line.sensors_used, 1) << line.time_s;
  EXPECT_EQ(monitor_->share(0), SensorShare::kMoved);
}

TEST_F(MonitorTest, AnImageThatIsRepeatedWithNewStampsIsNone) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  ASSERT_EQ(RunUntil(112.0).back().sensors_used, 2);
  const Frame last = sensors_[0]->At(time_s_);
  ASSERT_TRUE(monitor_->Add(last, 0));
  const auto repeat_until = [&](double end_s, bool with_second) {
    std::vector<MonitorLine> of_second;
    for (; time_s_ < end_s; time_s_ += kMonitoredFrame_s) {
      Frame again = last;
      again.color_time_s = again.depth_time_s = time_s_ + 0.01;
      EXPECT_FALSE(monitor_->Add(again, 0)) << "it would be an old number as a new one";
      EXPECT_EQ(monitor_->LineAside(again, 0).state, MonitorState::kBlind);
      EXPECT_EQ(monitor_->LineAside(again, 0).advice, LiveAdvice::kUnknown);
      if (!with_second) continue;
      if (const auto line = monitor_->Add(sensors_[1]->At(time_s_ + 0.03), 1))
        of_second.push_back(*line);
    }
    return of_second;
  };
  const std::vector<MonitorLine> alone = repeat_until(114.0, true);
  EXPECT_EQ(alone.back().sensors_used, 1);
  EXPECT_EQ(monitor_->share(0), SensorShare::kNoImage);
  (void)repeat_until(114.5, false);
  // Live again: its place is judged first, as after any time without an image.
  const std::vector<MonitorLine> back = RunUntil(116.0);
  ASSERT_EQ(back[1].sensor, 1U);
  EXPECT_EQ(back[1].sensors_used, 1);
  EXPECT_EQ(back.back().sensors_used, 2);
}

TEST_F(MonitorTest, ASensorWithoutNoiseLosesNoImage) {
  AddSensor(1.0);
  sensors_[0]->Silence();
  Begin();
  ASSERT_EQ(RunUntil(111.0).back().state, MonitorState::kMonitoring);
  const double period_s = kMonitoredFrame_s;
  std::size_t lines = 0;
  // Longer than the gap at the zero: the body holds its breath.
  const Frame held = sensors_[0]->At(time_s_);
  for (int i = 0; i < 30; ++i, time_s_ += period_s) {
    Frame frame = held;
    frame.color_time_s = frame.depth_time_s = time_s_;
    const auto line = monitor_->Add(frame);
    lines += line && line->state == MonitorState::kMonitoring ? 1 : 0;
  }
  EXPECT_EQ(lines, 30U);
}

TEST_F(MonitorTest, DriftOfDepthIsMeasuredAndLeavesTheNumbers) {
  AddSensor(1.0);
  Begin();
  ASSERT_EQ(RunUntil(111.0).back().state, MonitorState::kMonitoring);
  EXPECT_NEAR(monitor_->sensor().drift(), 1.0, 2e-4);
  // Over a time that is long for what follows the drift, 10 s.
  for (int i = 1; i <= 30; ++i) {
    sensors_[0]->Stretch(1.0 + 1e-4 * i);
    (void)RunUntil(time_s_ + 1.0);
  }
  const std::vector<MonitorLine> warm = RunUntil(time_s_ + 30.0);
  EXPECT_NEAR(warm.back().drift, 1.003, 2e-4);
  EXPECT_NEAR(OffBy(warm.back(), Eigen::Vector3d::Zero()), 0.0, 0.5) << "3.1 mm if it counted";
}

TEST_F(MonitorTest, TheMapShowsHowTheBodyLiesNowAndWhatIsNotSeen) {
  AddSensor(1.0);
  Begin();
  EXPECT_FALSE(monitor_->Map());
  ASSERT_EQ(RunUntil(112.0).back().state, MonitorState::kMonitoring);
  const LiveMap before = monitor_->Map().value();
  const auto hidden = [](const LiveMap& map) { return std::ranges::count(map.missing, 1); };
  EXPECT_LT(hidden(before), 5);
  Move({0.0, 0.0, 0.004});
  (void)RunUntil(112.0 + RestFrames::kBreath_s);  // at the same place of a breath
  const LiveMap risen = monitor_->Map().value();
  std::vector<float> rises_m;
  for (std::size_t i = 0; i < risen.rise_m.z.size(); ++i) {
    const float rise_m = risen.rise_m.z[i] - before.rise_m.z[i];
    if (std::isfinite(rise_m)) rises_m.push_back(rise_m);
  }
  ASSERT_GT(rises_m.size(), 200U) << "cells of 2 cm";
  EXPECT_NEAR(TakeMedian(rises_m), 0.004, 0.0005);
  covered_ = 0;
  (void)RunUntil(116.5);
  EXPECT_GT(hidden(monitor_->Map().value()), 200) << "something lies before the body";
}

TEST_F(MonitorTest, OneThatIsNotMountedInTimeTakesNoPart) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  // The second one sees no marker at all.
  std::vector<MonitorLine> lines;
  for (; time_s_ < 112.0; time_s_ += kMonitoredFrame_s) {
    if (const auto line = monitor_->Add(sensors_[0]->At(time_s_), 0)) lines.push_back(*line);
    Frame dark = sensors_[1]->At(time_s_ + 0.02);
    dark.color_rgb = cv::Mat::zeros(dark.color_rgb.size(), dark.color_rgb.type());
    if (const auto line = monitor_->Add(dark, 1)) lines.push_back(*line);
  }
  EXPECT_EQ(lines.back().state, MonitorState::kMonitoring);
  EXPECT_EQ(lines.back().sensors_used, 1);
  EXPECT_TRUE(monitor_->takes_part(0));
  EXPECT_FALSE(monitor_->takes_part(1));
  const MonitorLine aside = monitor_->LineAside(sensors_[1]->At(time_s_), 1);
  EXPECT_EQ(aside.state, MonitorState::kMounting) << "it was never mounted";
  EXPECT_EQ(aside.sensor, 1U);
  EXPECT_FALSE(aside.takes_part);
}

TEST_F(MonitorTest, TheZeroIsTheSameInWhateverPortionsItIsMade) {
  AddSensor(1.0);
  AddSensor(-1.0);
  Begin();
  const std::vector<MonitorLine> start = RunUntil(112.0);
  ASSERT_EQ(start.back().state, MonitorState::kMonitoring);
  std::vector<std::pair<std::size_t, const SensorAtRest*>> sensors = {{0, &monitor_->sensor(0)},
                                                                      {1, &monitor_->sensor(1)}};
  RestFits at_once(sensors, monitor_->scene().centroid_m);
  RestFits in_portions(sensors, monitor_->scene().centroid_m);
  EXPECT_TRUE(at_once.Make(at_once.size()));
  for (std::size_t made = 7; !in_portions.Make(7); made += 7) ASSERT_LT(made, at_once.size());
  const auto a = at_once.Statistics(), b = in_portions.Statistics();
  ASSERT_THAT(a, testing::SizeIs(3)) << "each sensor, and both";
  for (const auto& [set, statistics] : a) {
    const RestStatistics& other = b.at(set);
    EXPECT_EQ(statistics.T_zero.matrix(), other.T_zero.matrix());
    EXPECT_EQ(statistics.spread, other.spread);
    EXPECT_EQ(statistics.inflation, other.inflation);
    EXPECT_EQ(statistics.information, other.information);
  }
  EXPECT_LT(a.at({0, 1}).spread.norm(), a.at({0}).spread.norm());
}

}  // namespace
}  // namespace plumb
