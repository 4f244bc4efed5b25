// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/dense_terms.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include "algo/base/check_stop.hpp"
#include "algo/base/statistics.hpp"
#include "algo/registration/marker_face_term.hpp"
#include "algo/registration/plane_term.hpp"

namespace plumb::dense {
namespace {

// Position of a lattice's first cell, relative to the first usable cell.
struct Offset {
  int row = 0;
  int column = 0;
};

// Cells nearer than this to the other camera, or behind it, are not projected into it.
constexpr float kNearestCell_m = 0.1F;

// Projects cells of the first view into the second and calls visit() with each term.
template <typename Visit>
void ForEachTerm(const ViewPair& pair, Offset offset, int stride, double gate_m,
                 const Visit& visit) {
  const View& a = pair.a;
  const View& b = pair.b;
  const Eigen::Matrix3f R = pair.T_b_a.linear().cast<float>();
  const Eigen::Vector3f t = pair.T_b_a.translation().cast<float>();
  const double window = a.keyframe->dense.window_px;
  for (int r = 1 + offset.row; r + 1 < a.height; r += stride) {
    for (int c = 1 + offset.column; c + 1 < a.width; c += stride) {
      const auto i = static_cast<std::size_t>(r * a.width + c);
      if (a.keyframe->dense.normals[i].isZero()) continue;
      const Eigen::Vector3f q = R * a.points[i] + t;
      if (q.z() < kNearestCell_m) continue;
      const Eigen::Vector2d pixel = Project(pair.sensor.depth, q.cast<double>());
      const int column = static_cast<int>(std::floor((pixel.x() + 0.5) / window));
      const int row = static_cast<int>(std::floor((pixel.y() + 0.5) / window));
      if (column < 1 || row < 1 || column + 1 >= b.width || row + 1 >= b.height) continue;
      if (const auto term = PlaneTerm::Between(
              pair, i, static_cast<std::size_t>(row * b.width + column), q, R, gate_m))
        visit(*term);
    }
  }
}

// Every fourth cell in each direction; each pair uses another of the sixteen lattices. Neighbouring
// cells share most of their error, so the others would cost time without adding information.
constexpr int kLattice = 4;
// For the early rounds, whose terms only provide a start for the fine ones.
constexpr int kCoarseLattice = 2 * kLattice;
constexpr int kNumLattices = kLattice * kLattice;
constexpr int kHeldOut = 5;  // The lattice that is held out for Consistency().

// Offset of one of the kNumLattices lattices, or of a coarser one within it that changes with
// `round`.
Offset OffsetOf(int lattice, int stride, int round) {
  const int finer = stride / kLattice;
  return {lattice % kLattice + kLattice * (round % finer),
          lattice / kLattice + kLattice * (round / finer % finer)};
}

// Offset of the pair's own lattice, which is never the one that is held out.
Offset OffsetOfPair(std::size_t pair, int stride) {
  auto lattice = static_cast<int>(pair % (kNumLattices - 1));
  lattice += lattice >= kHeldOut ? 1 : 0;
  return OffsetOf(lattice, stride, static_cast<int>(pair / (kNumLattices - 1)));
}

// The part of MakeTerms() that is common to all terms.
struct TermMaker {
  const Sensor& sensor;
  const JointRegistrationOptions& options;
  double gate_m;
  int stride;

