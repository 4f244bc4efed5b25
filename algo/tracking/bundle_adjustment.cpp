#include "algo/tracking/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include <ceres/ceres.h>
#include <Eigen/Eigenvalues>

namespace plumb {
namespace {

// Cost functions carry their derivatives by hand: automatic ones cost six times as much, and this runs while sweeping.

using Matrix2x3d = Eigen::Matrix<double, 2, 3>;
using Matrix3x6d = Eigen::Matrix<double, 3, 6>;
template <int kRows, int kColumns>
using JacobianMap = Eigen::Map<Eigen::Matrix<double, kRows, kColumns, (kColumns == 1 ? Eigen::ColMajor : Eigen::RowMajor)>>;

// Right Jacobian of the rotation vector, to second order: the twists stay small because each call linearises anew.
Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& w) {
  const Eigen::Matrix3d W = Skew(w);
  return Eigen::Matrix3d::Identity() - 0.5 * W + W * W / 6.0;
}

// A point in the camera T0 * PoseFromTwist(x), `dt_s` after the stamp under the keyframe's velocity.
struct SeenPoint {
  Eigen::Vector3d p;
  Matrix3x6d J_pose;
  Eigen::Matrix3d J_world;  // dp / dp_world
  Eigen::Vector3d J_time;   // dp / ddt
};

SeenPoint See(const Pose& T_camera0_world, const Vector6d& velocity, const double* pose, const Eigen::Vector3d& p_world, double dt_s) {
  const Eigen::Vector3d w(pose[0], pose[1], pose[2]);
  const Eigen::Vector3d v(pose[3], pose[4], pose[5]);
  const Eigen::Matrix3d R_inverse = RotationFromVector(-w);
  const Eigen::Vector3d p = R_inverse * (T_camera0_world * p_world - v);
  // Later camera, to first order: p - dt (w x p + v).
  const Eigen::Matrix3d later = Eigen::Matrix3d::Identity() - dt_s * Skew(velocity.head<3>());
  SeenPoint seen;
  seen.J_time = -(velocity.head<3>().cross(p) + velocity.tail<3>());
  seen.p = p + dt_s * seen.J_time;
  seen.J_pose.leftCols<3>() = later * Skew(p) * RightJacobian(w);
  seen.J_pose.rightCols<3>() = -later * R_inverse;
  seen.J_world = later * R_inverse * T_camera0_world.linear();
  return seen;
}

// Pixel through the corrected lens, with derivatives to the point and to CalibrationModel::lens.
struct SeenPixel {
  Eigen::Vector2d pixel;
  Matrix2x3d J_point;
  Eigen::Matrix<double, 2, 6> J_lens;
};

SeenPixel ProjectCorrected(const Intrinsics& k, const double* lens, const Eigen::Vector3d& p) {
  const double iz = 1.0 / p.z();
  const double x = p.x() * iz;
  const double y = p.y() * iz;
  const double r2 = x * x + y * y;
  const double k1 = k.distortion[0] + lens[4];
  const double k2 = k.distortion[1] + lens[5];
  const double p1 = k.distortion[2];
  const double p2 = k.distortion[3];
  const double k3 = k.distortion[4];
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3));  // d radial / dx = slope x
  const double xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  const double yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  const double fx = k.fx * (1.0 + lens[0]);
  const double fy = k.fy * (1.0 + lens[1]);
  const double scale = k.width / 640.0;
  SeenPixel seen;
  seen.pixel = {fx * xd + k.cx + lens[2] * scale, fy * yd + k.cy + lens[3] * scale};
  const double dxx = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
  const double dxy = x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
  const double dyy = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
  seen.J_point << fx * dxx * iz, fx * dxy * iz, -fx * (dxx * x + dxy * y) * iz,  //
      fy * dxy * iz, fy * dyy * iz, -fy * (dxy * x + dyy * y) * iz;
  seen.J_lens << k.fx * xd, 0, scale, 0, fx * x * r2, fx * x * r2 * r2,  //
      0, k.fy * yd, 0, scale, fy * y * r2, fy * y * r2 * r2;
  return seen;
}

