// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/scene_alignment.hpp"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const Pose kTrue(Eigen::Translation3d(0.3, -0.2, 0.1) *
                 Eigen::AngleAxisd(0.8, Eigen::Vector3d(0.1, 0.2, 1).normalized()));

// Markers around a body, each turned another way.
MarkerMap Room(int count, double sigma_m = 0.001) {
  MarkerMap map;
  for (int id = 0; id < count; ++id) {
    const double angle = 6.283 * id / count;
    const Pose T(Eigen::Translation3d(0.7 * std::cos(angle), 0.5 * std::sin(angle), 0) *
                 Eigen::AngleAxisd(1.1 * id, Eigen::Vector3d::UnitZ()));
    SceneMarker marker;
    marker.sigma_m = sigma_m;
    marker.corners = CornersInMarkerFrame(0.104);
    for (Eigen::Vector3d& p : marker.corners) p = T * p;
    map[id] = marker;
  }
  return map;
}

MarkerMap Seen(const MarkerMap& room, double noise_m, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, noise_m);
  MarkerMap map = room;
  for (auto& [id, marker] : map) {
    for (Eigen::Vector3d& p : marker.corners)
      p = kTrue.inverse() * p + (noise_m > 0
                                     ? Eigen::Vector3d(noise(random), noise(random), noise(random))
                                     : Eigen::Vector3d::Zero());
  }
  return map;
}

void Move(MarkerMap& map, int id, const Eigen::Vector3d& by_m) {
  for (Eigen::Vector3d& p : map.at(id).corners) p += by_m;
}

double WorstCorner_m(const Alignment& alignment, const MarkerMap& room) {
  double worst = 0;
  for (const auto& [id, marker] : room) {
    for (const Eigen::Vector3d& p : marker.corners)
      worst = std::max(worst, (alignment.T_reference_current * (kTrue.inverse() * p) - p).norm());
  }
  return worst;
}

TEST(SceneAlignmentTest, ExactMarkersGiveTheExactPose) {
  for (const Preset preset : {Preset::kBest, Preset::kPaper}) {
    const MarkerMap room = Room(6);
    const AlignmentOutcome outcome = AlignScenes(room, Seen(room, 0, 1), preset);
    ASSERT_TRUE(outcome.alignment);
    EXPECT_LT(WorstCorner_m(*outcome.alignment, room), 1e-12);
    EXPECT_THAT(outcome.alignment->markers_used, ElementsAre(0, 1, 2, 3, 4, 5));
    EXPECT_THAT(EnglishTexts(outcome.warnings), IsEmpty());
  }
}

TEST(SceneAlignmentTest, NamesTheMarkerThatMovedAndLeavesItOut) {
  const MarkerMap room = Room(6);
  for (unsigned seed = 1; seed <= 20; ++seed) {
    MarkerMap current = Seen(room, 0.001, seed);
    Move(current, 4, {0.012, 0, 0});
    const AlignmentOutcome outcome = AlignScenes(room, current);
    ASSERT_TRUE(outcome.alignment);
    EXPECT_THAT(outcome.alignment->markers_rejected,
                ElementsAre(testing::Pair(4, testing::DoubleNear(0.012, 0.002))));
    EXPECT_THAT(EnglishTexts(outcome.warnings), ElementsAre(HasSubstr("marker 4 moved")));
    // 20 corners of 1 mm; measured worst corner over these seeds 1.0 mm.
    EXPECT_LT(WorstCorner_m(*outcome.alignment, room), 0.002);
  }
}

TEST(SceneAlignmentTest, TheOthersScatterShowsThatAMarkerMovedBySixMillimetres) {
  const MarkerMap room = Room(12, 0.0021);  // Four times the error.
  for (unsigned seed = 1; seed <= 20; ++seed) {
    MarkerMap current = Seen(room, 0.0006, seed);
    EXPECT_THAT(AlignScenes(room, current).alignment->markers_rejected, IsEmpty());
    Move(current, 4, {0.0045, 0, 0});  // Below `moved_m`.
    EXPECT_THAT(AlignScenes(room, current).alignment->markers_rejected, IsEmpty());
    Move(current, 4, {0.0018, 0, 0});
    EXPECT_THAT(AlignScenes(room, current).alignment->markers_rejected,
                ElementsAre(testing::Pair(4, testing::DoubleNear(0.0063, 0.001))));
  }
}