  // @param part  Filled where images have errors of their own.
  // @param curve  Filled unless null.
  void SumPair(const View& a, const View& b, const KeyframePair& pair, Offset offset, double share,
               QuadraticTerm& term, ImageErrorPart& part, DepthCurvePart* curve = nullptr) const;
  // @return the number of cells on the face.
  int SumFace(const View& view, int keyframe, const MarkerObservation& observation,
              const MapMarker& marker, QuadraticTerm& term, ImageErrorPart& part,
              DepthCurvePart* curve = nullptr) const;
};

// Derivative of the distance of a cell along m, in its own camera, with its image's error.
Eigen::Vector3d AlongImageError(const View& view, std::size_t cell, const Eigen::Vector3d& m) {
  const Eigen::Vector3d p = view.points[cell].cast<double>();
  return m.dot(p) / p.z() *
         ImageErrorJacobian(view.keyframe->dense.z_m[cell], view.cells->centred[cell]);
}

void TermMaker::SumPair(const View& a, const View& b, const KeyframePair& pair, Offset offset,
                        double share, QuadraticTerm& term, ImageErrorPart& part,
                        DepthCurvePart* curve) const {
  term = {};
  term.keyframe_a = pair.a;
  term.keyframe_b = pair.b;
  TermSum sum(term);
  const ViewPair views(sensor, a, b);
  ForEachTerm(views, offset, stride, gate_m, [&](const PlaneTerm& plane) {
    const DepthRow row = plane.Linearise(views, options.depth_noise);
    const double weight = sum.Add(row, share);
    if (!options.HasImageErrors()) return;
    const Eigen::Vector3d n_b = plane.normal.cast<double>();
    ImageErrorPart::Errors J;
    J << AlongImageError(a, plane.cell_a, views.T_b_a.linear().transpose() * n_b),
        -AlongImageError(b, plane.cell_b, n_b);
    part.Add(row, J, weight);
    if (curve != nullptr)
      curve->Add(row, J, a.keyframe->dense.z_m[plane.cell_a], b.keyframe->dense.z_m[plane.cell_b],
                 weight);
  });
  sum.Finish();
}

// A marker's pose is less certain than the poses of two overlapping views.
constexpr double kFaceGate_m = 0.03;  // Added to the gate.
constexpr int kMinFaceCells = 8;
constexpr double kFaceShare = 0.25;  // Neighbouring cells share their noise: four count as one.

// Zero where too few cells lie on the face.
int TermMaker::SumFace(const View& view, int keyframe, const MarkerObservation& observation,
                       const MapMarker& marker, QuadraticTerm& term, ImageErrorPart& part,
                       DepthCurvePart* curve) const {
  term = {};
  term.keyframe_a = keyframe;
  term.marker = observation.id;
  const Pose T_marker_depth = marker.T_world_marker.inverse() * view.T_world_depth;
  Eigen::Vector2d low(1e9, 1e9);
  Eigen::Vector2d high(-1e9, -1e9);
  for (const Eigen::Vector2d& corner : observation.corners) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  const int window = view.keyframe->dense.window_px;
  TermSum sum(term);
  int count = 0;
  for (int r = std::max(1, static_cast<int>(low.y()) / window);
       r <= std::min(view.height - 2, static_cast<int>(high.y()) / window); ++r) {
    for (int c = std::max(1, static_cast<int>(low.x()) / window);
         c <= std::min(view.width - 2, static_cast<int>(high.x()) / window); ++c) {
      const auto i = static_cast<std::size_t>(r * view.width + c);
      if (view.keyframe->dense.normals[i].isZero()) continue;
      const MarkerFaceTerm face(sensor, view, i, T_marker_depth);
      if (!face.IsOnFace(options.marker_length_m / 2, gate_m + kFaceGate_m)) continue;
      const DepthRow row = face.Linearise(options.depth_noise);
      const double weight = sum.Add(row, kFaceShare * options.DenseInformation());
      ++count;
      if (!options.HasImageErrors()) continue;
      ImageErrorPart::Errors J = ImageErrorPart::Errors::Zero();
      J.head<3>() = AlongImageError(view, i, T_marker_depth.linear().row(2).transpose());
      part.Add(row, J, weight);
      const double z_m = view.keyframe->dense.z_m[i];
      if (curve != nullptr) curve->Add(row, J, z_m, z_m, weight);
    }
  }
  sum.Finish();
  if (count >= kMinFaceCells) return count;
  term.H.setZero();
  term.g.setZero();
  part = {};
  return 0;
}

// Information of the prior of one image's error.
Eigen::Vector3d ImageErrorInformation(const JointRegistrationOptions& options) {
  const Eigen::Vector3d sigmas(options.image_offset_sigma_m, options.image_tilt_sigma,
                               options.image_tilt_sigma);
  return sigmas.cwiseAbs2().cwiseInverse();
}

// Weight of a cell of a pair beside its noise. It stands for others, relative to a lattice of two;
// and a keyframe's noise affects all its pairs, so together they have the weight of its cells used
// once.
double ShareOf(const JointRegistrationOptions& options, int stride, int uses_a, int uses_b) {
  return options.dense_weight * options.DenseInformation() * (stride * stride / 4.0) * 2.0 /
         std::sqrt(static_cast<double>(uses_a) * uses_b);
}

// A marker's face in one view.
struct Face {
  std::size_t view;
  const MarkerObservation* observation;
  const MapMarker* marker;
};

std::vector<Face> FindFaces(const TrackingMap& map) {
  std::vector<Face> faces;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    for (const MarkerObservation& observation : map.keyframes[k].data.markers)
      if (const auto marker = map.markers.find(observation.id); marker != map.markers.end())
        faces.push_back({k, &observation, &marker->second});
  return faces;
}

// How many of the pairs, and how many of the faces, share each view.
std::vector<int> UsesInPairs(std::size_t num_views, const std::vector<KeyframePair>& pairs) {
  std::vector<int> uses(num_views, 0);
  for (const KeyframePair& pair : pairs) {
    ++uses[static_cast<std::size_t>(pair.a)];
    ++uses[static_cast<std::size_t>(pair.b)];
  }
  return uses;
}
std::vector<int> UsesInFaces(std::size_t num_views, const std::vector<Face>& faces) {
  std::vector<int> uses(num_views, 0);
  for (const Face& face : faces) ++uses[face.view];
  return uses;
}

// The views that overlap with view `a`, best first.
std::vector<KeyframePair> OverlapsOf(std::size_t a, const Sensor& sensor,
                                     const JointRegistrationOptions& options,
                                     const std::vector<View>& views) {
  constexpr int kStride = 16;
  constexpr double kMinAxisAgreement = 0.5;  // Cosine between the two optical axes.
  const View& from = views[a];
  int tried = 0;
  for (int r = kStride / 2; r < from.height; r += kStride)
    for (int c = kStride / 2; c < from.width; c += kStride)
      tried += from.points[static_cast<std::size_t>(r * from.width + c)].z() > 0 ? 1 : 0;
  std::vector<KeyframePair> overlaps;
  for (std::size_t b = 0; b < views.size(); ++b) {
    if (a == b) continue;
    const Eigen::Vector3d axis_a = from.T_world_depth.linear().col(2);
    const Eigen::Vector3d axis_b = views[b].T_world_depth.linear().col(2);
    if (axis_a.dot(axis_b) < kMinAxisAgreement) continue;
    int hits = 0;
    ForEachTerm(ViewPair(sensor, from, views[b]), {}, kStride, options.max_gate_m,
                [&](const PlaneTerm&) { ++hits; });
    const double overlap = tried > 0 ? static_cast<double>(hits) / tried : 0.0;
    if (overlap >= options.min_overlap)
      overlaps.push_back({static_cast<int>(a), static_cast<int>(b), overlap});
  }
  std::stable_sort(overlaps.begin(), overlaps.end(),
                   [](const auto& x, const auto& y) { return x.overlap > y.overlap; });
  return overlaps;
}

// Normal equations of the errors of all images, three for each view, and of the curve behind them.
struct ErrorEquations {
  Eigen::MatrixXd H;
  Eigen::VectorXd g;

