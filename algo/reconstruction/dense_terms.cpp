#include "algo/reconstruction/dense_terms.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"
#include "algo/sensor_model/depth_correction.hpp"

namespace plumb::dense {
namespace {

using TermVector = Eigen::Matrix<double, QuadraticTerm::kSize, 1>;
// The parts of a term's two twists.
constexpr int kRotationA = QuadraticTerm::kTwistA, kShiftA = kRotationA + 3;
constexpr int kRotationB = QuadraticTerm::kTwistB, kShiftB = kRotationB + 3;
using DepthVector = Eigen::Matrix<double, CalibrationModel::kDepthSize, 1>;

// Position of a lattice's first cell, relative to the first usable cell.
struct Offset {
  int row = 0;
  int column = 0;
};

// Projects cells of one view into another. Calls visit(cell in a, cell in b, q), where q is the
// point in b's depth camera.
template <typename Visit>
void ForEachProjected(const Sensor& sensor, const View& a, const View& b, Offset offset, int stride,
                      const Visit& visit) {
  const Pose T_b_a = b.T_world_depth.inverse() * a.T_world_depth;
  const Eigen::Matrix3f R = T_b_a.linear().cast<float>();
  const Eigen::Vector3f t = T_b_a.translation().cast<float>();
  const double window = a.keyframe->dense.window_px;
  for (int r = 1 + offset.row; r + 1 < a.height; r += stride) {
    for (int c = 1 + offset.column; c + 1 < a.width; c += stride) {
      const auto i = static_cast<std::size_t>(r * a.width + c);
      if (a.keyframe->dense.normals[i].isZero()) continue;
      const Eigen::Vector3f q = R * a.points[i] + t;
      if (q.z() < 0.1F) continue;
      const Eigen::Vector2d pixel = Project(sensor.depth, q.cast<double>());
      const int column = static_cast<int>(std::floor((pixel.x() + 0.5) / window));
      const int row = static_cast<int>(std::floor((pixel.y() + 0.5) / window));
      if (column < 1 || row < 1 || column + 1 >= b.width || row + 1 >= b.height) continue;
      visit(i, static_cast<std::size_t>(row * b.width + column), q, R);
    }
  }
}

constexpr float kMinNormalAgreement = 0.8F;  // Cosine between the two normals of a correspondence.
constexpr float kMinIncidence = 0.35F;       // Cosine of the steepest incidence used.

struct Correspondence {
  double residual = 0;
  float cos_a = 0;  // Of the incidence on either side.
  float cos_b = 0;
  Eigen::Vector3f normal;  // In b's depth camera.
};

std::optional<Correspondence> Correspond(const View& a, const View& b, std::size_t i, std::size_t j,
                                         const Eigen::Vector3f& q, const Eigen::Matrix3f& R_b_a,
                                         double gate_m) {
  const Eigen::Vector3f& n = b.keyframe->dense.normals[j];
  if (n.isZero() || n.dot(R_b_a * a.keyframe->dense.normals[i]) < kMinNormalAgreement)
    return std::nullopt;
  const Eigen::Vector3f& p_b = b.points[j];
  Correspondence match;
  match.residual = n.dot(q - p_b);
  if (std::abs(match.residual) > gate_m) return std::nullopt;
  match.cos_b = -n.dot(p_b.normalized());
  match.cos_a = -a.keyframe->dense.normals[i].dot(a.points[i].normalized());
  if (match.cos_b < kMinIncidence || match.cos_a < kMinIncidence) return std::nullopt;
  match.normal = n;
  return match;
}

// Standard deviation of the point-to-plane distance, with depth noise along the ray.
double SigmaOf(const Correspondence& match, const DepthNoise& noise, float z_a_m, float z_b_m) {
  const double sigma_a = DepthSigma(noise, z_a_m, match.cos_a) * match.cos_a;
  const double sigma_b = DepthSigma(noise, z_b_m, match.cos_b) * match.cos_b;
  return std::sqrt(sigma_a * sigma_a + sigma_b * sigma_b + 0.001 * 0.001);
}

// Derivative of a cell's corrected depth with respect to the depth calibration, except for its
// times and shifts, which also move the point sideways.
DepthVector DepthJacobian(const View& view, std::size_t i) {
  const double z_raw = view.keyframe->dense.z_m[i];
  const Eigen::Vector2f& centred = view.cells->centred[i];
  const FieldRow& products = view.cells->products[i];
  DepthVector J = DepthVector::Zero();
  J[kDepthScale] = z_raw;
  J[kDepthOffset] = 1.0;
  J[kDepthBow] = centred.squaredNorm();
  J[kDepthSlopeX] = z_raw * centred.x();
  J[kDepthSlopeY] = z_raw * centred.y();
  J.segment<kNumFieldTerms>(kDepthField) = z_raw * products.head<kNumFieldTerms>().cast<double>();
  J.segment<kNumGrowthTerms>(kDepthGrowth) =
      z_raw * FieldGrowth(z_raw) * products.tail<kNumGrowthTerms>().cast<double>();
  return J;
}

// Derivative of a corrected point's position with respect to the depth calibration, projected onto
// a direction m of its own camera.
DepthVector PositionJacobian(const Sensor& sensor, const View& view, std::size_t i,
                             const DepthVector& J_depth, const Eigen::Vector3d& m) {
  const Eigen::Vector3d p = view.points[i].cast<double>();
  DepthVector J = m.dot(p) / p.z() * J_depth;
  J[kDepthShiftX] = -m.x() * p.z() * sensor.scale / sensor.depth.fx;
  J[kDepthShiftY] = -m.y() * p.z() * sensor.scale / sensor.depth.fy;
  const Vector6d& v = view.keyframe->velocity_per_s;
  const double along_motion = m.dot(v.head<3>().cross(p) + v.tail<3>());
  J[kDepthDelay] = along_motion;
  const auto row = static_cast<double>(i / static_cast<std::size_t>(view.width));
  J[kDepthReadout] = along_motion * ((row + 0.5) / view.height - 0.5);
  return J;
}

// The same with respect to the two focal lengths: a longer one moves the point towards the axis.
// The lens's distortion changes this by a few percent, which only costs a round.
Eigen::Vector2d FocalJacobian(const View& view, std::size_t i, const Eigen::Vector3d& m) {
  return -m.head<2>().cwiseProduct(view.points[i].head<2>().cast<double>());
}

// A residual in metres of the scene shrinks with the scene, so the solver would shrink the scene.
// The residual is therefore converted back to the units of the measurement, r z_raw / z_corrected,
// and so is J. Returns that factor times the residual.
double InRawUnits(const View& view, std::size_t i, const DepthVector& J_depth, double residual,
                  TermVector& J) {
  const double z = view.points[i].z();
  const double factor = view.keyframe->dense.z_m[i] / z;
  J *= factor;
  J.tail<CalibrationModel::kDepthSize>() -= residual * factor / z * J_depth;
  return residual * factor;
}

// Accumulates squared residuals into a term. Rows are collected and multiplied in blocks, which is
// several times faster than one by one. Single precision is not sufficient: the last bit of a stamp
// would change the poses, and a recording would not reproduce the live result.
class TermSum {
 public:
  explicit TermSum(QuadraticTerm& term) : term_(term) {}
  void Add(const TermVector& J, double residual, double weight) {
    const double root = std::sqrt(weight);
    rows_.col(count_) = root * J;
    residuals_[count_] = root * residual;
    if (++count_ == kBlock) Flush();
  }
  void Finish() {
    Flush();
    term_.H.triangularView<Eigen::StrictlyUpper>() = term_.H.transpose();
  }

