// SPDX-License-Identifier: Apache-2.0
// Faults of lens, driver and room: each does what its name says.
#include "drivers/simulator/suites/room_faults.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include <opencv2/core.hpp>

#include "algo/base/units.hpp"
#include "drivers/simulator/sensor/simulated_source.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/unit/simulator/simulated_support.hpp"

namespace plumb::simulated {
namespace {

SuitePlan PlanWith(const FaultSet& faults, const char* suite = "demo", int frames = 30) {
  return PlanSuite({.suite = suite,
                    .out = {},
                    .seed = 4,
                    .noise = NoiseLevel::kIdeal,
                    .faults = faults,
                    .frames = frames,
                    .rate_hz = 3.0,
                    .width = 160,
                    .height = 120});
}

SensorUnit IdealWith(Fault fault, std::uint64_t unit = 3) {
  return MakeSensorUnit(NoiseLevel::kIdeal, unit, 160, 120, FaultSet().With(fault));
}

double MeanLight(const cv::Mat& rgb) { return cv::mean(rgb)[0]; }

TEST(RoomFaultsTest, WithoutFaultsScenesHaveTheRoomsBoards) {
  const SuitePlan plan = PlanWith({});
  for (const ScenePlan& scene : plan.scenes) {
    ASSERT_EQ(scene.boards.size(), plan.room.boards.size());
    for (std::size_t i = 0; i < scene.boards.size(); ++i) {
      EXPECT_TRUE(scene.boards[i].T_world_marker.isApprox(plan.room.boards[i].T_world_marker, 0.0));
      EXPECT_EQ(scene.boards[i].print_scale[0], 1.0);
      EXPECT_EQ(scene.boards[i].bulge_m, 0.0);
    }
    EXPECT_FALSE(scene.sweep.events.Any());
  }
  EXPECT_EQ(plan.room.gloss, 0.0F);
}

TEST(RoomFaultsTest, AllPrintsAreScaledAlike) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kPrintScale));
  const std::array<double, 2> scale = plan.room.boards.front().print_scale;
  const double mean = 0.5 * (scale[0] + scale[1]) - 1.0;
  EXPECT_GE(std::abs(mean), 0.0025);
  EXPECT_LE(std::abs(mean), 0.005);
  for (const Board& board : plan.room.boards) EXPECT_EQ(board.print_scale, scale);
  const MarkerCorners corners = CornersOf(plan.room.boards.front());
  EXPECT_NEAR((corners[1] - corners[0]).norm(), kMarkerLength * scale[0], 1e-12);
  EXPECT_NEAR((corners[2] - corners[1]).norm(), kMarkerLength * scale[1], 1e-12);
}

TEST(RoomFaultsTest, AScaledPrintIsSeenAtItsSize) {
  Board board{17, Pose::Identity()};
  board.T_world_marker.translation() = Eigen::Vector3d(0.0, 0.0, 0.02);
  const auto black = [&](double scale) {
    board.print_scale = {scale, scale};
    const World world = BallWorld({0.0, 0.0, -0.5}, {board});
    const int count = 401;
    int found = 0;
    for (int i = 0; i < count; ++i) {
      const auto x = static_cast<float>(-0.056 + 0.112 * i / (count - 1));
      const Ray ray{Eigen::Vector3f(x, 0.0505F, 1.0F), -Eigen::Vector3f::UnitZ()};
      found += world.Trace(ray, world.FindCandidates(ray, 0.01F, 0.01F)).material ==
                       static_cast<Material>(kFirstBoard + 1)
                   ? 1
                   : 0;
    }
    return 0.112 * found / (count - 1);
  };
  EXPECT_NEAR(black(1.0), 0.104, 4e-4);
  EXPECT_NEAR(black(1.02), 0.104 * 1.02, 4e-4);
}

