// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/live_scenes.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

constexpr double kLiveInterval_s = 100.0;
constexpr double kColorRate_hz = 5.0;
constexpr std::size_t kFirstOfTwo = 5;  // among LiveNames()
constexpr std::size_t kCouchSteps = 1;
constexpr std::size_t kFirstOfOthers = 7;
constexpr std::size_t kProjector = 13;

// Looks at the body from one side, its length along the image.
Pose PlaceOfSensor(const Vector3d& at, double side, RandomStream& random) {
  const double azimuth = side * random.Uniform(65.0, 100.0) * kDegree;
  const double elevation = random.Uniform(48.0, 65.0) * kDegree;
  const double distance = random.Uniform(0.98, 1.12);
  const Vector3d towards(std::cos(elevation) * std::cos(azimuth),
                         std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
  Pose T = Pose::Identity();
  const Vector3d z = -towards;
  const Vector3d x = z.cross(Vector3d::UnitZ()).normalized();
  T.linear() << x, z.cross(x), z;
  T.translation() = at + distance * towards;
  return T;
}

double OneSide(RandomStream& random) { return random.Uniform() < 0.5 ? -1.0 : 1.0; }

// Periods and amplitudes vary from breath to breath.
std::vector<OneBreath> Breathe(RandomStream& random, double length_s) {
  const double period_s = random.Uniform(3.2, 5.2);
  const double belly_m = random.Uniform(5.0, 10.0) * kMillimetre;
  const double chest_m = belly_m * random.Uniform(0.2, 0.7);
  std::vector<OneBreath> breaths;
  double time_s = -random.Uniform(0.0, period_s);
  while (time_s < length_s + 1.0) {
    const double size = 1.0 + random.Within(0.15);
    const double breath_s = period_s * (1.0 + random.Within(0.12));
    breaths.push_back({time_s, time_s + breath_s, size * belly_m, size * chest_m});
    time_s += breath_s;
  }
  return breaths;
}

Vector6d Shift(double x_mm, double y_mm, double z_mm, double roll_deg = 0.0, double yaw_deg = 0.0) {
  Vector6d twist;
  twist << roll_deg * kDegree, 0.0, yaw_deg * kDegree, x_mm * kMillimetre, y_mm * kMillimetre,
      z_mm * kMillimetre;
  return twist;
}

void AddSteps(LiveScript& script, RandomStream& random) {
  const auto sign = [&] { return OneSide(random); };
  script.steps = {{13.0, 13.3, Shift(2.0 * sign(), 0, 0)},
                  {17.0, 17.3, Shift(0, 3.0 * sign(), 0)},
                  {21.0, 21.3, Shift(0, 0, 5.0 * sign())},
                  {25.0, 25.3, Shift(0, 0, 0, 1.0 * sign())},
                  {29.0, 29.3, Shift(3.0 * sign(), 4.0 * sign(), 0, 0, 2.0 * sign())}};
}

// The arm comes from the head, stays out of the way of the markers at the feet and goes on.
void AddPassing(LiveScript& script, const Pose& T_world_camera, RandomStream& random) {
  const auto radius = static_cast<float>(random.Uniform(0.07, 0.11));
  const auto rod = [&](double x) {
    return Rod{(T_world_camera * Vector3d(x, -0.5, 0.62)).cast<float>(),
               (T_world_camera * Vector3d(x, 0.5, 0.62)).cast<float>(), radius};
  };
  script.passing = {{14.0, 26.0, rod(-0.55), rod(0.55)}};
  script.steps = {{20.0, 20.3, Shift(0, random.Uniform(4.0, 6.0), 2.0)}};
}

// Two sensors: the left one is covered while the body moves, and pushed in the end.
void AddForTwo(LiveScript& script, const Pose& T_world_left, RandomStream& random) {
  const auto rod = [&](double x) {
    return Rod{(T_world_left * Vector3d(x, -0.5, 0.5)).cast<float>(),
               (T_world_left * Vector3d(x, 0.5, 0.5)).cast<float>(), 0.1F};
  };
  script.passing = {{13.0, 16.5, rod(-0.55), rod(0.55)}};
  script.steps = {{11.5, 11.8, Shift(2.0 * OneSide(random), 0, 0)},
                  {14.6, 14.9, Shift(0, 4.0 * OneSide(random), 2.0)},
                  {21.0, 21.3, Shift(0, 0, 3.0, 0, 1.0)}};
}

void AddCoughs(LiveScript& script, RandomStream& random) {
  script.steps = {{12.0, 28.0, Shift(-0.8, 0.6, -0.3)}};  // a slow slide
  for (double time_s = 14.0; time_s < 17.0; time_s += 0.5) {
    const double size_mm = random.Uniform(1.0, 2.5);
    script.steps.push_back({time_s, time_s + 0.15, Shift(0, 0, size_mm)});
    script.steps.push_back({time_s + 0.15, time_s + 0.45, Shift(0, 0, -size_mm)});
  }
  script.steps.push_back({24.0, 24.3, Shift(random.Uniform(3.0, 7.0), -2.0, 0, 0, 1.0)});
  script.steps.push_back({30.0, 31.0, Shift(-3.0, 2.0, 0, 0, -1.0)});
}

// What happens to room, sensor and driver, by the place among the names after those of two sensors.
void AddOther(LiveScript& script, SensorAtPlace& place, std::size_t other) {
  const Vector3d direction = Vector3d(0.8, -0.5, 0.3).normalized();
  if (other == 0) {
    script.dark = {{14.0, 28.0}};
    script.steps = {{18.0, 18.3, Shift(0, 5.0, 0)}, {31.0, 31.3, Shift(0, -5.0, 0)}};
  }
  if (other == 2) script.sheet = {{15.0, 25.0}};
  if (other == 3) place.sway_m = 0.2 * kMillimetre;
  if (other != 4 && other != 5) return;
  place.pushed_at_s = 20.0;
  place.T_before_after.translation() = (other == 4 ? 2.0 : 5.0) * kMillimetre * direction;
}

// By the place among all names.
void DisturbImages(std::size_t i, SimulatedSweep& sweep) {
  if (i == kFirstOfOthers + 1) sweep.lost_frames = sweep.late_frames = 0.1;
  sweep.other_projector = i == kProjector;
}

std::shared_ptr<const SensorUnit> AnotherUnit(const SimulateOptions& options) {
  return std::make_shared<const SensorUnit>(
      MakeSensorUnit(options.noise, Hash(options.unit.value_or(options.seed), 133), options.width,
                     options.height, FaultsOf(options), options.sensor));
}

}  // namespace