 private:
  static constexpr int kBlock = 64;
  void Flush() {
    if (count_ == 0) return;
    term_.H.selfadjointView<Eigen::Lower>().rankUpdate(rows_.leftCols(count_));
    term_.g.noalias() += rows_.leftCols(count_) * residuals_.head(count_);
    count_ = 0;
  }
  QuadraticTerm& term_;
  int count_ = 0;
  Eigen::Matrix<double, QuadraticTerm::kSize, kBlock> rows_;
  Eigen::Matrix<double, kBlock, 1> residuals_;
};

constexpr double kLossScale = 2.0;  // Cauchy scale in standard deviations.

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

void FindDenseTerm(const Sensor& sensor, const View& a, const View& b, const KeyframePair& pair,
                   Offset offset, int stride, double gate_m, double weight, const DepthNoise& noise,
                   QuadraticTerm& term) {
  term = {};
  term.keyframe_a = pair.a;
  term.keyframe_b = pair.b;
  TermSum sum(term);
  const Eigen::Matrix3d R_b_a = (b.T_world_depth.inverse() * a.T_world_depth).linear();
  ForEachProjected(
      sensor, a, b, offset, stride,
      [&](std::size_t i, std::size_t j, const Eigen::Vector3f& q_b, const Eigen::Matrix3f& R) {
        const auto match = Correspond(a, b, i, j, q_b, R, gate_m);
        if (!match) return;
        const Eigen::Vector3d n_b = match->normal.cast<double>();
        const Eigen::Vector3d n_a = R_b_a.transpose() * n_b;
        const Eigen::Vector3d p_color = a.T_color_depth * a.points[i].cast<double>();
        const Eigen::Vector3d n_color_a = a.T_color_depth.linear() * n_a;
        const Eigen::Vector3d q_color = b.T_color_depth * q_b.cast<double>();
        const Eigen::Vector3d n_color_b = b.T_color_depth.linear() * n_b;
        TermVector J;
        J.segment<3>(kRotationA) = p_color.cross(n_color_a);
        J.segment<3>(kShiftA) = n_color_a;
        J.segment<3>(kRotationB) = -q_color.cross(n_color_b);
        J.segment<3>(kShiftB) = -n_color_b;
        const DepthVector J_depth = DepthJacobian(a, i);
        J.segment<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt) =
            FocalJacobian(a, i, n_a) - FocalJacobian(b, j, n_b);
        J.tail<CalibrationModel::kDepthSize>() =
            PositionJacobian(sensor, a, i, J_depth, n_a) -
            PositionJacobian(sensor, b, j, DepthJacobian(b, j), n_b);
        const double residual = InRawUnits(a, i, J_depth, match->residual, J);
        const double sigma = SigmaOf(*match, noise, a.points[i].z(), b.points[j].z());
        const double in_sigmas = residual / sigma;
        const double w = weight * CauchyWeight(in_sigmas * in_sigmas, kLossScale) / (sigma * sigma);
        sum.Add(J, residual, w);
      });
  sum.Finish();
}

// Depth measured on a marker's face lies in the marker's plane, which ties the scale of the depth
// to the markers' side length. Zero where too few cells lie on the face.
void FindMarkerFaceTerm(const Sensor& sensor, const View& view, int keyframe,
                        const MarkerObservation& observation, const MapMarker& marker,
                        double half_side_m, double gate_m, const DepthNoise& noise,
                        QuadraticTerm& term) {
  term = {};
  term.keyframe_a = keyframe;
  term.marker = observation.id;
  const Pose T_marker_depth = marker.T_world_marker.inverse() * view.T_world_depth;
  const Eigen::Vector3d n_depth = T_marker_depth.linear().row(2).transpose();
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
      const Eigen::Vector3d p = view.points[i].cast<double>();
      const Eigen::Vector3d in_marker = T_marker_depth * p;
      if (std::abs(in_marker.x()) > 0.9 * half_side_m ||
          std::abs(in_marker.y()) > 0.9 * half_side_m)
        continue;
      if (std::abs(in_marker.z()) > gate_m) continue;
      const Eigen::Vector3d p_color = view.T_color_depth * p;
      const Eigen::Vector3d n_color = view.T_color_depth.linear() * n_depth;
      TermVector J = TermVector::Zero();
      J.segment<3>(kRotationA) = p_color.cross(n_color);
      J.segment<3>(kShiftA) = n_color;
      J.segment<3>(kRotationB) = -in_marker.cross(Eigen::Vector3d::UnitZ());
      J[kShiftB + 2] = -1.0;  // along z
      const DepthVector J_depth = DepthJacobian(view, i);
      J.tail<CalibrationModel::kDepthSize>() = PositionJacobian(sensor, view, i, J_depth, n_depth);
      J.segment<QuadraticTerm::kFocal>(QuadraticTerm::kFocalAt) = FocalJacobian(view, i, n_depth);
      const double cosine = std::clamp(-n_depth.dot(p.normalized()), 0.2, 1.0);
      const double sigma = std::hypot(DepthSigma(noise, p.z(), cosine) * cosine, 0.001);
      // Neighbouring cells share their noise: four cells count as one.
      const double residual = InRawUnits(view, i, J_depth, in_marker.z(), J);
      const double in_sigmas = residual / sigma;
      const double w = 0.25 * CauchyWeight(in_sigmas * in_sigmas, kLossScale) / (sigma * sigma);
      sum.Add(J, residual, w);
      ++count;
    }
  }
  sum.Finish();
  if (count >= 8) return;
  term.H.setZero();
  term.g.setZero();
}

}  // namespace