TEST(RoomFaultsTest, ACurledPrintBulgesBetweenItsSidesAndKeepsItsCorners) {
  Board board{17, Pose::Identity()};
  board.T_world_marker.translation() = Eigen::Vector3d(0.0, 0.0, 0.02);
  board.bulge_m = 0.002;
  const World world = BallWorld({0.0, 0.0, -0.5}, {board});
  for (const double x : {-0.052, -0.03, 0.0, 0.02, 0.052}) {
    // At a slant of 30 degrees.
    const Eigen::Vector3f way = Eigen::Vector3f(0.5F, 0.0F, -std::sqrt(0.75F)).normalized();
    const double height = 0.002 * (1.0 - std::pow(x / 0.052, 2));
    const Eigen::Vector3f target(static_cast<float>(x), 0.01F, static_cast<float>(0.02 + height));
    const Ray ray{target - way, way};
    const Hit hit = world.Trace(ray, world.FindCandidates(ray, 0.01F, 0.01F));
    EXPECT_NEAR(hit.t, 1.0, 2e-5) << x;
    const Eigen::Vector3f normal = world.Normal(hit.material, target);
    EXPECT_NEAR(normal.x() / normal.z(), 2 * 0.002 * x / (0.052 * 0.052), 1e-5);
  }
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kCurledPrints));
  EXPECT_EQ(plan.room.boards.front().bulge_m, 0.0);
  for (std::size_t i = 1; i < plan.room.boards.size(); ++i) {
    EXPECT_GE(std::abs(plan.room.boards[i].bulge_m), 0.0005);
    EXPECT_LE(std::abs(plan.room.boards[i].bulge_m), 0.0025);
  }
}

TEST(RoomFaultsTest, OneMarkerWasMovedInEverySceneButTheFirst) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kMovedMarker));
  const auto moved = [&](const ScenePlan& scene) {
    std::vector<double> distances;
    for (std::size_t i = 0; i < scene.boards.size(); ++i) {
      const double distance = (scene.boards[i].T_world_marker.translation() -
                               plan.room.boards[i].T_world_marker.translation())
                                  .norm();
      if (distance > 0) distances.push_back(distance);
    }
    return distances;
  };
  EXPECT_TRUE(moved(plan.scenes[0]).empty());
  ASSERT_EQ(moved(plan.scenes[1]).size(), 1U);
  EXPECT_GE(moved(plan.scenes[1])[0], 0.006);
  EXPECT_LE(moved(plan.scenes[1])[0], 0.020);
  EXPECT_TRUE(
      plan.scenes[1].boards[0].T_world_marker.isApprox(plan.room.boards[0].T_world_marker, 0.0));
}

TEST(RoomFaultsTest, AMarkerIsPushedDuringTheSweep) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kMovingMarker));
  const ScenePlan& scene = plan.scenes[0];
  ASSERT_TRUE(scene.sweep.events.pushed);
  const PushedBoard& pushed = *scene.sweep.events.pushed;
  const World world(plan.room, scene.body->grid, scene.T_world_body);
  const auto at = [&](double time) {
    return WorldAt(world, scene.sweep.events, time, Pose::Identity())
        .room()
        .boards[pushed.board]
        .T_world_marker;
  };
  EXPECT_TRUE(at(pushed.begin_s - 0.01).isApprox(scene.boards[pushed.board].T_world_marker, 1e-12));
  EXPECT_TRUE(at(pushed.end_s + 0.01).isApprox(pushed.T_world_after, 1e-12));
  const double way = (at(pushed.end_s).translation() - at(pushed.begin_s).translation()).norm();
  EXPECT_GE(way, 0.010);
  EXPECT_LE(way, 0.030);
  EXPECT_NEAR(
      (at(0.5 * (pushed.begin_s + pushed.end_s)).translation() - at(pushed.begin_s).translation())
          .norm(),
      0.5 * way, 1e-9);
}