TEST(SceneAlignmentTest, ThreeMarkersAreUsedWithACaution) {
  const MarkerMap room = Room(3);
  const AlignmentOutcome three = AlignScenes(room, Seen(room, 0.0005, 1));
  ASSERT_TRUE(three.alignment);
  EXPECT_THAT(EnglishTexts(three.warnings), ElementsAre(HasSubstr("only 3 markers")));
  const MarkerMap more = Room(4);
  EXPECT_THAT(AlignScenes(more, Seen(more, 0.0005, 1)).warnings, IsEmpty());
}

TEST(SceneAlignmentTest, NoisyDepthAccusesNobody) {
  const MarkerMap room = Room(6, 0.004);
  for (unsigned seed = 1; seed <= 50; ++seed) {
    const AlignmentOutcome outcome = AlignScenes(room, Seen(room, 0.0056, seed));  // both maps 4 mm
    ASSERT_TRUE(outcome.alignment);
    EXPECT_THAT(outcome.alignment->markers_rejected, IsEmpty()) << "seed " << seed;
  }
}

TEST(SceneAlignmentTest, ThreeGoodMarkersWinAgainstFourThatMovedEachItsOwnWay) {
  const MarkerMap room = Room(7);
  for (unsigned seed = 1; seed <= 10; ++seed) {
    MarkerMap current = Seen(room, 0.0005, seed);
    Move(current, 0, {0.3, 0, 0});
    Move(current, 2, {0, -0.2, 0});
    Move(current, 3, {-0.1, 0.1, 0.05});
    Move(current, 6, {0.05, 0.2, 0});
    const AlignmentOutcome outcome = AlignScenes(room, current);
    ASSERT_TRUE(outcome.alignment);
    EXPECT_THAT(outcome.alignment->markers_used, ElementsAre(1, 4, 5));
    EXPECT_THAT(outcome.alignment->markers_rejected, SizeIs(4));
  }
}

TEST(SceneAlignmentTest, OneGoodMarkerAgainstManyMovedIsNoAnswer) {
  const MarkerMap room = Room(5);
  MarkerMap current = Seen(room, 0.0005, 3);
  Move(current, 1, {0.3, 0, 0});
  Move(current, 2, {0, -0.2, 0});
  Move(current, 3, {-0.1, 0.1, 0.05});
  Move(current, 4, {0.05, 0.2, 0});
  const AlignmentOutcome outcome = AlignScenes(room, current);
  EXPECT_FALSE(outcome.alignment);
  EXPECT_THAT(EnglishTexts(RefusalsOfMarkers(outcome.markers, 3)),
              ElementsAre(HasSubstr("did not move")));
}

TEST(SceneAlignmentTest, TwoGroupsOfEqualSizeAreNoAnswer) {
  const MarkerMap room = Room(6);
  MarkerMap current = Seen(room, 0.0005, 4);
  for (const int id : {0, 1, 2}) Move(current, id, {0.1, 0.05, 0});
  const AlignmentOutcome outcome = AlignScenes(room, current);
  EXPECT_FALSE(outcome.alignment);
  EXPECT_THAT(EnglishTexts(RefusalsOfMarkers(outcome.markers, 3)),
              ElementsAre(HasSubstr("two groups of 3")));
}