// Share of the readout before or after the stamp at an image row: -0.5 at the top, 0.5 at the bottom.
double RowShare(double y_px, int height) { return (y_px + 0.5) / height - 0.5; }

constexpr double kNearestPoint_m = 0.02;  // In front of the camera; nearer, projections mean nothing.

// Blocks: pose, landmark, lens, readout.
struct KeypointCost final : ceres::SizedCostFunction<2, 6, 3, 6, 1> {
  const Intrinsics* intrinsics;
  Pose T_camera0_world;
  Vector6d velocity;
  Eigen::Vector2d measured_px;
  double sigma_px;

  KeypointCost(const Intrinsics* k, const Pose& T, const Vector6d& v, const Eigen::Vector2d& px, double sigma)
      : intrinsics(k), T_camera0_world(T), velocity(v), measured_px(px), sigma_px(sigma) {}

  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    const double share = RowShare(measured_px.y(), intrinsics->height);
    const SeenPoint point = See(T_camera0_world, velocity, blocks[0], Eigen::Map<const Eigen::Vector3d>(blocks[1]), blocks[3][0] * share);
    if (point.p.z() < kNearestPoint_m) return false;
    const SeenPixel seen = ProjectCorrected(*intrinsics, blocks[2], point.p);
    Eigen::Map<Eigen::Vector2d>{residual} = (seen.pixel - measured_px) / sigma_px;
    if (jacobians == nullptr) return true;
    const Matrix2x3d J = seen.J_point / sigma_px;
    if (jacobians[0] != nullptr) JacobianMap<2, 6>{jacobians[0]} = J * point.J_pose;
    if (jacobians[1] != nullptr) JacobianMap<2, 3>{jacobians[1]} = J * point.J_world;
    if (jacobians[2] != nullptr) JacobianMap<2, 6>{jacobians[2]} = seen.J_lens / sigma_px;
    if (jacobians[3] != nullptr) JacobianMap<2, 1>{jacobians[3]} = J * point.J_time * share;
    return true;
  }
};

// Blocks: pose, landmark, depth.
struct KeypointDepthCost final : ceres::SizedCostFunction<1, 6, 3, CalibrationModel::kDepthSize> {
  Pose T_camera0_world;
  Vector6d velocity;
  Eigen::Vector2d centred;
  double row_share;  // RowShare() of the pixel.
  double z_m;
  double dt_s;  // Depth stamp after colour stamp.
  double sigma_m;

  KeypointDepthCost(const Pose& T, const Vector6d& v, const Eigen::Vector2d& centred_coordinates, double share, double z, double dt,
                    double sigma)
      : T_camera0_world(T), velocity(v), centred(centred_coordinates), row_share(share), z_m(z), dt_s(dt), sigma_m(sigma) {}

  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    const double* d = blocks[2];
    const SeenPoint point =
        See(T_camera0_world, velocity, blocks[0], Eigen::Map<const Eigen::Vector3d>(blocks[1]), dt_s + d[5] + row_share * d[8]);
    // In the units of the measurement: in metres of the scene, a smaller scene would look better.
    const double bow = centred.squaredNorm();
    const double scale = 1.0 + d[0] + d[6] * centred.x() + d[7] * centred.y();
    const double predicted = (point.p.z() - d[1] - d[2] * bow) / scale;
    residual[0] = (z_m - predicted) / sigma_m;
    if (jacobians == nullptr) return true;
    const double factor = -1.0 / (scale * sigma_m);
    if (jacobians[0] != nullptr) Eigen::Map<Eigen::Matrix<double, 1, 6>>{jacobians[0]} = factor * point.J_pose.row(2);
    if (jacobians[1] != nullptr) Eigen::Map<Eigen::Matrix<double, 1, 3>>{jacobians[1]} = factor * point.J_world.row(2);
    if (jacobians[2] != nullptr)
      Eigen::Map<Eigen::Matrix<double, 1, CalibrationModel::kDepthSize>>{jacobians[2]} << -predicted * factor, -factor, -bow * factor, 0, 0,
          factor * point.J_time.z(), -predicted * factor * centred.x(), -predicted * factor * centred.y(),
          factor * point.J_time.z() * row_share;
    return true;
  }
};