TEST(RoomFaultsTest, RodsAreMetWhereTheyAre) {
  World world = BallWorld({0.0, 0.0, -0.5});
  Rods rods;
  rods.rods.push_back({{0.0F, -0.1F, 0.3F}, {0.0F, 0.1F, 0.3F}, 0.02F});
  world.PlaceRods(rods);
  const auto down = [&](float x, float y) {
    const Ray ray{Eigen::Vector3f(x, y, 1.0F), -Eigen::Vector3f::UnitZ()};
    return world.Trace(ray, world.FindCandidates(ray, 0.01F, 0.01F));
  };
  const auto height = [](float off) { return 0.3F + std::sqrt(0.02F * 0.02F - off * off); };
  EXPECT_EQ(down(0.0F, 0.0F).material, kRod);
  EXPECT_NEAR(down(0.0F, 0.0F).t, 1.0F - height(0.0F), 1e-5);
  EXPECT_NEAR(down(0.015F, 0.05F).t, 1.0F - height(0.015F), 1e-5);
  EXPECT_NEAR(down(0.0F, 0.11F).t, 1.0F - height(0.01F), 1e-5) << "the ball at the end";
  EXPECT_NEAR(down(0.0F, -0.11F).t, 1.0F - height(0.01F), 1e-5) << "and at the other";
  EXPECT_EQ(down(0.0F, 0.121F).material, kSupport);
  EXPECT_EQ(down(0.021F, 0.0F).material, kSupport);
  EXPECT_NEAR(world.Normal(kRod, {0.01F, 0.0F, height(0.01F)}).x(), 0.5F, 1e-4);
}

TEST(RoomFaultsTest, TheHandComesAndGoes) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kHand));
  const ScenePlan& scene = plan.scenes[0];
  ASSERT_TRUE(scene.sweep.events.hand);
  const HandVisit& visit = *scene.sweep.events.hand;
  const World world(plan.room, scene.body->grid, scene.T_world_body);
  const DepthCamera camera(plan.unit);
  const Trajectory trajectory(scene.sweep.motion);
  const auto render = [&](double time, bool hand) {
    SceneEvents events = scene.sweep.events;
    if (!hand) events.hand.reset();
    return camera.Render(WorldAt(world, events, time, Pose::Identity()), trajectory, time, 1);
  };
  const auto changed = [&](double time) {
    return cv::countNonZero(render(time, true).registered != render(time, false).registered);
  };
  EXPECT_GT(changed(0.5 * (visit.begin_s + visit.end_s)), 160 * 120 / 100);
  EXPECT_EQ(changed(visit.begin_s - 0.02), 0);
  EXPECT_EQ(changed(visit.end_s + 0.02), 0);
}

TEST(RoomFaultsTest, TheCableIsInEveryView) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kCable));
  const ScenePlan& scene = plan.scenes[0];
  const World world(plan.room, scene.body->grid, scene.T_world_body);
  const ColorCamera camera(plan.unit);
  const Trajectory trajectory(scene.sweep.motion);
  for (const double time : {1.0, 5.0, 9.0}) {
    const Pose T = trajectory.T_world_camera(time);
    const cv::Mat with =
        camera.Render(WorldAt(world, scene.sweep.events, time, T), trajectory, time, 1);
    const cv::Mat without = camera.Render(world, trajectory, time, 1);
    EXPECT_GT(cv::countNonZero(cv::Mat(with != without).reshape(1)), 60) << time;
  }
}

TEST(RoomFaultsTest, TheBodyBreathesAroundItsOwnShape) {
  const SuitePlan plan = PlanWith(FaultSet().With(Fault::kBreathing));
  const ScenePlan& scene = plan.scenes[0];
  ASSERT_TRUE(scene.sweep.events.breath);
  const Breath& breath = *scene.sweep.events.breath;
  const auto belly_height = [&](const DistanceGrid& grid) {
    return 1.0F - grid.Intersect({0.10F, 0.0F, 1.0F}, -Eigen::Vector3f::UnitZ(), 0.0F, 2.0F);
  };
  const float out = belly_height(*breath.levels.front());
  const float in = belly_height(*breath.levels.back());
  EXPECT_GT(in - out, 0.003F);
  EXPECT_LT(in - out, 0.012F);
  EXPECT_NEAR(in - out, breath.belly_m, 0.002);
  EXPECT_LT(breath.chest_m, breath.belly_m + 0.001);
  EXPECT_NEAR(belly_height(*scene.body->grid), 0.5F * (in + out), 5e-4F);
  double least = 1, most = 0;
  for (int i = 0; i < 100; ++i) {
    least = std::min(least, breath.DepthAt(breath.period_s * i / 100));
    most = std::max(most, breath.DepthAt(breath.period_s * i / 100));
  }
  EXPECT_LT(least, 0.01);
  EXPECT_GT(most, 0.99);
  EXPECT_EQ(plan.scenes[1].sweep.events.breath->levels.front(), breath.levels.front())
      << "scenes of one body share its levels";
}

