#include "algo/tracking/bundle_adjustment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>

#include "algo/base/check_stop.hpp"
#include "algo/tracking/bundle_model.hpp"

namespace plumb {
namespace {

using namespace bundle;  // NOLINT: the model is this file's own vocabulary
using Matrix2x6d = Eigen::Matrix<double, 2, 6>;
constexpr int kCamera = 6;  // Unknowns of a keyframe: its twist.
constexpr int kLensAndReadout = kReadoutAt + 1;
constexpr int kSeenByCorners = kEdgeBiasAt + 1;  // Unknowns of the calibration that corners see.
using CameraVector = Eigen::Matrix<double, kCamera, 1>;
using CameraMatrix = Eigen::Matrix<double, kCamera, kCamera>;
using CameraPoint = Eigen::Matrix<double, kCamera, 3>;
using CameraRows2 = Eigen::Matrix<double, 2, kCamera>;
using CameraRows3 = Eigen::Matrix<double, 3, kCamera>;
using CalibrationCamera = Eigen::Matrix<double, kCalibrationSize, kCamera>;
using CalibrationPoint = Eigen::Matrix<double, kCalibrationSize, 3>;

constexpr Eigen::Index kLargestDenseSystem =
    1200;                                // Unknowns; beyond, a sparse factorisation is faster.
constexpr double kLargestDamping = 1e8;  // Steps so short that improve nothing: at the minimum.

// A keypoint's observation and what the last linearisation made of it: rows pixel x, pixel y,
// depth, weighted.
struct PointView {
  int keyframe = 0;
  int landmark = 0;  // Slot.
  Eigen::Vector2d pixel;
  DepthPlace place;
  double z_m = 0;  // 0: none.
  double weight_z = 0;

  Eigen::Vector3d r = Eigen::Vector3d::Zero();
  Eigen::Matrix3d J_point = Eigen::Matrix3d::Zero();
  CameraRows3 J_camera = CameraRows3::Zero();
  // Lens and readout.
  Eigen::Matrix<double, 2, kLensAndReadout> J_lens =
      Eigen::Matrix<double, 2, kLensAndReadout>::Zero();
  DepthRow J_depth = DepthRow::Zero();

  // J' M for this observation's derivatives J to the whole calibration.
  template <int kColumns>
  [[nodiscard]] Eigen::Matrix<double, kCalibrationSize, kColumns> CalibrationTimes(
      const Eigen::Matrix<double, 3, kColumns>& M) const {
    Eigen::Matrix<double, kCalibrationSize, kColumns> product;
    product.template topRows<kLensAndReadout>().noalias() =
        J_lens.transpose() * M.template topRows<2>();
    product.row(kEdgeBiasAt).setZero();
    product.template bottomRows<CalibrationModel::kDepthSize>().noalias() =
        J_depth.transpose() * M.row(2);
    return product;
  }
};

struct CornerView {
  int keyframe = 0;
  int marker = 0;  // Slot.
  Eigen::Vector3d in_marker;
  Eigen::Vector2d pixel;
  Eigen::Vector2d inward;  // Sum of the unit directions along the two sides that meet here, times
                           // the pixel scale.
  double weight = 0;
};

// A landmark's own 3x3 system, inverted, and its coupling to the free keyframes and the
// calibration.
struct PointSystem {
  Eigen::Matrix3d V_inverse;
  Eigen::Vector3d g;
  std::vector<std::pair<int, CameraPoint>> W;  // Camera slot, ascending.
  CalibrationPoint W_calibration;
};

// Sum of the unit directions from corner i to its two neighbours.
Eigen::Vector2d Inward(const ImageCorners& corners, std::size_t i) {
  const Eigen::Vector2d next = (corners[(i + 1) % 4] - corners[i]).normalized();
  const Eigen::Vector2d previous = (corners[(i + 3) % 4] - corners[i]).normalized();
  return next + previous;
}

// Everything that moves.
struct State {
  std::vector<CameraState> cameras;  // One a keyframe of the map; those that stay never change.
  std::vector<Vector6d> markers;     // Twists on the markers' side.
  std::vector<Eigen::Vector3d> landmarks;
  CalibrationModel calibration;
};

// One problem; lives for one call of BundleAdjust(). Unknowns: free poses, markers, calibration;
// landmarks are eliminated.
class Bundle {
 public:
  Bundle(const Intrinsics& stated, const BundleOptions& options,
         const std::vector<QuadraticTerm>& terms, TrackingMap& map, CalibrationModel& calibration)
      : stated_(stated),
        options_(options),
        terms_(terms),
        map_(map),
        calibration_(calibration),
        pose_slot_(map.keyframes.size(), -1) {
    for (const int k : options.free_keyframes) {
      int& slot = pose_slot_[static_cast<std::size_t>(k)];
      if (slot >= 0) continue;
      slot = static_cast<int>(free_.size());
      free_.push_back(k);
    }
    CollectMarkers();
    CollectPoints();
    markers_at_ = kCamera * static_cast<Eigen::Index>(free_.size());
    calibration_at_ = markers_at_ + 6 * static_cast<Eigen::Index>(markers_.size());
    size_ = calibration_at_ + (options.calibrate ? kCalibrationSize : 0);
  }