const std::vector<std::string>& LiveNames() {
  static const std::vector<std::string> names = {
      "live_still",    "live_steps",      "live_passing",    "live_cough",    "live_pushed",
      "live_two_left", "live_two_right",  "live_dark",       "live_lossy",    "live_sheet",
      "live_sway",     "live_pushed_2mm", "live_pushed_5mm", "live_projector"};
  return names;
}

void AddLiveScenes(SuitePlan& plan, const SimulateOptions& options) {
  const ScenePlan swept = plan.scenes.back();
  plan.num_sweeps = plan.scenes.size();
  BodyShape chest = swept.body->shape, belly = swept.body->shape;
  chest.chest_rise_m += LiveScript::kRise_m;
  belly.belly_rise_m += LiveScript::kRise_m;
  const auto with_chest = MakeGrid(chest), with_belly = MakeGrid(belly);
  const auto add = [&](std::size_t i, const std::shared_ptr<const LiveScript>& script,
                       const SensorAtPlace& place) -> ScenePlan* {
    const std::string& name = LiveNames()[i];
    if (!options.live.empty() && std::ranges::find(options.live, name) == options.live.end())
      return nullptr;
    ScenePlan& scene = plan.scenes.emplace_back(swept);
    scene.name = name;
    scene.sweep.motion.at_rest = place;
    scene.sweep.num_frames = static_cast<int>(std::lround(options.live_s * options.rate_hz));
    // Both of two sensors at the same time.
    const std::size_t at = i < kFirstOfOthers ? std::min(i, kFirstOfTwo) : i;
    const double after_s = kLiveInterval_s * static_cast<double>(at + 1);
    scene.sweep.start_time_s += after_s;
    scene.sweep.on_before_s += after_s;
    scene.sweep.seed = Hash(options.seed, 132, i);
    scene.sweep.color_every = std::max(1, static_cast<int>(options.rate_hz / kColorRate_hz));
    scene.sweep.events = {};
    scene.sweep.events.live = script;
    return &scene;
  };
  for (std::size_t i = 0; i < LiveNames().size(); ++i) {
    if (i > kFirstOfTwo && i < kFirstOfOthers) continue;
    // The same as in the steps, so that the other projector's part can be seen.
    const std::size_t like = i == kProjector ? kCouchSteps : i;
    RandomStream random(Hash(options.seed, 131, like));
    LiveScript script{.exhaled = swept.body->grid, .chest = with_chest, .belly = with_belly};
    script.breaths = Breathe(random, options.live_s);
    script.lag_s = random.Uniform(0.2, 0.6);
    script.T_world_body = swept.T_world_body;
    script.centre = swept.T_world_body * swept.body->centroid;
    const double side = OneSide(random);
    SensorAtPlace place{.T_world_camera = PlaceOfSensor(script.centre, side, random)};
    if (like == kCouchSteps) AddSteps(script, random);
    if (i == 2) AddPassing(script, place.T_world_camera, random);
    if (i == 3) AddCoughs(script, random);
    if (i == 4 || i == kFirstOfTwo) {
      place.pushed_at_s = i == 4 ? 20.0 : 18.5;
      place.T_before_after.translation() = Vector3d(0.8, -0.5, 0.3) * kMillimetre;
    }
    if (i == kFirstOfTwo) AddForTwo(script, place.T_world_camera, random);
    if (i >= kFirstOfOthers) AddOther(script, place, i - kFirstOfOthers);
    const auto shared = std::make_shared<const LiveScript>(std::move(script));
    ScenePlan* const scene = add(i, shared, place);
    if (scene != nullptr) DisturbImages(i, scene->sweep);
    if (i != kFirstOfTwo) continue;
    ScenePlan* right =
        add(i + 1, shared, {.T_world_camera = PlaceOfSensor(shared->centre, -side, random)});
    if (right == nullptr) continue;
    right->other_unit = AnotherUnit(options);
    if (plan.scenes[plan.scenes.size() - 2].name == LiveNames()[i])
      plan.live_together["live_two"] = {LiveNames()[i], right->name};
  }
}