TEST(RoomFaultsTest, GlossyPrintsMirrorTheLights) {
  Board board{17, Pose::Identity()};
  board.T_world_marker.translation() = Eigen::Vector3d(0.0, 0.0, 0.02);
  const auto render = [&](float gloss) {
    Room room;
    room.boards = {board};
    room.support_texture = std::make_shared<const Texture>(Eigen::Vector2f(-1, -1), 0.05F, 40, 40,
                                                           Eigen::Vector3f::Constant(0.3F));
    room.skin_texture = room.support_texture;
    room.gloss = gloss;
    Pose T_world_body = Pose::Identity();
    T_world_body.translation().z() = -0.5;
    // Where the mirrored panel of (-0.7, 0.9, 2.3) is seen in the marker.
    const Eigen::Vector3f eye(0.7F * 0.3F, -0.9F * 0.3F, 0.02F + 2.28F * 0.3F);
    return World(room, Ball(), T_world_body).GlareAt(kFirstBoard, {0, 0, 0.02F}, eye);
  };
  EXPECT_EQ(render(0.0F), 0.0F);
  EXPECT_NEAR(render(0.5F), 0.5F, 0.02F);
  EXPECT_GT(PlanWith(FaultSet().With(Fault::kGlare)).room.gloss, 0.0F);
}

TEST(RoomFaultsTest, TheLensHasMoreTermsThanTheFileSays) {
  const SensorUnit unit = IdealWith(Fault::kLensHigher);
  EXPECT_NE(unit.color_lens_rest, LensRest{});
  EXPECT_EQ(unit.color_true, MakeSensorUnit(NoiseLevel::kIdeal, 3, 160, 120).color_true);
  double most = 0;
  for (int y = 0; y < 120; y += 7) {
    for (int x = 0; x < 160; x += 7) {
      const Eigen::Vector2d ideal = Undistort(unit.color_true, unit.color_lens_rest, {x, y});
      const double r2 = ideal.squaredNorm();
      const LensRest& rest = unit.color_lens_rest;
      // Forwards: the five terms, then the rest.
      const Eigen::Vector2d added(
          r2 * (rest.prism[0] + rest.prism[1] * r2) + rest.k4 * std::pow(r2, 4) * ideal.x(),
          r2 * (rest.prism[2] + rest.prism[3] * r2) + rest.k4 * std::pow(r2, 4) * ideal.y());
      const Eigen::Vector2d off(unit.color_true.fx * added.x(), unit.color_true.fy * added.y());
      const Eigen::Vector2d pixel =
          Project(unit.color_true, Eigen::Vector3d(ideal.x(), ideal.y(), 1.0)) + off;
      EXPECT_LT((pixel - Eigen::Vector2d(x, y)).norm(), 1e-6);
      most = std::max(most, 4 * off.norm());  // Of a 640-pixel image.
    }
  }
  EXPECT_GT(most, 0.02);
  EXPECT_LT(most, 1.0);
}

TEST(RoomFaultsTest, ADecentredLensIsNotInTheFile) {
  const SensorUnit unit = IdealWith(Fault::kLensTangential);
  EXPECT_NE(unit.color_true.distortion[2], unit.color_written.distortion[2]);
  EXPECT_EQ(unit.color_true.fx, unit.color_written.fx);
  EXPECT_LE(std::abs(unit.color_true.distortion[2]), 0.0006);
}