  explicit ErrorEquations(Eigen::Index size)
      : H(Eigen::MatrixXd::Zero(size, size)), g(Eigen::VectorXd::Zero(size)) {}
  // A face has one view, so that a = b, and nothing in the second half.
  void Add(const ImageErrorPart& part, Eigen::Index a, Eigen::Index b) {
    H.block<3, 3>(a, a) += part.H.topLeftCorner<3, 3>();
    g.segment<3>(a) += part.g.head<3>();
    if (a == b) return;
    H.block<3, 3>(b, b) += part.H.bottomRightCorner<3, 3>();
    H.block<3, 3>(a, b) += part.H.topRightCorner<3, 3>();
    H.block<3, 3>(b, a) += part.H.bottomLeftCorner<3, 3>();
    g.segment<3>(b) += part.g.tail<3>();
  }
  void Add(const DepthCurvePart& part, Eigen::Index a, Eigen::Index b, Eigen::Index curve_at) {
    constexpr int kSize = DepthCurve::kSize;
    H.block<kSize, kSize>(curve_at, curve_at) += part.H;
    g.segment<kSize>(curve_at) += part.g;
    H.block<kSize, 3>(curve_at, a) += part.H_errors.leftCols<3>();
    H.block<3, kSize>(a, curve_at) += part.H_errors.leftCols<3>().transpose();
    if (a == b) return;
    H.block<kSize, 3>(curve_at, b) += part.H_errors.rightCols<3>();
    H.block<3, kSize>(b, curve_at) += part.H_errors.rightCols<3>().transpose();
  }
};

// What the errors of all images, and the curve behind them, have to do with the depth images: one
// part for each pair and each face.
class ErrorSums {
 public:
  ErrorSums(const Sensor& sensor, const JointRegistrationOptions& options, const TrackingMap& map,
            const std::vector<View>& views, const std::vector<KeyframePair>& pairs, double gate_m,
            const std::stop_token& stop)
      : options_(options),
        views_(views),
        pairs_(pairs),
        faces_(FindFaces(map)),
        parts_(pairs.size() + faces_.size()),
        curves_(has_curve() ? parts_.size() : 0) {
    const std::vector<int> uses = UsesInPairs(views.size(), pairs);
    const TermMaker maker{sensor, options, gate_m, kLattice};
    tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t i) {
      CheckStop(stop);
      QuadraticTerm unused;
      DepthCurvePart* const curve = has_curve() ? &curves_[i] : nullptr;
      if (i >= pairs.size()) {
        const Face& face = faces_[i - pairs.size()];
        maker.SumFace(views[face.view], static_cast<int>(face.view), *face.observation,
                      *face.marker, unused, parts_[i], curve);
        return;
      }
      const auto a = static_cast<std::size_t>(pairs[i].a);
      const auto b = static_cast<std::size_t>(pairs[i].b);
      maker.SumPair(views[a], views[b], pairs[i], OffsetOfPair(i, kLattice),
                    ShareOf(options, kLattice, uses[a], uses[b]), unused, parts_[i], curve);
    });
  }