void AddRestLoops(SuitePlan& plan, const SimulateOptions& options, std::size_t sweep,
                  const RestLoops& wanted) {
  constexpr double kBreath_s = 4.0;
  const ScenePlan swept = plan.scenes.at(sweep);
  BodyShape chest = swept.body->shape, belly = swept.body->shape;
  chest.chest_rise_m += LiveScript::kRise_m;
  belly.belly_rise_m += LiveScript::kRise_m;
  RandomStream random(Hash(options.seed, 134));
  LiveScript script{
      .exhaled = swept.body->grid, .chest = MakeGrid(chest), .belly = MakeGrid(belly)};
  for (double begin_s = -2 * kBreath_s; begin_s < 3 * kBreath_s; begin_s += kBreath_s)
    script.breaths.push_back({begin_s, begin_s + kBreath_s, 8 * kMillimetre, 3 * kMillimetre});
  script.lag_s = 0.3;
  script.T_world_body = swept.T_world_body;
  script.centre = swept.T_world_body * swept.body->centroid;
  const double side = OneSide(random);
  const auto still = std::make_shared<const LiveScript>(script);
  script.steps = {{-2.0, -1.0, Shift(3.0, 4.0, 0.0)}};
  const auto moved = std::make_shared<const LiveScript>(std::move(script));
  const auto add = [&](const std::string& name, const SensorAtPlace& place,
                       const std::shared_ptr<const LiveScript>& seen,
                       const std::shared_ptr<const SensorUnit>& unit, std::uint64_t number) {
    ScenePlan& scene = plan.scenes.emplace_back(swept);
    scene.name = name;
    scene.sweep.motion.at_rest = place;
    scene.sweep.num_frames = static_cast<int>(std::lround(kBreath_s * options.rate_hz));
    scene.sweep.on_before_s += kLiveInterval_s;
    scene.sweep.seed = Hash(options.seed, 135, number);
    scene.sweep.color_every = std::max(1, static_cast<int>(options.rate_hz / kColorRate_hz));
    scene.sweep.events = {};
    scene.sweep.events.live = seen;
    if (unit) scene.other_unit = unit;
  };
  const SensorAtPlace first{.T_world_camera = PlaceOfSensor(still->centre, side, random)};
  add("rest", first, still, nullptr, 0);
  add("rest_moved", first, moved, nullptr, 1);
  if (wanted.with_second) {
    const SensorAtPlace second{.T_world_camera = PlaceOfSensor(still->centre, -side, random)};
    const auto unit = AnotherUnit(options);
    add("rest_second", second, still, unit, 2);
    add("rest_second_moved", second, moved, unit, 3);
  }
  if (!wanted.with_steps) return;
  constexpr int kSteps = 3;
  LiveScript script_there = *still;
  for (int i = 1; i <= kSteps; ++i) {
    script_there.T_world_body = Interpolate(still->T_world_body, plan.scenes.front().T_world_body,
                                            static_cast<double>(i) / kSteps);
    script_there.centre = script_there.T_world_body * swept.body->centroid;
    add(fmt::format("rest_step_{}", i), first, std::make_shared<const LiveScript>(script_there),
        nullptr, 4 + static_cast<std::uint64_t>(i));
  }
  const auto there = std::make_shared<const LiveScript>(script_there);
  SensorAtPlace nudged = first;
  nudged.T_world_camera.translation() += Vector3d(3.0, -2.0, 1.0) * kMillimetre;
  add("rest_nudged", nudged, there, nullptr, 8);
  // So long a breath that nothing moves within the loop: its end of inspiration.
  script_there.breaths = {{-1000.0, 1004.0, 8 * kMillimetre, 3 * kMillimetre}};
  add("rest_held", first, std::make_shared<const LiveScript>(std::move(script_there)), nullptr, 9);
}

}  // namespace plumb::simulated
