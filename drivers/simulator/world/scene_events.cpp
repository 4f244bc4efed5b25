// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/scene_events.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

const Vector3f kSleeve(0.20F, 0.33F, 0.36F);

// From 0 to 1 with zero velocity at both ends.
double Ease(double s) {
  s = std::clamp(s, 0.0, 1.0);
  return s * s * (3.0 - 2.0 * s);
}

Rod MakeRod(const Vector3d& a, const Vector3d& b, double radius) {
  return {a.cast<float>(), b.cast<float>(), static_cast<float>(radius)};
}

// The cable leaves the right end of the sensor, hangs through a corner of the view and sways.
void AddCable(std::vector<Rod>& rods, const Pose& T_world_camera, double time_s,
              std::uint64_t seed) {
  RandomStream random(seed);
  const double side = random.Uniform() < 0.5 ? -1.0 : 1.0;
  const double sway = 0.02 * std::sin(kTwoPi * random.Uniform(0.6, 1.2) * time_s);
  const Vector3d a(side * (0.19 + 0.3 * sway), -0.24, 0.28);
  const Vector3d b(side * (0.15 + sway), -0.06, 0.36);
  const Vector3d c(side * (0.20 + sway), 0.20, 0.40);
  rods.push_back(MakeRod(T_world_camera * a, T_world_camera * b, 3.0 * kMillimetre));
  rods.push_back(MakeRod(T_world_camera * b, T_world_camera * c, 3.0 * kMillimetre));
}

// Forearm, back of the hand, three fingers.
void AddHand(std::vector<Rod>& rods, const HandVisit& visit, double time_s) {
  const double middle = 0.5 * (visit.begin_s + visit.end_s);
  const double half = 0.5 * (visit.end_s - visit.begin_s);
  const double reached = Ease(2.0 * (1.0 - std::abs(time_s - middle) / half));
  if (reached <= 0) return;
  const Vector3d tip = visit.over + Vector3d(0, visit.side * 0.9 * (1.0 - reached), 0.0);
  const Vector3d back(0.02, visit.side, 0.25);
  const Vector3d knuckles = tip + 0.08 * back;
  const Vector3d wrist = tip + 0.18 * back;
  rods.push_back(MakeRod(wrist, wrist + 0.45 * back, 0.038));
  rods.push_back(MakeRod(knuckles, wrist, 0.030));
  for (const double across : {-0.025, 0.0, 0.025})
    rods.push_back(
        MakeRod(tip + Vector3d(1.3 * across, 0, 0), knuckles + Vector3d(across, 0, 0), 0.009));
}

Pose Between(const Pose& from, const Pose& to, double fraction) {
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(from.linear())
                   .slerp(fraction, Eigen::Quaterniond(to.linear()))
                   .toRotationMatrix();
  T.translation() = from.translation() + fraction * (to.translation() - from.translation());
  return T;
}

// Between end of expiration (0), where a breath rests longest, and end of inspiration (1); Lujan et
// al., Med Phys 1999.
double RiseAt(const std::vector<OneBreath>& breaths, double time_s, double OneBreath::*size) {
  for (const OneBreath& breath : breaths) {
    if (time_s < breath.begin_s || time_s >= breath.end_s) continue;
    const double phase = (time_s - breath.begin_s) / (breath.end_s - breath.begin_s);
    return breath.*size * std::pow(std::sin(0.5 * kTwoPi * phase), 4);
  }
  return 0.0;
}

}  // namespace

double LiveScript::BellyAt(double time_s) const {
  return RiseAt(breaths, time_s, &OneBreath::belly_m);
}

double LiveScript::ChestAt(double time_s) const {
  return RiseAt(breaths, time_s - lag_s, &OneBreath::chest_m);
}

Pose LiveScript::BodyAt(double time_s) const {
  Pose T = T_world_body;
  for (const BodyStep& step : steps) {
    const double done = Ease((time_s - step.begin_s) / (step.end_s - step.begin_s));
    if (done <= 0) continue;
    const Vector3d moved = T * (T_world_body.inverse() * centre);
    T = PoseAbout(moved, done * step.twist) * T;
  }
  return T;
}

bool LiveScript::DarkAt(double time_s) const {
  return std::ranges::any_of(dark, [&](const Stretch& one) { return one.Has(time_s); });
}

DistanceGrid LiveScript::ShapeAt(double time_s) const {
  const bool covered =
      std::ranges::any_of(sheet, [&](const Stretch& one) { return one.Has(time_s); });
  const double chest_m = ChestAt(time_s) + (covered ? kSheet_m : 0.0);
  return DistanceGrid::Between(*exhaled, *chest, chest_m / kRise_m, *belly,
                               BellyAt(time_s) / kRise_m);
}

double Breath::DepthAt(double time_s) const {
  return 0.5 - 0.5 * std::cos(kTwoPi * time_s / period_s + phase);
}

World WorldAt(const World& world, const SceneEvents& events, double time_s,
              const Pose& T_world_camera) {
  World now = world;
  if (events.pushed) {
    const PushedBoard& pushed = *events.pushed;
    const double fraction = Ease((time_s - pushed.begin_s) / (pushed.end_s - pushed.begin_s));
    const Pose& before = world.room().boards.at(pushed.board).T_world_marker;
    now.MoveBoard(pushed.board, Between(before, pushed.T_world_after, fraction));
  }
  if (events.breath) {
    const auto& levels = events.breath->levels;
    const double last = static_cast<double>(levels.size() - 1);
    now.ChangeBody(
        levels[static_cast<std::size_t>(std::lround(last * events.breath->DepthAt(time_s)))]);
  }
  if (events.live) {
    now.MoveBody(events.live->BodyAt(time_s));
    now.ChangeBody(std::make_shared<const DistanceGrid>(events.live->ShapeAt(time_s)));
  }
  Rods rods;
  for (const LiveScript::Passing& arm :
       events.live ? events.live->passing : std::vector<LiveScript::Passing>{}) {
    if (time_s < arm.begin_s || time_s > arm.end_s) continue;
    const auto share = static_cast<float>((time_s - arm.begin_s) / (arm.end_s - arm.begin_s));
    rods.rods.push_back({arm.from.a + share * (arm.to.a - arm.from.a),
                         arm.from.b + share * (arm.to.b - arm.from.b), arm.from.radius});
  }
  rods.albedo = events.hand ? kSleeve : Vector3f::Constant(0.04F);
  if (events.cable) AddCable(rods.rods, T_world_camera, time_s, events.seed);
  if (events.hand) AddHand(rods.rods, *events.hand, time_s);
  if (!rods.rods.empty()) now.PlaceRods(std::move(rods));
  return now;
}

}  // namespace plumb::simulated
