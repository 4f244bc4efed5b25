// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/endless_live.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/units.hpp"
#include "drivers/simulator/suites/live_scenes.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "drivers/simulator/suites/truth_writer.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kEndlessBreath_s = 4.0;
constexpr double kBeforeMoves_s = 12.0;
constexpr double kColorOfEndless_hz = 5.0;
constexpr double kWarmUpOfUnit_s = 600.0;    // As SimulatedSource has it.
constexpr double kWarmUpOfDrift = 0.006;     // The largest of a unit,
constexpr double kWarmUpTime_s = 20 * 60.0;  // and slower than any.
constexpr double kArm_s = 4.5;               // To pass through the image.
constexpr float kArmDepth_m = 0.6F;

struct Away {
  const char* size;
  Vector6d twist;
};

std::vector<Away> AwayFromZero() {
  const auto twist = [](double x_mm, double y_mm, double z_mm, double roll_deg, double yaw_deg) {
    Vector6d t;
    t << roll_deg * kDegree, 0.0, yaw_deg * kDegree, x_mm * kMillimetre, y_mm * kMillimetre,
        z_mm * kMillimetre;
    return t;
  };
  return {{"2 mm", twist(2, 0, 0, 0, 0)},  {"2 mm", twist(0, 0, 2, 0, 0)},
          {"3 mm", twist(0, -3, 0, 0, 0)}, {"3 mm", twist(0, 0, 3, 0, 0)},
          {"5 mm", twist(-5, 0, 0, 0, 0)}, {"5 mm", twist(0, 5, 0, 0, 0)},
          {"1 deg", twist(0, 0, 0, 0, 1)}, {"1 deg", twist(0, 0, 0, -1, 0)},
          {"2 deg", twist(0, 0, 0, 0, -2)}};
}

World WorldOfPlan(const SuitePlan& plan) {
  Room room = plan.room;
  room.boards = plan.scenes.back().boards;
  return {room, plan.scenes.back().body->grid, plan.scenes.back().T_world_body};
}

}  // namespace

SimulateOptions EndlessSuite(SimulateOptions options) {
  options.suite = "live";
  options.live = {LiveNames().front()};
  return options;
}

EndlessLive::EndlessLive(const SuitePlan& plan, EndlessKind kind, double length_s, double rate_hz)
    : planned_(plan.scenes.back()),
      unit_(plan.unit),
      kind_(kind),
      rate_hz_(rate_hz),
      num_frames_(static_cast<int>(std::lround(length_s * rate_hz))),
      num_phases_(static_cast<int>(std::lround(kEndlessBreath_s * rate_hz))),
      world_(WorldOfPlan(plan)),
      trajectory_(planned_.sweep.motion),
      color_camera_(unit_),
      depth_camera_(unit_) {
  info_ = MakeSource(plan, plan.scenes.size() - 1)->info();
  info_.num_frames = num_frames_;
  LiveScript script = *planned_.sweep.events.live;
  script.breaths.clear();
  for (int k = -2; k < 3; ++k)
    script.breaths.push_back(
        {k * kEndlessBreath_s, (k + 1) * kEndlessBreath_s, 8 * kMillimetre, 3 * kMillimetre});
  scripts_.push_back(script);
  if (kind != EndlessKind::kMoves) return;
  for (const Away& away : AwayFromZero()) {
    script.steps = {{-2.0, -1.0, away.twist}};
    scripts_.push_back(script);
  }
  PlanStays(length_s);
}

void EndlessLive::PlanStays(double length_s) {
  RandomStream random(Hash(planned_.sweep.seed, 141));
  const std::vector<Away> away = AwayFromZero();
  double time_s = kBeforeMoves_s + random.Uniform();
  for (int visit = 0; time_s < length_s; ++visit) {
    const auto to =
        std::min(away.size() - 1,
                 static_cast<std::size_t>(random.Uniform() * static_cast<double>(away.size())));
    constexpr int kCoveredEvery = 5;
    stays_.push_back({time_s, 1 + to, visit % kCoveredEvery == kCoveredEvery - 1});
    steps_.push_back({planned_.sweep.start_time_s + time_s, away[to].size});
    time_s += random.Uniform(2.0, 4.0);
    stays_.push_back({time_s, 0, false});
    time_s += random.Uniform(2.5, 6.0);
  }
}

