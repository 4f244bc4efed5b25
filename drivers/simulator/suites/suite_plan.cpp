// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/suite_plan.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/units.hpp"
#include "drivers/simulator/suites/live_scenes.hpp"
#include "drivers/simulator/suites/room_faults.hpp"
#include "drivers/simulator/world/board_layout.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

constexpr double kFirstStamp_s = 1.7e9;
constexpr double kSceneInterval_s = 100.0;

// Placement of a body: the position of its centroid above the support, and its attitude.
struct Placement {
  double x = 0.0, y = 0.0;
  double yaw_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0;
  double lift = 0.0;  // Height of a pad under the body, metres.
};

// The body rests on the support: its lowest point presses one millimetre into it or lies on a pad.
Pose Placed(const BodyModel& body, const Placement& placement) {
  Pose T = Pose::Identity();
  T.linear() = (Eigen::AngleAxisd(placement.yaw_deg * kDegree, Vector3d::UnitZ()) *
                Eigen::AngleAxisd(placement.pitch_deg * kDegree, Vector3d::UnitY()) *
                Eigen::AngleAxisd(placement.roll_deg * kDegree, Vector3d::UnitX()))
                   .toRotationMatrix();
  double lowest = 0;
  for (const Eigen::Vector3f& vertex : body.surface.vertices)
    lowest = std::min(lowest, (T.linear() * vertex.cast<double>()).z());
  const Vector3d turned = T.linear() * body.centroid;
  T.translation() = Vector3d(placement.x - turned.x(), placement.y - turned.y(),
                             -lowest - 1 * kMillimetre + placement.lift);
  return T;
}

std::vector<std::pair<std::string, std::string>> OrderedPairs(
    const std::vector<ScenePlan>& scenes) {
  std::vector<std::pair<std::string, std::string>> pairs;
  for (const ScenePlan& a : scenes) {
    for (const ScenePlan& b : scenes) {
      if (a.name != b.name) pairs.emplace_back(a.name, b.name);
    }
  }
  return pairs;
}

void PlanDemo(SuitePlan& plan, const SimulateOptions& options) {
  const auto body = MakeBody({.kind = BodyKind::kTorso});
  RandomStream random(Hash(options.seed, 62));
  const auto sign = [&] { return random.Uniform() < 0.5 ? -1.0 : 1.0; };
  const Placement moved{sign() * random.Uniform(0.02, 0.05), sign() * random.Uniform(0.015, 0.04),
                        sign() * random.Uniform(3.0, 8.0), random.Within(1.2), random.Within(1.2)};
  plan.scenes.push_back({"reference", body, Placed(*body, {}), {}});
  plan.scenes.push_back({"moved", body, Placed(*body, moved), {}});
  plan.pairs = {{"reference", "moved"}};
}

void PlanNine(SuitePlan& plan, const SimulateOptions& options) {
  const auto body = MakeBody({.kind = BodyKind::kTorso});
  RandomStream random(Hash(options.seed, 63));
  for (int i = 0; i < 9; ++i) {
    // A 3 x 3 pattern of places with random offsets, so that the whole area is used for every seed.
    Placement placement;
    placement.x = 0.17 * (i % 3 - 1) + random.Within(0.08);
    placement.y = 0.12 * (i / 3 - 1) + random.Within(0.05);
    placement.yaw_deg = 12.0 * ((i * 4) % 9 - 4) * 0.6 + random.Within(6.0);
    placement.pitch_deg = random.Within(1.5);
    placement.roll_deg = random.Within(1.8);
    plan.scenes.push_back({fmt::format("placement_{}", i + 1), body, Placed(*body, placement), {}});
  }
  plan.pairs = OrderedPairs(plan.scenes);
}

// Moves of 0 to 10 mm and 0 to 2 deg, the range that verdicts distinguish. The first four
// placements are so close to each other that every pair of them uses at most half of the tolerance
// (3 mm, 1 deg); the others are farther apart.
void PlanSmall(SuitePlan& plan, const SimulateOptions& options) {
  constexpr int kClose = 4;
  constexpr int kPlacements = 10;
  const auto body = MakeBody({.kind = BodyKind::kTorso});
  RandomStream random(Hash(options.seed, 68));
  for (int i = 0; i < kPlacements; ++i) {
    const bool close = i < kClose;
    const double shift = (close ? 0.6 : 4.0) * kMillimetre;
    const double turn_deg = close ? 0.2 : 0.9;
    Placement placement;
    placement.x = random.Within(shift);
    placement.y = random.Within(shift);
    placement.lift = 2.0 * kMillimetre + random.Within(0.5 * shift);
    placement.yaw_deg = random.Within(turn_deg);
    placement.pitch_deg = random.Within(0.5 * turn_deg);
    placement.roll_deg = random.Within(turn_deg);
    plan.scenes.push_back({fmt::format("placement_{}", i + 1), body, Placed(*body, placement), {}});
  }
  plan.pairs = OrderedPairs(plan.scenes);
}

