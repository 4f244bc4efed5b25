// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/room_faults.hpp"

#include <cmath>
#include <map>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

// An estimate for a printer that fits the page to its margins.
constexpr double kPrintScale = 0.005;
// An estimate, along against across the paper's direction of travel.
constexpr double kPrintStretch = 0.0015;
constexpr double kBulge = 2.5 * kMillimetre;
constexpr int kBreathLevels = 9;

double Sign(RandomStream& random) { return random.Uniform() < 0.5 ? -1.0 : 1.0; }

// All prints are from one printer.
void ScalePrints(std::vector<Board>& boards, std::uint64_t seed) {
  RandomStream random(seed);
  const double scale = Sign(random) * random.Uniform(0.5, 1.0) * kPrintScale;
  const double stretch = random.Within(kPrintStretch);
  for (Board& board : boards)
    board.print_scale = {1.0 + scale + 0.5 * stretch, 1.0 + scale - 0.5 * stretch};
}

// All except the reference marker, which is assumed to be well kept.
void CurlPrints(std::vector<Board>& boards, std::uint64_t seed) {
  RandomStream random(seed);
  for (std::size_t i = 1; i < boards.size(); ++i)
    boards[i].bulge_m = Sign(random) * random.Uniform(0.2, 1.0) * kBulge;
}

// A marker displaced on its board, slightly rotated, away from the body.
Pose Shifted(const Pose& T_world_marker, double distance_m, RandomStream& random) {
  const Vector3d place = T_world_marker.translation();
  const double outwards = std::atan2(place.y(), place.x()) + random.Within(1.0);
  Pose shifted = T_world_marker;
  shifted.linear() =
      Eigen::AngleAxisd(random.Within(4.0 * kDegree), Vector3d::UnitZ()).toRotationMatrix() *
      T_world_marker.linear();
  shifted.translation() += distance_m * Vector3d(std::cos(outwards), std::sin(outwards), 0.0);
  return shifted;
}

std::size_t AnyButTheReference(const std::vector<Board>& boards, RandomStream& random) {
  return 1 + static_cast<std::size_t>(random.Uniform() * static_cast<double>(boards.size() - 1));
}

void MoveOneMarker(ScenePlan& scene, std::uint64_t seed) {
  RandomStream random(seed);
  Board& board = scene.boards[AnyButTheReference(scene.boards, random)];
  board.T_world_marker =
      Shifted(board.T_world_marker, random.Uniform(6.0, 20.0) * kMillimetre, random);
}

PushedBoard PushOneMarker(const ScenePlan& scene, std::uint64_t seed) {
  RandomStream random(seed);
  PushedBoard pushed;
  pushed.board = AnyButTheReference(scene.boards, random);
  pushed.T_world_after = Shifted(scene.boards[pushed.board].T_world_marker,
                                 random.Uniform(10.0, 30.0) * kMillimetre, random);
  pushed.begin_s = scene.sweep.motion.duration_s * random.Uniform(0.3, 0.7);
  pushed.end_s = pushed.begin_s + random.Uniform(0.3, 0.8);
  return pushed;
}

HandVisit PlanHand(const ScenePlan& scene, std::uint64_t seed) {
  RandomStream random(seed);
  HandVisit visit;
  visit.begin_s = scene.sweep.motion.duration_s * random.Uniform(0.25, 0.65);
  visit.end_s = visit.begin_s + random.Uniform(0.8, 1.5);
  visit.side = Sign(random);
  // Point above the body at which the sensor looks at that moment.
  const Pose T_world_camera =
      Trajectory(scene.sweep.motion).T_world_camera(0.5 * (visit.begin_s + visit.end_s));
  const Vector3d way = T_world_camera.linear().col(2);
  const double height = 0.33;
  visit.over = T_world_camera.translation() +
               way * (T_world_camera.translation().z() - height) / std::max(0.5, -way.z());
  visit.over.y() += visit.side * random.Uniform(0.05, 0.15);
  return visit;
}

// The body's own shape is in the middle of the breathing cycle.
class Breaths {
 public:
  explicit Breaths(std::uint64_t seed) : random_(seed) {
    chest_m_ = random_.Uniform(3.0, 6.0) * kMillimetre;
    belly_m_ = random_.Uniform(5.0, 10.0) * kMillimetre;
  }
  Breath Of(const std::shared_ptr<const BodyModel>& body) {
    auto& levels = levels_[body.get()];
    for (int i = 0; levels.size() < kBreathLevels; ++i) {
      const double depth = static_cast<double>(i) / (kBreathLevels - 1) - 0.5;
      BodyShape shape = body->shape;
      shape.chest_rise_m += depth * chest_m_;
      shape.belly_rise_m += depth * belly_m_;
      levels.push_back(MakeGrid(shape));
    }
    return {levels, chest_m_, belly_m_, random_.Uniform(3.0, 5.0), random_.Uniform(0.0, kTwoPi)};
  }

 private:
  RandomStream random_;
  double chest_m_, belly_m_;  // From exhaled to inhaled.
  std::map<const BodyModel*, std::vector<std::shared_ptr<const DistanceGrid>>> levels_;
};

}  // namespace

void ApplyRoomFaults(SuitePlan& plan, std::uint64_t seed) {
  const auto on = [&](Fault fault) { return plan.unit.faults.Has(fault); };
  if (on(Fault::kPrintScale)) ScalePrints(plan.room.boards, Hash(seed, 121));
  if (on(Fault::kCurledPrints)) CurlPrints(plan.room.boards, Hash(seed, 122));
  if (on(Fault::kGlare)) plan.room.gloss = 0.5F;
  Breaths breaths(Hash(seed, 123));
  for (std::size_t i = 0; i < plan.scenes.size(); ++i) {
    ScenePlan& scene = plan.scenes[i];
    SceneEvents& events = scene.sweep.events;
    scene.boards = plan.room.boards;
    scene.sweep.on_before_s += plan.unit.on_before_s;
    events.seed = Hash(seed, 124, i);
    events.cable = on(Fault::kCable);
    if (on(Fault::kMovedMarker) && i > 0) MoveOneMarker(scene, Hash(seed, 125, i));
    if (on(Fault::kMovingMarker)) events.pushed = PushOneMarker(scene, Hash(seed, 126, i));
    if (on(Fault::kHand)) events.hand = PlanHand(scene, Hash(seed, 127, i));
    if (on(Fault::kBreathing)) events.breath = breaths.Of(scene.body);
  }
}

}  // namespace plumb::simulated