// Blocks: pose, marker, lens, readout, edge bias.
struct CornerCost final : ceres::SizedCostFunction<2, 6, 6, 6, 1, 1> {
  const Intrinsics* intrinsics;
  Pose T_camera0_world;
  Pose T_world_marker0;
  Vector6d velocity;
  Eigen::Vector3d corner_in_marker;
  Eigen::Vector2d measured_px;
  Eigen::Vector2d inward;  // Sum of the unit directions along the two sides that meet here, times the pixel scale.
  double sigma_px;

  CornerCost(const Intrinsics* k, const Pose& T_camera_world, const Pose& T_world_marker, const Vector6d& v, const Eigen::Vector3d& corner,
             const Eigen::Vector2d& px, const Eigen::Vector2d& inward_px, double sigma)
      : intrinsics(k),
        T_camera0_world(T_camera_world),
        T_world_marker0(T_world_marker),
        velocity(v),
        corner_in_marker(corner),
        measured_px(px),
        inward(inward_px),
        sigma_px(sigma) {}

  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override {
    const Eigen::Vector3d w(blocks[1][0], blocks[1][1], blocks[1][2]);
    const Eigen::Vector3d v(blocks[1][3], blocks[1][4], blocks[1][5]);
    const Eigen::Matrix3d R_marker = RotationFromVector(w);
    const Eigen::Vector3d p_world = T_world_marker0 * (R_marker * corner_in_marker + v);
    const double share = RowShare(measured_px.y(), intrinsics->height);
    const SeenPoint point = See(T_camera0_world, velocity, blocks[0], p_world, blocks[3][0] * share);
    if (point.p.z() < kNearestPoint_m) return false;
    const SeenPixel seen = ProjectCorrected(*intrinsics, blocks[2], point.p);
    Eigen::Map<Eigen::Vector2d>{residual} = (seen.pixel + blocks[4][0] * inward - measured_px) / sigma_px;
    if (jacobians == nullptr) return true;
    const Matrix2x3d J = seen.J_point / sigma_px;
    if (jacobians[0] != nullptr) JacobianMap<2, 6>{jacobians[0]} = J * point.J_pose;
    if (jacobians[1] != nullptr) {
      Matrix3x6d J_marker;
      J_marker << -R_marker * Skew(corner_in_marker) * RightJacobian(w), Eigen::Matrix3d::Identity();
      JacobianMap<2, 6>{jacobians[1]} = J * point.J_world * T_world_marker0.linear() * J_marker;
    }
    if (jacobians[2] != nullptr) JacobianMap<2, 6>{jacobians[2]} = seen.J_lens / sigma_px;
    if (jacobians[3] != nullptr) JacobianMap<2, 1>{jacobians[3]} = J * point.J_time * share;
    if (jacobians[4] != nullptr) JacobianMap<2, 1>{jacobians[4]} = inward / sigma_px;
    return true;
  }
};

template <int kN>
struct PriorCost {
  std::array<double, kN> sigma;
  template <typename T>
  bool operator()(const T* value, T* residual) const {
    for (int i = 0; i < kN; ++i) residual[i] = value[i] / sigma[static_cast<std::size_t>(i)];
    return true;
  }
};