TEST(SceneAlignmentTest, FewerThanThreeSharedMarkersAreNoAnswerInBestOnly) {
  const MarkerMap room = Room(6);
  MarkerMap current = Seen(room, 0.0005, 5);
  for (const int id : {0, 1, 2, 3}) current.erase(id);
  const AlignmentOutcome best = AlignScenes(room, current);
  EXPECT_FALSE(best.alignment);
  EXPECT_THAT(
      EnglishTexts(RefusalsOfMarkers(best.markers, 3)),
      ElementsAre(
          "the scan needs at least 3 markers shared with the reference, found 2 (ids 4, 5); "
          "keep the markers in view"));
  current.erase(4);
  const AlignmentOutcome paper = AlignScenes(room, current, Preset::kPaper);
  ASSERT_TRUE(paper.alignment);  // four coplanar corners determine a pose
  EXPECT_THAT(paper.alignment->markers_used, ElementsAre(5));
  EXPECT_THAT(EnglishTexts(RefusalsOfMarkers(paper.markers, 3)),
              ElementsAre(HasSubstr("found 1 (id 5)")));
  current.clear();
  EXPECT_FALSE(AlignScenes(room, current, Preset::kPaper).alignment);
}

TEST(SceneAlignmentTest, ThePaperPresetUsesAMovedMarkerAndTheGateIsShownIt) {
  const MarkerMap room = Room(6);
  MarkerMap current = Seen(room, 0.0005, 5);
  Move(current, 4, {0.012, 0, 0});
  const AlignmentOutcome paper = AlignScenes(room, current, Preset::kPaper);
  ASSERT_TRUE(paper.alignment);
  EXPECT_THAT(paper.alignment->markers_used, SizeIs(6));
  EXPECT_THAT(paper.markers.moved_used, ElementsAre(4));
  EXPECT_THAT(EnglishTexts(RefusalsOfMarkers(paper.markers, 3)),
              ElementsAre(HasSubstr("marker 4 moved")));
  const AlignmentOutcome best = AlignScenes(room, current);
  EXPECT_THAT(best.markers.moved_used, IsEmpty());
  EXPECT_THAT(EnglishTexts(RefusalsOfMarkers(best.markers, 3)), IsEmpty());
}

TEST(SceneAlignmentTest, PreciseMarkersOutweighVagueOnes) {
  MarkerMap room = Room(6);
  for (const int id : {0, 2, 4}) room.at(id).sigma_m = 0.02;
  double weighted = 0, equal = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    MarkerMap current = Seen(room, 0.0005, seed);
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0, 0.02);
    for (const int id : {0, 2, 4}) {
      for (Eigen::Vector3d& p : current.at(id).corners)
        p += Eigen::Vector3d(noise(random), noise(random), noise(random));
    }
    const AlignmentOutcome best = AlignScenes(room, current);
    ASSERT_TRUE(best.alignment);
    EXPECT_THAT(best.alignment->markers_rejected, IsEmpty());
    weighted += WorstCorner_m(*best.alignment, room);
    equal += WorstCorner_m(*AlignScenes(room, current, Preset::kPaper).alignment, room);
  }
  EXPECT_LT(weighted, 0.2 * equal);  // measured 0.06
}

TEST(SceneAlignmentTest, CovarianceMatchesTheScatterOfRepeatedScans) {
  const MarkerMap room = Room(6, 0.001);
  Matrix6d scatter = Matrix6d::Zero();
  Matrix6d claimed = Matrix6d::Zero();
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    const AlignmentOutcome outcome =
        AlignScenes(room, Seen(room, 0.001 * std::sqrt(2.0), static_cast<unsigned>(trial) + 1));
    ASSERT_TRUE(outcome.alignment);
    const Eigen::Vector3d c = outcome.alignment->centre_m;
    const Pose error = Eigen::Translation3d(-c) * outcome.alignment->T_reference_current *
                       kTrue.inverse() * Eigen::Translation3d(c);
    const Vector6d twist = TwistFromPose(error);
    scatter += twist * twist.transpose() / kTrials;
    claimed += outcome.alignment->covariance / kTrials;
  }
  // Corners here are independent, the claim counts four as two: it is twice the scatter, and 7 %
  // more because the variance factor is never taken below one. Measured 2.0 to 2.6.
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(claimed(i, i) / scatter(i, i), 2.14, 0.5) << i;
}