  [[nodiscard]] bool has_curve() const { return options_.depth_curve_sigma_m > 0; }
  [[nodiscard]] Eigen::Index curve_at() const {
    return static_cast<Eigen::Index>(3 * views_.size());
  }

  [[nodiscard]] ErrorEquations Equations() const {
    ErrorEquations equations(size());
    equations.H.diagonal().head(curve_at()) =
        ImageErrorInformation(options_).replicate(static_cast<Eigen::Index>(views_.size()), 1);
    equations.H.diagonal().tail(size() - curve_at()).array() =
        1.0 / (options_.depth_curve_sigma_m * options_.depth_curve_sigma_m);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      equations.Add(parts_[i], first(i), second(i));
      if (has_curve()) equations.Add(curves_[i], first(i), second(i), curve_at());
    }
    return equations;
  }

  // The equations' dependence on poses, markers and calibration, times their covariance with the
  // calibration.
  [[nodiscard]] Eigen::MatrixXd Driven(const BundlePosterior& posterior) const {
    Eigen::MatrixXd driven = Eigen::MatrixXd::Zero(size(), kCalibrationSize);
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const Eigen::Matrix<double, QuadraticTerm::kSize, kCalibrationSize> of_term =
          CovarianceOf(i, posterior);
      const Eigen::Matrix<double, 6, kCalibrationSize> of_images = parts_[i].H_x * of_term;
      driven.middleRows<3>(first(i)) += of_images.topRows<3>();
      if (first(i) != second(i)) driven.middleRows<3>(second(i)) += of_images.bottomRows<3>();
      if (has_curve()) driven.bottomRows<DepthCurve::kSize>() += curves_[i].H_x * of_term;
    }
    return driven;
  }

 private:
  [[nodiscard]] Eigen::Index size() const {
    return curve_at() + (has_curve() ? DepthCurve::kSize : 0);
  }
  [[nodiscard]] const Face* FaceOf(std::size_t part) const {
    return part < pairs_.size() ? nullptr : &faces_[part - pairs_.size()];
  }
  // Rows of the errors of a part's images; a face has one image.
  [[nodiscard]] Eigen::Index first(std::size_t part) const {
    const Face* const face = FaceOf(part);
    return static_cast<Eigen::Index>(
        3 * (face != nullptr ? face->view : static_cast<std::size_t>(pairs_[part].a)));
  }
  [[nodiscard]] Eigen::Index second(std::size_t part) const {
    return FaceOf(part) != nullptr ? first(part) : Eigen::Index{3} * pairs_[part].b;
  }

  // Covariance of a part's unknowns, in the order of a QuadraticTerm, with the calibration.
  [[nodiscard]] Eigen::Matrix<double, QuadraticTerm::kSize, kCalibrationSize> CovarianceOf(
      std::size_t part, const BundlePosterior& posterior) const {
    Eigen::Matrix<double, QuadraticTerm::kSize, kCalibrationSize> of_term =
        Eigen::Matrix<double, QuadraticTerm::kSize, kCalibrationSize>::Zero();
    const auto set = [&](int at, std::optional<Eigen::Index> row) {
      if (row) of_term.middleRows<6>(at) = posterior.with_calibration.middleRows<6>(*row);
    };
    const Face* const face = FaceOf(part);
    set(QuadraticTerm::kTwistA, posterior.CameraAt(static_cast<int>(first(part) / 3)));
    set(QuadraticTerm::kTwistB, face != nullptr ? posterior.MarkerAt(face->observation->id)
                                                : posterior.CameraAt(pairs_[part].b));
    const CalibrationMatrix calibration = posterior.calibration();
    of_term.middleRows<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt) =
        calibration.middleRows<QuadraticTerm::kFocal>(kLensAt);
    of_term.bottomRows<CalibrationModel::kDepthSize>() =
        calibration.middleRows<CalibrationModel::kDepthSize>(kDepthAt);
    return of_term;
  }

  const JointRegistrationOptions& options_;
  const std::vector<View>& views_;
  const std::vector<KeyframePair>& pairs_;
  std::vector<Face> faces_;
  std::vector<ImageErrorPart> parts_;
  std::vector<DepthCurvePart> curves_;
};

}  // namespace