  BundleSummary Run() {
    BundleSummary summary;
    summary.num_residuals = static_cast<int>(2 * (views_.size() + corners_.size()));
    for (const PointView& view : views_) summary.num_residuals += view.z_m > 0 ? 1 : 0;
    State state = Start();
    DropViewsBehindCameras(state);
    double cost = Cost(state);
    summary.initial_cost = summary.final_cost = cost;
    if (!std::isfinite(cost) || size_ == 0) return summary;
    summary.usable = true;
    double damping = 1e-4;
    bool linearised = false;
    while (summary.num_iterations < options_.max_iterations && damping < kLargestDamping) {
      CheckStop(options_.stop);
      ++summary.num_iterations;
      if (!linearised) Linearise(state);
      linearised = true;
      State next;
      const double next_cost =
          Step(state, damping, next) ? Cost(next) : std::numeric_limits<double>::infinity();
      if (!(next_cost < cost)) {
        damping *= 10.0;
        continue;
      }
      const bool settled = cost - next_cost < options_.function_tolerance * std::abs(cost);
      state = std::move(next);
      cost = next_cost;
      damping = std::max(1e-9, 0.2 * damping);
      linearised = false;
      if (settled) break;
    }
    summary.final_cost = cost;
    if (options_.find_information && options_.calibrate) summary.information = Information(state);
    Write(state);
    return summary;
  }

 private:
  // ---- what is observed
  // --------------------------------------------------------------------------------------------

  void CollectMarkers() {
    for (const int k : free_)
      for (const MarkerObservation& m : map_.keyframes[static_cast<std::size_t>(k)].data.markers)
        if (map_.markers.contains(m.id)) markers_.try_emplace(m.id, 0);
    for (const QuadraticTerm& term : terms_)
      if (term.keyframe_b < 0) markers_.try_emplace(term.marker, 0);
    int slot = 0;
    for (auto& [id, index] : markers_) {
      index = slot++;
      T_world_marker0_.push_back(map_.markers.at(id).T_world_marker);
    }
    const MarkerCorners in_marker = CornersInMarkerFrame(options_.marker_length_m);
    const double scale = stated_.width / 640.0;
    for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
      for (const MarkerObservation& m : map_.keyframes[k].data.markers) {
        const auto found = markers_.find(m.id);
        if (found == markers_.end()) continue;
        for (std::size_t i = 0; i < 4; ++i)
          corners_.push_back({static_cast<int>(k), found->second, in_marker[i], m.corners[i],
                              scale * Inward(m.corners, i),
                              1.0 / std::max(options_.min_corner_sigma_px * scale, m.sigma_px[i])});
      }
    }
  }

  void CollectPoints() {
    // Landmarks that a free keyframe sees, then every observation of those. One seen only once
    // constrains nothing.
    std::vector<int> slot(map_.landmarks.size(), -1);
    for (const int k : free_) {
      for (const KeypointObservation& o : map_.keyframes[static_cast<std::size_t>(k)].keypoints) {
        const Landmark& landmark = map_.landmarks[static_cast<std::size_t>(o.landmark)];
        int& s = slot[static_cast<std::size_t>(o.landmark)];
        if (s >= 0 || !landmark.usable || landmark.num_observations < 2) continue;
        s = static_cast<int>(landmarks_.size());
        landmarks_.push_back(o.landmark);
      }
    }
    for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
      for (const KeypointObservation& o : map_.keyframes[k].keypoints) {
        const int s = slot[static_cast<std::size_t>(o.landmark)];
        if (s < 0) continue;
        PointView view{static_cast<int>(k), s, o.pixel, DepthPlace(o.pixel, stated_), o.z_m};
        if (o.z_m > 0)
          view.weight_z = 1.0 / (options_.keypoint_depth_sigmas * DepthSigma(o.z_m, 0.8));
        views_.push_back(view);
      }
    }
  }