// 1/2 |A (x - x0) + b|^2 equal to the quadratic up to a constant: A = sqrt(L) V', b = A H^+ g.
class QuadraticCost : public ceres::CostFunction {
 public:
  QuadraticCost(const QuadraticTerm& term, const std::array<double, CalibrationModel::kDepthSize>& depth0) : depth0_(depth0) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, QuadraticTerm::kSize, QuadraticTerm::kSize>> solver(term.H);
    const double cutoff = 1e-10 * std::max(1e-300, solver.eigenvalues().maxCoeff());
    int rank = 0;
    for (int i = 0; i < QuadraticTerm::kSize; ++i) rank += solver.eigenvalues()[i] > cutoff ? 1 : 0;
    A_.resize(rank, QuadraticTerm::kSize);
    b_.resize(rank);
    int row = 0;
    for (int i = 0; i < QuadraticTerm::kSize; ++i) {
      const double value = solver.eigenvalues()[i];
      if (!(value > cutoff)) continue;
      A_.row(row) = std::sqrt(value) * solver.eigenvectors().col(i).transpose();
      b_[row++] = solver.eigenvectors().col(i).dot(term.g) / std::sqrt(value);
    }
    set_num_residuals(rank);
    *mutable_parameter_block_sizes() = {6, 6, CalibrationModel::kDepthSize};
  }

  [[nodiscard]] bool empty() const { return num_residuals() == 0; }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    Eigen::Matrix<double, QuadraticTerm::kSize, 1> x;
    for (int i = 0; i < 6; ++i) {
      x[i] = parameters[0][i];
      x[6 + i] = parameters[1][i];
    }
    for (int i = 0; i < CalibrationModel::kDepthSize; ++i) x[12 + i] = parameters[2][i] - depth0_[static_cast<std::size_t>(i)];
    Eigen::Map<Eigen::VectorXd>(residuals, num_residuals()) = A_ * x + b_;
    if (jacobians == nullptr) return true;
    CopyColumns<6>(0, jacobians[0]);
    CopyColumns<6>(6, jacobians[1]);
    CopyColumns<CalibrationModel::kDepthSize>(12, jacobians[2]);
    return true;
  }

 private:
  template <int kColumns>
  void CopyColumns(int first, double* jacobian) const {
    if (jacobian == nullptr) return;
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kColumns, Eigen::RowMajor>>(jacobian, num_residuals(), kColumns) =
        A_.middleCols<kColumns>(first);
  }

  std::array<double, CalibrationModel::kDepthSize> depth0_;
  Eigen::Matrix<double, Eigen::Dynamic, QuadraticTerm::kSize> A_;
  Eigen::VectorXd b_;
};

// Sum of the unit directions from corner i to its two neighbours.
Eigen::Vector2d Inward(const ImageCorners& corners, std::size_t i) {
  const Eigen::Vector2d next = (corners[(i + 1) % 4] - corners[i]).normalized();
  const Eigen::Vector2d previous = (corners[(i + 3) % 4] - corners[i]).normalized();
  return next + previous;
}

// Builds and solves one problem; lives for one call of BundleAdjust().
class Bundle {
 public:
  Bundle(const Intrinsics& stated, const BundleOptions& options, TrackingMap& map, CalibrationModel& calibration)
      : stated_(stated), options_(options), map_(map), calibration_(calibration) {
    poses_.resize(map.keyframes.size(), {});
    for (const int k : options.free_keyframes) free_.insert(k);
  }

  BundleSummary Run(const std::vector<QuadraticTerm>& terms) {
    AddObservations();
    for (const QuadraticTerm& term : terms) AddTerm(term);
    AddPriors();
    FixBlocks();
    ceres::Solver::Options solver_options;
    solver_options.linear_solver_type = ceres::SPARSE_SCHUR;
    solver_options.max_num_iterations = options_.max_iterations;
    solver_options.num_threads = 1;
    solver_options.function_tolerance = 1e-5;
    solver_options.logging_type = ceres::SILENT;
    solver_options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    Order(*solver_options.linear_solver_ordering);
    ceres::Solver::Summary summary;
    ceres::Solve(solver_options, &problem_, &summary);
    BundleSummary result;
    result.usable = summary.IsSolutionUsable();
    result.num_residuals = summary.num_residuals;
    result.num_iterations = static_cast<int>(summary.iterations.size());
    result.initial_cost = summary.initial_cost;
    result.final_cost = summary.final_cost;
    if (result.usable) WriteBack();
    return result;
  }