Cells MakeCells(const Intrinsics& stated, const TrackingMap& map) {
  const DenseView& first = map.keyframes[0].dense;
  Cells cells;
  for (int r = 0; r < first.height; ++r)
    for (int c = 0; c < first.width; ++c)
      cells.centred.push_back(CentredCoordinates((c + 0.5) * first.window_px - 0.5,
                                                 (r + 0.5) * first.window_px - 0.5, stated.width,
                                                 stated.height)
                                  .cast<float>());
  cells.products = FieldProductsOfCells(stated.width, stated.height, first.window_px);
  return cells;
}

Sensor MakeSensor(const Intrinsics& stated, const CalibrationModel& calibration) {
  Sensor sensor;
  sensor.stated = stated;
  sensor.corrected = calibration.Corrected(stated);
  sensor.scale = stated.width / 640.0;
  sensor.depth = sensor.corrected;
  sensor.depth.cx += calibration.depth[kDepthShiftX] * sensor.scale;
  sensor.depth.cy += calibration.depth[kDepthShiftY] * sensor.scale;
  return sensor;
}

std::vector<View> MakeViews(const Sensor& sensor, const CalibrationModel& calibration,
                            const Cells& cells, const TrackingMap& map) {
  std::vector<View> views(map.keyframes.size());
  if (map.keyframes.empty()) return views;
  const DenseView& first = map.keyframes[0].dense;
  std::vector<Eigen::Vector2f> rays(first.size());
  const DepthCorrection correction(calibration, sensor.stated.width, sensor.stated.height,
                                   first.window_px);
  tbb::parallel_for(0, first.height, [&](int r) {
    for (int c = 0; c < first.width; ++c) {
      const auto i = static_cast<std::size_t>(r * first.width + c);
      const double x = (c + 0.5) * first.window_px - 0.5;
      const double y = (r + 0.5) * first.window_px - 0.5;
      rays[i] = Undistort(sensor.depth, {x, y}).cast<float>();
    }
  });
  // Rows are read out one after the other: each cell is moved to where the camera at the stamp
  // would see it.
  const auto readout_s = static_cast<float>(calibration.depth[kDepthReadout]);
  std::vector<float> row_fraction;
  for (int r = 0; r < first.height; ++r)
    row_fraction.push_back((static_cast<float>(r) + 0.5F) / static_cast<float>(first.height) -
                           0.5F);
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t k) {
    const MapKeyframe& keyframe = map.keyframes[k];
    View& view = views[k];
    view.keyframe = &keyframe;
    view.T_world_depth = DepthPose(keyframe, calibration);
    view.T_color_depth = keyframe.T_world_color.inverse() * view.T_world_depth;
    view.width = keyframe.dense.width;
    view.height = keyframe.dense.height;
    view.cells = &cells;
    view.points.assign(keyframe.dense.size(), Eigen::Vector3f::Zero());
    const Eigen::Vector3f w = keyframe.velocity_per_s.head<3>().cast<float>();
    const Eigen::Vector3f v = keyframe.velocity_per_s.tail<3>().cast<float>();
    for (std::size_t i = 0; i < view.points.size(); ++i) {
      const float z = keyframe.dense.z_m[i];
      if (z <= 0) continue;
      const auto corrected = static_cast<float>(correction.Correct(i, z));
      const Eigen::Vector3f p(rays[i].x() * corrected, rays[i].y() * corrected, corrected);
      const float late_s = row_fraction[i / static_cast<std::size_t>(view.width)] * readout_s;
      view.points[i] = p + late_s * (w.cross(p) + v);
    }
  });
  return views;
}