  [[nodiscard]] State Start() const {
    State state;
    for (const MapKeyframe& keyframe : map_.keyframes) {
      CameraState camera;
      camera.T_camera0_world = keyframe.T_world_color.inverse();
      camera.velocity_per_s = keyframe.velocity_per_s;
      camera.Prepare();
      state.cameras.push_back(camera);
    }
    state.markers.assign(markers_.size(), Vector6d::Zero());
    for (const int id : landmarks_)
      state.landmarks.push_back(map_.landmarks[static_cast<std::size_t>(id)].p_world);
    state.calibration = calibration_;
    return state;
  }

  // A landmark that starts behind a camera has no projection there; later it cannot get there, see
  // Cost().
  void DropViewsBehindCameras(const State& state) {
    std::erase_if(views_, [&](const PointView& view) {
      return PointInCamera(state, view).z() < kNearestPoint_m;
    });
    std::erase_if(corners_, [&](const CornerView& view) {
      return (state.cameras[static_cast<std::size_t>(view.keyframe)].T_camera_world *
              CornerInWorld(state, view))
                 .z() < kNearestPoint_m;
    });
    views_of_landmark_.assign(landmarks_.size(), {});
    views_of_keyframe_.assign(map_.keyframes.size(), {});
    for (std::size_t i = 0; i < views_.size(); ++i) {
      views_of_landmark_[static_cast<std::size_t>(views_[i].landmark)].push_back(
          static_cast<std::uint32_t>(i));
      views_of_keyframe_[static_cast<std::size_t>(views_[i].keyframe)].push_back(
          static_cast<std::uint32_t>(i));
    }
  }

  static Eigen::Vector3d PointInCamera(const State& state, const PointView& view) {
    return state.cameras[static_cast<std::size_t>(view.keyframe)].T_camera_world *
           state.landmarks[static_cast<std::size_t>(view.landmark)];
  }

  [[nodiscard]] Eigen::Vector3d CornerInWorld(const State& state, const CornerView& view) const {
    return MarkerPose(view.marker) *
           (PoseFromTwist(state.markers[static_cast<std::size_t>(view.marker)]) * view.in_marker);
  }

  // As it was at the beginning.
  [[nodiscard]] const Pose& MarkerPose(int slot) const {
    return T_world_marker0_[static_cast<std::size_t>(slot)];
  }

  // Of a keyframe's unknowns; negative if it stays.
  [[nodiscard]] Eigen::Index CameraAt(int keyframe) const {
    return kCamera * static_cast<Eigen::Index>(pose_slot_[static_cast<std::size_t>(keyframe)]);
  }
  [[nodiscard]] double PixelWeight() const {
    return 1.0 / (options_.keypoint_sigma_px * stated_.width / 640.0);
  }
  [[nodiscard]] double DepthDelay(const State& state, int keyframe, double row_share) const {
    const Keyframe& data = map_.keyframes[static_cast<std::size_t>(keyframe)].data;
    return data.depth_time_s - data.color_time_s + state.calibration.depth[kDepthDelay] +
           row_share * state.calibration.depth[kDepthReadout];
  }

  // ---- cost
  // --------------------------------------------------------------------------------------------------------