// The placements of `small` against the same body in a planning CT, which lies within 4 mm and 1
// deg of them in its plan.
void PlanCt(SuitePlan& plan, const SimulateOptions& options) {
  PlanSmall(plan, options);
  RandomStream random(Hash(options.seed, 69));
  const std::shared_ptr<const BodyModel> body = plan.scenes.front().body;
  // The head points to the gantry.
  Eigen::Matrix3d R;
  R << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  plan.T_iec_world.linear() =
      Eigen::AngleAxisd(random.Within(3.0) * kDegree, Vector3d::UnitZ()).toRotationMatrix() * R;
  const Vector3d isocentre =
      plan.scenes.front().T_world_body * body->centroid +
      Vector3d(random.Within(0.08), random.Within(0.05), random.Within(0.03));
  plan.T_iec_world.translation() = -(plan.T_iec_world.linear() * isocentre);
  plan.pairs.clear();
  for (const std::string_view position : kNamesOf<PatientPosture>) {
    Placement placement;
    placement.x = random.Within(4 * kMillimetre);
    placement.y = random.Within(4 * kMillimetre);
    placement.lift = 2.0 * kMillimetre + random.Within(2 * kMillimetre);
    placement.yaw_deg = random.Within(1.0);
    placement.pitch_deg = random.Within(0.5);
    placement.roll_deg = random.Within(1.0);
    CtPlan& ct = plan.cts.emplace_back();
    ct.name = fmt::format("ct_{}", position);
    ct.body = body;
    ct.T_world_body = Placed(*body, placement);
    ct.options = {.posture = Named<PatientPosture>(position).value(),
                  .isocentre_mm = {random.Within(90), random.Within(300), random.Within(200)},
                  .spacing_m = options.ct_spacing_m,
                  .skin_m = options.ct_skin_m * random.Normal(),
                  .phase = random.Uniform(0.0, 1.0),
                  .quirks = options.ct_quirks};
    for (const ScenePlan& scene : plan.scenes) plan.pairs.emplace_back(ct.name, scene.name);
  }
}

void PlanPatient(SuitePlan& plan, const SimulateOptions& options) {
  RandomStream random(Hash(options.seed, 64));
  const BodyShape relaxed{.kind = BodyKind::kFullBody, .right_arm_abduction_rad = 0.5 * kDegree};
  const auto add = [&](const std::string& name, const BodyShape& shape,
                       const Placement& placement) {
    const auto body = MakeBody(shape);
    // The trunk's position must not depend on the deformation, so it is placed by the relaxed
    // body's centroid.
    BodyModel anchor = *body;
    if (!plan.scenes.empty()) anchor.centroid = plan.scenes.front().body->centroid;
    plan.scenes.push_back({name, body, Placed(anchor, placement), {}});
  };
  const auto small = [&] {
    return Placement{random.Within(0.015), random.Within(0.012), random.Within(2.0),
                     random.Within(0.6), random.Within(0.8)};
  };
  add("reference", relaxed, {});
  BodyShape arm = relaxed;
  arm.right_arm_abduction_rad = random.Uniform(6.0, 9.0) * kDegree;
  add("arm_moved", arm, small());
  BodyShape belly = relaxed;
  belly.belly_rise_m = -random.Uniform(0.010, 0.018);
  add("belly_lower", belly, small());
  BodyShape chest = relaxed;
  chest.chest_rise_m = random.Uniform(0.006, 0.012);
  add("chest_higher", chest, small());
  for (std::size_t i = 1; i < plan.scenes.size(); ++i)
    plan.pairs.emplace_back("reference", plan.scenes[i].name);
}

double HandOf(NoiseLevel noise) { return noise == NoiseLevel::kHard ? 1.8 : 1.0; }

constexpr double kTremble_m = 4.0 * kMillimetre;
constexpr double kTremble_rad = 0.4 * kDegree;