Eigen::Matrix<double, 3, kCalibrationSize> CellJacobian(const Sensor& sensor, const View& view,
                                                        std::size_t cell) {
  Eigen::Matrix<double, 3, kCalibrationSize> J = Eigen::Matrix<double, 3, kCalibrationSize>::Zero();
  const DepthVector J_depth = DepthJacobian(view, cell);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d m = Eigen::Vector3d::Unit(axis);
    J.block<1, QuadraticTerm::kFocal>(axis, kLensAt) = FocalJacobian(view, cell, m).transpose();
    J.block<1, CalibrationModel::kDepthSize>(axis, kDepthAt) =
        PositionJacobian(sensor, view, cell, J_depth, m).transpose();
  }
  return J;
}

std::vector<KeyframePair> FindPairs(const Sensor& sensor, const JointRegistrationOptions& options,
                                    const std::vector<View>& views, const std::stop_token& stop) {
  const std::size_t n = views.size();
  std::vector<std::vector<KeyframePair>> candidates(n);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t a) {
    CheckStop(stop);
    for (std::size_t b = 0; b < n; ++b) {
      if (a == b) continue;
      const Eigen::Vector3d axis_a = views[a].T_world_depth.linear().col(2);
      const Eigen::Vector3d axis_b = views[b].T_world_depth.linear().col(2);
      if (axis_a.dot(axis_b) < 0.5) continue;
      int hits = 0;
      int tried = 0;
      const int stride = 16;
      for (int r = stride / 2; r < views[a].height; r += stride)
        for (int c = stride / 2; c < views[a].width; c += stride)
          tried +=
              views[a].points[static_cast<std::size_t>(r * views[a].width + c)].z() > 0 ? 1 : 0;
      ForEachProjected(
          sensor, views[a], views[b], {}, stride,
          [&](std::size_t i, std::size_t j, const Eigen::Vector3f& q, const Eigen::Matrix3f& R) {
            hits += Correspond(views[a], views[b], i, j, q, R, options.max_gate_m) ? 1 : 0;
          });
      const double overlap = tried > 0 ? static_cast<double>(hits) / tried : 0.0;
      if (overlap >= options.min_overlap)
        candidates[a].push_back({static_cast<int>(a), static_cast<int>(b), overlap});
    }
    // Spread over the overlap range instead of the nearest only, because distant pairs prevent
    // drift.
    std::stable_sort(candidates[a].begin(), candidates[a].end(),
                     [](const auto& x, const auto& y) { return x.overlap > y.overlap; });
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
               const std::stop_token& stop, std::vector<QuadraticTerm>& terms) {
  std::vector<int> uses(views.size(), 0);
  for (const KeyframePair& pair : pairs) {
    ++uses[static_cast<std::size_t>(pair.a)];
    ++uses[static_cast<std::size_t>(pair.b)];
  }
  struct Face {
    std::size_t view;
    const MarkerObservation* observation;
    const MapMarker* marker;
  };
  std::vector<Face> faces;
  for (std::size_t k = 0; k < views.size(); ++k)
    for (const MarkerObservation& observation : map.keyframes[k].data.markers)
      if (const auto marker = map.markers.find(observation.id); marker != map.markers.end())
        faces.push_back({k, &observation, &marker->second});
  const int stride = density == Density::kCoarse ? kCoarseLattice : kLattice;
  // Number of cells that one cell stands for, relative to a lattice of two.
  const double cells_for_one = stride * stride / 4.0;
  // Terms are large, so the space for links that may be appended is reserved now.
  terms.reserve(pairs.size() + faces.size() + views.size());
  terms.resize(pairs.size() + faces.size());
  tbb::parallel_for(std::size_t{0}, terms.size(), [&](std::size_t i) {
    CheckStop(stop);
    if (i >= pairs.size()) {
      const Face& face = faces[i - pairs.size()];
      FindMarkerFaceTerm(sensor, views[face.view], static_cast<int>(face.view), *face.observation,
                         *face.marker, options.marker_length_m / 2, gate_m + 0.03,
                         options.depth_noise, terms[i]);
      return;
    }
    const auto a = static_cast<std::size_t>(pairs[i].a);
    const auto b = static_cast<std::size_t>(pairs[i].b);
    // A keyframe's noise affects all its pairs, so together they have the weight of its cells used
    // once.
    const double weight = options.dense_weight * cells_for_one * 2.0 /
                          std::sqrt(static_cast<double>(uses[a]) * uses[b]);
    FindDenseTerm(sensor, views[a], views[b], pairs[i], OffsetOfPair(i, stride), stride, gate_m,
                  weight, options.depth_noise, terms[i]);
  });
}

double Consistency(const Sensor& sensor, const std::vector<View>& views,
                   const std::vector<KeyframePair>& pairs, double gate_m) {
  std::vector<std::vector<float>> parts(pairs.size());
  tbb::parallel_for(std::size_t{0}, pairs.size(), [&](std::size_t p) {
    const View& a = views[static_cast<std::size_t>(pairs[p].a)];
    const View& b = views[static_cast<std::size_t>(pairs[p].b)];
    ForEachProjected(
        sensor, a, b, OffsetOf(kHeldOut, kLattice, 0), kLattice,
        [&](std::size_t i, std::size_t j, const Eigen::Vector3f& q, const Eigen::Matrix3f& R) {
          if (const auto match = Correspond(a, b, i, j, q, R, gate_m))
            parts[p].push_back(static_cast<float>(std::abs(match->residual)));
        });
  });
  std::vector<float> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all.empty() ? 0.0 : TakeMedian(all);
}

}  // namespace plumb::dense