  // 1/2 sum of losses, and the quadratic terms (up to their constant).
  [[nodiscard]] double Cost(const State& state) const {
    std::vector<double> parts(map_.keyframes.size(), 0.0);
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
      for (const std::uint32_t i : views_of_keyframe_[k]) parts[k] += PointCost(state, views_[i]);
    });
    double cost = 0;
    for (const double part : parts) cost += part;
    for (const CornerView& view : corners_) {
      const double share = RowShare(view.pixel.y(), stated_.height);
      const SeenPoint point =
          See(state.cameras[static_cast<std::size_t>(view.keyframe)], CornerInWorld(state, view),
              state.calibration.readout_s[0] * share);
      if (point.p.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
      cost +=
          0.5 * CauchyLoss(CornerResidual(state, view, point.p).squaredNorm(), kCornerLossScale);
    }
    for (const QuadraticTerm& term : terms_) {
      const TermVector x = TermState(state, term);
      cost += x.dot(0.5 * (term.H * x) + term.g);
    }
    if (options_.calibrate) cost += options_.prior.Cost(ToVector(state.calibration));
    return cost;
  }

  [[nodiscard]] double PointCost(const State& state, const PointView& view) const {
    const CameraState& camera = state.cameras[static_cast<std::size_t>(view.keyframe)];
    const Eigen::Vector3d p = PointInCamera(state, view);
    const Eigen::Vector3d motion =
        -(camera.velocity_per_s.head<3>().cross(p) + camera.velocity_per_s.tail<3>());
    const Eigen::Vector3d at_row =
        p + state.calibration.readout_s[0] * view.place.row_share * motion;
    if (at_row.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
    const Eigen::Vector2d r =
        (ProjectCorrected(stated_, state.calibration.lens, at_row).pixel - view.pixel) *
        PixelWeight();
    double cost = 0.5 * CauchyLoss(r.squaredNorm(), kKeypointLossScale);
    if (view.z_m > 0) {
      const double z = p.z() + DepthDelay(state, view.keyframe, view.place.row_share) * motion.z();
      const double rz =
          (PredictDepthOnly(state.calibration, z, view.place) - view.z_m) * view.weight_z;
      cost += 0.5 * CauchyLoss(rz * rz, kKeypointLossScale);
    }
    return cost;
  }

  [[nodiscard]] Eigen::Vector2d CornerResidual(const State& state, const CornerView& view,
                                               const Eigen::Vector3d& p) const {
    const Eigen::Vector2d pixel = ProjectCorrected(stated_, state.calibration.lens, p).pixel;
    return (pixel + state.calibration.edge_bias_px[0] * view.inward - view.pixel) * view.weight;
  }

  using TermVector = Eigen::Matrix<double, QuadraticTerm::kSize, 1>;
  [[nodiscard]] TermVector TermState(const State& state, const QuadraticTerm& term) const {
    TermVector x;
    x.head<6>() = state.cameras[static_cast<std::size_t>(term.keyframe_a)].twist;
    x.segment<6>(6) = term.keyframe_b >= 0
                          ? state.cameras[static_cast<std::size_t>(term.keyframe_b)].twist
                          : state.markers[static_cast<std::size_t>(markers_.at(term.marker))];
    for (int i = 0; i < QuadraticTerm::kFocal; ++i)
      x[QuadraticTerm::kFocalAt + i] = state.calibration.lens[static_cast<std::size_t>(i)] -
                                       calibration_.lens[static_cast<std::size_t>(i)];
    for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
      x[QuadraticTerm::kDepthCalibrationAt + i] =
          state.calibration.depth[static_cast<std::size_t>(i)] -
          calibration_.depth[static_cast<std::size_t>(i)];
    return x;
  }

  // ---- linearisation
  // -----------------------------------------------------------------------------------------------

  // Fills views_, points_, and the undamped H_ (lower half) and g_ of poses, markers and
  // calibration, landmarks not yet eliminated. Parallel loops write to their own slots, and every
  // sum has one order: the same bits on any number of threads.
  void Linearise(const State& state) {
    H_ = Eigen::MatrixXd::Zero(size_, size_);
    g_ = Eigen::VectorXd::Zero(size_);
    std::vector<CalibrationMatrix> H_calibration(map_.keyframes.size(), CalibrationMatrix::Zero());
    std::vector<CalibrationVector> g_calibration(map_.keyframes.size(), CalibrationVector::Zero());
    tbb::parallel_for(std::size_t{0}, map_.keyframes.size(), [&](std::size_t k) {
      LineariseKeyframe(state, k, H_calibration[k], g_calibration[k]);
    });
    if (options_.calibrate) {
      for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
        H_.bottomRightCorner<kCalibrationSize, kCalibrationSize>() += H_calibration[k];
        g_.tail<kCalibrationSize>() += g_calibration[k];
      }
      const CalibrationMatrix& prior = options_.prior.information;
      H_.bottomRightCorner<kCalibrationSize, kCalibrationSize>() += prior;
      g_.tail<kCalibrationSize>() += prior * (ToVector(state.calibration) - options_.prior.mean);
    }
    for (const CornerView& view : corners_) AddCorner(state, view);
    for (const QuadraticTerm& term : terms_) AddTerm(state, term);
    points_.resize(landmarks_.size());
  }

  void LineariseKeyframe(const State& state, std::size_t k, CalibrationMatrix& H_calibration,
                         CalibrationVector& g_calibration) {
    const int slot = pose_slot_[k];
    CameraMatrix H = CameraMatrix::Zero();
    CameraVector g = CameraVector::Zero();
    CalibrationCamera H_coupled = CalibrationCamera::Zero();
    for (const std::uint32_t i : views_of_keyframe_[k]) {
      PointView& view = views_[i];
      LineariseView(state, view);
      if (slot >= 0) {
        H.noalias() += view.J_camera.transpose() * view.J_camera;
        g.noalias() += view.J_camera.transpose() * view.r;
      }
      if (!options_.calibrate) continue;
      if (slot >= 0) H_coupled += view.CalibrationTimes<kCamera>(view.J_camera);
      H_calibration.topLeftCorner<kLensAndReadout, kLensAndReadout>().noalias() +=
          view.J_lens.transpose() * view.J_lens;
      H_calibration.bottomRightCorner<CalibrationModel::kDepthSize, CalibrationModel::kDepthSize>()
          .noalias() += view.J_depth.transpose() * view.J_depth;
      g_calibration += view.CalibrationTimes<1>(view.r);
    }
    if (slot < 0) return;
    H_.block<kCamera, kCamera>(kCamera * slot, kCamera * slot) += H;
    g_.segment<kCamera>(kCamera * slot) += g;
    if (options_.calibrate)
      H_.block<kCalibrationSize, kCamera>(calibration_at_, kCamera * slot) += H_coupled;
  }

  void LineariseView(const State& state, PointView& view) const {
    const CameraState& camera = state.cameras[static_cast<std::size_t>(view.keyframe)];
    const Eigen::Vector3d& p_world = state.landmarks[static_cast<std::size_t>(view.landmark)];
    const double row_s = state.calibration.readout_s[0] * view.place.row_share;
    const SeenPoint point = See(camera, p_world, row_s);
    const SeenPixel seen = ProjectCorrected(stated_, state.calibration.lens, point.p);
    const Eigen::Vector2d r = (seen.pixel - view.pixel) * PixelWeight();
    const double w = PixelWeight() * std::sqrt(CauchyWeight(r.squaredNorm(), kKeypointLossScale));
    const Eigen::Matrix<double, 2, 3> J = w * seen.J_point;
    view.r.head<2>() = w * (seen.pixel - view.pixel);
    view.J_point.topRows<2>().noalias() = J * point.J_world;
    view.J_camera.topRows<2>() = J * point.J_pose;
    view.J_lens.leftCols<CalibrationModel::kLensSize>() = w * seen.J_lens;
    view.J_lens.col(kReadoutAt) = view.place.row_share * (J * point.J_time);
    view.r[2] = 0;
    view.J_point.row(2).setZero();
    view.J_camera.row(2).setZero();
    view.J_depth.setZero();
    if (!(view.z_m > 0)) return;
    const double late_s = DepthDelay(state, view.keyframe, view.place.row_share);
    const SeenPoint late = See(camera, p_world, late_s);
    const PredictedDepth predicted = PredictDepth(state.calibration, late, view.place);
    const double rz = (predicted.z_m - view.z_m) * view.weight_z;
    const double wz = view.weight_z * std::sqrt(CauchyWeight(rz * rz, kKeypointLossScale));
    view.r[2] = wz * (predicted.z_m - view.z_m);
    view.J_point.row(2) = wz * predicted.J_z * late.J_world.row(2);
    view.J_camera.row(2) = wz * predicted.J_z * late.J_pose.row(2);
    view.J_depth = wz * predicted.J_depth;
  }

  void AddCorner(const State& state, const CornerView& view) {
    const Vector6d& twist = state.markers[static_cast<std::size_t>(view.marker)];
    CameraState marker_side;  // Only for the right Jacobian of the twist.
    marker_side.twist = twist;
    marker_side.Prepare();
    const Pose T_world_marker = MarkerPose(view.marker) * PoseFromTwist(twist);
    const double share = RowShare(view.pixel.y(), stated_.height);
    const Eigen::Vector3d p_world =
        MarkerPose(view.marker) * (PoseFromTwist(twist) * view.in_marker);
    const double row_s = state.calibration.readout_s[0] * share;
    const SeenPoint point =
        See(state.cameras[static_cast<std::size_t>(view.keyframe)], p_world, row_s);
    const SeenPixel seen = ProjectCorrected(stated_, state.calibration.lens, point.p);
    Eigen::Vector2d r = CornerResidual(state, view, point.p);
    const double robust = std::sqrt(CauchyWeight(r.squaredNorm(), kCornerLossScale));
    const double w = robust * view.weight;
    r *= robust;
    const Eigen::Matrix<double, 2, 3> J = w * seen.J_point;
    Matrix3x6d J_in_world;
    J_in_world.leftCols<3>() =
        -T_world_marker.linear() * Skew(view.in_marker) * marker_side.J_right;
    J_in_world.rightCols<3>() = MarkerPose(view.marker).linear();
    const Matrix2x6d J_marker = J * point.J_world * J_in_world;
    const CameraRows2 J_camera = J * point.J_pose;
    const Eigen::Index m = markers_at_ + 6 * view.marker;
    const Eigen::Index a = CameraAt(view.keyframe);
    H_.block<6, 6>(m, m).noalias() += J_marker.transpose() * J_marker;
    g_.segment<6>(m).noalias() += J_marker.transpose() * r;
    if (a >= 0) {
      H_.block<kCamera, kCamera>(a, a).noalias() += J_camera.transpose() * J_camera;
      H_.block<6, kCamera>(m, a).noalias() += J_marker.transpose() * J_camera;
      g_.segment<kCamera>(a).noalias() += J_camera.transpose() * r;
    }
    if (!options_.calibrate) return;
    Eigen::Matrix<double, 2, kSeenByCorners> J_calibration;
    J_calibration << w * seen.J_lens, share * (J * point.J_time), w * view.inward;
    H_.block<kSeenByCorners, kSeenByCorners>(calibration_at_, calibration_at_).noalias() +=
        J_calibration.transpose() * J_calibration;
    H_.block<kSeenByCorners, 6>(calibration_at_, m).noalias() +=
        J_calibration.transpose() * J_marker;
    if (a >= 0)
      H_.block<kSeenByCorners, kCamera>(calibration_at_, a).noalias() +=
          J_calibration.transpose() * J_camera;
    g_.segment<kSeenByCorners>(calibration_at_).noalias() += J_calibration.transpose() * r;
  }

  void AddTerm(const State& state, const QuadraticTerm& term) {
    const TermVector slope = term.H * TermState(state, term) + term.g;
    constexpr int kFocal = QuadraticTerm::kFocal;
    constexpr int kFocalAt = QuadraticTerm::kFocalAt;
    constexpr int kDepthSize = CalibrationModel::kDepthSize;
    constexpr int kDepth = QuadraticTerm::kDepthCalibrationAt;
    const Eigen::Index a = CameraAt(term.keyframe_a);
    const Eigen::Index b = term.keyframe_b >= 0 ? CameraAt(term.keyframe_b)
                                                : markers_at_ + 6 * markers_.at(term.marker);
    const Eigen::Index f = calibration_at_ + kLensAt;
    const Eigen::Index d = calibration_at_ + kDepthAt;
    const auto add_pose = [&](Eigen::Index at, Eigen::Index in_term) {
      H_.block<6, 6>(at, at) += term.H.block<6, 6>(in_term, in_term);
      g_.segment<6>(at) += slope.segment<6>(in_term);
      if (!options_.calibrate) return;
      H_.block<kFocal, 6>(f, at) += term.H.block<kFocal, 6>(kFocalAt, in_term);
      H_.block<kDepthSize, 6>(d, at) += term.H.block<kDepthSize, 6>(kDepth, in_term);
    };
    if (a >= 0) add_pose(a, 0);
    if (b >= 0) add_pose(b, 6);
    if (a >= 0 && b >= 0) {
      if (b > a) {
        H_.block<6, 6>(b, a) += term.H.block<6, 6>(6, 0);
      } else {
        H_.block<6, 6>(a, b) += term.H.block<6, 6>(0, 6);
      }
    }
    if (!options_.calibrate) return;
    H_.block<kFocal, kFocal>(f, f) += term.H.block<kFocal, kFocal>(kFocalAt, kFocalAt);
    H_.block<kDepthSize, kFocal>(d, f) += term.H.block<kDepthSize, kFocal>(kDepth, kFocalAt);
    H_.block<kDepthSize, kDepthSize>(d, d) += term.H.bottomRightCorner<kDepthSize, kDepthSize>();
    g_.segment<kFocal>(f) += slope.segment<kFocal>(kFocalAt);
    g_.segment<kDepthSize>(d) += slope.tail<kDepthSize>();
  }

  // ---- solution
  // ----------------------------------------------------------------------------------------------------

  void MakePoint(std::size_t s, double damping) {
    PointSystem& point = points_[s];
    Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
    point.g.setZero();
    point.W.clear();
    point.W_calibration.setZero();
    for (const std::uint32_t i : views_of_landmark_[s]) {
      const PointView& view = views_[i];
      V.noalias() += view.J_point.transpose() * view.J_point;
      point.g.noalias() += view.J_point.transpose() * view.r;
      const int slot = pose_slot_[static_cast<std::size_t>(view.keyframe)];
      if (slot >= 0) point.W.emplace_back(slot, view.J_camera.transpose() * view.J_point);
      if (options_.calibrate) point.W_calibration += view.CalibrationTimes<3>(view.J_point);
    }
    V.diagonal() *= 1.0 + damping;
    V.diagonal().array() += 1e-9 * V.trace() + 1e-12;
    point.V_inverse = V.inverse();
  }

  // One damped Gauss-Newton step; false if the system cannot be solved.
  bool Step(const State& state, double damping, State& next) {
    tbb::parallel_for(std::size_t{0}, points_.size(),
                      [&](std::size_t s) { MakePoint(s, damping); });
    Eigen::MatrixXd S = H_;
    S.diagonal() *= 1.0 + damping;
    S.diagonal().array() += 1e-9;
    Eigen::VectorXd right = g_;
    Eliminate(S, right);
    if (options_.calibrate && options_.fix_centre_and_distortion)
      Pin(calibration_at_ + kLensAt + QuadraticTerm::kFocal,
          CalibrationModel::kLensSize - QuadraticTerm::kFocal, S, right);
    if (options_.calibrate && options_.fix_depth_field)
      Pin(calibration_at_ + kDepthAt + kDepthField, kNumDepthTerms - kDepthField, S, right);
    Eigen::VectorXd x;
    if (!Solve(S, right, x)) return false;
    next = state;
    for (std::size_t slot = 0; slot < free_.size(); ++slot) {
      CameraState& camera = next.cameras[static_cast<std::size_t>(free_[slot])];
      camera.twist -= x.segment<6>(kCamera * static_cast<Eigen::Index>(slot));
      camera.Prepare();
    }
    for (std::size_t m = 0; m < markers_.size(); ++m)
      next.markers[m] -= x.segment<6>(markers_at_ + 6 * static_cast<Eigen::Index>(m));
    if (options_.calibrate) MoveCalibration(-x.tail<kCalibrationSize>(), next.calibration);
    tbb::parallel_for(std::size_t{0}, points_.size(), [&](std::size_t s) {
      const PointSystem& point = points_[s];
      Eigen::Vector3d rest = point.g;
      for (const auto& [a, W] : point.W)
        rest.noalias() -=
            W.transpose() * x.segment<kCamera>(kCamera * static_cast<Eigen::Index>(a));
      if (options_.calibrate)
        rest.noalias() -= point.W_calibration.transpose() * x.tail<kCalibrationSize>();
      next.landmarks[s] -= point.V_inverse * rest;
    });
    return true;
  }

  // What the residuals say of the calibration once everything else has been eliminated.
  [[nodiscard]] CalibrationMatrix Information(const State& state) {
    Linearise(state);
    tbb::parallel_for(std::size_t{0}, points_.size(), [&](std::size_t s) { MakePoint(s, 0.0); });
    Eigen::MatrixXd S = H_;
    S.diagonal().array() += 1e-9;
    Eigen::VectorXd right = g_;
    Eliminate(S, right);
    const Eigen::MatrixXd poses = S.topLeftCorner(calibration_at_, calibration_at_);
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> solver(poses);
    if (solver.info() != Eigen::Success) return CalibrationMatrix::Zero();
    const Eigen::MatrixXd coupling = S.bottomLeftCorner(kCalibrationSize, calibration_at_);
    CalibrationMatrix information =
        S.bottomRightCorner<kCalibrationSize, kCalibrationSize>().selfadjointView<Eigen::Lower>();
    information -= coupling * solver.solve(coupling.transpose());
    information -= options_.prior.information;
    return 0.5 * (information + information.transpose());
  }

  // S -= W V^-1 W', right -= W V^-1 g over all landmarks. Each free keyframe's rows are one task,
  // so every block has one writer.
  void Eliminate(Eigen::MatrixXd& S, Eigen::VectorXd& right) const {
    tbb::parallel_for(std::size_t{0}, free_.size(), [&](std::size_t slot) {
      const auto a = kCamera * static_cast<Eigen::Index>(slot);
      for (const std::uint32_t i : views_of_keyframe_[static_cast<std::size_t>(free_[slot])]) {
        const PointSystem& point = points_[static_cast<std::size_t>(views_[i].landmark)];
        const CameraPoint WV =
            views_[i].J_camera.transpose() * (views_[i].J_point * point.V_inverse);
        right.segment<kCamera>(a).noalias() -= WV * point.g;
        for (const auto& [b, W] : point.W)
          if (b <= static_cast<int>(slot))
            S.block<kCamera, kCamera>(a, kCamera * static_cast<Eigen::Index>(b)).noalias() -=
                WV * W.transpose();
        if (options_.calibrate)
          S.block<kCalibrationSize, kCamera>(calibration_at_, a).noalias() -=
              point.W_calibration * WV.transpose();
      }
    });
    if (!options_.calibrate) return;
    CalibrationMatrix H = CalibrationMatrix::Zero();
    for (const PointSystem& point : points_) {
      const CalibrationPoint WV = point.W_calibration * point.V_inverse;
      H.noalias() += WV * point.W_calibration.transpose();
      right.tail<kCalibrationSize>().noalias() -= WV * point.g;
    }
    S.bottomRightCorner<kCalibrationSize, kCalibrationSize>() -= H;
  }

  // Makes `count` unknowns stay where they are.
  static void Pin(Eigen::Index first, Eigen::Index count, Eigen::MatrixXd& S,
                  Eigen::VectorXd& right) {
    S.middleRows(first, count).setZero();
    S.middleCols(first, count).setZero();
    S.diagonal().segment(first, count).setOnes();
    right.segment(first, count).setZero();
  }

  static bool Solve(const Eigen::MatrixXd& S, const Eigen::VectorXd& right, Eigen::VectorXd& x) {
    if (S.rows() <= kLargestDenseSystem) {
      const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> solver(S);
      if (solver.info() != Eigen::Success) return false;
      x = solver.solve(right);
    } else {
      const Eigen::SparseMatrix<double> sparse =
          S.triangularView<Eigen::Lower>().toDenseMatrix().sparseView();
      const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver(sparse);
      if (solver.info() != Eigen::Success) return false;
      x = solver.solve(right);
    }
    return x.allFinite();
  }

  void Write(const State& state) {
    for (const int k : free_) {
      MapKeyframe& keyframe = map_.keyframes[static_cast<std::size_t>(k)];
      keyframe.T_world_color = Orthonormalised(
          keyframe.T_world_color * PoseFromTwist(state.cameras[static_cast<std::size_t>(k)].twist));
    }
    for (const auto& [id, slot] : markers_) {
      MapMarker& marker = map_.markers.at(id);
      marker.T_world_marker = Orthonormalised(
          marker.T_world_marker * PoseFromTwist(state.markers[static_cast<std::size_t>(slot)]));
    }
    for (std::size_t s = 0; s < landmarks_.size(); ++s)
      map_.landmarks[static_cast<std::size_t>(landmarks_[s])].p_world = state.landmarks[s];
    calibration_ = state.calibration;
  }

  const Intrinsics& stated_;
  const BundleOptions& options_;
  const std::vector<QuadraticTerm>& terms_;
  TrackingMap& map_;
  CalibrationModel& calibration_;
  std::vector<int> free_;       // Keyframes, by pose slot.
  std::vector<int> pose_slot_;  // Of each keyframe; -1: stays.
  std::map<int, int> markers_;  // Id to slot.
  std::vector<Pose> T_world_marker0_;
  std::vector<int> landmarks_;  // Ids, by slot.
  std::vector<PointView> views_;
  std::vector<CornerView> corners_;
  std::vector<std::vector<std::uint32_t>> views_of_landmark_;
  std::vector<std::vector<std::uint32_t>> views_of_keyframe_;
  Eigen::Index markers_at_ = 0;
  Eigen::Index calibration_at_ = 0;
  Eigen::Index size_ = 0;
  Eigen::MatrixXd H_;
  Eigen::VectorXd g_;
  std::vector<PointSystem> points_;
};

}  // namespace

BundleSummary BundleAdjust(const Intrinsics& stated, const BundleOptions& options,
                           const std::vector<QuadraticTerm>& terms, TrackingMap& map,
                           CalibrationModel& calibration) {
  return Bundle(stated, options, terms, map, calibration).Run();
}

}  // namespace plumb