void PlanSweeps(SuitePlan& plan, const SimulateOptions& options, double half_way, double height) {
  const unsigned room = options.room.value_or(options.seed);
  const double tremble = plan.unit.faults.Has(Fault::kTremble) ? HandOf(options.noise) : 0.0;
  for (std::size_t i = 0; i < plan.scenes.size(); ++i) {
    ScenePlan& scene = plan.scenes[i];
    RandomStream random(Hash(room, 65, i));
    // The operator follows the body, but not exactly.
    const Vector3d centre = scene.T_world_body * scene.body->centroid;
    const Vector3d forward = scene.T_world_body.linear().col(0);
    Pose T_world_sweep = Pose::Identity();
    T_world_sweep.translation() = Vector3d(0.5 * centre.x() + random.Within(0.02),
                                           0.6 * centre.y() + random.Within(0.02), 0.0);
    T_world_sweep.linear() = Eigen::AngleAxisd(0.45 * std::atan2(forward.y(), forward.x()) +
                                                   random.Within(2.0 * kDegree),
                                               Vector3d::UnitZ())
                                 .toRotationMatrix();
    SweepOptions motion;
    motion.T_world_sweep = T_world_sweep;
    motion.half_way_m = half_way;
    motion.height_m = height + random.Within(0.03);
    motion.swing_m = random.Uniform(0.19, 0.25);
    motion.swing_period_s = random.Uniform(3.2, 4.2);
    motion.duration_s = options.frames / options.rate_hz;
    motion.tremor = HandOf(options.noise);
    motion.tremble_m = tremble * kTremble_m;
    motion.tremble_rad = tremble * kTremble_rad;
    motion.seed = Hash(room, 66, i);
    scene.sweep = {.motion = motion,
                   .num_frames = options.frames,
                   .rate_hz = options.rate_hz,
                   .start_time_s = kFirstStamp_s + kSceneInterval_s * static_cast<double>(i),
                   .on_before_s = kSceneInterval_s * static_cast<double>(i),
                   .seed = Hash(room, 67, i)};
  }
}

}  // namespace

SuitePlan PlanSuite(const SimulateOptions& options) {
  if (options.frames < 2 || options.frames > 20000)
    throw std::invalid_argument(
        fmt::format("simulate: frames must be 2 to 20000, found {}", options.frames));
  if (!(options.rate_hz > 0) || options.rate_hz > 60)
    throw std::invalid_argument(
        fmt::format("simulate: rate must be over 0 and up to 60 Hz, found {}", options.rate_hz));
  const unsigned room = options.room.value_or(options.seed);
  SuitePlan plan;
  plan.name = options.suite;
  plan.unit = MakeSensorUnit(options.noise, options.unit.value_or(room), options.width,
                             options.height, FaultsOf(options), options.sensor);
  GiveLens(plan.unit, options.lens);
  const bool patient = options.suite == "patient";
  if (options.suite == "demo") {
    PlanDemo(plan, options);
  } else if (options.suite == "nine") {
    PlanNine(plan, options);
  } else if (options.suite == "small") {
    PlanSmall(plan, options);
  } else if (options.suite == "ct") {
    PlanCt(plan, options);
  } else if (patient) {
    PlanPatient(plan, options);
  } else if (options.suite == "live") {
    PlanDemo(plan, options);
  } else {
    throw std::invalid_argument(fmt::format(
        "simulate: unknown suite \"{}\", expected demo, nine, small, patient, ct or live",
        options.suite));
  }
  PlanSweeps(plan, options, patient ? 0.95 : 0.58, patient ? 1.0 : 0.95);

  std::vector<LayoutScene> layout;
  for (const ScenePlan& scene : plan.scenes) {
    SweepOptions steady = scene.sweep.motion;
    steady.tremble_m = steady.tremble_rad = 0.0;
    layout.push_back({scene.body->grid, scene.T_world_body, steady});
  }
  // The room is the same for every unit and fault.
  const SensorUnit usual = MakeSensorUnit(options.noise, room, options.width, options.height);
  const LayoutRegion region = patient ? LayoutRegion{1.02, 0.50, 26} : LayoutRegion{0.95, 0.66, 24};
  plan.room.boards = LayBoards(region, layout, usual.color_true, room);
  ApplyRoomFaults(plan, room);
  plan.reference_marker = plan.room.boards.front().id;
  for (ScenePlan& scene : plan.scenes) scene.sweep.reference_marker = plan.reference_marker;
  plan.room.support_texture =
      std::make_shared<const Texture>(patient ? PaintSheet(room) : PaintFloor(room));
  plan.room.skin_texture = std::make_shared<const Texture>(PaintSkin(options.seed));
  if (patient)
    plan.room.couch =
        Eigen::AlignedBox2f(Eigen::Vector2f(-1.12F, -0.58F), Eigen::Vector2f(1.12F, 0.58F));
  if (options.suite == "live") AddLiveScenes(plan, options);
  return plan;
}

std::unique_ptr<SimulatedSource> MakeSource(const SuitePlan& plan, std::size_t scene) {
  const ScenePlan& planned = plan.scenes.at(scene);
  Room room = plan.room;
  room.boards = planned.boards;
  return std::make_unique<SimulatedSource>(
      std::make_shared<const World>(room, planned.body->grid, planned.T_world_body),
      planned.other_unit ? *planned.other_unit : plan.unit, planned.sweep);
}

}  // namespace plumb::simulated

namespace plumb {

simulated::FaultSet FaultsOf(const SimulateOptions& options) {
  if (options.faults) return *options.faults;
  const bool mild = options.suite == "demo" && !options.unit;
  return mild ? simulated::MildFaults(options.noise) : simulated::FaultsOf(options.noise);
}

}  // namespace plumb