std::vector<KeyframePair> FindPairs(const Sensor& sensor, const JointRegistrationOptions& options,
                                    const std::vector<View>& views, const std::stop_token& stop) {
  std::vector<std::vector<KeyframePair>> candidates(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t a) {
    CheckStop(stop);
    candidates[a] = OverlapsOf(a, sensor, options, views);
    // Spread over the overlap range instead of the nearest only, because distant pairs prevent
    // drift.
    const auto wanted = static_cast<std::size_t>(options.max_pairs);
    if (candidates[a].size() > wanted) {
      std::vector<KeyframePair> spread;
      for (std::size_t i = 0; i < wanted; ++i)
        spread.push_back(candidates[a][i * candidates[a].size() / wanted]);
      candidates[a] = std::move(spread);
    }
  });
  std::vector<KeyframePair> pairs;
  for (const auto& list : candidates) pairs.insert(pairs.end(), list.begin(), list.end());
  return pairs;
}

void MakeTerms(const Sensor& sensor, const JointRegistrationOptions& options,
               const TrackingMap& map, const std::vector<View>& views,
               const std::vector<KeyframePair>& pairs, double gate_m, Density density,
               const DepthErrors& errors, const std::stop_token& stop,
               std::vector<QuadraticTerm>& terms) {
  const std::vector<Face> faces = FindFaces(map);
  const std::vector<int> uses = UsesInPairs(views.size(), pairs);
  const std::vector<int> uses_in_faces = UsesInFaces(views.size(), faces);
  const int stride = density == Density::kCoarse ? kCoarseLattice : kLattice;
  const TermMaker maker{sensor, options, gate_m, stride};
  // A view's error is common to all its terms, so together they have the information of one.
  const auto remove = [&](const ImageErrorPart& part, std::size_t a, std::size_t b,
                          const std::vector<int>& shared, QuadraticTerm& term) {
    if (!options.HasImageErrors()) return;
    const Eigen::Vector3d information = ImageErrorInformation(options);
    ImageErrorPart::Errors of_term, at;
    of_term << information / shared[a], information / shared[b];
    at << errors.images[a], errors.images[b];
    part.RemoveFrom(term, of_term, at);
  };
  // Terms are large, so the space for links that may be appended is reserved now.
  terms.reserve(pairs.size() + faces.size() + views.size());
  terms.resize(pairs.size() + faces.size());
  tbb::parallel_for(std::size_t{0}, terms.size(), [&](std::size_t i) {
    CheckStop(stop);
    ImageErrorPart part;
    if (i >= pairs.size()) {
      const Face& face = faces[i - pairs.size()];
      if (maker.SumFace(views[face.view], static_cast<int>(face.view), *face.observation,
                        *face.marker, terms[i], part) > 0)
        remove(part, face.view, face.view, uses_in_faces, terms[i]);
      return;
    }
    const auto a = static_cast<std::size_t>(pairs[i].a);
    const auto b = static_cast<std::size_t>(pairs[i].b);
    maker.SumPair(views[a], views[b], pairs[i], OffsetOfPair(i, stride),
                  ShareOf(options, stride, uses[a], uses[b]), terms[i], part);
    remove(part, a, b, uses, terms[i]);
  });
}