const EndlessLive::Stay& EndlessLive::StayAt(double time_s) const {
  static const Stay kAtZero;
  const auto next = std::ranges::upper_bound(stays_, time_s, {}, &Stay::begin_s);
  return next == stays_.begin() ? kAtZero : *std::prev(next);
}

World EndlessLive::WorldOf(std::size_t place, double phase_s) const {
  SceneEvents events;
  events.live = std::make_shared<const LiveScript>(scripts_[place]);
  return WorldAt(world_, events, phase_s, trajectory_.T_world_camera(0.0));
}

const EndlessLive::View& EndlessLive::ViewOf(std::size_t place, int phase) {
  const auto [at, is_new] = views_.try_emplace({place, phase});
  if (is_new) {
    const double phase_s = phase / rate_hz_;
    at->second.depth = depth_camera_.See(WorldOf(place, phase_s), trajectory_, 0.0,
                                         Hash(planned_.sweep.seed, 142, at->first.second));
    at->second.belly_m = BellyHeight(scripts_[place], phase_s);
  }
  return at->second;
}

std::optional<std::pair<int, int>> EndlessLive::ArmAt(double time_s) const {
  for (const Stay& stay : stays_) {
    const double since_s = time_s - (stay.begin_s - 0.4 * kArm_s);
    if (!stay.covered || since_s < 0 || since_s > kArm_s) continue;
    const double width = info_.intrinsics.width;
    const int middle = static_cast<int>(width * (-0.2 + 1.4 * since_s / kArm_s));
    const int half = static_cast<int>(0.15 * width);
    return std::pair{std::clamp(middle - half, 0, info_.intrinsics.width),
                     std::clamp(middle + half, 0, info_.intrinsics.width)};
  }
  return std::nullopt;
}

double EndlessLive::WarmUpAt(double time_s) const {
  if (kind_ == EndlessKind::kDrift) {
    const double sign = UnitUniform(Hash(planned_.sweep.seed, 143)) < 0.5 ? -1.0 : 1.0;
    return sign * kWarmUpOfDrift * (1.0 - std::exp(-time_s / kWarmUpTime_s));
  }
  return unit_.warm_up * std::exp(-(planned_.sweep.on_before_s + time_s) / kWarmUpOfUnit_s);
}

std::optional<Frame> EndlessLive::Next() {
  if (next_ >= num_frames_) return std::nullopt;
  const double time_s = next_ / rate_hz_;
  const auto index = static_cast<std::uint64_t>(next_);
  const std::size_t place = StayAt(time_s).place;
  const View& view = ViewOf(place, next_ % num_phases_);
  DepthView depth = view.depth;
  const auto arm = ArmAt(time_s);
  if (arm && arm->first < arm->second) {
    const cv::Range columns(arm->first, arm->second);
    depth.true_m = depth.true_m.clone();
    depth.true_m.colRange(columns).setTo(kArmDepth_m);
    if (!depth.incidence_cosine.empty()) {
      depth.incidence_cosine = depth.incidence_cosine.clone();
      depth.incidence_cosine.colRange(columns).setTo(1.0F);
    }
  }
  Frame frame;
  const int color_every = std::max(1, static_cast<int>(std::lround(rate_hz_ / kColorOfEndless_hz)));
  if (light_.empty()) light_ = color_camera_.Light(WorldOf(0, 0.0), trajectory_, 0.0);
  if (next_ % color_every == 0) {
    cv::Mat light = light_;
    if (arm && arm->first < arm->second) {
      light = light_.clone();
      light.colRange(arm->first, arm->second).setTo(cv::Scalar::all(0.05));
    }
    color_ = color_camera_.Expose(light, Hash(planned_.sweep.seed, 144, index));
  }
  frame.color_rgb = color_;
  const DepthShot shot =
      depth_camera_.Measure(depth, time_s, Hash(planned_.sweep.seed, 145, index), WarmUpAt(time_s));
  shot.registered.convertTo(frame.depth_m, CV_32F, 1.0 / unit_.depth_units_per_metre);
  frame.index = next_;
  frame.depth_time_s = frame.color_time_s = planned_.sweep.start_time_s + time_s;
  truth_ = {.time_s = frame.depth_time_s,
            .T_world_body = scripts_[place].BodyAt(0.0),
            .belly_m = view.belly_m};
  ++next_;
  return frame;
}

}  // namespace plumb::simulated
