// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/dense_terms.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/unit/tracking/synthetic_map.hpp"

namespace plumb::dense {
namespace {

constexpr double kGate_m = 0.05;

struct Scene {
  explicit Scene(const synthetic::MapOptions& options) : truth(synthetic::MakeTrueMap(options)) {}

  void Prepare() {
    cells = MakeCells(truth.stated, truth.map);
    sensor = MakeSensor(truth.stated, {});
    views = MakeViews(sensor, {}, cells, truth.map);
  }
  [[nodiscard]] std::vector<QuadraticTerm> Terms(const std::vector<KeyframePair>& pairs,
                                                 Density density) const {
    std::vector<QuadraticTerm> terms;
    MakeTerms(sensor, {.marker_length_m = synthetic::kMarkerLength}, truth.map, views, pairs,
              kGate_m, density, {}, {}, terms);
    return terms;
  }

  synthetic::TrueMap truth;
  Cells cells;
  Sensor sensor;
  std::vector<View> views;
};

// Information about the first twist of all terms.
Eigen::Matrix<double, 6, 6> Information(const std::vector<QuadraticTerm>& terms) {
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (const QuadraticTerm& term : terms) sum += term.H.topLeftCorner<6, 6>();
  return sum;
}

TEST(DenseTerms, CoarseOnesWeighAsMuchAsFineOnes) {
  Scene scene({.num_keyframes = 8, .num_landmarks = 40, .markers = false, .dense = true});
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  ASSERT_GT(pairs.size(), 16U);
  const auto fine = Information(scene.Terms(pairs, Density::kFine));
  const auto coarse = Information(scene.Terms(pairs, Density::kCoarse));
  for (Eigen::Index i = 0; i < 6; ++i)
    EXPECT_NEAR(coarse(i, i) / fine(i, i), 1.0, 0.1) << "unknown " << i;
  EXPECT_NE(coarse, fine) << "the same cells were used";
}

TEST(DenseTerms, LeaveOutTheCellsThatAreHeldOut) {
  // A view against itself: every cell is projected onto itself.
  const std::vector<KeyframePair> itself(64, KeyframePair{1, 1, 1.0});
  const auto weight_m2 = [&](bool of_held_out, Density density) {
    Scene scene({.num_keyframes = 2, .num_landmarks = 40, .markers = false, .dense = true});
    DenseView& view = scene.truth.map.keyframes[1].dense;
    for (int r = 0; r < view.height; ++r)
      for (int c = 0; c < view.width; ++c)
        if ((r % 4 == 2 && c % 4 == 2) != of_held_out)
          view.normals[static_cast<std::size_t>(r * view.width + c)].setZero();
    scene.Prepare();
    return Information(scene.Terms(itself, density)).trace();
  };
  for (const Density density : {Density::kFine, Density::kCoarse}) {
    EXPECT_EQ(weight_m2(true, density), 0.0);
    EXPECT_GT(weight_m2(false, density), 0.0) << "nothing is used: nothing is tested";
  }
}

TEST(DenseTerms, AreTheSameInMemoryThatHeldOthers) {
  Scene scene({.num_keyframes = 4, .num_landmarks = 40, .dense = true});
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  const auto fresh = scene.Terms(pairs, Density::kFine);
  ASSERT_GT(fresh.size(), pairs.size()) << "no marker's face";
  auto used = scene.Terms(pairs, Density::kCoarse);
  used.resize(used.size() + 5, used.front());
  MakeTerms(scene.sensor, {.marker_length_m = synthetic::kMarkerLength}, scene.truth.map,
            scene.views, pairs, kGate_m, Density::kFine, {}, {}, used);
  ASSERT_EQ(used.size(), fresh.size());
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    EXPECT_EQ(used[i].H, fresh[i].H);
    EXPECT_EQ(used[i].g, fresh[i].g);
    EXPECT_EQ(used[i].marker, fresh[i].marker);
  }
}

TEST(DenseTerms, WeighByTheNoiseThatIsStatedForTheSensor) {
  Scene scene({.num_keyframes = 4, .num_landmarks = 40, .dense = true});
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  const auto weight_m2 = [&](const DepthNoise& noise) {
    std::vector<QuadraticTerm> terms;
    MakeTerms(scene.sensor, {.marker_length_m = synthetic::kMarkerLength, .depth_noise = noise},
              scene.truth.map, scene.views, pairs, kGate_m, Density::kFine, {}, {}, terms);
    std::array<double, 2> sums{};  // Between views, and on markers' faces.
    for (const QuadraticTerm& term : terms)
      sums[term.marker ? 1 : 0] += term.H.topLeftCorner<6, 6>().trace();
    return sums;
  };
  const auto usual = weight_m2({}), noisy = weight_m2({.constant_m = 0.02});
  for (const std::size_t i : {0U, 1U}) {
    EXPECT_GT(usual[i], 0.0) << i;
    EXPECT_LT(noisy[i], 0.05 * usual[i]) << i;  // sigma of 21 mm instead of 2
  }
}

// As a phone's range finder: each image with an offset and a tilt of its own.
JointRegistrationOptions OfAPhone() {
  return {.marker_length_m = synthetic::kMarkerLength,
          .image_offset_sigma_m = 0.008,
          .image_tilt_sigma = 0.008};
}

TEST(DenseTerms, FindsWhatEachImageErrsBy) {
  Scene scene({.num_keyframes = 6, .num_landmarks = 40, .dense = true});
  scene.Prepare();
  std::vector<ImageError> wrong;
  for (std::size_t k = 0; k < scene.views.size(); ++k) {
    const double sign = k % 2 == 0 ? 1.0 : -1.0;
    wrong.emplace_back(0.005 * sign, k == 1 ? 0.004 : 0.0, k == 2 ? -0.004 : 0.0);
    DenseView& view = scene.truth.map.keyframes[k].dense;
    for (std::size_t i = 0; i < view.size(); ++i)
      if (float& z_m = view.z_m[i]; z_m > 0)
        z_m -=
            static_cast<float>(ImageErrorJacobian(z_m, scene.cells.centred[i]).dot(wrong.back()));
  }
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  const auto found =
      FindDepthErrors(scene.sensor, OfAPhone(), scene.truth.map, scene.views, pairs, kGate_m, {});
  ASSERT_EQ(found.images.size(), wrong.size());
  for (std::size_t k = 0; k < wrong.size(); ++k) {
    EXPECT_NEAR(found.images[k][0], wrong[k][0], 0.001) << k;
    EXPECT_NEAR(found.images[k][1], wrong[k][1], 0.001) << k;
    EXPECT_NEAR(found.images[k][2], wrong[k][2], 0.001) << k;
  }
  EXPECT_TRUE(found.curve.knots_m.isZero(0.0)) << "this class has none";
  EXPECT_TRUE(FindDepthErrors(scene.sensor, {.marker_length_m = synthetic::kMarkerLength},
                              scene.truth.map, scene.views, pairs, kGate_m, {})
                  .images.empty());
}

// Posterior in which nothing but the calibration is uncertain, each term by 1.
BundlePosterior OfTheCalibrationAlone(std::size_t num_views) {
  BundlePosterior posterior;
  const auto at = static_cast<Eigen::Index>(6 * num_views);
  posterior.with_calibration.setZero(at + kCalibrationSize, kCalibrationSize);
  posterior.with_calibration.bottomRows<kCalibrationSize>().setIdentity();
  for (std::size_t k = 0; k < num_views; ++k)
    posterior.camera_rows.emplace_back(static_cast<Eigen::Index>(6 * k));
  return posterior;
}

// Derivatives of what FindDepthErrors() finds, against its differences.
TEST(DenseTerms, KnowsHowTheErrorsOfImagesFollowTheCalibrationAndThePoses) {
  Scene scene({.num_keyframes = 6, .num_landmarks = 40, .dense = true});
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  JointRegistrationOptions options = OfAPhone();
  options.depth_curve_sigma_m = 0.003;
  const auto stacked = [&](const CalibrationModel& calibration) {
    const Sensor sensor = MakeSensor(scene.truth.stated, calibration);
    const DepthErrors found = FindDepthErrors(
        sensor, options, scene.truth.map,
        MakeViews(sensor, calibration, scene.cells, scene.truth.map), pairs, kGate_m, {});
    Eigen::VectorXd all(3 * found.images.size() + DepthCurve::kSize);
    for (std::size_t k = 0; k < found.images.size(); ++k)
      all.segment<3>(3 * static_cast<Eigen::Index>(k)) = found.images[k];
    all.tail<DepthCurve::kSize>() = found.curve.knots_m;
    return all;
  };
  const Eigen::VectorXd before = stacked({});
  BundlePosterior posterior = OfTheCalibrationAlone(scene.views.size());
  const auto columns = [&] {
    return FindDepthErrorColumns(scene.sensor, options, scene.truth.map, scene.views, pairs,
                                 kGate_m, posterior, {});
  };
  constexpr double kStep = 1e-5;
  const DepthErrorColumns of_calibration = columns();
  for (const int term : {int{kDepthOffset}, int{kDepthScale}, int{kDepthSlopeX}}) {
    CalibrationModel moved;
    moved.depth[static_cast<std::size_t>(term)] = kStep;
    const Eigen::VectorXd expected = (stacked(moved) - before) / kStep;
    EXPECT_LT((of_calibration.rows.col(kDepthAt + term) - expected).norm(), 0.03 * expected.norm())
        << CalibrationNames()[static_cast<std::size_t>(kDepthAt + term)];
  }
  // An offset of the calibration is found again in the images and the curve, which take it up.
  const double taken_up = -of_calibration.OfImage(1)(0, kDepthAt + kDepthOffset);
  EXPECT_GT(taken_up, 0.2);
  EXPECT_LT(taken_up, 1.0);
  // A camera that moves forward with the offset.
  posterior.with_calibration(6 * 2 + 5, kDepthAt + kDepthOffset) = 1.0;
  const Eigen::VectorXd with_pose = columns().rows.col(kDepthAt + kDepthOffset) -
                                    of_calibration.rows.col(kDepthAt + kDepthOffset);
  scene.truth.map.keyframes[2].T_world_color.translate(Eigen::Vector3d(0, 0, kStep));
  const Eigen::VectorXd expected = (stacked({}) - before) / kStep;
  EXPECT_LT((with_pose - expected).norm(), 0.03 * expected.norm());
}

// As a time-of-flight camera: an error that follows the depth, in waves of half a metre.
TEST(DenseTerms, FindsTheCurveThatDepthFollows) {
  Scene scene({.num_keyframes = 6, .num_landmarks = 40, .dense = true});
  const auto wave_m = [](double z_m) { return 0.003 * std::sin(2 * std::numbers::pi * z_m / 0.5); };
  double nearest_m = 10.0, farthest_m = 0.0;
  for (MapKeyframe& keyframe : scene.truth.map.keyframes) {
    for (float& z_m : keyframe.dense.z_m) {
      if (z_m <= 0) continue;
      z_m -= static_cast<float>(wave_m(z_m));
      nearest_m = std::min<double>(nearest_m, z_m);
      farthest_m = std::max<double>(farthest_m, z_m);
    }
  }
  scene.Prepare();
  ASSERT_GT(farthest_m - nearest_m, 0.1);
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  JointRegistrationOptions options = OfAPhone();
  options.depth_curve_sigma_m = 0.003;
  const DepthErrors found =
      FindDepthErrors(scene.sensor, options, scene.truth.map, scene.views, pairs, kGate_m, {});
  double left_m2 = 0.0, wave_m2 = 0.0;
  for (std::size_t k = 0; k < scene.views.size(); ++k) {
    const DenseView& view = scene.truth.map.keyframes[k].dense;
    for (std::size_t i = 0; i < view.size(); ++i) {
      const double z_m = view.z_m[i];
      if (z_m <= 0) continue;
      const double left = found.Correction(k, z_m, scene.cells.centred[i]) - wave_m(z_m);
      left_m2 += left * left;
      wave_m2 += wave_m(z_m) * wave_m(z_m);
    }
  }
  EXPECT_LT(std::sqrt(left_m2 / wave_m2), 0.3);
}

TEST(DenseTerms, TakeADifferenceOfLessThanHalfAPercentForNone) {
  EXPECT_TRUE(AsConsistent(0.002979, 0.002983));
  EXPECT_TRUE(AsConsistent(0.003, 0.002));
  EXPECT_TRUE(AsConsistent(0.001, 0.0010049));
  EXPECT_FALSE(AsConsistent(0.001, 0.0010051));
}

TEST(DepthCurve, IsLinearBetweenItsKnotsAndConstantBeyond) {
  DepthCurve curve;
  for (int k = 0; k < DepthCurve::kSize; ++k) curve.knots_m[k] = 0.001 * k;
  EXPECT_NEAR(curve.Correction(0.25), 0.0, 1e-12);
  EXPECT_NEAR(curve.Correction(0.275), 0.0005, 1e-12);
  EXPECT_NEAR(curve.Correction(1.0), 0.015, 1e-12);
  EXPECT_NEAR(curve.Correction(0.1), 0.0, 1e-12);
  EXPECT_NEAR(curve.Correction(9.0), 0.001 * (DepthCurve::kSize - 1), 1e-12);
}

TEST(DenseTerms, AreNoSurerOfADistanceThanTheImagesAre) {
  Scene scene({.num_keyframes = 6, .num_landmarks = 40, .dense = true});
  scene.Prepare();
  const auto pairs = FindPairs(scene.sensor, {}, scene.views, {});
  const DepthErrors none{{scene.views.size(), ImageError::Zero()}, {}};
  std::vector<QuadraticTerm> terms;
  MakeTerms(scene.sensor, OfAPhone(), scene.truth.map, scene.views, pairs, kGate_m, Density::kFine,
            none, {}, terms);
  const auto exact = scene.Terms(pairs, Density::kFine);
  ASSERT_EQ(terms.size(), exact.size());
  // Along the axis of the first keyframe, from all its pairs together.
  double with_errors = 0.0, without = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (pairs[i].a != 0) continue;
    with_errors += terms[i].H(5, 5);
    without += exact[i].H(5, 5);
  }
  // What is left is what oblique rays see of the shift: an offset lengthens them, and moves nothing
  // along the axis alone.
  EXPECT_GT(with_errors, 0.0);
  EXPECT_GT(without, 10 * with_errors);
}

}  // namespace
}  // namespace plumb::dense
