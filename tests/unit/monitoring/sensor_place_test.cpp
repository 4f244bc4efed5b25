// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/sensor_place.hpp"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

class SensorPlaceTest : public testing::Test {
 protected:
  SensorPlaceTest() {
    T_camera_scene_.linear() =
        RotationFromVector({0.6, 0.1, 0.0}) * Eigen::Vector3d(1, -1, -1).asDiagonal();
    T_camera_scene_.translation() = Eigen::Vector3d(0.0, 0.05, 1.1);
    for (int id = 0; id < 8; ++id) {
      SceneMarker marker;
      const Eigen::Vector3d centre(-0.45 + 0.3 * (id % 4), id < 4 ? -0.3 : 0.3, 0.0);
      for (std::size_t c = 0; c < 4; ++c)
        marker.corners[c] = centre + CornersInMarkerFrame(0.104)[c];
      scene_[id] = marker;
    }
  }
  /// @param moved  In the scene, of the markers from `first` on.
  [[nodiscard]] SeenCorners See(const Pose& T_camera_scene,
                                const Eigen::Vector3d& moved = Eigen::Vector3d::Zero(),
                                int first = 0) {
    std::normal_distribution<double> noise(0.0, 0.05);
    SeenCorners seen;
    for (const auto& [id, marker] : scene_) {
      for (std::size_t c = 0; c < 4; ++c) {
        const Eigen::Vector3d p =
            marker.corners[c] + (id >= first ? moved : Eigen::Vector3d::Zero());
        seen[id][c] =
            Project(camera_, T_camera_scene * p) + Eigen::Vector2d(noise(random_), noise(random_));
      }
    }
    return seen;
  }
  [[nodiscard]] PlaceWatch Watch() {
    CornerMeans means;
    for (int i = 0; i < 15; ++i) means.Add(See(T_camera_scene_));
    const auto place = PlaceByMarkers(means.Means(), scene_, camera_);
    return {camera_,
            scene_,
            place.value(),
            means.Means(),
            means.Scatter_px(),
            Eigen::Vector3d(0, 0, 0.15)};
  }
  [[nodiscard]] PlaceCheck CheckThrice(PlaceWatch& watch, const Pose& T_camera_scene,
                                       const Eigen::Vector3d& moved = Eigen::Vector3d::Zero(),
                                       int first = 0, std::optional<bool> background = {}) {
    PlaceCheck check;
    for (int i = 0; i < 3; ++i)
      check =
          watch.Check(See(T_camera_scene, moved, first), [&](const Pose&) { return background; });
    return check;
  }
  [[nodiscard]] Pose Pushed(double mm) const {
    Pose push = Pose::Identity();
    push.translation() = Eigen::Vector3d(0.8, -0.5, 0.3).normalized() * mm * kMillimetre;
    return push * T_camera_scene_;
  }

  Intrinsics camera_;
  MarkerMap scene_;
  Pose T_camera_scene_ = Pose::Identity();
  std::mt19937 random_{5};
};

TEST_F(SensorPlaceTest, FindsThePoseInSpiteOfAMovedMarker) {
  SeenCorners seen = See(T_camera_scene_, Eigen::Vector3d(0.02, 0, 0), 7);
  const auto place = PlaceByMarkers(seen, scene_, camera_);
  ASSERT_TRUE(place);
  EXPECT_THAT(place->markers, ElementsAre(0, 1, 2, 3, 4, 5, 6));
  const Pose error = place->T_camera_scene * T_camera_scene_.inverse();
  EXPECT_LT((error * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(0, 0, 1)).norm(),
            0.5 * kMillimetre);
}

TEST_F(SensorPlaceTest, ThreeMarkersAreNoPlace) {
  SeenCorners seen = See(T_camera_scene_);
  while (seen.size() > 3) seen.erase(seen.begin());
  EXPECT_FALSE(PlaceByMarkers(seen, scene_, camera_));
}

TEST_F(SensorPlaceTest, ASensorAtRestHasNotMoved) {
  PlaceWatch watch = Watch();
  for (int i = 0; i < 2000; ++i) {
    const PlaceCheck check = watch.Check(See(T_camera_scene_), [](const Pose&) { return false; });
    ASSERT_FALSE(check.sensor_moved) << i;
    ASSERT_FALSE(check.couch_moved) << i;
  }
}

TEST_F(SensorPlaceTest, FewMarkersThatAnArmLeavesDoNotSayThatItMoved) {
  // Three beside each other: the body's place hangs on a long lever.
  PlaceWatch watch = Watch();
  for (int i = 0; i < 2000; ++i) {
    SeenCorners seen = See(T_camera_scene_);
    std::erase_if(seen, [](const auto& marker) { return marker.first != 0 && marker.first > 2; });
    const PlaceCheck check = watch.Check(seen, [](const Pose&) { return false; });
    ASSERT_FALSE(check.sensor_moved) << i;
  }
}

TEST_F(SensorPlaceTest, APushOfOneMillimetreIsFoundInThreeImages) {
  PlaceWatch watch = Watch();
  EXPECT_TRUE(CheckThrice(watch, Pushed(1.0)).sensor_moved);
}

TEST_F(SensorPlaceTest, MarkersThatStayProveThatTheCouchMoved) {
  PlaceWatch watch = Watch();
  const PlaceCheck check = CheckThrice(watch, T_camera_scene_, Eigen::Vector3d(0.004, 0.003, 0), 3);
  EXPECT_FALSE(check.sensor_moved);
  EXPECT_TRUE(check.couch_moved);
  EXPECT_THAT(check.still, ElementsAre(0, 1, 2));
}

TEST_F(SensorPlaceTest, WhereAllMarkersMoveTheBackgroundDecides) {
  const Eigen::Vector3d moved(0.004, 0.003, 0.002);
  PlaceWatch couch = Watch(), sensor = Watch(), unknown = Watch();
  EXPECT_TRUE(CheckThrice(couch, T_camera_scene_, moved, 0, true).couch_moved);
  EXPECT_TRUE(CheckThrice(sensor, T_camera_scene_, moved, 0, false).sensor_moved);
  EXPECT_TRUE(CheckThrice(unknown, T_camera_scene_, moved).sensor_moved) << "hold is safe";
}

TEST_F(SensorPlaceTest, MeansAreOfMarkersThatMostImagesShow) {
  CornerMeans means;
  SeenCorners seen = See(T_camera_scene_);
  means.Add(seen);
  seen.erase(0);
  means.Add(seen);
  means.Add(seen);
  EXPECT_THAT(means.Means(), SizeIs(7));
}

}  // namespace
}  // namespace plumb