DepthErrors FindDepthErrors(const Sensor& sensor, const JointRegistrationOptions& options,
                            const TrackingMap& map, const std::vector<View>& views,
                            const std::vector<KeyframePair>& pairs, double gate_m,
                            const std::stop_token& stop) {
  if (!options.HasImageErrors()) return {};
  const ErrorSums sums(sensor, options, map, views, pairs, gate_m, stop);
  const ErrorEquations equations = sums.Equations();
  const Eigen::VectorXd solution = -equations.H.ldlt().solve(equations.g);
  DepthErrors errors;
  for (Eigen::Index k = 0; k < sums.curve_at(); k += 3)
    errors.images.emplace_back(solution.segment<3>(k));
  if (sums.has_curve()) errors.curve.knots_m = solution.tail<DepthCurve::kSize>();
  return errors;
}

DepthErrorColumns FindDepthErrorColumns(const Sensor& sensor,
                                        const JointRegistrationOptions& options,
                                        const TrackingMap& map, const std::vector<View>& views,
                                        const std::vector<KeyframePair>& pairs, double gate_m,
                                        const BundlePosterior& posterior,
                                        const std::stop_token& stop) {
  if (!options.HasImageErrors() || posterior.empty()) return {};
  const ErrorSums sums(sensor, options, map, views, pairs, gate_m, stop);
  return {.rows = -sums.Equations().H.ldlt().solve(sums.Driven(posterior)),
          .num_images = views.size()};
}

double Consistency(const Sensor& sensor, const std::vector<View>& views,
                   const std::vector<KeyframePair>& pairs, double gate_m) {
  std::vector<std::vector<float>> parts(pairs.size());
  tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t p) {
    const ViewPair pair(sensor, views[static_cast<std::size_t>(pairs[p].a)],
                        views[static_cast<std::size_t>(pairs[p].b)]);
    ForEachTerm(pair, OffsetOf(kHeldOut, kLattice, 0), kLattice, gate_m,
                [&](const PlaneTerm& plane) {
                  parts[p].push_back(static_cast<float>(std::abs(plane.distance_m)));
                });
  });
  std::vector<float> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all.empty() ? 0.0 : TakeMedian(all);
}

// The cells' noise is the same before and after. In two of nine sweeps of a LiDAR unit the medians
// of 3 mm differed by 0.1 %, while the witnesses agreed better.
bool AsConsistent(double before_m, double after_m) {
  constexpr double kSaysNothing = 1.005;
  return after_m <= kSaysNothing * before_m;
}

}  // namespace plumb::dense