 private:
  void AddObservations() {
    // Landmarks that a free keyframe sees, then every observation of those. One seen only once constrains nothing.
    std::vector<bool> wanted(map_.landmarks.size(), false);
    std::set<int> wanted_markers;
    for (const int k : free_) {
      for (const KeypointObservation& o : map_.keyframes[static_cast<std::size_t>(k)].keypoints) {
        const Landmark& landmark = map_.landmarks[static_cast<std::size_t>(o.landmark)];
        wanted[static_cast<std::size_t>(o.landmark)] = landmark.usable && landmark.num_observations > 1;
      }
      for (const MarkerObservation& m : map_.keyframes[static_cast<std::size_t>(k)].data.markers) wanted_markers.insert(m.id);
    }
    for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
      const MapKeyframe& keyframe = map_.keyframes[k];
      for (const KeypointObservation& o : keyframe.keypoints)
        if (wanted[static_cast<std::size_t>(o.landmark)]) AddKeypoint(static_cast<int>(k), keyframe, o);
      for (const MarkerObservation& m : keyframe.data.markers)
        if (wanted_markers.contains(m.id) && map_.markers.contains(m.id)) AddMarker(static_cast<int>(k), keyframe, m);
    }
  }

  double* PoseBlock(int keyframe) {
    used_keyframes_.insert(keyframe);
    return poses_[static_cast<std::size_t>(keyframe)].data();
  }

  double* MarkerBlock(int id) { return markers_.try_emplace(id).first->second.data(); }

  void AddKeypoint(int k, const MapKeyframe& keyframe, const KeypointObservation& o) {
    Landmark& landmark = map_.landmarks[static_cast<std::size_t>(o.landmark)];
    used_landmarks_.insert(o.landmark);
    const Pose T_camera0_world = keyframe.T_world_color.inverse();
    const double sigma_px = options_.keypoint_sigma_px * stated_.width / 640.0;
    problem_.AddResidualBlock(new KeypointCost(&stated_, T_camera0_world, keyframe.velocity_per_s, o.pixel, sigma_px), &keypoint_loss_,
                              PoseBlock(k), landmark.p_world.data(), calibration_.lens.data(), calibration_.readout_s.data());
    if (o.z_m > 0) {
      const double dt = keyframe.data.depth_time_s - keyframe.data.color_time_s;
      const Eigen::Vector2d centred = CentredCoordinates(o.pixel.x(), o.pixel.y(), stated_.width, stated_.height);
      problem_.AddResidualBlock(
          new KeypointDepthCost(T_camera0_world, keyframe.velocity_per_s, centred, RowShare(o.pixel.y(), stated_.height), o.z_m, dt,
                                options_.keypoint_depth_sigmas * DepthSigma(o.z_m, 0.8)),
          &keypoint_loss_, PoseBlock(k), landmark.p_world.data(), calibration_.depth.data());
      depth_used_ = true;
    }
    lens_used_ = true;
  }

  void AddMarker(int k, const MapKeyframe& keyframe, const MarkerObservation& observation) {
    const MapMarker& marker = map_.markers.at(observation.id);
    const MarkerCorners corners = CornersInMarkerFrame(options_.marker_length_m);
    const double scale = stated_.width / 640.0;
    for (std::size_t i = 0; i < 4; ++i) {
      const double sigma_px = std::max(options_.min_corner_sigma_px * scale, observation.sigma_px[i]);
      problem_.AddResidualBlock(new CornerCost(&stated_, keyframe.T_world_color.inverse(), marker.T_world_marker, keyframe.velocity_per_s,
                                               corners[i], observation.corners[i], scale * Inward(observation.corners, i), sigma_px),
                                &corner_loss_, PoseBlock(k), MarkerBlock(observation.id), calibration_.lens.data(),
                                calibration_.readout_s.data(), calibration_.edge_bias_px.data());
    }
    lens_used_ = true;
    bias_used_ = true;
  }

  void AddTerm(const QuadraticTerm& term) {
    auto cost = std::make_unique<QuadraticCost>(term, calibration_.depth);
    if (cost->empty()) return;
    double* second = term.keyframe_b >= 0 ? PoseBlock(term.keyframe_b) : MarkerBlock(term.marker);
    problem_.AddResidualBlock(cost.release(), nullptr, PoseBlock(term.keyframe_a), second, calibration_.depth.data());
    depth_used_ = true;
  }

  void AddPriors() {
    using C = CalibrationModel;
    if (!options_.calibrate) return;
    if (lens_used_) {
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost<6>, 6, 6>(new PriorCost<6>{C::kLensSigma}), nullptr,
                                calibration_.lens.data());
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost<1>, 1, 1>(new PriorCost<1>{{C::kReadoutSigma}}), nullptr,
                                calibration_.readout_s.data());
    }
    if (bias_used_)
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost<1>, 1, 1>(new PriorCost<1>{{C::kEdgeBiasSigma}}), nullptr,
                                calibration_.edge_bias_px.data());
    if (depth_used_)
      problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<PriorCost<C::kDepthSize>, C::kDepthSize, C::kDepthSize>(
                                    new PriorCost<C::kDepthSize>{C::kDepthSigma}),
                                nullptr, calibration_.depth.data());
  }

  void FixBlocks() {
    for (const int k : used_keyframes_)
      if (!free_.contains(k)) problem_.SetParameterBlockConstant(PoseBlock(k));
    if (options_.fix_lens && problem_.HasParameterBlock(calibration_.lens.data()))
      problem_.SetParameterBlockConstant(calibration_.lens.data());
    if (!options_.calibrate) {
      for (double* block :
           {calibration_.lens.data(), calibration_.readout_s.data(), calibration_.edge_bias_px.data(), calibration_.depth.data()})
        if (problem_.HasParameterBlock(block)) problem_.SetParameterBlockConstant(block);
    }
  }

  // Landmarks first (Schur complement), the rest after, always in the same order.
  void Order(ceres::ParameterBlockOrdering& ordering) {
    for (const int landmark : used_landmarks_)
      ordering.AddElementToGroup(map_.landmarks[static_cast<std::size_t>(landmark)].p_world.data(), 0);
    for (const int k : used_keyframes_) ordering.AddElementToGroup(PoseBlock(k), 1);
    // Within a group Ceres goes by addresses, and those of separate allocations differ from run to run: a group for each.
    int group = 2;
    for (auto& [id, block] : markers_) ordering.AddElementToGroup(block.data(), group++);
    for (double* block :
         {calibration_.lens.data(), calibration_.readout_s.data(), calibration_.edge_bias_px.data(), calibration_.depth.data()})
      if (problem_.HasParameterBlock(block)) ordering.AddElementToGroup(block, group++);
  }

  void WriteBack() {
    for (const int k : free_) {
      MapKeyframe& keyframe = map_.keyframes[static_cast<std::size_t>(k)];
      const Vector6d twist = Eigen::Map<const Vector6d>(poses_[static_cast<std::size_t>(k)].data());
      keyframe.T_world_color = Orthonormalised(keyframe.T_world_color * PoseFromTwist(twist));
    }
    for (auto& [id, block] : markers_) {
      MapMarker& marker = map_.markers.at(id);
      marker.T_world_marker = Orthonormalised(marker.T_world_marker * PoseFromTwist(Eigen::Map<const Vector6d>(block.data())));
    }
  }

  const Intrinsics& stated_;
  const BundleOptions& options_;
  TrackingMap& map_;
  CalibrationModel& calibration_;
  // Shared by all residuals of a kind, so the problem must not own them.
  ceres::CauchyLoss keypoint_loss_{2.0};
  ceres::CauchyLoss corner_loss_{3.0};
  ceres::Problem problem_{[] {
    ceres::Problem::Options problem_options;
    problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    return problem_options;
  }()};
  std::set<int> free_;
  std::set<int> used_keyframes_;
  std::set<int> used_landmarks_;
  std::vector<std::array<double, 6>> poses_;
  std::map<int, std::array<double, 6>> markers_;
  bool lens_used_ = false;
  bool depth_used_ = false;
  bool bias_used_ = false;
};

}  // namespace

BundleSummary BundleAdjust(const Intrinsics& stated, const BundleOptions& options, const std::vector<QuadraticTerm>& terms,
                           TrackingMap& map, CalibrationModel& calibration) {
  return Bundle(stated, options, map, calibration).Run(terms);
}

}  // namespace plumb