TEST(SceneAlignmentTest, AMapThatCameOutLongerThanItsReferenceIsPulledBackAlongThatDirectionOnly) {
  const MarkerMap room = Room(12);
  MarkerMap current = Seen(room, 0.0003, 6);
  const Eigen::Vector3d along =
      kTrue.linear().transpose() * Eigen::Vector3d::UnitX();  // of the room, in the current frame
  const Eigen::Vector3d origin = kTrue.inverse() * Eigen::Vector3d::Zero();
  for (auto& [id, marker] : current) {
    for (Eigen::Vector3d& p : marker.corners) p += 0.004 * along.dot(p - origin) * along;
  }
  const AlignmentOutcome outcome = AlignScenes(room, current);
  ASSERT_TRUE(outcome.alignment);
  const Eigen::Matrix3d stretch = outcome.alignment->stretch;
  // 48 corners of 1.4 mm (claimed) over 0.5 m leave 0.06 %, so 8 % of the stretch is held back by
  // the prior: measured -0.0037.
  EXPECT_NEAR(stretch(0, 0), 1 - 0.0038, 0.0004);
  EXPECT_NEAR(stretch(1, 1), 1.0, 0.0004);
  EXPECT_NEAR(stretch(2, 2), 1.0, 1e-9);
  EXPECT_TRUE(stretch.isApprox(stretch.transpose()));
  // The paper's alignment is rigid, and so is one from vague markers.
  EXPECT_EQ(AlignScenes(room, current, Preset::kPaper).alignment->stretch,
            Eigen::Matrix3d::Identity());
  MarkerMap vague = current;
  for (auto& [id, marker] : vague) marker.sigma_m = 0.05;
  EXPECT_NEAR(AlignScenes(room, vague).alignment->stretch(0, 0), 1.0, 0.0003);
}

TEST(SceneAlignmentTest, DistortionIsWhatTheMapsDisagreeByAtAMarker) {
  const MarkerMap room = Room(12);
  EXPECT_LT(AlignScenes(room, Seen(room, 0, 1)).alignment->distortion.norm(), 1e-20);
  MarkerMap current = Seen(room, 0, 1);
  // Every other marker 2 mm up, the others 2 mm down: no rigid motion and no stretch explains it.
  const Eigen::Vector3d up = kTrue.linear().transpose() * Eigen::Vector3d::UnitZ();
  for (auto& [id, marker] : current) {
    for (Eigen::Vector3d& p : marker.corners) p += (id % 2 == 0 ? 0.002 : -0.002) * up;
  }
  const Eigen::Matrix3d distortion = AlignScenes(room, current).alignment->distortion;
  EXPECT_NEAR(std::sqrt(distortion(2, 2)), 0.002, 0.0003);
  EXPECT_NEAR(std::sqrt(distortion(0, 0)), 0.0, 0.0003);
}

TEST(SceneAlignmentTest, AMarkerThatWasHardlySeenSaysNothingOfTheDistortion) {
  const MarkerMap room = Room(12);
  const auto height_off_m = [&](double sigma_m) {
    MarkerMap current = Seen(room, 0, 1);
    const Eigen::Vector3d up = kTrue.linear().transpose() * Eigen::Vector3d::UnitZ();
    for (auto& [id, marker] : current) {
      const bool hardly = id == current.begin()->first;
      for (Eigen::Vector3d& p : marker.corners)
        p += (hardly ? 0.006 : id % 2 == 0 ? 0.0005 : -0.0005) * up;
      marker.sigma_m = hardly ? sigma_m : 0.0005;
    }
    return std::sqrt(AlignScenes(room, current).alignment->distortion(2, 2));
  };
  EXPECT_NEAR(height_off_m(0.012), 0.0006, 0.0002);
  // One that is as good as the others counts, if it was not found to have been moved.
  EXPECT_GT(height_off_m(0.003), height_off_m(0.012));
}

TEST(SceneAlignmentTest, DamagedCornersAreNotShared) {
  const MarkerMap room = Room(4);
  MarkerMap current = Seen(room, 0, 1);
  current.at(2).corners[1].x() = std::nan("");
  const AlignmentOutcome outcome = AlignScenes(room, current);
  ASSERT_TRUE(outcome.alignment);
  EXPECT_THAT(outcome.alignment->markers_used, ElementsAre(0, 1, 3));
}

}  // namespace
}  // namespace plumb