TEST(RoomFaultsTest, SpeckleStaysWithThePattern) {
  SensorUnit unit = IdealWith(Fault::kSpeckle);
  EXPECT_GE(unit.speckle, 0.3);
  const World world = BallWorld({0, 0, -0.5});
  const auto errors = [&](double height, std::uint64_t noise_seed) {
    const DepthShot shot =
        DepthCamera(unit).Render(world, Trajectory(Standing(height)), 2.0, noise_seed);
    return cv::Mat(shot.measured_m - shot.true_m);
  };
  const cv::Mat first = errors(0.8, 1);
  const double sigma = std::sqrt(first.dot(first) / static_cast<double>(first.total()));
  EXPECT_NEAR(sigma / (unit.speckle * NguyenAxialSigma(0.8, 0.0)), 1.1, 0.25);
  EXPECT_EQ(cv::countNonZero(first != errors(0.8, 2)), 0) << "the same in every image of a view";
  const cv::Mat other = errors(1.2, 1);
  EXPECT_LT(std::abs(first.dot(other)) / std::sqrt(first.dot(first) * other.dot(other)), 0.3)
      << "another where the pattern falls on another depth";
}

TEST(RoomFaultsTest, AColdSensorDriftsAndAWarmOneDoesNot) {
  SuitePlan plan = PlanWith(FaultSet().With(Fault::kWarmUp));
  EXPECT_NE(plan.unit.warm_up, 0.0);
  EXPECT_EQ(plan.scenes[1].sweep.on_before_s - plan.scenes[0].sweep.on_before_s, 100.0);
  const auto scale_after = [&](double on_before_s) {
    plan.scenes[0].sweep.on_before_s = on_before_s;
    const auto source = MakeSource(plan, 0);
    (void)source->Next();
    const cv::Mat& truth = source->truth().depth.true_m;
    return cv::sum(source->truth().depth.measured_m)[0] / cv::sum(truth)[0] - 1.0;
  };
  EXPECT_NEAR(scale_after(0.0), plan.unit.warm_up, 1e-5);
  EXPECT_NEAR(scale_after(600.0), plan.unit.warm_up * std::exp(-1.0), 1e-5);
  EXPECT_NEAR(scale_after(1e5), 0.0, 1e-6);
}

TEST(RoomFaultsTest, ExposureAndWhiteBalanceStep) {
  const auto levels = [](Fault fault) {
    const SuitePlan plan = PlanWith(FaultSet().With(fault), "demo", 24);
    const SuitePlan steady = PlanWith({}, "demo", 24);
    const auto source = MakeSource(plan, 0);
    const auto other = MakeSource(steady, 0);
    std::vector<double> ratios;
    while (const auto frame = source->Next())
      ratios.push_back(MeanLight(frame->color_rgb) / MeanLight(other->Next()->color_rgb));
    return ratios;
  };
  for (const Fault fault : {Fault::kExposureSteps, Fault::kWhiteBalance}) {
    const std::vector<double> ratios = levels(fault);
    const auto [least, most] = std::minmax_element(ratios.begin(), ratios.end());
    EXPECT_GT(*most / *least, fault == Fault::kExposureSteps ? 1.08 : 1.02);
  }
}

TEST(RoomFaultsTest, PairsAreLostAndDoubled) {
  SuitePlan plan = PlanWith({}, "demo", 60);
  plan.unit.lost_frames = 0.2;
  plan.unit.doubled_frames = 0.2;
  const auto source = MakeSource(plan, 0);
  int given = 0, doubled = 0, holes = 0;
  std::optional<Frame> before;
  while (std::optional<Frame> frame = source->Next()) {
    EXPECT_EQ(frame->index, given++);
    if (before) {
      const double gap = frame->color_time_s - before->color_time_s;
      EXPECT_GT(gap, 0.3);
      holes += gap > 0.5 ? 1 : 0;
      doubled +=
          cv::countNonZero(cv::Mat(frame->color_rgb != before->color_rgb).reshape(1)) == 0 ? 1 : 0;
    }
    before = std::move(frame);
  }
  EXPECT_EQ(source->info().num_frames, given);
  EXPECT_NEAR(given, 48, 9);
  EXPECT_GT(holes, 3);
  EXPECT_NEAR(doubled, 12, 8);
  const SensorUnit hard =
      MakeSensorUnit(NoiseLevel::kIdeal, 1, 160, 120, FaultSet().With(Fault::kLostFrames));
  EXPECT_GT(hard.lost_frames, 0.0);
  EXPECT_EQ(hard.doubled_frames, 0.0);
}

}  // namespace
}  // namespace plumb::simulated
